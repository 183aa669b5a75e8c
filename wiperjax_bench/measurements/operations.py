"""Operations and bytes of a traced program, counted.

Additions, multiplications, divisions, roots and functions are operations; comparisons and selects
are counted apart.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

FLOPS = {"add", "sub", "mul", "div", "sqrt", "rsqrt", "exp", "exp2", "log", "sin", "cos", "pow",
         "integer_pow", "neg", "add_any", "square", "round", "floor", "asin", "tan", "log1p",
         "expm1"}  # fmt: skip
CHOICES = {"select_n", "max", "min", "lt", "le", "gt", "ge", "eq", "ne", "and", "or", "not",
           "abs", "sign", "clamp", "is_finite"}  # fmt: skip


class Work(NamedTuple):
    """Operations of one execution of a program on its arrays, loops counted once."""

    flops: int
    choices: int
    memory: int  # bytes of all operands and results, were nothing kept in registers

    def __add__(self, other):  # type: ignore[override]
        return Work(*(a + b for a, b in zip(self, other, strict=True)))


def count(jaxpr) -> Work:
    """Return the work of a jaxpr and of everything it calls; the body of a loop counts once."""
    total = Work(0, 0, 0)
    for equation in jaxpr.eqns:
        inner = [_jaxpr(p) for v in equation.params.values() for p in _many(v)]
        inner = [p for p in inner if p is not None]
        if inner:
            for part in inner:
                total += count(part)
            continue
        out = equation.outvars[0].aval
        size = int(np.prod(getattr(out, "shape", ())))
        floating = jnp.issubdtype(getattr(out, "dtype", bool), jnp.floating)
        name = equation.primitive.name
        moved = sum(
            int(np.prod(v.aval.shape)) * v.aval.dtype.itemsize
            for v in (*equation.invars, *equation.outvars)
            if hasattr(v.aval, "shape")
        )
        total += Work(
            size * (name in FLOPS and floating), size * (name in CHOICES), moved * (size > 1)
        )
    return total


def _many(value):
    return value if isinstance(value, tuple | list) else (value,)


def _jaxpr(value):
    value = getattr(value, "jaxpr", value)
    return value if hasattr(value, "eqns") else None
