"""Whether a prescribed motion goes on where one smooth piece of it ends and the next begins.

The engine takes a state across such an end as it is. Were the speed of what it touches another one
behind it, what sticks or rests there would be carried along at once, by no force and no impact.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..vocabulary import checks
from .belts import AbstractBelt
from .system import AbstractSystem, cast

PIECES = 64  # of a prescribed motion that are looked at
WITHIN = 0.382  # of a piece: so far before and behind its end it is looked at, too
SAME = 1e-6  # of what it reaches at all these: a jump by less is rounding


def check_belt(belt: AbstractBelt, t) -> None:
    """Raises ValueError unless the pieces of a belt end one after the other, and its speed goes on
    from one to the next. ``t``: where it begins [s]. Traced values pass (`checks`)."""
    _check(belt, t, {"velocity must go on": belt.velocity}, ())


def check_system(system: AbstractSystem, t, q, rates) -> None:
    """Raises ValueError unless the pieces of a system's motion end one after the other, and its
    gap, the rate of that, and its slip speed go on from one to the next, at the state of its start,
    ``q`` and its ``rates``. Traced values pass."""

    def slip_speed(time, piece):
        local = system.on_piece(piece)
        return local.slip_speed(time, q, local.from_rates(time, q, rates))

    def approach(time, piece):
        local = system.on_piece(piece)

        def gap(t, q):
            return local.gap(t, q) + 0 * t

        return jax.jvp(gap, (time, q), (jnp.ones_like(time), cast(rates, q)))

    parts: dict[str, Callable] = {}
    if system.unilateral:
        parts["gap must go on"] = lambda *at: approach(*at)[0]
        parts["gap must go on at the same rate"] = lambda *at: approach(*at)[1]
    if system.law is not None:
        parts["slip_speed must go on"] = slip_speed
    _check(system, t, parts, (q, rates))


def _check(owner: Any, t, parts: dict[str, Callable], given: Any) -> None:
    """`check_belt` and `check_system`: ``parts`` are functions of (time, piece), by what is asked
    of them; ``given`` is what they depend on besides ``owner``."""
    if any(map(checks.is_traced, jax.tree.leaves((owner, t, given)))):
        return
    kind = type(owner).__name__
    pieces = owner.first_piece(t) + jnp.arange(PIECES).reshape(-1, *[1] * jnp.ndim(t))
    ends = np.asarray(jax.vmap(lambda piece: owner.break_time(piece) + 0 * t)(pieces))
    begins = np.concatenate([np.asarray(t)[None], ends[:-1]])
    if np.any(early := ~(ends > begins) & np.isfinite(begins)):
        must = "must be later for each piece, and than the time that it is the first piece of"
        raise ValueError(f"{kind}.break_time {must}, but was {ends[early][0]:g}")
    there = np.isfinite(ends)
    if not there.any():
        return
    ends, begins = (np.where(there, times, 0.0) for times in (ends, begins))
    part = WITHIN * (ends - begins)
    for asked, function in parts.items():

        def told(times, pieces, function=function):
            found = jax.vmap(lambda time, k: function(time, k) + 0 * time)(times, pieces)
            return np.where(there, found, 0.0)

        old, new = told(ends, pieces), told(ends, pieces + 1)
        beside = told(begins + part, pieces), told(ends + part, pieces + 1)
        reached = np.fmax.reduce(np.abs([old, new, *beside]), axis=(0, 1))
        jumps = ~(np.abs(new - old) <= SAME * reached)  # NaN does not go on either
        if jumps.any():
            at, old, new = (x[jumps][0] for x in (ends, old, new))
            must = f"{asked} where a piece ends, but at {at:g} s was {old:g} and then {new:g}"
            raise ValueError(f"{kind}.{must}")
