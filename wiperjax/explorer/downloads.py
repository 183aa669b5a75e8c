"""The run of the cell that is shown, saved by the browser: as data, or as sound; and its modes."""

import base64
from functools import partial
from pathlib import Path
from typing import Any

from bokeh.models import CustomJS, Row

from ..exports import exported
from ..modes.table import modes
from ..sound import sound
from ..specs.load import parse_scene
from ..systems.build import build
from .cells import scene_of, simulated
from .explored import Explored
from .widgets import button, choice, source

MODES = "modes.uff"
KINDS = {  # name of the file -> what it is
    "run.csv": "CSV", "run.mat": "MAT (MATLAB)", "run.uff": "UFF 58", MODES: "UFF 55 (its modes)",
    "run.wav": "WAV",
}  # fmt: skip
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
        self.kind = choice("save the run as", "run.csv", KINDS.items(), 170)
        self.button = button("save the run")
        self.button.on_click(self._wish)
        self.file = source(name=[], content=[])
        self.file.js_on_change("data", CustomJS(args={"file": self.file}, code=SAVE))
        self.view = Row(children=[self.kind, self.button], tags=[self.file])  # else nobody has it

    def _wish(self) -> None:
        page, name = self.page, str(self.kind.value)
        if name not in KINDS or page.explored.spec is None:
            return
        place, reference = page.place(), page.full_scale()
        work = partial(file_of, page.explored, place, page.begin(), name, reference)
        what = (page.explored, tuple(place.items()), str(page.begin()), reference, name)
        page.say(f"making {name} ...")  # seconds, where a program is compiled for it
        page.worker.wish((page, "file"), what, work, partial(self._later, name))

    def _later(self, name: str, found: Any) -> None:
        self.page.document.add_next_tick_callback(partial(self._save, name, found))

    def _save(self, name: str, found: Any) -> None:
        if isinstance(found, Exception):
            self.page.say(f"This cannot be saved: {found}", fault=True)
            return
        content = base64.b64encode(found).decode()
        self.file.data = {"name": [name], "content": [content]}
        self.page.say(f"{name} is made")


def file_of(
    explored: Explored, place: dict[str, int], start: Any, name: str, reference: float
) -> bytes:
    """What a file of this name (`KINDS`) holds of a cell: its run, the sound at its full scale, or
    the modes of its steady sliding.
    """
    scene, ending = scene_of(explored, place, start), Path(name).suffix
    if name == MODES:
        spec = parse_scene(scene, "this cell")
        return exported(modes(build(spec, spec.parameters()).system), ending)
    run, _ = simulated(explored, scene)
    if ending == ".wav":
        return sound(run, reference=reference).wav()
    return exported(run, ending)
