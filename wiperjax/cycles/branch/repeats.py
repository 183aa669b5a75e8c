"""The time in which a settled motion comes back to itself, as its samples tell."""

import jax
import jax.numpy as jnp

from ..first_guess import STILL

ALIKE = 0.02  # of half the range of a state: how near a motion that repeats comes back
NEARER = 3e-4  # of that half: what is farther off than the nearest by more is another turn


def repeat_time(states, window, sizes, counted):
    """Return a time in which a motion comes back to itself, of states (samples, 2n) that are evenly
    spread over ``window`` [s]: whole periods, from a maximum of the first coordinate that counts,
    in the first quarter if one is there, to the last that is as like it as any.

    NaN if that is not half as long, or there is none; ``window`` of a motion at rest. ``sizes``
    (2n,) are typical ones, ``counted`` (n,) tells the coordinates that have to come back.
    """
    count, n = states.shape[0], states.shape[1] // 2
    velocity = jnp.take(states, n + jnp.argmax(counted), axis=1)
    turns = (velocity[:-1] > 0) & (velocity[1:] <= 0)
    part = velocity[:-1] / jnp.where(turns, velocity[:-1] - velocity[1:], 1.0)
    there = states[:-1] + part[:, None] * jnp.diff(states, axis=0)
    times = (jnp.arange(count - 1) + part) * window / (count - 1)
    # samples blur the turns within a burst: from the one that the next follows latest
    coming = jax.lax.cummin(jnp.where(turns, times, jnp.inf), reverse=True)
    early = turns & (times <= jnp.maximum(0.25 * window, coming[0]))
    gap = jnp.where(early, jnp.append(coming[1:], jnp.inf) - times, 0.0)
    first = jnp.argmax(gap >= (1 - ALIKE) * jnp.max(gap))
    since, off = times - times[first], _apart(there, there[first], states, sizes, counted)
    alike = turns & (since >= 0.5 * window) & (off < ALIKE)
    # its neighbours in a burst are alike as well, a share of a period off
    again = alike & (off <= jnp.min(off, where=alike, initial=ALIKE) + NEARER)
    time = jnp.where(jnp.any(again), since[count - 2 - jnp.argmax(again[::-1])], jnp.nan)
    rests = jnp.where(counted, jnp.ptp(states[:, :n], axis=0) <= STILL * sizes[:n], True)
    return jnp.where(jnp.all(rests), window, time)


def comes_back(states, sizes, counted):
    """Whether the last of the states (samples, 2n) of a motion is like its first."""
    return _apart(states[-1:], states[0], states, sizes, counted)[0] < ALIKE


def _apart(some, one, states, sizes, counted):
    """How far ``some`` (k, 2n) of a motion's ``states`` are off ``one`` (2n,): shares (k,)."""
    n = states.shape[1] // 2
    half = 0.5 * (states.max(0) - states.min(0))
    kinds = jnp.repeat(half.reshape(2, n).max(1), n)
    half = jnp.maximum(half, 1e-3 * kinds)  # a coordinate that rests has no size of its own
    off = jnp.abs(some - one) / jnp.maximum(half, STILL * sizes)
    matters = jnp.concatenate([counted, jnp.ones_like(counted)])  # speeds do in any case
    return jnp.max(jnp.where(matters, off, 0.0), axis=1)
