"""A fusion barrier that XLA's CPU compiler respects."""

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir

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
            return _divide(x, jnp.broadcast_to(rows.astype(x.dtype), x.shape))
        value = x.astype(unit.dtype) / rows
        return value > 0.5 if x.dtype == bool else jnp.round(value).astype(x.dtype)

    return jtu.tree_map(barrier, tree)


@jax.custom_jvp
def _divide(x, rows):
    return x / rows


@_divide.defjvp
def _divide_jvp(primals, tangents):
    x, rows = primals
    return _divide(x, rows), _hold_p.bind(tangents[0], rows)


# Several tangents of one state are a batch over it, and a division by ones without that batch would
# be one by a broadcast array again: `hold` divides by ones of the tangents' own shape. It is linear
# in its first argument, so that reverse mode goes through it.
_hold_p = Primitive("hold")
_hold_p.def_impl(lambda x, rows: x / rows)
_hold_p.def_abstract_eval(lambda x, rows: x)


def _lower(x, rows):
    # 0 x is opaque too: it could be NaN
    return x / (rows + 0.0 * x)


mlir.register_lowering(_hold_p, mlir.lower_fun(_lower, multiple_results=False))


def _jvp(primals, tangents):
    (x, rows), (dx, _) = primals, tangents
    out = _hold_p.bind(x, rows)
    return out, ad.Zero.from_primal_value(out) if isinstance(dx, ad.Zero) else _hold_p.bind(
        dx, rows
    )


ad.primitive_jvps[_hold_p] = _jvp
ad.primitive_transposes[_hold_p] = lambda ct, x, rows: (
    ct if isinstance(ct, ad.Zero) else _hold_p.bind(ct, rows),
    None,
)


def _batch(arguments, axes):
    x, rows = arguments
    size = next(a.shape[i] for a, i in zip(arguments, axes, strict=True) if i is not None)
    x, rows = (
        jnp.broadcast_to(a, (size, *a.shape)) if i is None else jnp.moveaxis(a, i, 0)
        for a, i in zip(arguments, axes, strict=True)
    )
    return _hold_p.bind(x, rows), 0


batching.primitive_batchers[_hold_p] = _batch
