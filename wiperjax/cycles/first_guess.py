"""From a simulation to a first guess of its cycle: where it starts, and how long it takes."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..contact.system import AbstractSystem
from ..systems import numbers
from .chart import Passing, Turning
from .clock import check_clock, refuse_a_clock, scattered
from .orbit import event_margin, falls, far_from_events, smooth_intervals
from .return_map import Found, Shooting
from .returns import looked_at, on_section, passages
from .shooting import SAMPLES, UNKNOWN, Arc

STILL = 1e-6  # of the typical size: a coordinate that swings less rests
ALIKE = 0.05  # of the size of the motion: how near a settled motion must come back
NEARER = 1e-3  # of that: how near it is after more returns, if it is a cycle of these only
ROUNDED = 1e-6  # of the size: what comes back so near does so but for rounding
QUARTERS, EVENLY = 4, 0.125  # what runs on goes such a share of its way at least in each
MOST_RETURNS = 8  # to the section, or periods of the clock, in one period of the motion


class Guess(NamedTuple):
    """A start near a cycle."""

    shooting: Shooting
    state: np.ndarray  # (2n,)
    regime: int
    period: float
    phase: float = 0.0


class Missing(NamedTuple):
    """Why there is none."""

    found: Found
    why: str = ""


def free_guesses(shooting: Shooting, state, settle: float) -> Iterator[Guess | Missing]:
    """Yield guesses of the cycle of a steady system that a simulation comes to, the best first.

    Its section is, if ``shooting`` has none, where the first coordinate that moves turns; a blow
    may turn it, or stick may begin there: then where it passes the middle of its range. Raises
    ValueError if the settled motion does not cross the section that ``shooting`` has.
    """
    motion = looked_at(shooting, state, UNKNOWN, settle, 1e-7)
    seen = motion.samples[scattered(SAMPLES)]
    refuse_a_clock(shooting.system, seen, settle, shooting.names)
    motion = looked_at(shooting, motion.state, int(motion.regimes[-1]), 0.25 * settle, 1e-8)
    moves = moving(motion.samples, shooting.scale)
    if not np.any(moves):
        yield Missing(Found.AT_REST)
    elif shooting.section is not None:
        yield from _guesses(shooting, motion, shooting.section)
    else:
        coordinate = int(np.argmax(moves))
        yield from _guesses(shooting, motion, Turning(coordinate))
        middle = _middle(motion, coordinate)
        yield from _guesses(shooting, motion, middle)
        # that way it may be too quick for samples
        yield from _guesses(shooting, motion, replace(middle, sense=-middle.sense))


def _middle(motion: Arc, coordinate: int) -> Passing:
    """Return the section in the middle of a coordinate's range, passed the way that is faster."""
    n = motion.samples.shape[1] // 2
    place, speed = motion.samples[:, coordinate], motion.samples[:, n + coordinate]
    level = 0.5 * (np.min(place) + np.max(place))
    up, down = (np.max(s * speed[falls(s * (level - place))], initial=0) for s in (1, -1))
    return Passing(coordinate, level, 1.0 if up > down else -1.0)


def _guesses(shooting: Shooting, motion: Arc, section: Callable) -> Iterator[Guess | Missing]:
    """Yield the guesses on ``section`` of a settled motion that goes on from ``motion``, or why
    there is none."""
    typical, window = shooting.scale, float(motion.times[-1])
    longest = 16 * window
    for _ in range(8):
        motion = looked_at(shooting, motion.state, int(motion.regimes[-1]), window, 1e-8)
        if not np.any(moving(motion.samples, typical)):
            yield Missing(Found.AT_REST)
            return
        values = on_section(section, motion)
        count = len(falls(values))
        if count < 6 and window < longest:
            window *= 2
        elif count > 14:  # enough samples for each of them
            window *= 9 / count
        else:
            break
    if shooting.section is not None and not count:
        raise ValueError(
            "section must fall through 0 somewhere on the settled motion, "
            f"but there was {np.min(values):g} to {np.max(values):g}"
        )
    found = passages(shooting, motion, section, values)
    times, states = (np.array([getattr(p, name) for p in found]) for name in ("time", "state"))
    scale = _sizes(motion, typical)
    for k in _returns(states, scale):
        if isinstance(k, Missing):
            yield _running(k, shooting, motion)
            return
        best = max(found[-k:], key=lambda p: (p.smooth, p.state[0]))  # the highest away from events
        own = replace(shooting, scale=scale, section=section, repeats=k)
        yield Guess(own, best.state, best.regime, float(np.mean(times[k:] - times[:-k])))


