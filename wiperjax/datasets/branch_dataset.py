"""What lies beside a branch in its file: motions simulated up and down the range, steady slip, and
curves in two parameters.

Pure xarray, without jax, since pictures read it.
"""

from collections.abc import Iterable, Iterator

import numpy as np
import xarray as xr

from ..noise.samples import LARGEST, untold

_SIMULATED = "simulated_"
_KEPT = ("settle", "window")
CURVE = "curve_"
EXACT = 1e-7  # of `trivial_error`: where it is more, that is said
_OF_CURVES = ("over", "second", "fixed")
TAKEN = frozenset(
    (
        *("point", "multiplier", "special", "coordinate", "arclength", "state", "phase"),
        *("period", "maximum", "minimum", "amplitude", "velocity_rms", "stick_fraction"),
        *("flight_fraction", "normal_force_max", "slip_margin", "residual", "trivial_error"),
        *("stable", "word", "regimes", "multiplier_real", "multiplier_imag", "special_kind"),
        *("special_detail", "special_parameter", "special_point"),
        *("way", "peak", "repeat_time", "result"),  # of simulations
        *("rest", "rest_position", "rest_stable"),
        *("curve", "end", "lyapunov", "row_size", "kind", "end_code", "end_detail"),  # of curves
        "special_curve",
    )
)
"""Names of the variables and dimensions of branches and of what lies beside one."""
_ATTRIBUTES = ("over", "ends")  # of branches alone: those that maps have, too, no parameter has


def check_over(name: str) -> None:
    """Raises ValueError for a parameter that a branch cannot be over: its values would take the
    place of a variable of the same name, or be lost under it.
    """
    if name in TAKEN:
        must = "must have a name that no variable of a branch has"
        raise ValueError(f"the parameter that is varied {must}, was {name!r}: rename it")


def check_fixed(names: Iterable[str]) -> None:
    """Raises ValueError for a parameter whose value a branch cannot state as an attribute."""
    for name in names:
        if name in _ATTRIBUTES:
            must = "a system whose cycles are followed must have no parameter of the name"
            raise ValueError(
                f"{must} {name!r}, which is that of an attribute of branches: rename it"
            )


def doubts(branch: xr.Dataset) -> Iterator[str]:
    """What of a branch no cycle has, in words: another program changed it."""
    for name in (str(branch.attrs.get("over")), "period", "maximum", "minimum"):
        values = branch[name].values if name in branch else np.zeros(0)
        if (wrong := untold(values)).any():
            must = f"must be finite numbers up to {LARGEST:g} in size"
            yield f"its {name} {must}, but had {values[wrong][0]:g}"
        elif name == "period" and (wrong := values <= 0).any():
            yield f"its period must be > 0, but had {values[wrong][0]:g}"
    stable = branch["stable"].values if "stable" in branch else np.zeros(0)
    if (strange := stable[~np.isin(stable, (0, 1))]).size:
        yield f"its stable must be 0 or 1, but had {strange[0]:g}"


def with_simulations(branch: xr.Dataset, brute: xr.Dataset) -> xr.Dataset:
    """Return ``branch`` with a dataset of `up_and_down`, its names behind ``simulated_``."""
    names = [*brute.data_vars, str(brute.attrs["over"])]
    merged = branch.merge(brute.rename({name: f"{_SIMULATED}{name}" for name in names}))
    return merged.assign_attrs({f"{_SIMULATED}{key}": brute.attrs[key] for key in _KEPT})


def simulations(branch: xr.Dataset) -> xr.Dataset | None:
    """Return what `with_simulations` has put in, or None."""
    names = [str(name) for name in branch.variables if str(name).startswith(_SIMULATED)]
    if not names:
        return None
    plain = branch[names].rename({name: name.removeprefix(_SIMULATED) for name in names})
    return plain.drop_vars("arclength", errors="ignore").assign_attrs(over=branch.attrs["over"])


