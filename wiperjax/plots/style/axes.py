"""Axes in units a person reads: labels, scales, borders of the cells of a map, and pages."""

import math

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import XAxis
from matplotlib.figure import Figure, SubFigure
from matplotlib.legend import Legend
from matplotlib.ticker import (
    AutoLocator,
    FuncFormatter,
    LogLocator,
    MaxNLocator,
    NullFormatter,
    ScalarFormatter,
)

LETTERS = 5  # of a mark on the axis across, for which matplotlib leaves room
SHOWN = {  # unit in a file -> factor and unit in a picture: lips move by millimetres
    "m": (1e3, "mm"),
    "rad": (180.0 / np.pi, "deg"),
    "degrees": (1.0, "deg"),
    "1": (1.0, ""),
}


def page(size: tuple[float, float]) -> Figure:
    """Figure outside pyplot: needs no display, and is freed with its last reference."""
    return Figure(figsize=size, layout="constrained")


def axes_or_page(ax: Axes | None, size: tuple[float, float]) -> tuple[Axes, bool]:
    """Axes to draw in, and whether they have a page of their own, of this size: if `ax` is None."""
    return (page(size).subplots(), True) if ax is None else (ax, False)


def shown(variable: xr.DataArray) -> tuple[np.ndarray, str]:
    """Values of a variable as floats in the unit of pictures, and that unit (empty if none)."""
    factor, unit = shown_unit(variable)
    return factor * np.asarray(variable, dtype=float), unit


def shown_unit(variable: xr.DataArray) -> tuple[float, str]:
    """Factor from the stored unit of a variable to that of pictures, and the latter."""
    unit = str(variable.attrs.get("units", "1"))
    return SHOWN.get(unit, (1.0, unit))


def label(words: str, unit: str) -> str:
    """`attack angle (deg)`."""
    return f"{words} ({unit})" if unit else words


def long_name(variable: xr.DataArray) -> str:
    """What a variable is, in words."""
    return str(variable.attrs.get("long_name", str(variable.name).replace("_", " ")))


def value_text(axis: xr.DataArray, place: int) -> str:
    """`normal load 15 N/m`, `law coulomb`: one value of an axis."""
    if not is_numeric(axis):
        return f"{long_name(axis)} {axis.values[place]}"
    values, unit = shown(axis)
    gap = "" if unit == "deg" else " "
    return f"{long_name(axis)} {axis_numbers(values)[place]}{gap}{unit.replace('deg', '°')}".strip()


def axis_numbers(values: np.ndarray) -> list[str]:
    """The values of an axis or of its marks as text: no two of them read the same."""
    values = np.asarray(values, dtype=float)
    steps = np.abs(np.diff(values, prepend=np.nan, append=np.nan))
    nearest = np.nan_to_num(np.fmin(steps[:-1], steps[1:]))  # of its neighbours
    return [number(value, step) for value, step in zip(values.tolist(), nearest, strict=True)]


def number(value: float, step: float = 0.0) -> str:
    """Number with four digits, or as many as tell it from one that is a `step` away, without an
    exponent as long as that is readable.
    """
    digits = 4 if abs(value) < 1e4 else 6
    if step > 0 and value != 0:
        digits = max(digits, math.floor(math.log10(abs(value))) - math.floor(math.log10(step)) + 1)
    return f"{value:.{digits}g}"


def time_text(seconds: float) -> str:
    """`12.5 ms`, `61.2 s`: a length of time."""
    return f"{number(seconds)} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"


def is_numeric(axis: xr.DataArray) -> bool:
    """Whether the values of an axis are numbers; of maps that were joined they may be texts."""
    return axis.dtype.kind in "biuf"


def is_geometric(values: np.ndarray) -> bool:
    """Whether positive values are spaced by ratio rather than by difference, and span a factor of
    three.
    """
    values = np.asarray(values, dtype=float)
    if values.size < 3 or not (values > 0).all() or values.max() < 3 * values.min():
        return False
    return bool(np.std(np.diff(np.log(values))) < 0.1 * np.std(np.diff(values)) / np.mean(values))


def is_ordered(values: np.ndarray) -> bool:
    """Whether the values of an axis rise throughout, or fall: else its cells have no borders."""
    steps = np.diff(np.asarray(values, dtype=float))
    return bool((steps > 0).all() or (steps < 0).all())


def edges(values: np.ndarray) -> np.ndarray:
    """Borders of the cells around axis values, shape (n + 1,); geometric axes have geometric
    borders. Values on one side of zero have theirs there: no load is below it.
    """
    values = np.asarray(values, dtype=float)
    if values.size == 1:
        return values[0] + np.array([-0.5, 0.5]) * (abs(values[0]) or 1.0) * 0.1
    if is_geometric(values):
        return np.exp(_around(np.log(values)))
    border = _around(values)
    if (values >= 0).all():
        return np.maximum(border, 0.0)
    return np.minimum(border, 0.0) if (values <= 0).all() else border


