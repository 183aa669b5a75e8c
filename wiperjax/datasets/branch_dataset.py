"""What lies below a branch in its file: motions simulated up and down the range, steady slip.

Pure xarray, without jax, since pictures read it.
"""

import xarray as xr

_SIMULATED = "simulated_"
_KEPT = ("settle", "window")


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
    """Return ``branch`` with an equilibrium: parameter (unit of files), first coordinate, whether
    it is stable, (m,) each.
    """
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


def rest(branch: xr.Dataset):
    """Return (parameter, first coordinate, is stable) of `with_rest`, or None."""
    if "rest_position" not in branch:
        return None
    names = (f"rest_{branch.attrs['over']}", "rest_position", "rest_stable")
    parameter, position, stable = (branch[name].values for name in names)
    return parameter, position, stable.astype(bool)
