"""The time in which a settled motion comes back to itself, as its samples tell."""

import jax.numpy as jnp

from ..first_guess import STILL

ALIKE = 0.02  # of half the range of a state: how near a motion that repeats comes back


def repeat_time(states, window, sizes, counted):
    """Return the longest time in which a motion comes back to itself, of states (samples, 2n) that
    are evenly spread over ``window`` [s]: whole periods, from one maximum of the first coordinate
    that counts to the last that is like it.

    NaN if that is not half as long, or there is none; ``window`` of a motion at rest. ``sizes``
    (2n,) are typical ones, ``counted`` (n,) tells the coordinates that have to come back.
    """
    count, n = states.shape[0], states.shape[1] // 2
    velocity = jnp.take(states, n + jnp.argmax(counted), axis=1)
    turns = (velocity[:-1] > 0) & (velocity[1:] <= 0)
    part = velocity[:-1] / jnp.where(turns, velocity[:-1] - velocity[1:], 1.0)
    there = states[:-1] + part[:, None] * jnp.diff(states, axis=0)
    times = (jnp.arange(count - 1) + part) * window / (count - 1)
    first = jnp.argmax(turns)
    again = turns & _alike(there, there[first], states, sizes, counted)
    last = count - 2 - jnp.argmax(again[::-1])
    time = times[last] - times[first]
    time = jnp.where(jnp.any(turns) & (time >= 0.5 * window), time, jnp.nan)
    rests = jnp.where(counted, jnp.ptp(states[:, :n], axis=0) <= STILL * sizes[:n], True)
    return jnp.where(jnp.all(rests), window, time)


def comes_back(states, sizes, counted):
    """Whether the last of the states (samples, 2n) of a motion is like its first."""
    return _alike(states[-1:], states[0], states, sizes, counted)[0]


def _alike(some, one, states, sizes, counted):
    """Whether ``some`` (k, 2n) of a motion's ``states`` are like ``one`` (2n,), (k,)."""
    n = states.shape[1] // 2
    half = 0.5 * (states.max(0) - states.min(0))
    kinds = jnp.repeat(half.reshape(2, n).max(1), n)
    half = jnp.maximum(half, 1e-3 * kinds)  # a coordinate that rests has no size of its own
    off = jnp.abs(some - one) / jnp.maximum(half, STILL * sizes)
    matters = jnp.concatenate([counted, jnp.ones_like(counted)])  # speeds do in any case
    return jnp.all((off < ALIKE) | ~matters, axis=1)
