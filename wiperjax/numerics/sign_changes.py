"""Where a function changes its sign on a grid, of which no more is computed than may hold a root.

Every `PARTS`-th place is looked at. Between two of them that have one sign the function may still
dip through zero: only if it bends there as much as it is away from it, by the second differences
around. Those stretches, and those over which the sign changes, are looked at place by place.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

from .types import Scalar

PARTS = 8


class SignChanges(NamedTuple):
    """The first changes of sign, each field of shape (count,).

    Attributes:
        exists: whether there are so many.
        before, after: neighbouring places of the grid on either side of it.
        falls: whether the function is positive (or zero) before it.
    """

    exists: Scalar
    before: Scalar
    after: Scalar
    falls: Scalar


def sign_changes(
    function: Callable[[Scalar], tuple[Scalar, Scalar, Scalar]], start: Scalar, end: Scalar,
    stretches: int, count: int,
) -> SignChanges:  # fmt: skip
    """Return the first ``count`` changes of sign from ``start`` to ``end``.

    ``function``: place -> its value there, whether it has one, and a smooth number that must be
    positive at a root: where it vanishes between two places, the straight lines through both tell
    on which side of that the root is. The grid has ``stretches`` times
    `PARTS` intervals of one width: of two roots within one of them nothing is seen. A dip between
    coarse places is seen where it is no deeper than the sum of the two second differences beside it
    (four times what a kink, sixteen times what a parabola can do).

    May be mapped, not differentiated in reverse: what is found are places of a grid, and constant.
    """
    width = (end - start) / (PARTS * stretches)

    def at(number):
        return function(start + width * number)

    value, has, room = jax.vmap(at)(PARTS * jnp.arange(stretches + 1))
    slopes = jnp.diff(value)
    bends = jnp.pad(jnp.abs(jnp.diff(slopes)), 1, mode="edge")
    up, away = value >= 0, jnp.abs(value)
    near = jnp.minimum(away[1:], away[:-1]) <= bends[1:] + bends[:-1]
    has &= room > 0
    suspect = near | (up[1:] != up[:-1]) | ~(has[1:] & has[:-1])
    order = jnp.arange(stretches)

    def left(state):
        place, seen, _, _ = state
        return (seen < count) & jnp.any(suspect & (order >= place))

    def look(state):
        place, seen, before, falls = state
        place = jnp.argmax(suspect & (order >= place))
        fine = PARTS * place + jnp.arange(PARTS + 1)
        value, has, room = jax.vmap(at)(fine)
        up, away = value >= 0, jnp.abs(value)
        at_root = room[:-1] * away[1:] + room[1:] * away[:-1]
        change = (up[1:] != up[:-1]) & has[1:] & has[:-1] & (at_root > 0)
        number = seen + jnp.cumsum(change) - 1
        mine = change & (number == jnp.arange(count)[:, None])
        which, one = jnp.argmax(mine, axis=1), jnp.any(mine, axis=1)
        before = jnp.where(one, fine[which], before)
        falls = jnp.where(one, up[which], falls)
        return place + 1, seen + jnp.sum(change), before, falls

    none = jnp.zeros(count, int)
    _, seen, before, falls = jax.lax.while_loop(left, look, (0, 0, none, none > 0))
    exists = jnp.arange(count) < seen
    return SignChanges(exists, start + width * before, start + width * (before + 1), falls)
