"""From a simulation to a first guess of its cycle: where it starts, and how long it takes."""

import math
from collections.abc import Callable
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from ..blade import numbers
from ..vocabulary import checks
from ..vocabulary.codes import Result
from .chart import Turning
from .clock import STATES, check_clock, refuse_a_clock
from .orbit import crossings, event_margin, far_from_events, smooth_intervals
from .return_map import FAIR, Found, Lost, Shooting
from .shooting import SAMPLES, Arc

STILL = 1e-6  # of the typical size: a coordinate that swings less rests
ALIKE = 0.05  # of the size of the motion: how near a settled motion must come back
MOST_RETURNS = 8  # to the section, or periods of the clock, in one period of the motion


def free_guess(shooting: Shooting, state, settle: float):
    """Return (shooting, state, phase, regime, period) near the cycle of a steady system.

    Its section is, if ``shooting`` has none, where the first coordinate that moves turns. Raises
    ValueError if the settled motion does not cross the section that it has.
    """
    typical = shooting.scale
    motion = _run(shooting, state, -1, settle, 1e-7)
    refuse_a_clock(shooting.system, motion.samples[:: SAMPLES // STATES], settle)
    window, section = 0.25 * settle, shooting.section
    for _ in range(8):
        motion = _run(shooting, motion.state, int(motion.regimes[-1]), window, 1e-8)
        moves = moving(motion.samples, typical)
        if not np.any(moves):
            return Found.AT_REST
        chosen = section or Turning(int(np.argmax(moves)))
        values = _on_section(chosen, motion)
        times = crossings(motion, values)
        if len(times) < 6 and window < 4 * settle:
            window *= 2
        elif len(times) > 14:  # enough samples for each of them
            window *= 9 / len(times)
        else:
            break
    if section is not None and not len(times):
        raise ValueError(
            "section must fall through 0 somewhere on the settled motion, "
            f"but there was {np.min(values):g} to {np.max(values):g}"
        )
    if len(times) < 2:
        return Found.NOT_PERIODIC
    scale = _sizes(motion, typical)
    at = np.clip(np.searchsorted(motion.times, times) - 1, 0, len(motion.times) - 2)
    part = ((times - motion.times[at]) / np.diff(motion.times)[at])[:, None]
    states = (1 - part) * motion.samples[at] + part * motion.samples[at + 1]
    for k in range(1, min(MOST_RETURNS, len(times) - 1) + 1):
        if np.all(np.abs(states[k:] - states[:-k]) < ALIKE * scale):
            break
    else:
        return Found.NOT_PERIODIC
    length = float(np.mean(times[k:] - times[:-k]))
    whole = (motion.regimes[at] == motion.regimes[at + 1])[-k:]
    heights = np.where(whole | ~whole.any(), states[-k:, 0], -np.inf)
    best = len(states) - k + int(np.argmax(heights))  # the highest one away from events
    shooting = replace(shooting, scale=scale, section=chosen)
    return shooting, states[best], 0.0, int(motion.regimes[at[best]]), length


def moving(samples: np.ndarray, typical: np.ndarray) -> np.ndarray:
    """Whether each coordinate moves, (n,), of states (samples, 2n)."""
    n = samples.shape[1] // 2
    return np.ptp(samples[:, :n], axis=0) > STILL * typical[:n]


def _on_section(section: Callable, motion: Arc) -> np.ndarray:
    """Return ``section`` at the samples of a motion, (samples,)."""
    n = motion.samples.shape[1] // 2
    values = jax.vmap(lambda t, x: section(t, tuple(x[:n]), tuple(x[n:])))(
        jnp.asarray(motion.times), jnp.asarray(motion.samples)
    )
    if np.shape(values) != motion.times.shape:
        raise ValueError(f"section must give one number, but gave {checks.shown(values)}")
    return np.asarray(values)


def driven_guess(shooting: Shooting, state, settle: float):
    """Return (shooting, state, phase, regime, period) near the cycle of a driven system."""
    parameter = 0.0 if shooting.over is None else numbers.value(shooting.system, shooting.over)
    one, _ = shooting.driven_period(parameter)
    motion = _run(shooting, state, -1, max(1.0, math.ceil(settle / one)) * one, 1e-8)
    states, motions = [motion.state], []
    for _ in range(MOST_RETURNS):
        motion = _run(shooting, motion.state, int(motion.regimes[-1]), one, shooting.rtol)
        motions.append(motion)
        states.append(motion.state)
    samples = np.concatenate([m.samples for m in motions])
    check_clock(shooting, samples[:: len(samples) // STATES])
    if not np.any(moving(samples, shooting.scale)):
        return Found.AT_REST
    whole = motions[0]._replace(samples=samples)
    scale = _sizes(whole, shooting.scale)
    for k in range(1, MOST_RETURNS + 1):
        if np.all(np.abs(states[k] - states[0]) < ALIKE * scale):
            break
    else:
        return Found.NOT_PERIODIC
    shooting = replace(shooting, scale=scale, repeats=k)
    times = np.concatenate([m.times[:-1] + i * one for i, m in enumerate(motions[:k])])
    regimes = np.concatenate([m.regimes[:-1] for m in motions[:k]])
    smooth, margin = (
        np.concatenate([f(m) for m in motions[:k]]) for f in (smooth_intervals, event_margin)
    )
    index = far_from_events(regimes, smooth, margin)
    i, j = divmod(index, len(motions[0].times) - 1)
    phase = float(times[index] / (k * one))
    return shooting, motions[i].samples[j], phase, int(regimes[index]), k * one


def _run(shooting: Shooting, state, regime: int, length: float, rtol: float) -> Arc:
    """Return a motion that is looked at only. Raises `Lost` if it ends early."""
    moved = shooting.motion(shooting.system, state, length, regime=regime, rtol=rtol)
    if int(moved.result) not in FAIR:
        raise Lost(f"the motion ended early: {Result(int(moved.result)).name.lower()}")
    return moved


def _sizes(motion: Arc, typical: np.ndarray) -> np.ndarray:
    """Half the range of each number of the state; that of its kind if it hardly moves."""
    half = 0.5 * np.ptp(motion.samples, axis=0)
    n = len(half) // 2
    kinds = np.repeat([half[:n].max(), half[n:].max()], n)
    kinds = np.where(kinds > 0, kinds, typical)
    return np.where(half > 1e-3 * kinds, half, kinds)
