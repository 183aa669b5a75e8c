"""The part of a window that computes a dragged box again: progress, and the way back."""

import threading
from dataclasses import replace
from functools import partial
from typing import Any

from bokeh.models import Row

from .box import Boxes, box_spec
from .cells import begun
from .explored import Explored
from .widgets import LIVE, button, words

PART = "a part, computed again and finer"


class FinerPart:
    """A box of the map of a page, computed in the background and then shown in its place."""

    def __init__(self, page: Any, boxes: Boxes):
        self.page, self.boxes = page, boxes
        self.wish: threading.Event | None = None
        self.left: list[tuple[Explored, str, str, dict[str, int], Any]] = []
        self.words = words(330, html_attributes=LIVE)
        self.button = button("back to the whole map")
        self.button.on_click(self.back)
        self.view = Row(children=[self.button, self.words], visible=False)

    def dragged(self, event: Any) -> None:
        """Begins with the box that was dragged, in cells."""
        shape = event.geometry or {}
        if not event.final or shape.get("type") != "rect":
            return
        page = self.page
        axes = page.x, page.y  # they may be turned before the part is there
        ends = {
            name: (float(shape[f"{which}0"]), float(shape[f"{which}1"]))
            for name, which in zip(axes, "xy", strict=True)
        }
        ends.pop("", None)  # of a map of one axis
        self.stop()
        try:
            spec = box_spec(page.explored, ends, page.place(), page.begin())
        except ValueError as error:
            page.say(f"No finer part: {error}", fault=True)
            return
        name = self._name()
        self.view.visible, self.button.label = True, "stop"
        self._tell(0, spec.size)
        later = page.document.add_next_tick_callback
        self.wish = self.boxes.begin(
            spec,
            lambda done, of: later(partial(self._tell, done, of)),
            lambda found: later(partial(self._done, axes, name, found)),
        )

    def _name(self) -> str:
        """What a part of the map that is shown is called; the start of its cells is in it, for the
        part has but one to choose from.
        """
        page = self.page
        if self.left:  # a part by itself, with that start
            return page.explored.name
        if page.explored.spec.starts is None:
            return PART
        return f"{PART}, start: {begun(page.explored, page.place(), page.begin())}"

    def stop(self) -> None:
        """Drops the box that is being computed, if any."""
        if self.wish is not None:
            self.wish.set()
        self.wish = None

    def back(self) -> None:
        """Stops what is computed; else shows the map that the box is a part of."""
        if self.wish is not None:
            self.stop()
        elif self.left:
            explored, x, y, place, start = self.left.pop()
            self.page.open(explored, x, y, place, start)
        self._rest()

    def _tell(self, done: int, of: int) -> None:
        share = 100 * done / of
        text = "compiling ..." if not done else f"{done:,} of {of:,} cells"
        self.words.text = (
            f'<div role="progressbar" aria-valuenow="{share:.0f}" aria-valuemin="0" '
            f'aria-valuemax="100" class="progress"><div style="width:{share:.0f}%"></div></div>'
            f'<p class="note">finer part: {text}</p>'
        )

    def _done(self, axes: tuple[str, str], name: str, found: Any) -> None:
        if self.wish is None or self.wish.is_set():
            return
        self.wish, page = None, self.page
        if isinstance(found, Exception):
            page.say(f"The finer part cannot be computed: {found}", fault=True)
        else:
            self.left.append((page.explored, page.x, page.y, page.place(), page.begin()))
            page.open(replace(found, name=name), *axes)
        self._rest()

    def _rest(self) -> None:
        """What is shown while nothing is computed."""
        self.view.visible, self.words.text = bool(self.left), ""
        deep = len(self.left) > 1
        self.button.label = "back to the larger part" if deep else "back to the whole map"
