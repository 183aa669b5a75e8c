"""The run of the cell that is shown, saved by the browser: as data, or as sound."""

import base64
from functools import partial
from typing import Any

from bokeh.models import CustomJS, Row

from ..exports import exported
from ..sound import sound
from .cells import scene_of, simulated
from .explored import Explored
from .widgets import button, choice, source

KINDS = {".csv": "CSV", ".mat": "MAT (MATLAB)", ".uff": "UFF 58", ".wav": "WAV"}
SAVE = """
const text = atob(file.data.content[0]);
const bytes = Uint8Array.from(text, c => c.charCodeAt(0));
const link = document.createElement('a');
link.href = URL.createObjectURL(new Blob([bytes]));
link.download = file.data.name[0];
link.click();
setTimeout(() => URL.revokeObjectURL(link.href), 1000);
"""


class Downloads:
    """A choice of formats, and a button that has the run of a page's cell saved."""

    def __init__(self, page: Any):
        self.page = page
        self.kind = choice("save the run as", ".csv", KINDS.items(), 170)
        self.button = button("save the run")
        self.button.on_click(self._wish)
        self.file = source(name=[], content=[])
        self.file.js_on_change("data", CustomJS(args={"file": self.file}, code=SAVE))
        self.view = Row(children=[self.kind, self.button], tags=[self.file])  # else nobody has it

    def _wish(self) -> None:
        page, ending = self.page, str(self.kind.value)
        if ending not in KINDS or page.explored.spec is None:
            return
        place, reference = page.place(), page.full_scale()
        work = partial(file_of, page.explored, place, page.begin(), ending, reference)
        what = (id(page.explored), tuple(place.items()), str(page.begin()), reference, ending)
        page.worker.wish((page, "file"), what, work, partial(self._later, ending))

    def _later(self, ending: str, found: Any) -> None:
        self.page.document.add_next_tick_callback(partial(self._save, ending, found))

    def _save(self, ending: str, found: Any) -> None:
        if isinstance(found, Exception):
            self.page.say(f"The run cannot be saved: {found}", fault=True)
            return
        content = base64.b64encode(found).decode()
        self.file.data = {"name": [f"run{ending}"], "content": [content]}


def file_of(
    explored: Explored, place: dict[str, int], start: Any, ending: str, reference: float
) -> bytes:
    """What a file of this ending holds of the run of a cell; the sound at its full scale."""
    run, _ = simulated(explored, scene_of(explored, place, start))
    if ending == ".wav":
        return sound(run, reference=reference).wav()
    return exported(run, ending)
