"""Regimes of a run as bands behind a curve, faithful also where stays are too short to be seen.

Bands thinner than a pixel are drawn as a pixel or not at all: a motion that sticks for a third of
each period may look as if it hardly ever stuck. So stays shorter than a five-hundredth of the axis
are drawn together: a stretch of them is one band that is divided by height, each colour as high as
its exact share of the time. A stretch is cut between whole periods, so that a steady motion has
steady shares.
"""

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ...datasets.run_dataset import regime_spans
from ..style.palette import REGIMES, UNKNOWN, readable

FINEST = 1 / 500  # of the axis: about two pixels of a page
ALPHA = 0.40

Span = tuple[float, float, str]
Piece = tuple[float, float, dict[str, float]]  # start, end, regime -> share of the time


def regime_bands(ds: xr.Dataset, ax: Axes) -> None:
    """Shades the background of `ax` by regime, from the exact event times if the run holds them."""
    boxes: dict[str, list] = {}
    for start, stop, shares in pieces(ds):
        low = 0.0
        for name in sorted(shares, key=_order):
            high = low + shares[name]
            boxes.setdefault(name, []).append(
                [(start, low), (start, high), (stop, high), (stop, low)]
            )
            low = high
    for name, corners in boxes.items():  # one object a regime: thousands of spans stay cheap
        band = PolyCollection(
            corners,
            facecolor=REGIMES.get(name, UNKNOWN),
            alpha=ALPHA,
            linewidth=0,
            transform=ax.get_xaxis_transform(),
            zorder=0,
        )
        band.set_snap(False)  # a band of half a pixel is half as strong, not gone
        ax.add_collection(band, autolim=False)


def regime_legend(ds: xr.Dataset) -> list[Patch | Line2D]:
    """Legend entries of the regimes that occur in a run, and of what divided bands mean."""
    found = list(pieces(ds))
    seen = {name for *_, shares in found for name in shares}
    handles: list[Patch | Line2D] = [
        Patch(color=REGIMES.get(name, UNKNOWN), alpha=ALPHA, label=readable(name))
        for name in sorted(seen, key=_order)
    ]
    if any(len(shares) > 1 for *_, shares in found):
        words = "divided: stays too short to show, by share of time"
        handles.append(Line2D([], [], linestyle="", label=words))
    return handles


def pieces(ds: xr.Dataset) -> list[Piece]:
    """Start, end (s) and shares of the regimes of each band: long stays alone, short ones, of less
    than `FINEST` of the time of `ds`, together.
    """
    least = FINEST * float(ds["time"][-1] - ds["time"][0])
    found: list[Piece] = []
    short: list[Span] = []
    for span in regime_spans(ds):
        if span[1] - span[0] < least:
            short.append(span)
            continue
        found += _together(short, least)
        found.append((span[0], span[1], {span[2]: 1.0}))
        short = []
    return found + _together(short, least)


def _together(spans: list[Span], least: float) -> list[Piece]:
    """Pieces of at least `least` (s) and of whole periods, if consecutive `spans` are as long."""
    if not spans or spans[-1][1] - spans[0][0] < least:
        return [(start, stop, {name: 1.0}) for start, stop, name in spans]
    cuts = [0]
    for k in range(1, len(spans)):
        begin = spans[cuts[-1]]
        repeats = spans[k][2] == begin[2]
        if repeats and spans[k][0] - begin[0] >= least and spans[-1][1] - spans[k][0] >= least:
            cuts.append(k)
    return [_piece(spans[a:b]) for a, b in zip(cuts, [*cuts[1:], len(spans)], strict=True)]


def _piece(spans: list[Span]) -> Piece:
    whole = spans[-1][1] - spans[0][0]
    shares: dict[str, float] = {}
    for start, stop, name in spans:
        shares[name] = shares.get(name, 0.0) + (stop - start) / whole
    return spans[0][0], spans[-1][1], shares


def _order(name: str) -> tuple[int, str]:
    names = list(REGIMES)
    return (names.index(name) if name in names else len(names), name)
