"""A scene as the middle of a small map: what it is called there, and what a second of it costs.

What a model costs is asked of a batch, which is where it pays: one motion by itself is mostly
overhead of its turns. The same batch names the scene, so that a model is compiled once.
"""

import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from ..machine.cores import available
from ..specs.load import parse_sweep
from ..specs.scene import SceneSpec
from ..specs.sweep import SweepSpec
from ..specs.tables import SweepRun
from ..vocabulary.kinds import BELTS
from .block import evaluate_block
from .cells import batch
from .cells.evaluate import evaluate

SIDE = 15  # blades along each axis; odd, so that the scene is one of them
SPREAD = 0.02  # of load and speed, relative
TURNS = 5  # interleaved


def ready(scenes: Iterable[SceneSpec]) -> None:
    """Compile what `middle` and `costs` run of some scenes, on all cores at once."""
    # costs are those of one core; what is compiled for them need not be
    batch.compile_all(map(around, scenes), SIDE**2, available())


def middle(scene: SceneSpec) -> dict[str, np.ndarray]:
    """Return the columns of a map that a scene has in the middle of its sweep (`around`), () each.

    Raises ValueError where the scene cannot be started.
    """
    spec = around(scene)
    columns, _ = evaluate_block(spec, np.arange(spec.size), evaluate)
    return {name: values[spec.size // 2] for name, values in columns.items()}


def costs(scenes: Mapping[str, SceneSpec]) -> dict[str, float]:
    """Return for each scene the processor time [s] of the engine for a second of motion of one
    blade: the median of `TURNS` turns, in each of which every scene has its own.

    It is that of the cells of `around`; the process must work on one core. Compilation is not
    counted.
    """
    runs = {name: _motions(around(scene)) for name, scene in scenes.items()}
    for run in runs.values():
        run()  # compiles what `middle` has not
    spent = [[_spent(run) for run in runs.values()] for _ in range(TURNS)]
    motion = [SIDE**2 * scene.run.duration for scene in scenes.values()]
    return dict(zip(scenes, (np.median(spent, axis=0) / motion).tolist(), strict=True))


def around(scene: SceneSpec) -> SweepSpec:
    """Return the sweep of `SIDE` x `SIDE` blades whose load and belt speed are within `SPREAD` of a
    scene's, with the settings that the scene states, else those of a sweep; looked at is what is of
    the scene (`SceneSpec.transient`), by its thresholds.

    Raises SpecError for a scene so near an end of a range that they reach beyond it.
    """
    data, known = scene.document(), scene.parameters()
    keys = {name: key for key, name in BELTS[scene.belt.kind].items()}
    data["blade"] = _without(data.get("blade", {}), "normal_load")
    data["belt"] = _without(data.get("belt", {}), keys["belt_speed"])
    transient = scene.transient
    stated = scene.run.model_dump(exclude_unset=True, exclude_none=True)
    settings = {name: value for name, value in stated.items() if name in SweepRun.model_fields}
    return parse_sweep(
        _without(data, "title")
        | {
            "axes": {name: _near(known[name]) for name in ("normal_load", "belt_speed")},
            "run": settings | {"transient": transient, "window": scene.run.duration - transient},
            "classes": scene.thresholds().model_dump(exclude_none=True),
        },
        f"compared are blades within {SPREAD:.0%} of its load and speed",
    )


def _without(table: Mapping, key: str) -> dict:
    return {name: value for name, value in table.items() if name != key}


def _near(value: float) -> dict[str, float]:
    return {"start": value * (1 - SPREAD), "stop": value * (1 + SPREAD), "num": SIDE}


def _motions(spec: SweepSpec) -> Callable[[], Any]:
    """Return what computes all cells of a sweep, and nothing but their motion."""
    motions = batch.program(spec, np.arange(spec.size))
    return lambda: motions(spec.size)


def _spent(run: Callable[[], Any]) -> float:
    begun = time.process_time()
    run()
    return time.process_time() - begun
