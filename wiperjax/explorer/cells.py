"""A cell of a map as a scene: what `wiperjax simulate` would take to see its motion."""

import json
import math
from typing import Any

import numpy as np

from ..datasets.map_starts import from_start, usual_start
from ..maps.starts import before, drawn, ended_columns, kicked
from ..noise.run_class import assess
from ..plots.style.axes import value_text
from ..runs.scene import run_scene
from ..specs.load import parse_scene
from ..specs.tables import Start
from ..vocabulary.kinds import BELTS, WAYS, WIPER
from ..vocabulary.ranges import FEWEST_SETTLED
from .explored import Explored

RATE = 50_000  # samples a second of a blade: what is heard, and every corner of a squeal
A_PERIOD = 50  # samples of the highest squeal of another system, which may be slow
FEWEST_SAMPLES = 1000
MOST_SAMPLES = 1_000_000  # of a run: a longer one is sampled more coarsely
AS_SWEPT = ("rtol", "atol", "solver", "max_steps", "max_step", "zeno_time")  # keys of `[run]`


def scene_of(explored: Explored, place: dict[str, int], start: Any = None) -> dict[str, Any]:
    """The scene of a cell, shaped like a scene file: solver and tolerance are those of the map, so
    that the motion is the one it tells of.

    Raises: `ValueError` where the map does not say what it was made from.
    """
    spec, ds = explored.spec, explored.ds
    if spec is None:
        raise ValueError(f"this cell cannot be simulated: {explored.unable}")
    settings = spec.settings
    duration = settings.transient + settings.window
    rate = RATE if spec.system == WIPER else A_PERIOD * spec.classes.squeal_band[1]
    interval = min(max(1 / rate, duration / MOST_SAMPLES), duration / FEWEST_SAMPLES)
    interval = min(interval, settings.window / (FEWEST_SETTLED + 1))  # a scene is judged by these
    document = spec.document()
    tables = {name: dict(document.get(name, {})) for name in ("blade", "parameters", "belt")}
    keys = {name: key for key, name in BELTS.get(spec.belt_kind or "", {}).items()}
    for name, number in place.items():
        table = spec.parameter_table[name].table
        tables[table][keys[name] if table == "belt" else name] = float(ds[name].values[number])
    run = {"duration": duration, "transient": settings.transient, "sample_interval": interval}
    run |= {name: getattr(settings, name) for name in AS_SWEPT}
    where = ", ".join(value_text(ds[name], number) for name, number in place.items())
    if spec.starts is not None:  # two motions of one cell would bear one name
        where += f", start: {begun(explored, place, start)}"
    return {
        "title": where[:400],
        **{name: document[name] for name in ("system", "model") if name in document},
        **{name: table for name, table in tables.items() if table},
        "start": start_of(explored, place, start),
        "run": {key: value for key, value in run.items() if value is not None},
        "classes": spec.classes.model_dump(mode="json", exclude_none=True),
    }


def start_of(explored: Explored, place: dict[str, int], start: Any) -> dict[str, Any]:
    """The table `[start]` of a cell that begins at `start`, if the map has several; None: the one
    that the map shows of it. Its state is what the sweep itself began from.
    """
    spec, ds = explored.spec, explored.ds
    starts = spec.starts
    if starts is None:
        return dict(spec.document().get("start", {}))
    cell = np.array([np.ravel_multi_index([place[dim] for dim in explored.dims], spec.shape)])
    start = begun(explored, place, start)
    if starts.random is not None:
        return _state(spec, cell, {name: x[[int(start)]] for name, x in drawn(starts, 1).items()})
    if start == "steady_slip":
        return _state(spec.model_copy(update={"start": Start(equilibrium=starts.kick)}), cell)
    if start not in WAYS or (last := int(before(spec, cell, start)[0])) < 0:
        return {}
    where = dict(zip(explored.dims, np.unravel_index(last, spec.shape), strict=True))
    there = from_start(ds[list(ended_columns(spec))].isel(where), start).load()
    ended = {str(name): x.values[None] for name, x in there.data_vars.items()}
    return _state(spec, cell, kicked(spec, cell, ended))


def begun(explored: Explored, place: dict[str, int], start: Any = None) -> Any:
    """The start of a cell of a map of several, if none is chosen the one that the map shows of it:
    its name, or the number that it was drawn as.
    """
    if start is not None:
        return start
    label = explored.ds["label"]
    if explored.spec.starts.random is None or "start" not in label.dims:
        return explored.starts[0]
    return explored.starts[int(usual_start(label.isel(place)))]


def _state(spec: Any, cell: np.ndarray, ended: Any = None) -> dict[str, Any]:
    """Position and velocity that the sweep `spec` begins a cell with; `ended` as in `prepare`."""
    from ..maps.cells.batch import prepare  # jax, which a map that is only looked at can do without

    _, *state = prepare(spec, cell, ended=ended)
    position, velocity = ([float(x[0]) for x in part] for part in state)
    rest = [0.0] * (2 - len(position) if spec.system == WIPER else 0)  # the bar stays on the glass
    return {"position": position + rest, "velocity": velocity + rest}


def simulated(explored: Explored, scene: dict[str, Any]) -> tuple[Any, dict[str, float]]:
    """The run of the scene of a cell, and what is told of it after the transient, as the map does.
    All cells have one compiled program.
    """
    run = run_scene(parse_scene(scene, "this cell"), varied=explored.dims)
    finished = int(run["result"]) == 0
    told = assess(run) if finished else None
    return run, {} if told is None else {str(n): float(v) for n, v in told.data_vars.items()}


def toml_of(scene: dict[str, Any]) -> str:
    """A scene as the text of a scene file."""
    lines = [f"{key} = {_value(value)}" for key, value in scene.items() if not _is_table(value)]
    for table, keys in scene.items():
        if _is_table(keys) and keys:
            lines += [
                "",
                f"[{table}]",
                *(f"{key} = {_value(value)}" for key, value in keys.items()),
            ]
    return "\n".join(lines) + "\n"


def _is_table(value: Any) -> bool:
    return isinstance(value, dict)


def _value(value: Any) -> str:
    """A text, number or list of numbers as TOML writes it."""
    if isinstance(value, float) and not math.isfinite(value):
        return repr(value)
    return json.dumps(value, ensure_ascii=False)
