"""Where the map is shown: one plane of it, in cells, with its cursor, lines and legend.

Axes count cells, so that every cell is as large as every other and an image can show them; their
marks are the values. What a pointer or a key does to the cursor happens in the browser.
"""

from typing import Any

import numpy as np
from bokeh.events import DocumentReady, MouseLeave, MouseMove, Tap
from bokeh.models import (
    BoxSelectTool,
    CustomJS,
    FixedTicker,
    LinearColorMapper,
)
from bokeh.plotting import figure
from matplotlib.ticker import LogLocator, MaxNLocator

from ..plots.maps.numbers import told_names
from ..plots.style.axes import axis_numbers, is_geometric, shown
from ..plots.style.palette import UNKNOWN
from .explored import Explored, escaped
from .overlay import Overlay
from .scale import NO_VALUE, painted
from .style import titled
from .widgets import source, span, words

WIDTH = 520

TAP = """
const nx = axes.data.x[0].length, ny = axes.data.y[0].length;
const i = Math.round(cb_obj.x), j = Math.round(cb_obj.y);
if (i >= 0 && j >= 0 && i < nx && j < ny) cursor.data = {x: [i], y: [j]};
"""
MOVE = """
const a = {x: axes.data.x[0], y: axes.data.y[0]}, p = plane.data;
const spot = (i, j) => {
  const k = j * a.x.length + i, v = p.values[0][k];
  const name = names.data.code.indexOf(v);
  const short = Number.isInteger(v) && Math.abs(v) < 1e7 ? v : Number(v.toPrecision(4));
  const number = Number.isFinite(v) ? short + ' ' + names.tags[1] : 'no number';
  const word = names.tags[2] ? (name < 0 ? names.tags[2] : names.data.name[name]) : number;
  const up = names.tags[4] ? `, ${names.tags[4]} ${a.y[j]}` : '';
  return `${names.tags[3]} ${a.x[i]}${up}: ${word}`;
};
const i = Math.round(cb_obj.x), j = Math.round(cb_obj.y);
const there = p.values.length && i >= 0 && j >= 0 && i < a.x.length && j < a.y.length;
readout.text = there ? spot(i, j) : '';
"""
KEYS = """
const steps = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]};
document.addEventListener('keydown', (event) => {
  const step = steps[event.key];
  const tag = (event.composedPath()[0].tagName || '').toLowerCase();
  const busy = ['input', 'select', 'textarea', 'audio', 'option'].includes(tag);
  const slides = event.composedPath().some(e => e.classList && e.classList.contains('noUi-handle'));
  if (!step || busy || slides || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  const [i, j] = [cursor.data.x[0], cursor.data.y[0]];
  const nx = axes.data.x[0].length, ny = axes.data.y[0].length;
  const [sx, sy] = [flip.tags[0], flip.tags[1]];
  const k = Math.min(Math.max(i + sx * step[0], 0), nx - 1);
  const l = Math.min(Math.max(j + sy * step[1], 0), ny - 1);
  if (k !== i || l !== j) cursor.data = {x: [k], y: [l]};
});
"""
# Bokeh drops a drag whose pointer rests for 0.3 s first, as it does before a careful hand moves, or
# on a page that is busy drawing; its classes have no setting for it, and nothing here is pressed.
DRAGS = """
const gestures = window.Bokeh?.require?.('core/ui_gestures')?.UIGestures;
if (gestures) gestures.press_threshold = 2 ** 31 - 1;  // ms, the longest that a timer takes
"""


