"""The limit cycle that a simulation comes to: settled, guessed, closed, and passed once."""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from ..contact.own_numbers import check_single
from ..contact.system import AbstractSystem
from ..engine.arguments import check_system, coordinates, longest_step
from ..systems import numbers
from ..vocabulary import checks
from ..vocabulary.ranges import POSITIVE, SETTINGS
from .clock import check_clock, refuse_a_clock
from .cycle import ISOLATED, Cycle, close, typical
from .drift import may_drift
from .first_guess import Guess, Missing, driven_guesses, free_guesses, names
from .return_map import REPEATS, Found, Shooting, complete
from .shooting import Lost

AGAIN = 1e-6  # of the size of the motion: how near a cycle that is passed twice comes to its start
FINER = 1e-2  # of its tolerance: with that a motion is closed that nearly did
DYING = 0.5  # of its swing: what a motion that dies out has left of it after so long
UNSTABLE = "it passes near an unstable cycle, on which nothing settles"
GOES_ON = "it closed a state of rest, but the motion goes on"


def find_cycle(
    system: AbstractSystem,
    *,
    settle: float,
    initial_state=None,
    period: Callable[[Any], Any] | float | None = None,
    section: Callable | None = None,
    over: str | None = None,
    rtol: float = 1e-10,
    max_step: float | None = None,
) -> Cycle:
    """Return the limit cycle that a simulation of ``settle`` seconds comes to.

    **Main arguments:** ``system``; ``settle`` [s], time after which the motion is near its cycle;
    ``initial_state`` = (position, q') (default: the system's own start).

    **Other arguments:** ``period`` of what drives the system [s], a number, or a function of the
    system if it depends on what will be varied; None: nothing depends on time (a steady belt).
    ``section(t, q, v)``, a function of positions and velocities q' on whose zeros the cycle of a
    system without a clock starts, where the settled motion falls through it (default: where the
    first coordinate that moves is highest, or else where it passes the middle of its range).
    ``over``, name of the number that `branch.follow` will vary; ``rtol``, ``max_step`` [s] of the
    integration.

    **Returns** a `Cycle`; ``found`` says whether there is one, else why not.

    Raises ValueError for arguments that cannot be meant.
    """
    check_system(system)
    check_single(system)
    settle = checks.number("settle", settle, POSITIVE)
    rtol = checks.number("rtol", rtol, SETTINGS["rtol"])
    max_step = longest_step(max_step)
    if section is not None and not callable(section):
        raise ValueError(f"section must be a function, but was {checks.shown(section)}")
    if not callable(period) and period is not None:
        checks.number("period", period, POSITIVE)
    system = numbers.traceable(system, *(() if over is None else (over,)))
    start = coordinates(system, initial_state)
    state = np.concatenate([np.asarray(part, float).ravel() for part in start])
    clock = period if callable(period) or period is None else _Constant(float(period))
    sizes = typical(system, len(state) // 2)
    shooting = Shooting(
        system,
        over,
        clock,
        None if clock else section,
        repeats=1,
        scale=sizes,
        period_scale=1.0,
        parameter_scale=1.0 if over is None else abs(numbers.value(system, over)) or 1.0,
        rtol=rtol,
        max_step=max_step,
    )
    beside = (state + 0.1 * sizes)[None]
    if clock is None:
        refuse_a_clock(system, beside, settle, shooting.names)
    else:
        check_clock(system, clock, shooting.names, beside)
    guess = free_guesses if clock is None else driven_guesses
    cycle = _closed(system, guess(shooting, state, settle), settle)
    if cycle.found == Found.NOT_PERIODIC and np.any(drifts := may_drift(system, state)):
        drift = f"nothing depends on {names(system, drifts)}, and what drifts is no cycle"
        cycle = replace(cycle, why=f"{cycle.why}; {drift}")
    return cycle


def _closed(system, guesses: Iterable[Guess | Missing], settle: float) -> Cycle:
    """Return the first of the guesses' cycles that there is, or why the first guess has none."""
    failed = None
    try:
        for guess in guesses:
            cycle = Cycle(system, *guess) if isinstance(guess, Missing) else _near(guess, settle)
            if cycle.found in (Found.FOUND, Found.NOT_ISOLATED, Found.AT_REST):
                return cycle
            failed = failed or cycle
    except Lost as lost:
        failed = failed or Cycle(system, Found.TRAJECTORY_FAILED, why=str(lost))
    assert failed is not None
    return failed


def _near(guess: Guess, settle: float) -> Cycle:
    """Return the cycle that the settled motion of ``guess`` is, or comes to."""
    shooting, state, regime, period, phase = guess
    cycle = once(close(*guess))
    if cycle.residual < REPEATS and cycle.found == Found.NOT_CONVERGED:
        # steps over a corner of a law are as rough as the tolerance allows
        shooting = replace(shooting, rtol=max(FINER * shooting.rtol, SETTINGS["rtol"].low))
        guess = guess._replace(shooting=shooting)
        cycle = once(close(*guess))
    if cycle.found == Found.AT_REST and not _dies(guess, settle):
        return replace(cycle, found=Found.NOT_CONVERGED, why=GOES_ON)
    values = cycle.multipliers
    if values is None or not np.any(np.abs(values) > 1 + ISOLATED):
        return cycle
    # nothing settles on this one; beside it there may be one of twice its period, too near to tell
    if np.any(np.real(values) < -1 - ISOLATED):
        twice = replace(shooting, repeats=2 * shooting.repeats)
        other = once(close(twice, state, regime, 2 * period, 0.5 * phase))
        if other.stable:
            return other
    return Cycle(shooting.system, Found.NOT_PERIODIC, why=UNSTABLE, shooting=shooting)


def once(cycle: Cycle) -> Cycle:
    """Return a cycle passed once, if it is one of a part of its period, passed several times.

    Returns to a section may lie between two samples in one period and not in another: their number
    bounds that of the parts. So does how often its events come again: a quick slip may lie so in
    most periods. The number of a clock's periods is divided by that of the parts.
    """
    shooting, state = cycle.shooting, cycle.state
    if shooting is None or state is None:
        return cycle
    whole = shooting.repeats
    tried = {j for j in range(2, whole + 1) if shooting.clock is None or whole % j == 0}
    if shooting.clock is None:
        again = _times(cycle.word.split())
        tried |= {j for j in range(2, again + 1) if again % j == 0}
    for parts in sorted(tried, reverse=True):
        start = {"phase": cycle.phase, "regime": cycle.regime}
        early = shooting.motion(cycle.system, state, cycle.period, part=1 / parts, **start)
        if np.all(np.abs(early.state - state) < AGAIN * shooting.scale):
            shorter = replace(shooting, repeats=max(1, whole // parts))
            phase = parts * cycle.phase % 1.0
            found = close(shorter, state, cycle.regime, cycle.period / parts, phase)
            return found if found.multipliers is not None else cycle
    return cycle


def _times(names: list[str]) -> int:
    """Return how often a period passes the same events in a row."""
    size = len(names)
    lengths = (n for n in range(1, size) if size % n == 0 and names == names[n:] + names[:n])
    return size // next(lengths, size or 1)


def _dies(guess: Guess, settle: float) -> bool:
    """Whether a motion that moves, and closes at rest, dies out within ``settle``.

    Raises `Lost` if it ends before.
    """
    shooting, state, regime, period, phase = guess
    part = 4 * math.ceil(max(1.0, 0.25 * settle / period))
    start = {"phase": phase, "part": part, "regime": regime}
    later = complete(shooting.motion(shooting.system, state, period, **start))
    sizes, n = later.samples / shooting.scale, len(state) // 2
    quarter = len(sizes) // 4
    first, last = (np.max(np.ptp(x[:, :n], axis=0)) for x in (sizes[:quarter], sizes[-quarter:]))
    return bool(last <= DYING * first)


class _Constant:
    """A period that depends on nothing: a class, so that its cycles can be pickled."""

    def __init__(self, value: float):
        self.value = value

    def __call__(self, system):
        return self.value
