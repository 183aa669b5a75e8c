"""The lip in slow motion. It plays in the browser, also without a server behind the page."""

from typing import Any

import numpy as np
from bokeh.models import Column, CustomJS, Row

from ..plots.style.palette import BELT, REGIMES, readable
from .frames import FRAMES
from .widgets import slider, source, toggle, words

DRAWN = {  # of one frame of the animation
    "rod": {"x": [], "y": [], "colour": []}, "joint": {"x": [], "y": []},
    "glass": {"x": [], "y": []}, "push": {"x": [], "y": []}, "tip": {"x": [], "y": []},
    "now": {"t": [], "v": []}, "here": {"x": [], "v": []},
}  # fmt: skip

FRAME = """
const f = frames.data; const n = f.x.length; if (!n) return;
const k = Math.min(slider.value, n - 1), L = f.length[k];
const set = (source, data) => { source.data = data };
set(rod, {x: [[0, f.x[k]]], y: [[f.hinge[k], f.y[k]]], colour: [f.colour[k]]});
set(joint, {x: [0], y: [f.hinge[k]]});
const marks = [];
for (let i = -4; i < 4; i++) {
  const place = i * 0.5 * L + f.travel[k] + 2 * L;
  marks.push(place - 4 * L * Math.floor(place / (4 * L)) - 2 * L);
}
set(glass, {x: marks, y: marks.map(() => -0.05 * L)});
const far = Math.hypot(f.px[k] - f.x[k], f.py[k] - f.y[k]) > 0.02 * L;
set(push, far ? {x: [[f.x[k], f.px[k]]], y: [[f.y[k], f.py[k]]]} : {x: [], y: []});
set(tip, far ? {x: [f.px[k]], y: [f.py[k]]} : {x: [], y: []});
set(now, {t: [f.t[k]], v: [f.v[k]]});
set(here, {x: [f.at[k]], v: [f.v[k]]});
picture.title.text = `The lip at ${f.when[k]}: ${f.regime[k]}`;
"""
PLAY = """
if (!toggle.active) { toggle.label = '▶ slow motion'; return }
toggle.label = '❚❚ pause';
const step = () => {
  if (!toggle.active) return;
  const n = frames.data.x.length;
  if (n) slider.value = (slider.value + 1) % n;
  setTimeout(step, 50);
};
step();
"""


def drawn_sources() -> dict[str, Any]:
    """What is drawn of one frame, here and in the other pictures; empty."""
    return {name: source(syncable=False, **data) for name, data in DRAWN.items()}


def slow_motion(picture: Any, frames: Any, drawn: dict[str, Any]) -> tuple[Any, CustomJS]:
    """Draws the lip into a figure; returns it with its buttons and the key of its colours, and what
    draws: frames that a page has from its beginning do not change.
    """
    picture.hspan(y=0, line_color=BELT, line_width=2)
    picture.scatter("x", "y", marker="dash", angle=np.pi / 2, size=12, color=BELT,
                    line_width=2, source=drawn["glass"])  # fmt: skip
    picture.multi_line("x", "y", color="colour", line_width=7, line_cap="round",
                       source=drawn["rod"])  # fmt: skip
    picture.multi_line("x", "y", color="black", line_width=2, source=drawn["push"])
    picture.scatter("x", "y", size=6, color="black", source=drawn["tip"])
    picture.scatter("x", "y", size=9, color="black", source=drawn["joint"])
    numbers = [str(number + 1) for number in range(FRAMES)]
    frame = slider("frame", numbers, 0, picture.width - 140, syncable=False)
    play = toggle("▶ slow motion", 120)
    given = {"frames": frames, "slider": frame, "picture": picture, **drawn}
    draw = CustomJS(args=given, code=FRAME)
    frame.js_on_change("value", draw)
    frames.js_on_change("data", draw)
    play.js_on_change(
        "active",
        CustomJS(args={"toggle": play, "slider": frame, "frames": frames},
                 code=PLAY),
    )  # fmt: skip
    row = Row(children=[play, frame], styles={"gap": "8px"})
    legend = "".join(
        f'<span class="key"><i style="background:{colour}"></i>{readable(name)}</span>'
        for name, colour in REGIMES.items()
    )
    force = '<span class="key"><i class="line"></i>contact force on the tip</span>'
    key = words(picture.width, f'<div class="keys">{legend}{force}</div>')
    return Column(children=[picture, row, key], width=picture.width), draw