class MapPanel:
    """The plane of a map.

    Attributes:
        picture: the figure.
        legend, readout: HTML beside it.
        cursor: the cell that is shown, `x` and `y` of one place.
        held: the cell that is held beside it, if it lies in the plane.
    """

    def __init__(self) -> None:
        self.plane = source(image=[], values=[], x=[], y=[], w=[], h=[])
        self.axes = source(x=[[]], y=[[]])
        self.names = source(code=[], name=[])
        self.cursor = source(x=[0], y=[0])
        self.held = source(x=[], y=[])
        self._axes: Any = None  # that are shown
        self.mapper = LinearColorMapper(low=-0.5, high=0.5, palette=[UNKNOWN], high_color=UNKNOWN)
        self.picture = self._figure()
        self.legend = words(WIDTH)
        self.readout = words(WIDTH, render_as_text=True, css_classes=["readout"])
        given = {"axes": self.axes, "plane": self.plane, "names": self.names}
        move = CustomJS(args=given | {"readout": self.readout}, code=MOVE)
        self.picture.js_on_event(MouseMove, move)
        clear = CustomJS(args={"readout": self.readout}, code="readout.text = ''")
        self.picture.js_on_event(MouseLeave, clear)
        self.plane.js_on_change("data", clear)  # the pointer may rest where another cell is now
        self.picture.js_on_event(
            Tap, CustomJS(args={"axes": self.axes, "cursor": self.cursor}, code=TAP)
        )

    def listen(self, document: Any) -> None:
        """Lets the arrow keys of a document move the cursor, and a pointer rest before it drags."""
        given = {"axes": self.axes, "cursor": self.cursor, "flip": self.cursor}
        document.js_on_event(DocumentReady, CustomJS(args=given, code=KEYS + DRAGS))

    def show(self, explored: Explored, plane: Any, x: str, y: str, variable: str) -> None:
        """Shows a `plane` (`Explored.plane`) by one of its variables; `y` is empty for a map of one
        axis, which is a strip, and under the curve of a number.
        """
        plane = told_names(plane, variable)
        paint = painted(plane, variable)
        rows, columns = paint.shades.shape
        named = {name: explored.axis_words(name) for name in (x, y)}
        tags = ["", paint.unit, NO_VALUE if paint.names else "", named[x][0], named[y][0]]
        _change(self.mapper, palette=paint.palette, low=-0.5, high=len(paint.palette) - 0.5)
        self.plane.data = {
            "image": [paint.shades], "values": [paint.values.ravel()], "x": [-0.5], "y": [-0.5],
            "w": [columns], "h": [rows],
        }  # fmt: skip
        _change(
            self.names,
            data={"code": list(paint.names), "name": list(paint.names.values())},
            tags=tags,
        )
        self._show_axes(plane, x, y, named)
        curve = paint.values[0] if not y and not paint.names else None
        keys = self.overlay.show(plane, x, y, variable, curve)
        label = f"{explored.variables[variable]}{f' ({paint.unit})' if paint.unit else ''}"
        _change(self.overlay.axis, axis_label=label)
        _change(self.legend, text=paint.legend + keys)

    def refuse(self, explored: Explored, x: str, y: str, why: str) -> None:
        """Shows no cells over two axes, and `why`: else those of the plane before are taken for
        these, under the axes of that one.
        """
        named = {name: explored.axis_words(name) for name in (x, y)}
        self.plane.data = {column: [] for column in self.plane.data}
        self._show_axes(explored.ds, x, y, named)
        self.overlay.clear()
        _change(self.legend, text=f'<p class="fault">{escaped(why)}</p>')

    def frame(self, cell: tuple[int, int] | None) -> None:
        """Frames the cell that is held, if it lies in this plane."""
        x, y = ([], []) if cell is None else ([cell[0]], [cell[1]])
        _change(self.held, data={"x": x, "y": y})

    def _show_axes(self, plane: Any, x: str, y: str, named: Any) -> None:
        """Shows what the two axes are, unless it is there."""
        texts = {"x": [named[x][2]], "y": [named[y][2]]}
        falls = [bool(name) and bool(np.diff(plane[name][[0, -1]])[0] < 0) for name in (x, y)]
        pair = (x, y, falls)
        if self._axes == pair and dict(self.axes.data) == texts:
            return
        self._axes, self.axes.data = pair, texts
        self.cursor.tags = [-1 if fall else 1 for fall in falls]
        ranges = (self.picture.x_range, self.picture.y_range)
        counts = [len(named[name][2]) for name in (x, y)]
        for fall, count, range_ in zip(falls, counts, ranges, strict=True):
            ends = (-0.5, count - 0.5)
            range_.update(start=ends[fall], end=ends[not fall])
        self.upright.visible = bool(y)
        for name, axis in ((x, self.picture.xaxis[0]), (y, self.upright)):
            if name:
                _mark(axis, plane[name], named[name])

    def parts(self) -> list[tuple[Any, tuple[str, ...]]]:
        """What `show` changes from plane to plane of the same two axes: models and properties."""
        return [
            (self.plane, ("data",)),
            (self.axes, ("data",)),
            *self.overlay.parts(),
            (self.names, ("data", "tags")),
            (self.mapper, ("palette", "low", "high")),
            (self.legend, ("text",)),
        ]

    def _figure(self) -> Any:
        picture: Any = figure(
            width=WIDTH, height=440, x_range=span(-0.5, 0.5), y_range=span(-0.5, 0.5),
            tools=[BoxSelectTool(renderers=[])], toolbar_location=None, **titled(),
        )  # fmt: skip
        picture.grid.visible = False
        picture.image(
            image="image", x="x", y="y", dw="w", dh="h", color_mapper=self.mapper,
            source=self.plane,
        )  # fmt: skip
        self.upright = picture.yaxis[0]
        self.overlay = Overlay(picture)
        for one, dash in ((self.held, "dashed"), (self.cursor, "solid")):
            for colour, width in (("white", 6), ("black", 2.6)):
                picture.rect("x", "y", width=1, height=1, source=one, fill_alpha=0,
                             line_color=colour, line_width=width, line_dash=dash)  # fmt: skip
        for colour, width in (("white", 4), ("black", 1.8)):
            picture.scatter("x", "y", source=self.cursor, marker="circle", size=26,
                            fill_alpha=0, line_color=colour, line_width=width)  # fmt: skip
        return picture


def _change(model: Any, **values: Any) -> None:
    """Sets what differs: what is set is sent, and drawn anew."""
    model.update(**{name: x for name, x in values.items() if getattr(model, name) != x})


def _mark(axis: Any, coordinate: Any, named: tuple[str, str, list[str]]) -> None:
    """Marks of round values along an axis that counts cells."""
    name, unit, _ = named
    values = shown(coordinate)[0]
    low, high = float(values.min()), float(values.max())
    geometric = is_geometric(values)
    locator = LogLocator(subs=(1.0, 2.0, 5.0)) if geometric else MaxNLocator(6)
    ticks = np.asarray(locator.tick_values(low, high)) if high > low else values
    room = 1e-9 * (high - low)
    ticks = ticks[(ticks >= low - room) & (ticks <= high + room)]
    scale = np.log if geometric else np.asarray
    order = np.argsort(values)
    places = np.interp(scale(ticks), scale(values)[order], order.astype(float))
    axis.ticker = FixedTicker(ticks=places.tolist())
    texts = axis_numbers(ticks)
    axis.major_label_overrides = dict(zip(places.tolist(), texts, strict=True))
    axis.axis_label = f"{name} ({unit})" if unit else name