def _returns(states: np.ndarray, scale: np.ndarray) -> list[int] | list[Missing]:
    """Return after how many of the ``states`` (count, 2n) of a motion it comes back, or why it does
    not: of its sizes ``scale`` (2n,). Beside the first there may be more, after which it is far
    nearer: behind a grazing the periods of a cycle of several are nearly alike.
    """
    nearest, found = math.inf, []
    for k in range(1, min(MOST_RETURNS, len(states) - 1) + 1):
        missed = float(np.max(np.abs(states[k:] - states[:-k]) / scale))
        if missed < (NEARER * nearest if found else ALIKE):
            found.append(k)
        elif found:
            continue
        nearest = min(nearest, missed)
        if nearest < ROUNDED:
            break
    if found:
        return found
    why = f"no return comes nearer to where it began than {nearest:.0%} of the size of the motion"
    return [Missing(Found.NOT_PERIODIC, why if nearest < math.inf else "it does not return")]


def _running(missing: Missing, shooting: Shooting, motion: Arc) -> Missing:
    """Why a settled ``motion`` has no cycle, and what of it runs on: longer looks do not help."""
    found = runs_on(motion.samples)
    if not np.any(found):
        return missing
    on = f"{names(shooting.system, found)} runs on, and what turns round for good is no cycle"
    return missing._replace(why=f"{missing.why}; {on}")


def runs_on(samples: np.ndarray) -> np.ndarray:
    """Whether each coordinate, (n,), runs on one way in states (samples, 2n), and evenly: what
    comes to rest goes ever shorter ways.
    """
    place = samples[:, : samples.shape[1] // 2]
    ways = np.diff(place[np.linspace(0, len(place) - 1, QUARTERS + 1).astype(int)], axis=0)
    least = np.maximum(np.min(ways, axis=0), np.min(-ways, axis=0))
    return least > EVENLY * np.ptp(place, axis=0)


def names(system: AbstractSystem, chosen: np.ndarray) -> str:
    """Return the names of the ``chosen`` (n,) coordinates, as words."""
    known = system.coordinates or [f"q{i}" for i in range(len(chosen))]
    return ", ".join(name for name, one in zip(known, chosen, strict=True) if one)


def moving(samples: np.ndarray, typical: np.ndarray) -> np.ndarray:
    """Whether each coordinate moves, (n,), of states (samples, 2n)."""
    n = samples.shape[1] // 2
    return np.ptp(samples[:, :n], axis=0) > STILL * typical[:n]


def driven_guesses(shooting: Shooting, state, settle: float) -> Iterator[Guess | Missing]:
    """Yield guesses of the cycle of a driven system that a simulation comes to, the best first."""
    parameter = 0.0 if shooting.over is None else numbers.value(shooting.system, shooting.over)
    one, _ = shooting.driven_period(parameter)
    motion = looked_at(shooting, state, UNKNOWN, max(1.0, math.ceil(settle / one)) * one, 1e-8)
    ends, motions = [motion.state], []
    for _ in range(MOST_RETURNS):
        motion = looked_at(shooting, motion.state, int(motion.regimes[-1]), one, shooting.rtol)
        motions.append(motion)
        ends.append(motion.state)
    samples = np.concatenate([m.samples for m in motions])
    clock, seen = shooting.clock, samples[scattered(len(samples))]
    assert clock is not None
    check_clock(shooting.system, clock, shooting.names, seen)
    if not np.any(moving(samples, shooting.scale)):
        yield Missing(Found.AT_REST)
        return
    whole = motions[0]._replace(samples=samples)
    scale, states = _sizes(whole, shooting.scale), np.array(ends)
    for k in _returns(states, scale):
        if isinstance(k, Missing):
            yield _running(k, shooting, whole)
        else:
            yield _driven_guess(shooting, scale, motions[:k], one)


def _driven_guess(shooting: Shooting, scale, motions: list[Arc], one: float) -> Guess:
    """Return the guess of a cycle of as many periods ``one`` of the clock as there are motions."""
    k = len(motions)
    shooting = replace(shooting, scale=scale, repeats=k)
    times = np.concatenate([m.times[:-1] + i * one for i, m in enumerate(motions)])
    regimes = np.concatenate([m.regimes[:-1] for m in motions])
    smooth, margin = (
        np.concatenate([f(m) for m in motions]) for f in (smooth_intervals, event_margin)
    )
    index = far_from_events(regimes, smooth, margin)
    i, j = divmod(index, len(motions[0].times) - 1)
    phase = float(times[index] / (k * one))
    return Guess(shooting, motions[i].samples[j], int(regimes[index]), k * one, phase)


def _sizes(motion: Arc, typical: np.ndarray) -> np.ndarray:
    """Half the range of each number of the state; that of its kind if it hardly moves."""
    half = 0.5 * np.ptp(motion.samples, axis=0)
    n = len(half) // 2
    kinds = np.repeat([half[:n].max(), half[n:].max()], n)
    kinds = np.where(kinds > 0, kinds, typical)
    return np.where(half > 1e-3 * kinds, half, kinds)
