"""Choices over trees of arrays, names of their leaves, and writing into one."""

import jax
import jax.numpy as jnp
import numpy as np


def check_settings() -> None:
    """Raises ValueError where JAX is set up for what the engine cannot bear.

    Without 64-bit numbers, whoever switched them off after wiperjax was imported would get events
    to seven digits, without a word; NaN and inf, which JAX may search for, stand for what is not
    there.
    """
    if jnp.result_type(float) != jnp.float64:
        raise ValueError("jax_enable_x64 must be True, as wiperjax sets it, but was False")
    for search in ("jax_debug_nans", "jax_debug_infs"):
        if getattr(jax.config, search):
            why = "NaN and inf stand for what is not there"
            raise ValueError(f"{search} must be False, for {why}, but was True")


def where(condition, a, b):
    """`jnp.where` over pytrees."""
    return jax.tree.map(lambda x, y: jnp.where(condition, x, y), a, b)


def put(array, at, values):
    """Return ``array`` with ``values``, in its dtype, in the places ``at``; those beyond its end
    are dropped, of the others no two may be the same.

    That is a promise: without it a derivative goes through the whole array.
    """
    values = jnp.asarray(values, array.dtype)
    return array.at[at].set(values, mode="drop", unique_indices=True)


def fields_of(path) -> tuple[str, ...]:
    """Names of the keys that lead to a leaf of a tree, of `jax.tree_util.tree_map_with_path`."""
    return tuple(jax.tree_util.keystr((key,), simple=True) for key in path)


def cellwise(value, count: int) -> np.ndarray:
    """One value for each of ``count`` cells of something that may be the same for all."""
    value = np.asarray(value)
    return value[:count] if value.ndim else np.full(count, value)


def pick(slots, index):
    """Entry ``index`` (traced, one a lane) of a tuple, the first where there is none; entries may
    be tuples of the same shape."""
    out = slots[0]
    for i, entry in enumerate(slots[1:], 1):
        out = jax.tree.map(lambda a, b, i=i: jnp.where(index == i, b, a), out, entry)
    return out
