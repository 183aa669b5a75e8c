"""What is drawn over the cells of a map: borders and patterns; over one axis, a number's curve."""

from html import escape
from typing import Any

import contourpy
import numpy as np
from bokeh.models import LinearAxis

from ..datasets.map_starts import hangs_on_start
from ..plots.maps.borders import PREFIX, border_pieces, border_places, border_words
from ..plots.maps.categories import row_runs
from ..plots.maps.stability import WORDS, growth_between, places
from ..plots.style.palette import BORDER, BOUNDARY, HATCHES
from ..vocabulary.cf import flag_names
from .content import with_room
from .widgets import source, span

MOST_HATCHED = 4000  # pieces: beyond, cells are finer than the pattern
PATTERNS = {
    "////": "right_diagonal_line",
    "xxxx": "diagonal_cross",
    "....": "dot",
    "\\\\\\\\": "left_diagonal_line",
}


class Overlay:
    """Curves and patterns over a plane of a map, in cells."""

    def __init__(self, picture: Any) -> None:
        self.lines = {name: source(x=[], y=[]) for name in ("boundary", "border", "dots", "curve")}
        self.hatched = {
            pattern: source(left=[], right=[], bottom=[], top=[]) for pattern in PATTERNS
        }
        self._growth = np.zeros((1, 0))  # that the boundary is drawn of
        self.numbers = span(0, 1)
        picture.extra_y_ranges = {"numbers": self.numbers}
        self.axis: Any = LinearAxis(y_range_name="numbers", visible=False)
        picture.add_layout(self.axis, "left")
        self._draw(picture)

    def show(self, plane: Any, x: str, y: str, variable: str, values: Any) -> str:
        """Shows what belongs to a plane of one of its variables, `values` being the numbers of a
        map of one axis (else None); returns its key as HTML.
        """
        keys = self._show_lines(plane, x, y, variable)
        curve = np.zeros(0) if values is None else values
        _fill(self.lines["curve"], x=np.arange(len(curve)), y=curve)
        known = curve[np.isfinite(curve)]
        self.axis.visible = bool(known.size)
        if known.size:
            low, high = with_room(known)
            self.numbers.update(start=low, end=high)
        self._hatch(plane, variable)
        return keys

    def clear(self) -> None:
        """Shows nothing."""
        for one in (*self.lines.values(), *self.hatched.values()):
            _fill(one, **{column: [] for column in one.data})
        self._growth, self.axis.visible = np.zeros((1, 0)), False

    def parts(self) -> list[tuple[Any, tuple[str, ...]]]:
        """What `show` changes: models and properties."""
        sources = [*self.lines.values(), *self.hatched.values()]
        return [
            *((one, ("data",)) for one in sources),
            (self.numbers, ("start", "end")),
            (self.axis, ("visible", "axis_label")),
        ]

    def _draw(self, picture: Any) -> None:
        for pattern, one in self.hatched.items():
            colour = dict(HATCHES.values())
            picture.quad(
                left="left", right="right", bottom="bottom", top="top", source=one,
                fill_alpha=0, line_width=0, hatch_pattern=PATTERNS[pattern], hatch_scale=8,
                hatch_color=colour[pattern], hatch_weight=1.2,
            )  # fmt: skip
        for colour, width in ((BOUNDARY, 3), (BORDER, 1.4)):
            picture.multi_line("x", "y", source=self.lines["border"], color=colour,
                               line_width=width, line_cap="round")  # fmt: skip
        picture.scatter("x", "y", source=self.lines["dots"], size=2, color=BORDER)
        for colour, width in (("white", 4.5), (BOUNDARY, 2)):
            picture.multi_line("x", "y", source=self.lines["boundary"], color=colour,
                               line_width=width, line_dash="solid")  # fmt: skip
        for colour, width in (("white", 4.5), ("black", 2)):
            picture.line("x", "y", source=self.lines["curve"], color=colour, line_width=width,
                         y_range_name="numbers")  # fmt: skip

    def _show_lines(self, plane: Any, x: str, y: str, variable: str) -> str:
        """Shows the border of linear stability, and those that were located; returns their key."""
        growth = plane["growth_rate"].values if "growth_rate" in plane else np.zeros((1, 0))
        if not np.array_equal(growth, self._growth, equal_nan=True):  # else it is drawn
            self._growth, found = growth, _boundary(plane, x, y)
            _fill(self.lines["boundary"], x=[c[:, 0] for c in found], y=[c[:, 1] for c in found])
        keys = ""
        if len(self.lines["boundary"].data["x"]):
            keys += _line(BOUNDARY, WORDS)
        pieces, dots = _borders(plane, x, y, variable)
        _fill(
            self.lines["border"],
            x=[np.array([a[0], b[0]]) for a, b in pieces],
            y=[np.array([a[1], b[1]]) for a, b in pieces],
        )
        _fill(self.lines["dots"], x=dots[:, 0], y=dots[:, 1])
        if pieces:
            keys += _line(
                "#ffffff;outline:1px solid #000",
                escape(border_words(str(plane.attrs.get(PREFIX + "on", "")))),
            )
        return f'<div class="keys">{keys}</div>' if keys else ""

    def _hatch(self, plane: Any, variable: str) -> None:
        """Patterns over classes that have one, and where the class hangs on the start."""
        masks = {}
        if "flag_values" in plane[variable].attrs:
            for code, name in flag_names(plane[variable]).items():
                if name in HATCHES:
                    masks[HATCHES[name][0]] = plane[variable].values == code
        if variable == "label" and (several := hangs_on_start(plane)) is not None:
            masks[HATCHES["several"][0]] = several.values
        for pattern, one in self.hatched.items():
            row, start, stop = row_runs(masks.get(pattern, np.zeros((1, 1), bool)))
            if len(row) > MOST_HATCHED:
                row = start = stop = row[:0]
            _fill(one, left=start - 0.5, right=stop - 0.5, bottom=row - 0.5, top=row + 0.5)


def _boundary(plane: Any, x: str, y: str) -> list[Any]:
    """Where the growth rate changes its sign: curves, (points, 2), in cells."""
    growth = growth_between(plane, y, x) if y else growth_between(plane.isel({y: 0}), x)
    if growth is None:
        return []
    across = places(plane.sizes[x], growth.shape[-1])
    if y:
        up, masked = places(plane.sizes[y], len(growth)), np.ma.masked_invalid(growth)
        return list(contourpy.contour_generator(across, up, masked).lines(0.0))
    grows, known = growth > 0, np.isfinite(growth)
    first = np.flatnonzero((grows[:-1] != grows[1:]) & known[:-1] & known[1:])
    share = growth[first] / (growth[first] - growth[first + 1])
    return _upright(across[first] + share * across[1])


def _borders(plane: Any, x: str, y: str, variable: str) -> tuple[list, np.ndarray]:
    """Located borders as `border_pieces` has them; over one axis lines across it."""
    if not y:
        return _upright(border_places(plane, x, variable)), np.zeros((0, 2))
    return border_pieces(plane, x, y, variable)


def _upright(places: np.ndarray) -> list[np.ndarray]:
    """Lines across the strip of a map of one axis."""
    return [np.array([[place, -0.5], [place, 0.5]]) for place in places]


def _fill(one: Any, **columns: Any) -> None:
    """Fills a source, unless it was empty and stays so."""
    if any(map(len, columns.values())) or any(map(len, one.data.values())):
        one.data = columns


def _line(colour: str, text: str) -> str:
    return f'<span class="key"><i class="line" style="border-color:{colour}"></i>{text}</span>'
