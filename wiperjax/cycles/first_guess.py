"""From a simulation to a first guess of its cycle: where it starts, and how long it takes."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from ..blade import numbers
from ..contact.space import contact
from ..contact.system import AbstractSystem
from ..vocabulary.codes import Result
from .orbit import event_margin, far_from_events, smooth_intervals, turns
from .return_map import FAIR, Found, Lost, Shooting
from .shooting import Arc, shoot

INSTANTS = 64  # at which forces are compared
CHANGED = 1e-9  # of them: less is rounding
STILL = 1e-6  # of the typical size: a smaller oscillation is rest
ALIKE = 0.05  # of the size of the motion: how near a settled motion must come back
MOST_RETURNS = 8  # turning points, or periods of the clock, in one period of the motion


def has_a_clock(system: AbstractSystem, state, span: float) -> bool:
    """Whether forces or prescribed speeds of a system in one ``state`` (2n,) change with time,
    within ``span`` [s].
    """
    times = span * jnp.geomspace(1e-6, 1.0, INSTANTS)
    n = len(state) // 2

    def seen(t):
        local = system.prepared().on_piece(system.first_piece(t))
        q, rates = tuple(jnp.asarray(state[:n])), tuple(jnp.asarray(state[n:]))
        return contact(local, t, q, local.from_rates(t, q, rates))

    found = jax.tree.leaves(jax.vmap(seen)(times))
    return any(np.ptp(x) > CHANGED * np.max(np.abs(x)) for x in map(np.asarray, found) if x.ndim)


def free_guess(shooting: Shooting, state, settle: float):
    """Return (shooting, state, phase, regime, period) near the cycle of a steady system."""
    typical = shooting.scale
    motion = _run(shooting, state, -1, settle, 1e-7)
    window = 0.25 * settle
    for _ in range(8):
        motion = _run(shooting, motion.state, int(motion.regimes[-1]), window, 1e-8)
        if np.ptp(motion.samples[:, 0]) < STILL * typical[0]:
            return Found.AT_REST
        times, peak = turns(motion)
        times = times[peak]
        if len(times) < 6 and window < 4 * settle:
            window *= 2
        elif len(times) > 14:  # enough samples for each of them
            window *= 9 / len(times)
        else:
            break
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
    shooting = replace(shooting, scale=scale)
    return shooting, states[best], 0.0, int(motion.regimes[at[best]]), length


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
    if np.ptp(samples[:, 0]) < STILL * shooting.scale[0]:
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
    moved = shoot(shooting.system, shooting.along(), state, length, regime=regime, rtol=rtol)
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
