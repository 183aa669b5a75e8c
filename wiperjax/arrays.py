"""Choices over trees of arrays."""

import jax
import jax.numpy as jnp


def where(condition, a, b):
    """`jnp.where` over pytrees."""
    return jax.tree.map(lambda x, y: jnp.where(condition, x, y), a, b)
