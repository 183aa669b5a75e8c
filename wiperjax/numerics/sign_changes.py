"""Where a function changes its sign on a grid, of which no more is computed than may hold a root.

Every `PARTS`-th place is looked at. Between two of them that have one sign the function may still
dip through zero: only if it bends there as much as it is away from it, by the second differences
around. Those stretches, and those over which the sign changes, are looked at place by place, and
beside the lowest of these places at the bottom of the dip: two roots are born there, nearer to each
other than any grid.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

from .types import Scalar

PARTS = 8
INNER, NARROWINGS = 0.4, 24  # of two intervals about a bottom, to 1e-5 of one

Function = Callable[[Scalar], tuple[Scalar, Scalar, Scalar]]


class SignChanges(NamedTuple):
    """The first changes of sign, each field of shape (count,).

    Attributes:
        exists: whether there are so many.
        before, after: places on either side of it, neighbours on the grid or nearer.
        falls: whether the function is positive (or zero) before it.
    """

    exists: Scalar
    before: Scalar
    after: Scalar
    falls: Scalar


def sign_changes(
    function: Function, start: Scalar, end: Scalar, stretches: int, count: int
) -> SignChanges:
    """Return the first ``count`` changes of sign from ``start`` to ``end``.

    ``function``: place -> its value there, whether it has one, and a smooth number that must be
    positive at a root: where it vanishes between two places, the straight lines through both tell
    on which side of that the root is. The grid has ``stretches`` times
    `PARTS` intervals of one width. A dip between coarse places is seen where it is no deeper than
    the sum of the two second differences beside it (four times what a kink, sixteen times what a
    parabola can do). Two roots within one interval are seen down to 1e-5 of it apart, of one such
    pair in a stretch.

    May be mapped, not differentiated in reverse: what is found are places, and constant.
    """
    width = (end - start) / (PARTS * stretches)
    value, has, room = jax.vmap(function)(start + width * (PARTS * jnp.arange(stretches + 1)))
    up = value >= 0
    has &= room > 0
    suspect = _may_dip(value) | (up[1:] != up[:-1]) | ~(has[1:] & has[:-1])
    order = jnp.arange(stretches)

    def left(state):
        place, seen, _ = state
        return (seen < count) & jnp.any(suspect & (order >= place))

    def look(state):
        place, seen, found = state
        place = jnp.argmax(suspect & (order >= place))
        x = start + width * (PARTS * place + jnp.arange(PARTS + 1))
        x, (value, has, room) = _with_bottom(function, x, jax.vmap(function)(x))
        up, away = value >= 0, jnp.abs(value)
        at_root = room[:-1] * away[1:] + room[1:] * away[:-1]
        change = (up[1:] != up[:-1]) & has[1:] & has[:-1] & (at_root > 0)
        number = seen + jnp.cumsum(change) - 1
        mine = change[None] & (number[None] == jnp.arange(count)[:, None])
        which, one = jnp.argmax(mine, axis=1), jnp.any(mine, axis=1)
        here = SignChanges(one, x[which], x[which + 1], up[which])
        found = jax.tree.map(lambda new, old: jnp.where(one, new, old), here, found)
        return place + 1, seen + jnp.sum(change), found

    no, nowhere = jnp.zeros(count, bool), jnp.full(count, start)
    return jax.lax.while_loop(left, look, (0, 0, SignChanges(no, nowhere, nowhere, no)))[2]


def _may_dip(value):
    """Return between which of neighbouring places (places - 1,) the ``value`` bends as much as it
    is away from zero, so that it may dip through it."""
    bends = jnp.pad(jnp.abs(jnp.diff(value, 2)), 1, mode="edge")
    away = jnp.abs(value)
    return jnp.minimum(away[1:], away[:-1]) <= bends[1:] + bends[:-1]


def _with_bottom(function: Function, x, values):
    """Return places ``x`` (places,) and their ``values`` with one more, in order: the bottom beside
    the place nearest to zero, if the sign is another there than at its neighbours; else that place
    once more."""
    value = values[0]
    last, lowest = len(x) - 1, jnp.argmin(jnp.abs(value))
    around = jnp.clip(lowest + jnp.arange(-1, 2), 0, last)
    sign = jnp.where(value[lowest] >= 0, 1.0, -1.0)
    dips = jnp.any(_may_dip(value)[jnp.clip(around[:2], 0, last - 1)])
    dips &= jnp.all(sign * value[around] > 0)

    def wanted(state):
        return dips & (state[2] < NARROWINGS)  # hardly ever: mapped, all turn until none wants more

    def narrowed(state):
        low, high, turn = state
        one, other = low + INNER * (high - low), high - INNER * (high - low)
        left = sign * function(one)[0] < sign * function(other)[0]
        return jnp.where(left, low, one), jnp.where(left, other, high), turn + 1

    low, high, _ = jax.lax.while_loop(wanted, narrowed, (x[around[0]], x[around[2]], 0))
    bottom = 0.5 * (low + high)
    values_there = function(bottom)
    through = dips & (sign * values_there[0] < 0)
    beyond = jnp.abs(bottom - x[0]) > jnp.abs(x[lowest] - x[0])
    order, here = jnp.arange(last + 2), lowest + (beyond & through)

    def with_one(old, one):
        one = jnp.where(through, one, old[lowest])
        return jnp.where(order == here, one, old[order - (order >= here)])

    return with_one(x, bottom), jax.tree.map(with_one, values, values_there)
