"""Axes in physical units: labels, logarithmic scales, and borders of the cells of a map."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter


def axis_label(variable: xr.DataArray) -> str:
    """`attack angle (deg)`: the long name and unit of a coordinate or variable."""
    name = str(variable.attrs.get("long_name", variable.name))
    unit = short_unit(str(variable.attrs.get("units", "1")))
    return f"{name} ({unit})" if unit else name


def short_unit(unit: str) -> str:
    """Unit as it stands beside a number; empty if dimensionless."""
    return {"1": "", "degrees": "deg"}.get(unit, unit)


def is_geometric(values: np.ndarray) -> bool:
    """Whether positive values are spaced by ratio rather than by difference, and span a factor of
    three.
    """
    values = np.asarray(values, dtype=float)
    if values.size < 3 or not (values > 0).all() or values.max() < 3 * values.min():
        return False
    return bool(np.std(np.diff(np.log(values))) < 0.1 * np.std(np.diff(values)) / np.mean(values))


def edges(values: np.ndarray) -> np.ndarray:
    """Borders of the cells around axis values, shape (n + 1,); geometric axes have geometric
    borders.
    """
    values = np.asarray(values, dtype=float)
    if values.size == 1:
        return values[0] + np.array([-0.5, 0.5]) * (abs(values[0]) or 1.0) * 0.1
    scaled = np.log(values) if is_geometric(values) else values
    middle = 0.5 * (scaled[1:] + scaled[:-1])
    full = np.concatenate([[2 * scaled[0] - middle[0]], middle, [2 * scaled[-1] - middle[-1]]])
    return np.exp(full) if is_geometric(values) else full


def set_axis(ax: Axes, which: str, coordinate: xr.DataArray) -> None:
    """Label, scale and limits of the `x` or `y` axis for the values of a coordinate."""
    axis = getattr(ax, f"{which}axis")
    border = edges(coordinate.values)
    getattr(ax, f"set_{which}label")(axis_label(coordinate))
    if is_geometric(coordinate.values):
        getattr(ax, f"set_{which}scale")("log")
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    getattr(ax, f"set_{which}lim")(min(border), max(border))