def _around(values: np.ndarray) -> np.ndarray:
    """Places in the middle between values, and as far beyond the first and the last."""
    middle = 0.5 * (values[1:] + values[:-1])
    return np.concatenate([[2 * values[0] - middle[0]], middle, [2 * values[-1] - middle[-1]]])


def set_axis(ax: Axes, which: str, coordinate: xr.DataArray) -> None:
    """Label, scale and limits of the `x` or `y` axis for the values of a coordinate."""
    values, unit = shown(coordinate)
    border = edges(values)
    getattr(ax, f"set_{which}label")(label(long_name(coordinate), unit))
    if is_geometric(values):
        plain_log(ax, which)
    else:
        axis = getattr(ax, f"{which}axis")
        axis.set_major_locator(Marks())
        axis.set_major_formatter(whole_numbers())
    getattr(ax, f"set_{which}lim")(min(border), max(border))


def whole_numbers() -> ScalarFormatter:
    """Marks with all their digits: what matplotlib takes out of them it writes over the label."""
    formatter = ScalarFormatter(useOffset=False)
    formatter.set_scientific(False)
    return formatter


class Marks(AutoLocator):
    """Marks of a linear axis; every second one where long numbers would touch on that across."""

    def tick_values(self, vmin, vmax):
        marks = np.asarray(super().tick_values(vmin, vmax))
        if marks.size < 2 or not isinstance(self.axis, XAxis):
            return marks
        letters = max(map(len, whole_numbers().format_ticks(marks.tolist())))
        room = self.axis.get_tick_space() * LETTERS / (letters + 1)
        while marks.size > 4 and marks.size - 2 > room:  # two of them may lie beyond the ends
            marks = marks[marks.size % 2 :: 2]
        return marks


def plain_log(ax: Axes, which: str) -> None:
    """Logarithmic axis with the marks 1, 2, 5, 10 written as plain numbers."""
    getattr(ax, f"set_{which}scale")("log")
    log_marks(getattr(ax, f"{which}axis"))


def _short(value: float) -> str:
    """`20k` for 20000: long marks would run into each other."""
    return f"{value / 1000:g}k" if value >= 1000 else f"{value:g}"


def log_marks(axis) -> None:
    """Marks 1, 2, 5, 10 on an axis that is logarithmic, as plain numbers; closer ones where the
    axis is so short that fewer than three of them lie on it.
    """
    axis.set_major_locator(LogMarks(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: _short(value)))
    axis.set_minor_formatter(NullFormatter())


class LogMarks(LogLocator):
    """Marks of a logarithmic axis; 1, 3, 10 where 1 and 2 would touch on the axis across, and even
    ones where fewer than three of these lie on less than a decade: every second one where these
    would touch.
    """

    def tick_values(self, vmin, vmax):
        low, high = sorted((vmin, vmax))
        span = np.log10(high / low)
        space = np.inf if self.axis is None else self.axis.get_tick_space()
        if isinstance(self.axis, XAxis):
            self.set_params(subs=(1, 3) if np.log10(2) * space < span else (1, 2, 5))

        def within(marks: np.ndarray) -> np.ndarray:
            return marks[(marks >= low) & (marks <= high)]

        marks = np.asarray(super().tick_values(vmin, vmax))
        if within(marks).size < 3 and span >= 1:  # of so many decades even ones lie at one end
            powers = within(10.0 ** np.arange(np.ceil(np.log10(low)), np.log10(high) + 1))
            apart = int(np.ceil(span / max(1, space)))
            powers = powers[:: max(1, min(apart, powers.size - 1))]
            marks = max(marks, powers, key=lambda some: within(some).size)
        elif within(marks).size < 3:
            marks = np.asarray(MaxNLocator(6, steps=[1, 2, 5, 10]).tick_values(low, high))
        if span < 1:  # longer axes have their marks by decades
            marks = within(marks)
            while marks.size > 2 and space * np.diff(np.log10(marks))[-1] < span:
                marks = marks[::2]
        return marks[marks > 0]


def legend_below(figure: Figure | SubFigure, handles: list, **options) -> Legend | None:
    """A legend below the axes of a page, in as many columns as fit its width; None if empty."""
    for columns in range(min(len(handles), 8), 0, -1):
        legend = figure.legend(
            handles=handles, loc="outside lower center", ncols=columns, frameon=False, **options
        )
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            return legend
        legend.remove()
    return None
