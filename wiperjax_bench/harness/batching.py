"""Running the JAX methods over the cells of a scene, compiled once for many scenes."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from wiperjax import Wiper

from ..scenes.scene import Scene

_OPTIONAL = ("hinge_mass", "hinge_damping", "gravity")


def absent(scene: Scene) -> tuple[str, ...]:
    """Return the parameters whose terms need not be computed at all: zero in every cell."""
    return tuple(name for name in _OPTIONAL if not np.any(getattr(scene.wiper, name)))


def arrays(wiper: Wiper) -> Wiper:
    """Return the wiper with arrays for numbers, so that another value is not another program."""
    return jax.tree.map(lambda x: jnp.asarray(np.asarray(x)), wiper)


def over_cells(one, wiper: Wiper, zeros: tuple[str, ...], start):
    """Return ``one(wiper, start)`` of all cells; ``zeros`` as `absent` gives them.

    To be called while traced: a zero parameter must be the Python number for its terms to go.
    """
    axes = jax.tree.map(lambda x: 0 if np.ndim(x) else None, wiper)

    def cell(wiper, start):
        return one(dataclasses.replace(wiper, **{name: 0.0 for name in zeros}), start)

    return jax.vmap(cell, in_axes=(axes, 0))(wiper, start)


def at_samples(ends, values, times):
    """Return ``values`` (cells, ends, n), linear between ``ends``, at ``times``."""
    right = np.clip(np.searchsorted(ends, times * (1 - 1e-12)), 1, len(ends) - 1)
    left = right - 1
    share = ((times - ends[left]) / (ends[right] - ends[left]))[:, None]
    return (1 - share) * values[:, left] + share * values[:, right]