def with_rest(branch: xr.Dataset, parameter, position, stable) -> xr.Dataset:
    """Return ``branch`` with its equilibria: ``parameter`` (m,) (unit of files); first coordinate
    and whether it is stable, (m, k) of k equilibria there, in order, NaN where there are fewer.

    They are stored as curves, one after the other, with a NaN between.
    """
    parameter, position, stable = _as_curves(parameter, position, stable)
    over = str(branch.attrs["over"])
    what = str(branch["maximum"].attrs["long_name"]).removeprefix("largest ")
    attrs = branch["maximum"].attrs | {"long_name": f"{what} at rest"}
    return branch.assign(
        {
            f"rest_{over}": ("rest", parameter, branch[over].attrs),
            "rest_position": ("rest", position, attrs),
            "rest_stable": ("rest", stable.astype("i1"), {"long_name": "whether rest is stable"}),
        }
    )


def _as_curves(parameter, position, stable):
    """Return (parameter, position, stable) of `with_rest`, (rows,) each, one curve after the other.

    A curve goes on to what is nearest of the next ones, if nothing is nearer to that.
    """
    curves: list[list[tuple[int, int]]] = []
    last: dict[int, list[tuple[int, int]]] = {}  # the curve that went through each column
    for k, row in enumerate(position):
        way = np.abs(position[max(k - 1, 0)][:, None] - row)
        way[np.isnan(way)] = np.inf
        here = {}
        for j in np.flatnonzero(np.isfinite(row)):
            i = int(np.argmin(way[:, j]))
            if i in last and np.argmin(way[i]) == j:
                here[j] = last[i]
            else:
                here[j] = []
                curves.append(here[j])
            here[j].append((k, j))
        last = here
    none = (len(parameter), 0)
    places = [place for curve in curves for place in (*curve, none)][:-1]
    k, j = np.array(places, int).reshape(-1, 2).T
    empty = np.full((1, position.shape[1]), np.nan)
    known = np.vstack([position, empty]), np.vstack([stable, empty == 0])
    return np.append(parameter, np.nan)[k], *(values[k, j] for values in known)


def rest(branch: xr.Dataset):
    """Return (parameter, first coordinate, is stable), (rows,) each, of `with_rest`, or None."""
    if "rest_position" not in branch:
        return None
    names = (f"rest_{branch.attrs['over']}", "rest_position", "rest_stable")
    parameter, position, stable = (branch[name].values for name in names)
    return parameter, position, stable.astype(bool)


def with_curves(dataset: xr.Dataset, curves: xr.Dataset) -> xr.Dataset:
    """Return a branch or a map with the curves of `curves_dataset`, all names behind ``curve_``."""
    names = {str(name): f"{CURVE}{name}" for name in (*curves.variables, *curves.dims)}
    renamed = curves.rename(names)
    kept = {f"{CURVE}{key}": curves.attrs[key] for key in _OF_CURVES if key in curves.attrs}
    return dataset.assign(renamed.variables).assign_attrs(kept)


def curves(dataset: xr.Dataset) -> xr.Dataset | None:
    """Return what `with_curves` has put in, or None; curves themselves as they are.

    Of the file of a scene the attribute ``fixed`` holds the other numbers of the blade (JSON).
    """
    if "row_size" in dataset:
        return dataset
    if f"{CURVE}row_size" not in dataset:
        return None
    names = [str(name) for name in dataset.variables if str(name).startswith(CURVE)]
    dims = [str(dim) for name in names for dim in dataset[name].dims]
    plain = {name: name.removeprefix(CURVE) for name in {*names, *dims}}
    found = xr.Dataset({name: dataset[name].variable for name in names}).rename(plain)
    kept = (key for key in _OF_CURVES if CURVE + key in dataset.attrs)
    attrs = {key: dataset.attrs[CURVE + key] for key in kept}
    return found.assign_attrs(attrs)
