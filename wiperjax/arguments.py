"""What a person gives to `simulate`: checked, and brought into one shape."""

import math

import jax.numpy as jnp
import numpy as np

from .guards import starting_sides
from .results import Result
from .system import AbstractSystem
from .wiper import Wiper

MOST_SAMPLES = 5 * 10**7


def number(name: str, value, high: float | None = None) -> float:
    """Return a positive finite number, at most ``high``. Raises ValueError that names it."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not (0 < number < math.inf and (high is None or number <= high)):
        limit = "" if high is None else f" and <= {high:g}"
        raise ValueError(f"{name} must be a finite number > 0{limit}, but was {value!r}")
    return number


def regular_times(duration: float, interval: float) -> np.ndarray:
    """Multiples of ``interval`` from 0 up to ``duration``, that itself if it is one to rounding."""
    ratio = duration / interval
    if ratio > MOST_SAMPLES:
        raise ValueError(
            f"sample_interval must be at least {duration / MOST_SAMPLES:g} s with this duration "
            f"({MOST_SAMPLES:g} samples), but was {interval:g}"
        )
    times = interval * np.arange(math.floor(ratio * (1 + 1e-12)) + 1)
    if abs(times[-1] - duration) <= 1e-12 * duration:
        times[-1] = duration
    return times


def coordinates(initial_state) -> tuple[tuple, tuple]:
    """Return (position, velocity) as tuples of floats. Raises ValueError for other shapes."""
    must = "initial_state must be (position, velocity), each n >= 1 finite numbers"
    try:
        position, velocity = (
            tuple(float(x) for x in np.asarray(part, dtype=float)) for part in initial_state
        )
    except (TypeError, ValueError):
        raise ValueError(f"{must}, but was {initial_state!r}") from None
    if not position or len(position) != len(velocity):
        raise ValueError(f"{must}, but their lengths were {len(position)} and {len(velocity)}")
    if not np.all(np.isfinite(position + velocity)):
        raise ValueError(f"{must}, but was {(position, velocity)}")
    return position, velocity


def tolerances(atol, n: int):
    """Return ``atol`` as `make_problem` wants it. Raises ValueError for other shapes or values."""
    if atol is None:
        return None
    must = f"atol must be one number > 0, or (positions, velocities) with 1 or {n} numbers each"
    try:
        parts = [atol, atol] if np.ndim(atol) == 0 else list(atol)
        pair = tuple(
            tuple(float(x) for x in np.broadcast_to(np.asarray(part, float), (n,)))
            for part in parts
        )
    except (TypeError, ValueError):
        raise ValueError(f"{must}, but was {atol!r}") from None
    if len(pair) != 2 or not all(0 < x < math.inf for part in pair for x in part):
        raise ValueError(f"{must}, but was {atol!r}")
    return pair


def check_start(system: AbstractSystem, start, result: int) -> None:
    """Raises ValueError, saying why, for a state in which no motion can begin."""
    t = jnp.asarray(0.0)
    q, v = (tuple(jnp.asarray(x) for x in part) for part in start)
    sides = starting_sides(system, t, q, v)
    system = system.on_sides(sides)
    found = zip(sides, system.switches(t, q, v), system.ends(t, q, v), strict=True)
    if any(side * s < 0 or (s == 0 and end) for side, s, end in found):
        where = " (|phi| < collapse_angle)" if isinstance(system, Wiper) else ""
        raise ValueError(f"initial_state must lie where the model holds{where}, but was {start}")
    if result == Result.INCONSISTENT_START:
        gap = float(system.gap(t, q)) if system.unilateral else 0.0
        if gap < 0:
            raise ValueError(f"initial_state must have a gap >= 0, but the gap was {gap:g}")
        raise ValueError(
            "initial_state must allow a finite contact force, but at this state of rest none "
            "exists (Painleve: friction and hinge_mass jam the tip); start it sliding or lifted"
        )
