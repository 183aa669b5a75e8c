"""A fusion barrier that XLA's CPU compiler respects."""

import jax.numpy as jnp
import jax.tree_util as jtu

ROWS = 8  # largest leading axis (nodes, slots) that `keep` serves


def begin_unit(lanes, dtype):
    """Return the ones that `keep` divides by, (ROWS, *lanes); to be carried through a loop."""
    return jnp.ones((ROWS, *lanes), dtype)


def keep(tree, unit):
    """Divide by ``unit``, ones that the compiler cannot see: a fusion barrier.

    XLA's CPU compiler fuses producers into every consumer and so computes a stage, or the verdict
    on a step, again for each of its uses; it never duplicates a floating-point division.
    (`lax.optimization_barrier` does not stop it, and a division by a broadcast scalar is turned
    into a product, which is duplicated: hence an array (ROWS, ...) in the loop carry.) Truth values
    and small integers travel as floats. A test on the size of the compiled program guards this.
    """

    def barrier(x):
        rows = unit[: x.shape[0]] if x.ndim == unit.ndim else unit[0]
        if jnp.issubdtype(x.dtype, jnp.floating):
            return x / rows.astype(x.dtype)
        value = x.astype(unit.dtype) / rows
        return value > 0.5 if x.dtype == bool else jnp.round(value).astype(x.dtype)

    return jtu.tree_map(barrier, tree)
