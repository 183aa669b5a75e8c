"""What has no derivative, and says so by a NaN wherever one is asked for, in either mode.

A tangent times NaN would do it forwards. Backwards it would make all derivatives NaN, also of
numbers that do not hang on this one: theirs come with a cotangent of 0, and 0 times NaN is NaN.
A primitive of its own, since `jax.custom_derivatives.linear_call` knows no `jax.vmap`.
"""

import jax
import jax.numpy as jnp
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir

_tangent = Primitive("unknown")  # of a change, and of where it is unknown, of one shape


def _change(change, where):
    return change * jnp.where(where, jnp.nan, 1.0).astype(change.dtype)


def _jvp(given, tangents):
    (change, where), (more, _) = given, tangents
    slope = more if isinstance(more, ad.Zero) else _tangent.bind(more, where)
    return _tangent.bind(change, where), slope


def _transpose(cotangent, change, where):
    if isinstance(cotangent, ad.Zero):
        return cotangent, None
    return jnp.where(cotangent == 0, cotangent, _tangent.bind(cotangent, where)), None


def _batch(given, axes):
    (size,) = {x.shape[axis] for x, axis in zip(given, axes, strict=True) if axis is not None}
    front = [batching.bdim_at_front(x, axis, size) for x, axis in zip(given, axes, strict=True)]
    return _tangent.bind(*front), 0


_tangent.def_impl(jax.jit(_change))
_tangent.def_abstract_eval(lambda change, _: change)
mlir.register_lowering(_tangent, mlir.lower_fun(_change, multiple_results=False))
ad.primitive_jvps[_tangent] = _jvp
ad.primitive_transposes[_tangent] = _transpose
batching.primitive_batchers[_tangent] = _batch


@jax.custom_jvp
def unknown(value, where):
    """Return ``value``; where so, its derivative is NaN."""
    return value


@unknown.defjvp
def _not_a_number(given, tangents):
    (value, where), (change, _) = given, tangents
    return value, _tangent.bind(change, jnp.broadcast_to(where, change.shape))
