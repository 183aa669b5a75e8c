"""Coordinates that may drift: nothing depends on where they are, as on the height of what falls.

A motion that repeats but for such a coordinate is no cycle, and goes on as one all the same.
"""

import jax.numpy as jnp
import numpy as np

from ..contact.system import AbstractSystem
from .clock import CHANGED, seen
from .cycle import typical

AROUND = 8  # states in which it is looked at
FAR = 2.0  # of the typical sizes: how far these lie from each other


def may_drift(system: AbstractSystem, state) -> np.ndarray:
    """Whether nothing depends on each coordinate, (n,), in states around ``state`` (2n,): no
    acceleration or force, gap, slip speed, switch or rebound. At the time 0."""
    state = np.asarray(state, float)
    n = len(state) // 2
    sizes = typical(system, n)
    turned = (np.arange(AROUND)[:, None] * np.sqrt(np.arange(2, 2 * n + 2))) % 1.0 - 0.5
    states, now = state + FAR * sizes * turned, jnp.zeros(1)
    here = seen(system, states, now)
    found = np.zeros(n, bool)
    for i in range(n):
        moved = states.copy()
        moved[:, i] += sizes[i] * np.linspace(0.5, FAR, AROUND)
        pairs = zip(here, seen(system, moved, now), strict=True)
        found[i] = all(np.all(np.abs(a - b) <= CHANGED * np.max(np.abs(a))) for a, b in pairs)
    return found
