"""What the reference of a chart is worth: a second method, or an exact answer, beside it."""

import diffrax
import numpy as np

from ..harness.interface import Answer
from ..rivals.engine import Engine
from ..rivals.scipy_phases import Phases
from ..scenes import exact, families
from ..scenes.scene import Scene
from . import errors

SECOND = ("engine Dopri8 at rtol 1e-10", "scipy DOP853 at rtol 1e-11")  # in full, and quick


def errors_of_second(scene: Scene, true: errors.Truth, quick: bool) -> errors.Errors:
    """Return the errors of a second method at high accuracy: what the reference is worth.

    For the block that is its exact answer, else `SECOND`: the engine's is compiled already if it is
    among the methods.
    """
    if scene.name == "block":
        return errors.judge(scene, true, exact_block(scene))
    if quick:  # compiles nothing
        return errors.judge(scene, true, Phases("DOP853").prepare(scene.head(2), 1e-11)())
    answer = Engine(diffrax.Dopri8).prepare(scene, 1e-10).answer()  # type: ignore
    return errors.judge(scene, true, answer)


def exact_block(scene: Scene) -> Answer:
    """Return the closed form of `families.block` as an answer."""
    speeds = scene.parameters()["belt_speed"]
    found = [exact.block(families.BLOCK_START, v, 0.5, scene.sample_times) for v in speeds]
    x, v, times, kinds = zip(*found, strict=True)
    along = lambda rows: np.stack([np.stack(rows), np.zeros((len(rows), len(rows[0])))], axis=-1)
    zero = np.zeros(scene.cells)
    return Answer(scene.sample_times, along(x), along(v), list(times), list(kinds), zero > 0, zero)
