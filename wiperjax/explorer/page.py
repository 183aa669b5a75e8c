"""One window: a map beside the motion of a cell, or of two, and what a click does."""

import time
from functools import partial
from typing import Any

import numpy as np
from bokeh.events import SelectionGeometry
from bokeh.models import Column, Row

from ..machine.files import StoreError
from .box import Boxes
from .content import Content
from .downloads import Downloads
from .explored import Explored, escaped, plain
from .finer_part import FinerPart
from .map_panel import WIDTH, MapPanel
from .motion import first_place, wish_motion
from .motion_panel import FIRST, FLEX, MotionPanel
from .style import PAGE
from .widgets import LIVE, beside, button, choice, slider, words
from .worker import Worker

REST = 200  # ms without a move after which a slider rests
FULL_SCALES = {"1": "1 m/s", "0.3": "0.3 m/s", "0.1": "0.1 m/s", "0.03": "0.03 m/s"}


Cell = tuple[Explored, dict[str, int]]  # a map, and a place in it


class Page:
    """What one window shows of a map, in a Bokeh document of its own."""

    def __init__(self, document: Any, explored: Explored, worker: Worker, boxes: Boxes):
        self.document, self.explored, self.worker = document, explored, worker
        self.finer, self.downloads = FinerPart(self, boxes), Downloads(self)
        self.map, self.motion, self.other = MapPanel(), MotionPanel("Cell"), MotionPanel("Held")
        self.other.view.visible = False
        self.last: tuple[Cell, Content] | None = None  # that is shown
        self.held: Cell | None = None
        self.quiet = False  # whether widgets change by themselves
        self.rests: Any = None  # what is done once a slider rests
        self.status = words(WIDTH, html_attributes=LIVE, css_classes=["state"])
        self.above = Column(children=[], width=WIDTH)
        self.hold = button("hold this cell beside")
        self.hold.on_click(self._hold)
        self.reference = choice("full scale of the sound", "1", FULL_SCALES.items(), 170)
        self.reference.on_change("value", lambda attr, old, new: self._look())
        self.map.picture.on_event(SelectionGeometry, self.finer.dragged)
        self.map.cursor.on_change("data", lambda attr, old, new: self._look())
        self.below = Column(children=[], width=WIDTH)
        help_ = (
            "<p class='note'>Click a cell, or move with <kbd>&larr;</kbd> <kbd>&rarr;</kbd> "
            "<kbd>&uarr;</kbd> <kbd>&darr;</kbd>: its motion is computed on the spot. "
            "Drag a box to compute that part again, finer.</p>"
        )
        self.title = words(WIDTH)
        left = Column(
            children=[
                self.title, self.above, self.map.picture, self.map.readout, self.map.legend,
                self.below, self.finer.view, Row(children=[self.hold, self.reference]),
                self.downloads.view,
                self.status,
                words(WIDTH, help_),
            ],
            width=WIDTH,
        )  # fmt: skip
        motions = beside(self.motion.view, self.other.view, flex=FLEX)
        document.add_root(beside(left, motions))
        document.title = plain(f"wiperjax explore: {explored.name}")
        document.template = PAGE
        for panel in (self.map, self.motion):
            panel.listen(document)
        self.open(explored)

    def open(
        self,
        explored: Explored,
        x: str | None = None,
        y: str | None = None,
        place: dict[str, int] | None = None,
        start: Any = None,
    ) -> None:
        """Shows a map (the first one, or a part of it, finer), at `place` or its middle."""
        self.explored = explored
        self.x, self.y = explored.plane_axes() if x is None else (x, y or "")
        name = escaped(explored.ds.attrs.get("title") or explored.name)
        file = escaped(explored.name)
        self.title.text = f"<h1>{name}</h1>" + (f"<p class='note'>{file}</p>" * (file != name))
        self.at = place or first_place(explored)
        chosen = str(self.variable.value) if self.above.children else ""
        self._widgets(chosen, start)
        self._plane()
        self.quiet = True
        self._point()
        self.quiet = False
        self._look()

    def _widgets(self, chosen: str, start: Any) -> None:
        """Choices above the map, a slider for each other axis below."""
        explored = self.explored
        long = [dim for dim in explored.dims if explored.ds.sizes[dim] > 1]
        axes = [(dim, explored.axis_words(dim)[0]) for dim in long]
        variables = explored.variables
        chosen = chosen if chosen in variables else next(iter(variables))
        width = 200 if self.y else WIDTH - 20
        self.variable = choice("shown", chosen, variables.items(), width)
        self.across = choice("across", self.x, axes, 145)
        self.up = choice("up", self.y, axes, 145)
        self.variable.on_change("value", lambda attr, old, new: self._plane())
        self.across.on_change("value", partial(self._turn, "x"))
        self.up.on_change("value", partial(self._turn, "y"))
        self.across.visible = self.up.visible = bool(self.y)
        children: list[Any] = [Row(children=[self.variable, self.across, self.up])]
        self.start = None
        if len(explored.starts) > 1:
            names = [("", f"the usual one ({explored.usual_start})")]
            names += [(str(s), plain(str(s))) for s in explored.starts]
            self.start = choice("start", "" if start is None else str(start), names, 200)
            self.start.on_change("value", self._other_start)
            children.append(self.start)
        self.above.children = children
        self._sliders()

    def _sliders(self) -> None:
        sliders = []
        for dim in self.explored.dims:
            if dim in (self.x, self.y) or self.explored.ds.sizes[dim] < 2:
                continue
            name, _, texts = self.explored.axis_words(dim)
            one = slider(name, texts, self.at[dim], WIDTH - 20, name=dim)
            one.on_change("value", partial(self._slide, dim))
            sliders.append(one)
        self.below.children = sliders

    def _other_start(self, attr: str, old: str, new: str) -> None:
        self._plane()
        self._look()

    def _slide(self, dim: str, attr: str, old: Any, new: Any) -> None:
        self.at[dim] = int(new)
        self._plane()
        self._look_later()

    def _look_later(self) -> None:
        """Looks once a slider rests: a motion for each of its places would hold the planes up."""
        if self.rests is not None:
            self.document.remove_timeout_callback(self.rests)
        self.rests = self.document.add_timeout_callback(self._rested, REST)

    def _rested(self) -> None:
        self.rests = None
        self._look()

    def _turn(self, which: str, attr: str, old: str, new: str) -> None:
        """Another axis across or up; the two change places where they would be the same."""
        if self.quiet or new not in self.explored.dims:
            return
        place = {self.x: self.map.cursor.data["x"][0], self.y: self.map.cursor.data["y"][0]}
        self.at |= {dim: int(k) for dim, k in place.items()}
        if which == "x":
            self.x, self.y = new, old if new == self.y else self.y
        else:
            self.y, self.x = new, old if new == self.x else self.x
        self.quiet = True
        self.across.value, self.up.value = self.x, self.y
        self._sliders()
        self._plane()
        self._point()
        self.quiet = False

    def _point(self) -> None:
        """Puts the cursor where the page is."""
        self.map.cursor.data = {"x": [self.at[self.x]], "y": [self.at.get(self.y, 0)]}

    def begin(self) -> Any:
        """The start that is chosen, as the map names it."""
        chosen = "" if self.start is None else self.start.value
        return next((s for s in self.explored.starts if str(s) == chosen), None)

    def _plane(self) -> None:
        variable = str(self.variable.value)
        if variable not in self.explored.variables:
            return
        try:
            plane = self.explored.plane(self.x, self.y, self.at, self.begin(), {variable})
            self.map.show(self.explored, plane, self.x, self.y, variable)
        except (ValueError, StoreError) as error:  # too large, damaged, or of averaged codes
            self.map.refuse(self.explored, self.x, self.y, str(error))
        self._frame()

    def _frame(self) -> None:
        """Frames the held cell, if it is one of the plane that is shown."""
        explored, place = self.held or (None, {})
        rest = [dim for dim in self.explored.dims if dim not in (self.x, self.y)]
        here = explored is self.explored and all(place[dim] == self.at[dim] for dim in rest)
        self.map.frame((place[self.x], place.get(self.y, 0)) if here else None)

    def place(self) -> dict[str, int]:
        """The cell of the cursor: axis -> place."""
        cursor = self.map.cursor.data
        chosen = self.at | {self.x: int(cursor["x"][0]), self.y: int(cursor["y"][0])}
        sizes = self.explored.ds.sizes
        return {dim: int(np.clip(chosen[dim], 0, sizes[dim] - 1)) for dim in self.explored.dims}

    def full_scale(self) -> float:
        """What the sound reaches full scale at, in the unit of velocity."""
        chosen = str(self.reference.value)
        return float(chosen) if chosen in FULL_SCALES else 1.0

    def _look(self) -> None:
        """Has the motion of the cell of the cursor computed, and shows it."""
        if self.quiet:
            return
        if self.explored.spec is None:
            self._nothing()
            self.say(f"Cells of this map cannot be simulated: {self.explored.unable}.", fault=True)
            return
        explored, place, start = self.explored, self.place(), self.begin()
        self.say("computing ...")
        reference = self.full_scale()
        later = partial(self._later, (explored, place), time.perf_counter())
        wish_motion(self.worker, self, explored, place, later, start, reference)

    def _nothing(self) -> None:
        """Shows no motion: that of another cell is not to be taken for this one's."""
        self.last, self.motion.view.visible = None, False

    def _later(self, cell: Cell, begun: float, found: Any) -> None:
        """Shows what the worker found, in the thread of the server."""
        self.document.add_next_tick_callback(partial(self._show, cell, begun, found))

    def _show(self, cell: Cell, begun: float, found: Any) -> None:
        if isinstance(found, Exception):
            self._nothing()
            self.say(f"This cell cannot be computed: {found}", fault=True)
            return
        self.last, self.motion.view.visible = (cell, found), True
        self.motion.show(found, FIRST)  # one message after the other: these are drawn meanwhile
        self.document.add_next_tick_callback(partial(self._show_rest, begun, found))

    def _show_rest(self, begun: float, found: Content) -> None:
        self.motion.show(found)
        self.say(f"computed and shown in {1e3 * (time.perf_counter() - begun):.0f} ms")

    def _hold(self) -> None:
        """Holds the motion that is shown beside those that follow, or lets it go."""
        if self.other.view.visible:
            self.other.view.visible, self.held = False, None
            self.hold.label = "hold this cell beside"
        elif self.last is not None:
            self.held, content = self.last
            self.other.show(content)
            self.other.view.visible = True
            self.hold.label = "let the held cell go"
        self._frame()

    def say(self, text: str, fault: bool = False) -> None:
        """Shows a line of state."""
        self.status.text = f'<p class="{"fault" if fault else "note"}">{escaped(text)}</p>'
