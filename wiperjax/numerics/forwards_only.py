"""What is differentiated forwards, and says so where it is asked backwards.

JAX refuses the loop of a motion by itself, but by the name of a loop that no caller has seen.
"""

from typing import Any

import equinox as eqx
import jax
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir

_tangent = Primitive("forwards_only")  # the identity, at no cost in what is compiled
_tangent.def_impl(lambda x, **_: x)
_tangent.def_abstract_eval(lambda x, **_: x)
batching.defvectorized(_tangent)
mlir.register_lowering(_tangent, lambda _, x, **__: [x])


def _refuse(cotangent, tangent, instead: str):
    raise ValueError(instead)


ad.deflinear2(_tangent, _refuse)


def forwards_only(tree: Any, instead: str) -> Any:
    """Return ``tree``, whose derivatives backwards are a ValueError that says ``instead``."""

    @jax.custom_jvp
    def same(x):
        return x

    @same.defjvp
    def _same_jvp(primals, tangents):
        return *primals, _tangent.bind(*tangents, instead=instead)

    return jax.tree.map(lambda x: same(x) if eqx.is_inexact_array(x) else x, tree)
