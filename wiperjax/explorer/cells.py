"""A cell of a map as a scene: what `wiperjax simulate` would take to see its motion."""

import json
import math
from typing import Any

import numpy as np

from ..noise.run_class import assess
from ..plots.style.axes import value_text
from ..runs.scene import run_scene
from ..specs.load import parse_scene
from ..vocabulary.kinds import BELTS, WAYS
from .explored import Explored

RATE = 50_000  # samples a second: what is heard, and every corner of a squeal
MOST_SAMPLES = 1_000_000  # of a run: a longer one is sampled more coarsely


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
    interval = max(1 / RATE, duration / MOST_SAMPLES)
    document = spec.document()
    tables = {name: dict(document.get(name, {})) for name in ("blade", "parameters", "belt")}
    keys = {name: key for key, name in BELTS.get(spec.belt_kind or "", {}).items()}
    for name, number in place.items():
        table = spec.parameter_table[name].table
        tables[table][keys[name] if table == "belt" else name] = float(ds[name].values[number])
    run = {
        "duration": duration,
        "sample_interval": interval,
        "rtol": settings.rtol,
        "atol": settings.atol,
        "solver": settings.solver,
        "max_steps": settings.max_steps,
        "zeno_time": settings.zeno_time,
    }
    where = ", ".join(value_text(ds[name][number]) for name, number in place.items())
    return {
        "title": where[:400],
        **{name: document[name] for name in ("system", "model") if name in document},
        **{name: table for name, table in tables.items() if table},
        "start": start_of(explored, place, start),
        "run": {key: value for key, value in run.items() if value is not None},
        "classes": spec.classes.model_dump(mode="json", exclude_none=True),
    }


def start_of(explored: Explored, place: dict[str, int], start: Any) -> dict[str, Any]:
    """The table `[start]` of a cell that begins at `start`, if the map has several."""
    starts = explored.spec.starts
    if starts is None:
        return dict(explored.spec.document().get("start", {}))
    ds, start = explored.ds, explored.starts[0] if start is None else start
    if starts.random is not None:
        chosen = ds.isel(start=int(start))
        x, y, vx, vy = (float(chosen[f"start_{key}"]) for key in ("x", "y", "vx", "vy"))
        return {"position": [x, y], "velocity": [vx, vy]}
    if start == "steady_slip":
        return {"equilibrium": starts.kick}
    axis = explored.dims[-1]  # along which `up` and `down` go
    before = place[axis] + (-1 if start == "up" else 1)
    if start not in WAYS or not 0 <= before < ds.sizes[axis]:
        return {}
    names = ["result", "final_x", "final_y", "final_vx", "final_vy"]
    last = ds[names].isel(place | {axis: before}).sel(start=start).load()
    if int(last["result"]) != 0:
        return {}
    x, y, vx, vy = (float(last[name]) for name in names[1:])
    length = explored.spec.cells(np.ravel_multi_index(tuple(place.values()), explored.spec.shape))
    return {
        "position": [x + starts.kick * float(length["lip_length"]), max(y, 0.0)],
        "velocity": [vx, vy],
    }


def simulated(scene: dict[str, Any], transient: float) -> tuple[Any, dict[str, float]]:
    """The run of a scene, and what is told of it after the `transient` (s), as a map tells it."""
    run = run_scene(parse_scene(scene, "this cell"))
    finished = int(run["result"]) == 0
    told = assess(run, transient=transient) if finished else None
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
