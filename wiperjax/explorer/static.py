"""A map as one file: for a colleague without Python. All that it can show is stored in it.

What the panels show in each of their states is noted, and put back in the browser.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from bokeh.document import Document
from bokeh.embed import file_html
from bokeh.models import Column, CustomJS
from bokeh.resources import INLINE

from ..machine.files import check_output, log, replacing
from .explored import USUAL, Explored, escaped, plain
from .map_panel import WIDTH, MapPanel
from .motion import motion_of
from .motion_panel import MotionPanel
from .style import PAGE
from .widgets import beside, choice, slider, words

MOST_VALUES = 6_000_000  # cells of all planes: 30 MB
SECONDS = 1.0  # of the sound of each cell
COARSE = (4, 3, 2)  # cells across, up, and along each other axis whose motions are stored
MOST_MOTIONS = 48

PUT = """
const pairs = (o) => o instanceof Map ? [...o.entries()] : Object.entries(o);
const put = (states, key) => {
  const state = states instanceof Map ? states.get(key) : states[key];
  if (state) for (const [model, changes] of state)
    for (const [name, value] of pairs(changes)) model[name] = value;
};
const at = {};
for (const one of sliders) at[one.name] = one.value;
"""
PLANE = """
put(states, [variable.value, ...sliders.map(one => one.value)].join(' '));
"""
CELL = """
at[axes[0]] = cursor.data.x[0]; at[axes[1]] = cursor.data.y[0];  // '' if there is no other axis
let best = -1, least = Infinity;
places.forEach((place, k) => {
  let far = 0;
  place.forEach((n, d) => { far += ((n - (at[dims[d]] ?? 0)) / Math.max(1, sizes[d] - 1)) ** 2 });
  if (far < least) { least = far; best = k }
});
if (best >= 0 && shown.tags[0] !== best) { shown.tags = [best]; put(motions, String(best)) }
const own = (d, k) => axes.includes(d) || places[best][k] === (at[d] ?? 0);
const here = best >= 0 && dims.every(own);  // in the plane that is shown
const [i, j] = axes.map(axis => dims.indexOf(axis));
held.data = here ? {x: [places[best][i]], y: [places[best][j] ?? 0]} : {x: [], y: []};
"""


def write_static(
    explored: Explored,
    path: str | Path,
    cells: Sequence[Mapping[str, Any]] | None = None,
    force: bool = False,
    say: Callable[[str], None] = lambda text: None,
) -> int:
    """Writes a page that needs nothing but a browser; returns how many motions are in it. A motion
    that cannot be shown is left out, with a warning.

    Arguments:

    - `cells`: axis -> value, of the cells whose motions are stored (the nearest of the map); None:
        a coarse choice.
    - `say`: told which cell is at work.

    Raises: `ValueError` for cells outside the map or of one whose cells cannot be simulated, or a
        map too large for one file; `StoreError` if `path` exists (without `force`) or cannot be
        written.
    """
    check_output(path, force)
    x, y = explored.plane_axes()
    rest = [dim for dim in explored.dims if dim not in (x, y)]
    places = coarse(explored, x, y) if cells is None else [nearest(explored, c) for c in cells]
    if len(places) > MOST_MOTIONS:
        raise ValueError(f"at most {MOST_MOTIONS} cells can be stored, were {len(places)}")
    if explored.spec is None:
        why = f"cells of this map cannot be simulated: {explored.unable}"
        if cells is not None:
            raise ValueError(why)
        log.warning("%s: holds no motions: %s", path, why)
    panel, motion = MapPanel(), MotionPanel("Stored motion nearest to the cell")
    chosen = variables(explored)
    states = {}
    for at in itertools.product(*(range(explored.ds.sizes[dim]) for dim in rest)):
        plane = explored.plane(x, y, dict(zip(rest, at, strict=True)), None, set(chosen))
        for name in chosen:
            panel.show(explored, plane, x, y, name)
            states[" ".join(map(str, (name, *at)))] = noted(panel.parts())
    held, motions = [], {}
    for number, place in enumerate(places if explored.spec is not None else []):
        say(f"cell {number + 1} of {len(places)}")
        try:
            motion.show(motion_of(explored, place, seconds=SECONDS))
        except ValueError as error:  # no steady slip to begin at, perhaps
            log.warning("%s: cell %d is left out: %s", path, number + 1, error)
            continue
        motions[str(len(held))] = noted(motion.parts())
        held.append(place)
    places = held or places
    document = _page(explored, (x, y), panel, motion, chosen, states, places, motions)
    html = file_html(document, INLINE, title=document.title, template=PAGE)
    with replacing(path, force=force) as temporary:
        temporary.write_text(html, encoding="utf-8")
    return len(motions)


def variables(explored: Explored) -> list[str]:
    """Usual variables, as many of them as one file can hold. Raises: `ValueError` for none."""
    size = math.prod(explored.ds.sizes[dim] for dim in explored.dims)
    held = [name for name in USUAL if name in explored.variables]
    fit = min(MOST_VALUES // size, len(held))
    if fit < 1:
        raise ValueError(f"a map of {size:,} cells is too large for one file; take a part of it")
    return held[:fit]


def coarse(explored: Explored, x: str, y: str) -> list[dict[str, int]]:
    """Places of cells spread over a map, both axes of the plane more densely."""
    counts = {dim: COARSE[2] for dim in explored.dims} | {x: COARSE[0], y: COARSE[1]}
    along = []
    for dim in explored.dims:
        size = explored.ds.sizes[dim]
        inner = (np.arange(counts[dim]) + 0.5) / counts[dim] * size
        along.append(sorted({int(place) for place in inner}))
    found = [dict(zip(explored.dims, place, strict=True)) for place in itertools.product(*along)]
    return found[:: max(1, -(-len(found) // MOST_MOTIONS))]


def nearest(explored: Explored, values: Mapping[str, Any]) -> dict[str, int]:
    """The place of the cell nearest to some values, the middle of axes that are not named.

    Raises: `ValueError` for a name that is no axis, or a value outside it.
    """
    if strange := sorted(set(values) - set(explored.dims)):
        raise ValueError(f"{strange[0]} must be an axis: {', '.join(explored.dims)}")
    place = {dim: explored.ds.sizes[dim] // 2 for dim in explored.dims}
    for dim, value in values.items():
        along = explored.ds[dim].values
        if isinstance(value, str) or not along.min() <= value <= along.max():
            must = f"must lie in {along.min():g} ... {along.max():g}"
            raise ValueError(f"{dim} {must}, was {value}")
        place[dim] = int(np.argmin(np.abs(along - value)))
    return place


def noted(parts: list[tuple[Any, tuple[str, ...]]]) -> list[list[Any]]:
    """Models with their properties as they are now."""
    return [
        [model, {name: _copied(getattr(model, name)) for name in names}] for model, names in parts
    ]


def _copied(value: Any) -> Any:
    return dict(value) if isinstance(value, dict) else value


def _page(explored, axes, panel, motion, chosen, states, places, motions) -> Document:
    """The document with what moves in it."""
    rest = [dim for dim in explored.dims if dim not in axes]
    variable = choice("shown", chosen[0], [(n, explored.variables[n]) for n in chosen], 300)
    middle, sliders = places[len(places) // 2], []
    for dim in rest:
        name, _, texts = explored.axis_words(dim)
        sliders.append(slider(name, texts, middle[dim], WIDTH - 20, name=dim))
    args = {"states": states, "variable": variable, "sliders": sliders, "motions": motions}
    args |= {
        "places": [list(place.values()) for place in places] if motions else [],
        "dims": list(explored.dims), "axes": list(axes), "cursor": panel.cursor,
        "sizes": [explored.ds.sizes[dim] for dim in explored.dims], "held": panel.held,
        "shown": panel.held,
    }  # fmt: skip
    panel.held.tags = [-1]
    panel.cursor.data = {"x": [middle[axes[0]]], "y": [middle.get(axes[1], 0)]}
    show = CustomJS(args=args, code=PUT + PLANE + CELL)
    variable.js_on_change("value", show)
    panel.cursor.js_on_change("data", show)
    for one in sliders:
        one.js_on_change("value", show)
    name = escaped(explored.ds.attrs.get("title") or explored.name)
    note = f"{len(motions)} motions are stored; a dashed frame is the one that is shown."
    if not motions:
        note = "No motions are stored" + f": cells cannot be simulated, {explored.unable}." * (
            explored.spec is None
        )
    if explored.usual_start:
        note += f" Start of the cells: {explored.usual_start}."
    head = f"<h1>{name}</h1><p class='note'>{escaped(explored.name)}. {note}</p>"
    left = Column(
        children=[
            words(WIDTH, head),
            variable,
            panel.picture,
            panel.readout,
            panel.legend,
            *sliders,
        ],
        width=WIDTH,
    )
    motion.view.visible = bool(motions)
    document = Document()
    document.add_root(beside(left, motion.view))
    document.title = plain(f"wiperjax explore: {explored.name}")
    panel.listen(document)
    document.js_on_event("document_ready", show)
    motion.listen(document)
    return document
