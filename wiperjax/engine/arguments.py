"""What a person gives to `solve` and `simulate`: checked, and brought into one shape.

Values that JAX will know only when it runs pass unseen (`checks`).
"""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..contact import fits
from ..contact.system import AbstractSystem
from ..numerics.runge_kutta import check_solver
from ..vocabulary import checks
from ..vocabulary.ranges import COUNT, FINITE, NON_NEGATIVE, POSITIVE, RUN_SAMPLES, SETTINGS, Range
from .observers.base import AbstractObserver

LAST_DIGITS = 4  # that rounding may take a time off another which is meant to be the same
MOST_EVENTS = 10**7  # room for them
MOST_PIECES = 2**31 - 1000  # smooth pieces of a motion, and some that it goes on for


def check_system(system: Any) -> None:
    """Raises ValueError unless ``system`` is one."""
    checks.instance("system", system, AbstractSystem, "a system such as Wiper()")


def check_integration(solver, rtol, zeno_time, max_steps, reverse=False) -> None:
    """Raises ValueError for how a motion cannot be integrated; no solver leaves the choice open."""
    if solver is not None:
        check_solver(solver)
    checks.numbers("rtol", rtol, SETTINGS["rtol"], arrays=False)
    checks.numbers("zeno_time", zeno_time, NON_NEGATIVE, arrays=False)
    checks.numbers("max_steps", max_steps, COUNT, arrays=False)
    checks.flag("reverse", reverse)
    if reverse and checks.is_traced(max_steps):  # there is room for so many
        raise ValueError("max_steps must be known with reverse=True (static), but was traced")


def longest_step(max_step) -> float | None:
    """Return ``max_step`` [s] as a number; None for no limit. Raises ValueError for any other."""
    return None if max_step is None else checks.number("max_step", max_step, POSITIVE)


def check_observation(sample_times, max_events, max_step, observer, start, reverse) -> None:
    """Raises ValueError for what `solve` cannot keep of a motion."""
    if reverse and sample_times is not None:
        raise ValueError("sample_times must be left out with reverse=True, but was given")
    checks.numbers("start", start, FINITE, arrays=False)
    if sample_times is not None and not checks.is_traced(sample_times):
        first = checks.increasing("sample_times", sample_times)[0]
        if not checks.is_traced(start) and first < _begun(start, sample_times):
            begin = f"must begin at start ({float(start):.16g} s) or later"
            raise ValueError(f"sample_times {begin}, but began at {float(first):.16g}")
    checks.whole("max_events", max_events, Range(0, MOST_EVENTS, whole=True))
    if max_step is not None:
        checks.numbers("max_step", max_step, Range(0, low_open=True, infinite=True), arrays=False)
    if observer is not None:
        checks.instance("observer", observer, AbstractObserver, "one such as RegimeTotals(0.0)")


def check_beginning(observer, statistics_start, end) -> None:
    """Raises ValueError for statistics that begin at no time before the ``end`` [s], or elsewhere
    than their observer does.
    """
    begin = getattr(observer, "begin", None)
    if statistics_start is not None:
        checks.numbers("statistics_start", statistics_start, FINITE, arrays=False)
        known = not (checks.is_traced(begin) or checks.is_traced(statistics_start))
        if begin is not None and known and begin != statistics_start:
            must = f"must be where the observer begins ({float(begin):g} s), or left out"
            raise ValueError(f"statistics_start {must}, but was {statistics_start:g}")
    for name, time in (("statistics_start", statistics_start), ("observer.begin", begin)):
        if time is not None:  # the numbers gathered would be zeros
            checks.at_most(name, time, end, "the end of the motion", itself=False)


def check_start(system: AbstractSystem, start: Any) -> None:
    """Raises ValueError for a ``start`` so far from 0 that its smooth piece of the prescribed
    motion has a number of more than 32 bits."""
    if any(map(checks.is_traced, jax.tree.leaves((system, start)))) or not np.any(start):
        return
    with jax.ensure_compile_time_eval():  # also inside a trace of something else
        first = system.first_piece(jnp.asarray(start, float))
    piece = np.max(np.abs(np.asarray(first, float)))
    if piece > MOST_PIECES:
        must = f"must lie in one of the first {MOST_PIECES} pieces of the prescribed motion"
        raise ValueError(f"start {must}, but was {float(start):g} s, in number {piece:g}")


def from_start(sample_times: Any, start: Any) -> jax.Array | None:
    """Return the sample times [s], (m,); those that only rounding puts before ``start`` at it."""
    if sample_times is None:
        return None
    times = jnp.asarray(sample_times, float)
    early = (times < start) & (times >= _begun(start, sample_times))
    return jnp.where(early, start, times)


