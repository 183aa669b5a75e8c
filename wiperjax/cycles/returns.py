"""Where a simulated motion passes a section: the instants, and the states there.

Samples lie too far apart to tell: between two of them the motion may begin to slip, and turn, and a
state between theirs is none of the motion. So the interval is simulated again, with as many samples
as the whole motion had.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..vocabulary import checks
from .orbit import falls, smooth_intervals
from .return_map import Shooting, complete
from .shooting import GROWING, Arc

CLOSER = 3  # times at most that an interval is simulated again
BEYOND = 1.02  # of an interval: a passage at its very end comes no later than that
JUMPS = 1e-3  # of a section's range: what is left of a passage in one millionth of the motion


class Passage(NamedTuple):
    """A passage through a section."""

    time: float  # s
    state: np.ndarray  # (2n,)
    regime: int
    smooth: bool  # no event is near


def passages(shooting: Shooting, motion: Arc, section: Callable, values) -> list[Passage]:
    """Return where ``motion`` falls through ``section``, whose ``values`` are those at its samples.

    Where a velocity jumps over zero, at a blow, nothing is passed. Raises `Lost`.
    """
    found = (_passage(shooting, motion, section, values, int(at)) for at in falls(values))
    return [passage for passage in found if passage is not None]


def _passage(shooting: Shooting, motion: Arc, section: Callable, values, at: int) -> Passage | None:
    """Return the passage in the interval ``at``, or None."""
    size, time = np.ptp(values), 0.0
    for _ in range(CLOSER):
        begin, end = motion.times[at : at + 2]
        time += begin
        state, regime = motion.samples[at], int(motion.regimes[at])
        motion = looked_at(shooting, state, regime, BEYOND * (end - begin), 1e-8)
        values = on_section(section, motion)
        low = np.flatnonzero(values <= 0)
        if not len(low):
            return None
        at = max(int(low[0]) - 1, 0)
        smooth = bool(smooth_intervals(motion)[at])
        if smooth:
            break
    high, low = values[at : at + 2]
    if not smooth and high - low > JUMPS * size:
        return None
    part = max(high, 0.0) / (max(high, 0.0) - low or 1.0)
    here = (1 - part) * motion.samples[at] + part * motion.samples[at + 1]
    time += (1 - part) * motion.times[at] + part * motion.times[at + 1]
    return Passage(float(time), here, int(motion.regimes[at]), smooth)


def on_section(section: Callable, motion: Arc) -> np.ndarray:
    """Return ``section`` at the samples of a motion, (samples,)."""
    n = motion.samples.shape[1] // 2
    values = jax.vmap(lambda t, x: section(t, tuple(x[:n]), tuple(x[n:])))(
        jnp.asarray(motion.times), jnp.asarray(motion.samples)
    )
    if np.shape(values) != motion.times.shape:
        raise ValueError(f"section must give one number, but gave {checks.shown(values)}")
    return np.asarray(values)


def looked_at(shooting: Shooting, state, regime: int, length: float, rtol: float) -> Arc:
    """Return a motion that is looked at only, at growing distances: were it in step with its
    samples, it would seem slow, or at rest. Raises `Lost` if it ends early."""
    how = {"regime": regime, "rtol": rtol, "grid": GROWING}
    return complete(shooting.motion(shooting.system, state, length, **how))
