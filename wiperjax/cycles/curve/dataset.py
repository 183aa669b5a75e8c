"""Curves in two parameters as a labelled dataset, which plain xarray and netCDF understand."""

import numpy as np
import xarray as xr

from ...contact.system import system_attributes
from ...datasets.branch_dataset import check_over
from ...machine import provenance
from ...systems import numbers
from ...vocabulary import cf, checks
from ...vocabulary.codes import CurveEnd
from .follow import Curve

_ENDS = {end.name.lower(): int(end) for end in CurveEnd}


def curves_dataset(curves: list[Curve]) -> xr.Dataset:
    """Return the curves of `follow_curves` as a dataset.

    Its dimensions are ``curve``, ``point``, ``special`` and ``end``. All points of the first curve
    come first, then those of the next: ``row_size`` says how many are whose (a contiguous ragged
    array of CF). The parameters have the names and units of files (angles in degrees).
    ``special_point`` is the index of the point that a special point is. ``end_code`` says why
    either end is one (`CurveEnd`), ``end_detail`` in words.

    Raises ValueError for no curves at all, and for a parameter named as a variable of these.
    """
    if not isinstance(curves, list) or not all(isinstance(curve, Curve) for curve in curves):
        must = "must be a list of follow_curves(...)"
        raise ValueError(f"curves {must}, but was {checks.shown(curves)}")
    if not curves:
        raise ValueError("curves must hold at least one curve, but the branch had none to follow")
    system = curves[0].system
    sizes = np.array([len(curve.places) for curve in curves])
    offsets = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    places = np.concatenate([curve.places for curve in curves])
    facts = [each for curve in curves for each in curve.facts]
    marks = [
        (curve.special[k], int(offsets[i]), i)
        for i, curve in enumerate(curves)
        for k in range(len(curve.special))
    ]
    words, shown = numbers.words(system), ("m", "s", "1") if system.of_a_blade else ("s", "1")

    def about(text: str, units: str) -> dict[str, str]:
        return {"long_name": text} | ({"units": units} if units in shown else {})

    variables, names = {}, []
    for k, name in enumerate(curves[0].names):
        stored, attrs, to_file = numbers.stored(system, name)
        check_over(stored)
        names.append(stored)
        variables[stored] = ("point", to_file(places[:, k]), attrs)
    half = f"half the range of the {words['position']}"
    variables |= {
        "amplitude": ("point", [each.amplitude for each in facts], about(half, "m")),
        "period": ("point", [each.period for each in facts], about("period", "s")),
        "lyapunov": (
            "point",
            np.array([each.test.get("bautin", np.nan) for each in facts]),
            about("first Lyapunov coefficient of a Hopf point; above 0 the onset is hard", "1"),
        ),
        "row_size": (
            "curve",
            sizes.astype(np.int32),
            {"long_name": "number of points of a curve", "sample_dimension": "point"},
        ),
        "kind": ("curve", np.array([curve.kind for curve in curves], object)),
        "end_code": (
            ("curve", "end"),
            np.array([[int(code) for code, _ in curve.ends] for curve in curves], np.int8),
            {"long_name": "why a curve ends", **cf.flags(_ENDS)},
        ),
        "end_detail": (
            ("curve", "end"),
            np.array([[detail for _, detail in curve.ends] for curve in curves], object),
        ),
        "special_kind": ("special", np.array([mark.kind for mark, _, _ in marks], object)),
        "special_detail": ("special", np.array([mark.detail for mark, _, _ in marks], object)),
        "special_curve": ("special", np.array([i for _, _, i in marks], np.int32)),
        "special_point": (
            "special",
            np.array([mark.index + offset for mark, offset, _ in marks], np.int32),
        ),
    }
    return xr.Dataset(
        variables,
        attrs={
            **provenance.maker(),
            "over": names[0],
            "second": names[1],
            **system_attributes(system),
        },
    )