def _begun(start: Any, sample_times: Any) -> Any:
    """Return the time [s] from which a motion that begins at ``start`` is known: `LAST_DIGITS`
    before it, of the poorer of the two precisions."""
    given = (jnp.result_type(getattr(x, "dtype", float), float) for x in (start, sample_times))
    return start - LAST_DIGITS * max(float(jnp.finfo(kind).eps) for kind in given) * abs(start)


def regular_times(duration: float, interval: float) -> np.ndarray:
    """Multiples of ``interval`` from 0 up to ``duration``, that itself if it is one to rounding."""
    ratio = duration / interval
    if ratio > RUN_SAMPLES:
        raise ValueError(
            f"sample_interval must be at least {duration / RUN_SAMPLES:g} s with this duration "
            f"({RUN_SAMPLES:g} samples), but was {interval:g}"
        )
    times = interval * np.arange(math.floor(ratio * (1 + 1e-12)) + 1)
    if abs(times[-1] - duration) <= 1e-12 * duration:
        times[-1] = duration
    return times


def check_state(system: AbstractSystem, initial_state, name: str = "initial_state") -> None:
    """Raises ValueError unless it is (position, velocity), of as many coordinates as ``system``
    says it has, and the system answers there as it is asked (`contact.fits`).
    """
    must = f"{name} must be (position, velocity), each n >= 1 finite numbers"
    try:
        position, velocity = (tuple(part) for part in initial_state)
    except (TypeError, ValueError):
        raise ValueError(f"{must}, but was {checks.shown(initial_state)}") from None
    if not position or len(position) != len(velocity):
        raise ValueError(f"{must}, but their lengths were {len(position)} and {len(velocity)}")
    for value in position + velocity:
        if checks.is_traced(value):
            continue
        if not checks.is_number(value) or FINITE.outside(value) is not None:
            raise ValueError(f"{must}, but was {checks.shown(initial_state)}")
    check_coordinates(name, system, len(position))
    try:
        fits.check(system, position, velocity)
    except ValueError as error:
        if system.coordinates:  # else nobody knows which is wrong
            raise
        kind, had = type(system).__name__, len(position)
        must = f"{name} must have the coordinates of {kind}, but had {had}"
        raise ValueError(f"{must}; or {error}") from error


def check_coordinates(name: str, system: AbstractSystem, n: int) -> None:
    """Raises ValueError for a state ``name`` of ``n`` coordinates if ``system`` names others."""
    own = len(system.coordinates)
    if own and n != own:
        raise ValueError(
            f"{name} must have the {own} coordinates of {type(system).__name__}, but had {n}"
        )


def checked_start(system: AbstractSystem, initial_state) -> Any:
    """Return ``initial_state``, the system's own start if that is None. Raises ValueError unless it
    is one (`check_state`), naming which of the two."""
    name = "initial_state"
    if initial_state is None:
        name, initial_state = f"{type(system).__name__}.default_state()", system.default_state()
    check_state(system, initial_state, name)
    return initial_state


def coordinates(system: AbstractSystem, initial_state) -> tuple[tuple, tuple]:
    """Return (position, velocity) of `checked_start` as tuples of floats."""
    start = checked_start(system, initial_state)
    each = "each number of initial_state"  # a system's own is known where the system is
    position, velocity = (tuple(checks.number(each, x, FINITE) for x in part) for part in start)
    return position, velocity


def check_tolerances(atol, n: int) -> None:
    """Raises ValueError unless ``atol`` is None, a number, or (positions, velocities)."""
    must = f"atol must be one number > 0, or (positions, velocities) with 1 or {n} numbers each"
    if isinstance(atol, tuple | list):
        parts = [part if isinstance(part, tuple | list) else (part,) for part in atol]
        fits = len(parts) == 2 and all(len(part) in (1, n) for part in parts)
        leaves = [leaf for part in parts for leaf in part]
    else:
        fits, leaves = True, [] if atol is None else [atol]
    known = [leaf for leaf in leaves if not checks.is_traced(leaf)]
    fits = fits and all(checks.is_number(leaf, arrays=False) for leaf in known)
    if not fits or any(POSITIVE.outside(leaf) is not None for leaf in known):
        raise ValueError(f"{must}, but was {checks.shown(atol)}")


def tolerances(atol, n: int) -> tuple[tuple, tuple] | None:
    """Return ``atol`` as n floats for positions and velocities each; None if it is None.

    Arrays hold a value a coordinate. Raises ValueError for other shapes or values.
    """

    def listed(value):
        if isinstance(value, tuple | list):
            return [listed(x) for x in value]
        return value.tolist() if hasattr(value, "tolist") else value

    atol = listed(atol)
    check_tolerances(atol, n)
    if atol is None:
        return None
    parts = atol if isinstance(atol, list) else [atol, atol]
    full = (np.broadcast_to(np.asarray(part, float), (n,)) for part in parts)
    positions, velocities = (tuple(float(x) for x in part) for part in full)
    return positions, velocities
