"""What a rung of the ladder costs in a batch, which is where it pays: of blades around a scene.

One motion by itself is mostly overhead of its turns, and says little of a sweep.
"""

import time
from collections.abc import Callable, Mapping

import jax
import jax.numpy as jnp
import numpy as np

from ..engine.kept import Kept, as_arrays
from ..specs.load import parse_sweep
from ..specs.scene import SceneSpec
from ..specs.sweep import SweepSpec
from ..vocabulary.kinds import BELTS
from .cells.batch import Run, Settings, outcomes, prepare

SIDE = 16  # blades along each axis
SPREAD = 0.02  # of load and speed, relative
TURNS = 5  # interleaved

_compute = Kept(outcomes)


def rung_costs(scenes: Mapping[str, SceneSpec]) -> dict[str, float]:
    """Return for each scene the processor time [s] of the engine for a second of motion of one
    blade: the median of `TURNS` turns, in each of which every scene has its own.

    A scene stands for `SIDE` x `SIDE` blades, load and belt speed within `SPREAD` of its own, with
    the settings of a sweep; the process must work on one core. Compilation is not counted.

    Raises ValueError where there is no start (of a block without steady slip).
    """
    runs = {name: _motions(_around(scene)) for name, scene in scenes.items()}
    for run in runs.values():
        run()  # compiles
    spent = [[_spent(run) for run in runs.values()] for _ in range(TURNS)]
    motion = [SIDE**2 * scene.run.duration for scene in scenes.values()]
    return dict(zip(scenes, (np.median(spent, axis=0) / motion).tolist(), strict=True))


def _around(scene: SceneSpec) -> SweepSpec:
    """Return the sweep of blades around a scene."""
    data, known = scene.document(), scene.parameters()
    keys = {name: key for key, name in BELTS[scene.belt.kind].items()}
    data["blade"] = _without(data.get("blade", {}), "normal_load")
    data["belt"] = _without(data.get("belt", {}), keys["belt_speed"])
    half = scene.run.duration / 2
    return parse_sweep(
        _without(data, "title")
        | {
            "axes": {name: _near(known[name]) for name in ("normal_load", "belt_speed")},
            "run": {"transient": half, "window": half},
        }
    )


def _without(table: Mapping, key: str) -> dict:
    return {name: value for name, value in table.items() if name != key}


def _near(value: float) -> dict[str, float]:
    return {"start": value * (1 - SPREAD), "stop": value * (1 + SPREAD), "num": SIDE}


def _motions(spec: SweepSpec) -> Callable[[], object]:
    """Return what computes all cells of a sweep, and nothing but their motion."""
    built, position, velocity = prepare(spec, np.arange(spec.size))
    system = as_arrays(built.system, spec.run.precision)
    count, run, settings = jnp.asarray(spec.size, jnp.int32), Run.of(spec), Settings.of(spec)
    return lambda: jax.block_until_ready(_compute(system, position, velocity, count, run, settings))


def _spent(run: Callable[[], object]) -> float:
    begun = time.process_time()
    run()
    return time.process_time() - begun
