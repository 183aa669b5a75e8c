"""Where steady slip loses its stability, as far as the cells of a map tell it.

The growth rate falls off with speed about as exp(-speed / stribeck_speed): a straight line from
cell to cell puts its zero up to 40 % too far out where there are five speeds. A curve that leans on
the next cells, too, halves that, and leaves less than 1 % where nine speeds are spaced by ratio.
Where steady slip jumps to another equilibrium (docs/model.md, section 10) no curve runs through the
rates of both: there the line keeps to the borders of the cells.
`wiperjax refine --on growth_rate=0 --levels 6` computes it.
"""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..style.axes import is_geometric, shown
from ..style.palette import BOUNDARY

WORDS = "steady slip loses stability (linear; interpolated)"
BETWEEN = "black line: between cells"
NOTE = f"{BETWEEN}; refine --on growth_rate=0 --levels 6 computes it"
# times the steps beside it; of the reference blade up to 1 on a curve, 1.2 to 5 in a jump
JUMP = 2.0
PARTS, MOST = 20, 200  # numbers for each cell along an axis, and for the axis unless it has more


def stability_boundary(ds: xr.Dataset, ax: Axes, x: str, y: str) -> bool:
    """Draws the line growth_rate = 0 over a plane; returns whether there is one."""
    growth = growth_between(ds, y, x)
    if growth is None:
        return False
    up, across = (
        between(shown(ds[dim])[0], places(ds.sizes[dim], size))
        for dim, size in zip((y, x), growth.shape, strict=True)
    )
    lines = np.ma.masked_invalid(growth)
    ax.contour(across, up, lines, levels=[0.0], colors="white", linewidths=3.2)
    ax.contour(across, up, lines, levels=[0.0], colors=BOUNDARY, linewidths=1.4)
    return True


def boundary_legend() -> Line2D:
    """The entry of the line in a legend."""
    return Line2D([], [], color=BOUNDARY, linewidth=1.4, label=WORDS)


def growth_between(ds: xr.Dataset, *dims: str) -> np.ndarray | None:
    """Growth rates (1/s) of a line or a plane of a map, also between its cells, at the `places`
    along each of `dims`. None where they have one sign.
    """
    if "growth_rate" not in ds or min(ds.sizes[dim] for dim in dims) < 2:
        return None
    growth = ds["growth_rate"].transpose(*dims).values.astype(float)
    known = growth[np.isfinite(growth)]
    if not known.size or not known.min() < 0 < known.max():
        return None
    for axis in range(growth.ndim):
        growth = np.moveaxis(_finer(np.moveaxis(growth, axis, 0)), 0, axis)
    return growth


def places(cells: int, count: int) -> np.ndarray:
    """Where `count` numbers of `growth_between` along an axis lie, in cells from its first."""
    return np.linspace(0.0, cells - 1.0, count)


def between(values: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Values of an axis at places in cells from its first, by ratio where its cells are."""
    cells = np.arange(len(values))
    if is_geometric(values):
        return np.exp(np.interp(place, cells, np.log(values)))
    return np.interp(place, cells, values)


def _finer(values: np.ndarray) -> np.ndarray:
    """Values (cells, ...) by cubic pieces that are monotone where the values are (Fritsch and
    Butland 1984; scipy's take no holes). Beside a cell without a number, or a jump, the slope is
    the chord's; where they jump, each half of the way keeps its cell's.
    """
    count = min(PARTS, MOST // max(len(values) - 1, 1))
    if count < 2:
        return values
    steps = np.diff(values, axis=0)
    jumps = _jumps(steps)
    chords = np.where(jumps, np.nan, steps)
    with np.errstate(invalid="ignore", divide="ignore"):
        before, after = chords[:-1], chords[1:]
        inner = np.where(before * after > 0, 2 / (1 / before + 1 / after), 0.0)
    inner = np.where(np.isnan(before), after, np.where(np.isnan(after), before, inner))
    slopes = np.concatenate([_end(chords[:2]), inner, _end(chords[-2:][::-1])])
    t = (np.arange(count) / count).reshape(-1, *[1] * (values.ndim - 1))
    pieces = [
        low + t * (left + t * (3 * chord - 2 * left - right + t * (left + right - 2 * chord)))
        for low, chord, left, right in zip(values, chords, slopes, slopes[1:], strict=False)
    ]
    halves = [
        low + np.heaviside(t - 0.5, 0.5) * step for low, step in zip(values, steps, strict=False)
    ]
    pieces = [np.where(*three) for three in zip(jumps, halves, pieces, strict=True)]
    curve = np.concatenate([*pieces, values[-1:]])
    curve[::count] = values  # also of a cell beside a hole
    return curve


def _jumps(chords: np.ndarray) -> np.ndarray:
    """Which steps from cell to cell are jumps, far longer than those on either side; not the first
    and the last, for what falls off steeply begins with a long one.
    """
    sizes, jump = np.abs(chords), np.zeros(chords.shape, dtype=bool)
    jump[1:-1] = sizes[1:-1] > JUMP * np.maximum(sizes[:-2], sizes[2:])
    return jump


def _end(chords: np.ndarray) -> np.ndarray:
    """Slope at an end, (1, ...), by the last two chords (that at the end first), kept monotone."""
    chord, further = chords[:1], chords[-1:]
    share = np.clip(1.5 - 0.5 * further / np.where(chord == 0, np.inf, chord), 0.0, 3.0)
    return chord * np.where(np.isnan(share), 1.0, share)
