"""Colours of a variable over a plane: shades for the image, and their legend as HTML."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.colors import LogNorm, Normalize, SymLogNorm, to_hex
from matplotlib.ticker import LogLocator, MaxNLocator, SymmetricalLogLocator

from ..plots.maps.categories import category_keys, colours_of
from ..plots.maps.numbers import TONE, on_scale, suited, told, tones, why_untold
from ..plots.style.axes import LogMarks, axis_numbers, shown
from ..plots.style.palette import HATCHES, UNKNOWN, readable
from ..vocabulary.cf import flag_names
from ..vocabulary.codes import NOT_COMPUTED
from ..vocabulary.columns import derivative
from .explored import escaped, plain

SHADES = 250
NOTHING = 255  # the shade of a cell without a value
NO_VALUE = "no value"  # what is said of one among names
MOST_TICKS = 8  # of a bar of colours
BAR, LETTER = 480, 6.5  # widths in pixels: of a bar, and of a letter below it
STRIPES = {"////": (135,), "\\\\\\\\": (45,), "xxxx": (45, 135)}  # pattern -> across which angles


class Painted(NamedTuple):
    """A plane as it is painted.

    Attributes:
        shades: (rows, columns), uint8, `NOTHING` where there is no value.
        palette: a colour for each shade.
        values: the numbers in the unit of pictures, (rows, columns), float32; codes of categories
            as the map has them.
        names: code -> name of a category; empty for numbers.
        unit: of the numbers.
        legend: HTML.
    """

    shades: np.ndarray
    palette: list[str]
    values: np.ndarray
    names: dict[int, str]
    unit: str
    legend: str


def painted(plane: xr.Dataset, variable: str) -> Painted:
    """Colours of `variable`, of the dimensions (y, x), over a plane of a map."""
    if "flag_values" in plane[variable].attrs:
        return _categories(plane, variable)
    return _numbers(plane, variable)


def _categories(plane: xr.Dataset, variable: str) -> Painted:
    names = {code: plain(name, 60) for code, name in sorted(flag_names(plane[variable]).items())}
    colours = list(colours_of(plane[variable]).values())[:NOTHING]
    codes = np.asarray(plane[variable].values)
    order = np.array(list(names))[:NOTHING]
    place = np.clip(np.searchsorted(order, codes), 0, len(order) - 1)
    shades = np.where(order[place] == codes, place, NOTHING).astype(np.uint8)
    keys = [_key(colour, text, name) for name, text, colour in category_keys(plane, variable)]
    if np.isnan(codes).any():
        keys.append(_key(UNKNOWN, NO_VALUE, ""))
    names = {code: readable(name) for code, name in names.items()}
    names.setdefault(NOT_COMPUTED, "not computed")
    values = codes if codes.dtype.itemsize == 1 else codes.astype(np.float32)  # as it is sent
    return Painted(shades, colours, values, names, "", _keys(keys))


def _key(colour: str, text: str, name: str) -> str:
    pattern, edge = HATCHES.get(name, ("", ""))
    images = [
        f"repeating-linear-gradient({angle}deg,{edge} 0 1px,transparent 1px 4px)"
        for angle in STRIPES.get(pattern, ())
    ]
    stripes = f";background-image:{','.join(images)}" if images else ""
    swatch = f'<i style="background-color:{colour}{stripes}"></i>'
    return f'<span class="key">{swatch}{escaped(text)}</span>'


def _keys(keys: list[str]) -> str:
    return f'<div class="keys">{"".join(keys)}</div>'


def _numbers(plane: xr.Dataset, variable: str) -> Painted:
    values, unit = shown(told(plane, variable))
    seen = np.ma.masked_invalid(values)
    norm, cmap = _scale(variable, seen)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.ma.filled(np.ma.asarray(norm(on_scale(seen, norm)), float), np.nan)
    known = np.isfinite(share)
    shades = np.full(values.shape, NOTHING, np.uint8)
    shades[known] = np.clip(share[known] * SHADES, 0, SHADES - 1).astype(np.uint8)
    palette = _palette(cmap)
    legend = _bar(norm, palette, unit)
    if not known.all():
        why = why_untold(plane, variable) or "no number"  # none on this scale
        legend += _keys([_key(UNKNOWN, why, "")])
    return Painted(shades, palette, values.astype(np.float32), {}, unit, legend)


@cache
def _palette(cmap: str) -> list[str]:
    return [to_hex(colour) for colour in colormaps[cmap](np.linspace(0, 1, SHADES))]


def _scale(variable: str, values: np.ma.MaskedArray) -> tuple[Normalize, str]:
    """Scale and colour map of a variable, those of `plots`."""
    if variable.endswith("_fraction"):
        return Normalize(0.0, 1.0), "cividis"
    some = values.compressed()
    positive = some[some > 0]
    if variable == TONE:
        return tones(values), "viridis"
    if variable.startswith("velocity_rms") and positive.size:
        return LogNorm(1e-3 * positive.max(), positive.max()), "magma"
    signed = variable == "growth_rate" or derivative(variable) is not None
    norm, cmap = suited(values, signed)
    if norm is None:
        low, high = (float(some.min()), float(some.max())) if some.size else (0.0, 1.0)
        norm = Normalize(low, high if high > low else low + (abs(low) or 1.0))
    return norm, cmap


def _bar(norm: Any, palette: list[str], unit: str) -> str:
    """The colours with their numbers."""
    low, high = float(norm.vmin), float(norm.vmax)
    if isinstance(norm, LogNorm):
        ticks = LogMarks(subs=(1.0, 2.0, 5.0)).tick_values(low, high)
        if ((ticks >= low) & (ticks <= high)).sum() > MOST_TICKS:
            ticks = LogLocator().tick_values(low, high)
    elif type(norm) is Normalize:
        ticks = MaxNLocator(6).tick_values(low, high)
    else:
        locator = SymmetricalLogLocator(base=10, linthresh=norm.linthresh)
        locator.set_params(numticks=1000)  # it counts decades up to 1, whatever the largest is
        ticks = locator.tick_values(low, high)
    ticks = np.asarray([tick for tick in ticks if low <= tick <= high])
    if type(norm) is not SymLogNorm:  # of which the zero might go
        ticks = ticks[:: max(1, -(-len(ticks) // MOST_TICKS))]
    ticks = _apart(norm, ticks)
    stops = ",".join(palette[::12] + palette[-1:])
    marks = "".join(
        f'<span class="tick" style="left:{100 * float(norm(tick)):.1f}%">{text}</span>'
        for tick, text in zip(ticks, axis_numbers(ticks), strict=True)
    )
    words = f'<p class="note">{escaped(unit)}</p>' if unit else ""
    shades = f'<div class="shades" style="background:linear-gradient(90deg,{stops})"></div>'
    return f'<div class="bar">{shades}{marks}</div>{words}'


def _apart(norm: Any, ticks: np.ndarray) -> np.ndarray:
    """Ticks whose numbers do not lie over each other: zero, then from the ends of a bar inwards."""
    widths = {t: LETTER * len(n) for t, n in zip(ticks, axis_numbers(ticks), strict=True)}
    kept: list[float] = []
    for tick in sorted(ticks, key=lambda t: (t != 0, -abs(float(norm(t)) - 0.5))):
        far = [BAR * abs(float(norm(tick)) - float(norm(one))) for one in kept]
        needs = [0.5 * (widths[tick] + widths[one]) + LETTER for one in kept]
        if all(a >= b for a, b in zip(far, needs, strict=True)):
            kept.append(tick)
    return np.sort(kept)
