"""Barriers that XLA's CPU compiler respects: between fusions, and between compiled loops."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jax.experimental.xla_metadata import set_xla_metadata


@jax.jit
def _same(*arrays):
    return arrays


def keep(tree):
    """Return ``tree`` with its arrays computed once, however often they are used.

    XLA's CPU compiler fuses producers into every consumer, and so computes a stage, or the verdict
    on a step, again for each of its uses (measured: ten times the program, three times the time).
    `lax.optimization_barrier` does not stop it. A call that may not be inlined does: it is empty,
    and what goes in must exist. Values, derivatives and batching pass through; other processors
    fuse differently and are left alone. A test on the size of the compiled program guards this.
    """
    if jax.default_backend() != "cpu":
        return tree
    arrays, rest = eqx.partition(tree, eqx.is_array)
    leaves, structure = jax.tree.flatten(arrays)
    with set_xla_metadata(inlineable="false"):
        leaves = _same(*leaves)
    return eqx.combine(jax.tree.unflatten(structure, leaves), rest)


def apart(number):
    """Return ``number``; a loop that computes it so is not compiled as one function.

    By `jax_settings` a loop becomes one function, with all loops in it, unless there is something
    in it that has no place there, such as a sort. Of two long loops in a third that is best: as two
    functions a sweep's are compiled in a fifth less time, for a hundredth more when they run.
    """
    if jax.default_backend() != "cpu":
        return number
    return lax.sort(jnp.stack([number, number]))[0]
