"""Modes over the parameters of a sweep, and what its simulated map says of them."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..contact.system import AbstractSystem
from ..datasets.map_dataset import describe
from ..noise.class_counts import whole_codes
from ..specs.load import parse_sweep
from ..specs.sweep import SweepSpec
from ..systems.build import build
from ..vocabulary import checks
from ..vocabulary.cf import flags
from ..vocabulary.codes import LABELS, NOT_COMPUTED
from .linear import linear_over
from .table import CONVENTION, modes_of

AT_ONCE = 2048  # cells
VARIABLES = ("mode", "real_part", "frequency", "growth_rate", "exists", "verdict")
VERDICTS = {"not_told": -1, "quiet": 0, "noisy": 1, "over_predicted": 2, "missed": 3}
"""What the linear test says of a cell beside its simulated class: stable and quiet, unstable and
noisy, unstable yet quiet, stable yet noisy."""


def modes_over(spec: SweepSpec | Mapping[str, Any]) -> xr.Dataset:
    """Return the modes of steady sliding in every cell of a sweep, without any motion.

    ``spec``: a sweep of `load_sweep`, or a mapping shaped like a sweep file.

    **Returns** a dataset over the sweep's axes (units of files, angles in degrees) and ``mode``
    (the fastest growing first, NaN where there are fewer): ``real_part`` [1/s], ``frequency`` [Hz];
    ``growth_rate``, the largest real part; ``exists``, whether steady sliding was found.

    Raises ValueError (`SpecError`) for what is no sweep, for a system without friction, and for an
    axis that has the name of one of these variables.
    """
    spec = parse_sweep(spec) if isinstance(spec, Mapping) else spec
    checks.instance("spec", spec, SweepSpec, "a sweep, or a mapping shaped like a sweep file")
    if taken := [name for name in spec.axes if name in VARIABLES]:
        must = "must have names that no variable of modes over a sweep has"
        raise ValueError(f"axes {must}, but had {taken[0]!r}: rename that parameter")
    blocks = np.array_split(np.arange(spec.size), -(-spec.size // AT_ONCE))
    parts = [_block(spec, index) for index in blocks]
    values = np.concatenate([part[0] for part in parts])
    exists = np.concatenate([part[1] for part in parts])
    values = np.where(exists[:, None], values, np.nan)
    values = values[:, : max(1, int(np.isfinite(values).sum(axis=1).max(initial=0)))]
    described = describe(spec)
    names, shape = tuple(described["coords"]), spec.shape
    coords = {
        name: (name, np.asarray(entry["values"]), entry["attrs"])
        for name, entry in described["coords"].items()
    }

    def over(values: np.ndarray, long_name: str, units: str):
        dims = (*names, "mode") if values.ndim == 2 else names
        found = values.reshape(*shape, *values.shape[1:])
        return dims, found, {"long_name": long_name, "units": units}

    top = np.where(exists, np.real(values[:, 0]), np.nan)
    attrs = described["attrs"] | {"title": spec.title or "modes of steady sliding"}
    attrs["damping_convention"] = CONVENTION
    return xr.Dataset(
        {
            "real_part": over(np.real(values), "real part", "1/s"),
            "frequency": over(np.imag(values) / (2 * np.pi), "frequency", "Hz"),
            "growth_rate": over(top, "largest real part", "1/s"),
            "exists": over(exists.astype(np.int8), "whether steady sliding was found", "1"),
        },
        coords=coords | {"mode": np.arange(1, values.shape[1] + 1)},
        attrs=attrs,
    )


def beside(found: xr.Dataset, simulated: xr.Dataset) -> xr.Dataset:
    """Return modes of a sweep with the variable ``verdict`` (`VERDICTS`): what the linear test says
    of each cell, beside the class in the map of the same sweep.

    Raises ValueError for a map of other axes or values of these, of several starts, or of classes
    that were averaged.
    """
    names = tuple(str(name) for name in found["growth_rate"].dims)
    label = simulated["label"]
    if set(label.dims) != set(names):
        must = f"must be over {', '.join(names)}, with one start a cell"
        raise ValueError(f"the map {must}, was over {', '.join(map(str, label.dims))}")
    for name in names:  # cells are paired by their place
        axis, own = found[name].values, label[name].values
        numbers = axis.shape == own.shape and own.dtype.kind in "iuf"
        if not numbers or not np.allclose(axis, own, rtol=1e-12, atol=0):
            must = "must be those of its sweep, in the same order"
            raise ValueError(f"the map's values of {name} {must}, were others")
    label = whole_codes(label.transpose(*names))
    grows, told = np.asarray(found["growth_rate"]) > 0, np.asarray(found["exists"]) > 0
    told &= ~np.isin(label, [LABELS["failed"], LABELS["collapsed"], NOT_COMPUTED])
    told &= ~np.isnan(label)  # of cells that `ds.where` took out
    quiet = label == LABELS["quiet"]
    cases = [~told, quiet & ~grows, ~quiet & grows, quiet & grows]
    codes = [VERDICTS[name] for name in ("not_told", "quiet", "noisy", "over_predicted")]
    verdict = np.select(cases, codes, default=VERDICTS["missed"]).astype(np.int8)
    about = {"long_name": "linear test beside the simulated class"} | flags(VERDICTS)
    return found.assign(verdict=(names, verdict, about))


def shares(found: xr.Dataset) -> dict[str, float]:
    """Share of the cells with each verdict of `beside`, of those that are told."""
    verdict = np.asarray(found["verdict"])
    told = max(1, int((verdict >= 0).sum()))
    return {name: float((verdict == c).sum() / told) for name, c in VERDICTS.items() if c >= 0}


def _block(spec: SweepSpec, index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return eigenvalues (cells, 2 m) and whether they exist (cells,), of some cells."""
    system: AbstractSystem = build(spec, spec.cells(index)).system
    if system.law is None:
        raise ValueError(f"system must have friction, but {type(system).__name__} has none")
    near = system.sliding_near()
    near = tuple(jnp.broadcast_to(jnp.asarray(x, float), index.shape) for x in near)

    def array(x: Any) -> Any:
        return jnp.asarray(x, float) if isinstance(x, np.ndarray | jax.Array) else x

    varying, shared = eqx.partition(
        jax.tree.map(array, system), lambda x: isinstance(x, jax.Array) and x.ndim > 0
    )
    found = linear_over(varying, near, shared)
    matrix, basis = np.asarray(found.matrix), np.asarray(found.basis)
    fine = np.asarray(found.exists) & np.isfinite(matrix).all(axis=(1, 2))
    matrix = np.where(fine[:, None, None], matrix, np.eye(matrix.shape[-1]))
    return modes_of(matrix, basis).values, fine
