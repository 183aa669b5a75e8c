"""Truth values as wide as the numbers that they choose between.

A program holds a truth value as a byte, and an enumeration as 32 bits. A processor without mask
registers chooses between numbers of 64 bits by masks of 64 bits: it unpacks each value that is read
and packs each that is written, which is a sixth of the instructions of a turn of many lanes (AVX2:
1,500 of 9,100 of a flow and a jump, counted in the machine code; with wide masks 500). Here a
traced program is written anew, with integers as wide as its numbers in place of both: -1 is true,
0 false. What is computed stays the same.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jax import lax
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal, jaxpr_as_fun, jaxprs_in_params

from ..machine.jax_settings import mask_registers

SHORT = 4  # operations that are copied sooner than called, as those of `jax.numpy.where`
BOOL, INT32 = np.dtype("bool"), np.dtype("int32")
NARROW = {BOOL, INT32}
# what is the same of wide integers: bits and places of both kinds, and, unless it overflows, what
# is computed of whole numbers (the larger of two masks is not that of two truth values)
OF_BOTH = {"and", "or", "xor", "not", "broadcast_in_dim", "reshape", "squeeze"}
OF_NUMBERS = {"add", "sub", "neg", "max", "min", "eq", "ne", "lt", "le", "gt", "ge"}


def width_for(number):
    """Return the dtype of masks that choose between numbers like ``number``; None where narrow ones
    are as good."""
    if jax.default_backend() != "cpu" or mask_registers():
        return None
    return np.dtype(f"int{8 * number.dtype.itemsize}")


def widened(tree, width) -> Any:
    """Return ``tree`` with integers of ``width``, as `width_for` gives it, in place of truth values
    and of 32-bit integers."""
    return tree if width is None else jax.tree.map(partial(_widened, width=width), tree)


def narrowed(tree, model) -> Any:
    """Return a `widened` tree with the dtypes of ``model``."""
    return jax.tree.map(lambda x, like: _narrowed(x, like.dtype), tree, model)


def with_wide_masks(step: Callable, model, width) -> Callable:
    """Return ``step(parameters, state)``, which returns a state, for states that are `widened`.

    ``model`` is a state as ``step`` takes it; ``parameters`` stay as they are. Derivatives pass
    through.
    """
    if width is None:
        return step

    def wide(parameters, state):
        arrays, rest = eqx.partition(parameters, eqx.is_array)

        def plain(arrays, state):
            return step(eqx.combine(arrays, rest), state)

        shapes = jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape, x.dtype), (arrays, model))
        program = jax.make_jaxpr(plain)(*shapes)
        given = [*jax.tree.leaves(widened(arrays, width)), *jax.tree.leaves(state)]
        found = _Rewriting(width).run(program, *given)
        return jax.tree.unflatten(jax.tree.structure(state), found)

    return wide


# `lax`, not `jax.numpy`: thousands of operations are written anew


def _widened(x, width):
    if x.dtype == BOOL:
        return _chosen(x, -1, 0, width)
    return lax.convert_element_type(x, width) if x.dtype == INT32 else x


def _written(literal: Literal, width) -> np.ndarray:
    """What `_widened` gives of a number that stands in a program, as one that stands in it."""
    value = np.asarray(literal.val, _dtype(literal))
    if value.dtype not in NARROW:
        return value
    return -value.astype(width) if value.dtype == BOOL else value.astype(width)


def _dtype(variable) -> np.dtype:
    return variable.aval.dtype


def _narrowed(x, dtype):
    if x.dtype == dtype:
        return x
    return _holds(x) if dtype == BOOL else lax.convert_element_type(x, dtype)


def _holds(mask):
    return lax.lt(mask, lax.full_like(mask, 0))


def _chosen(holds, yes, no, dtype):
    return lax.select(holds, *(lax.full(np.shape(holds), x, dtype) for x in (yes, no)))


class _Rewriting:
    """A traced program, and those that it calls, with wide integers; each is traced once."""

    def __init__(self, width):
        self.width = width
        self.called: dict[int, tuple[ClosedJaxpr, Callable]] = {}  # by identity, kept alive

    def run(self, program: ClosedJaxpr, *given) -> list:
        """Return the results of ``program``, `widened`, as its arguments are."""
        jaxpr, width = program.jaxpr, self.width
        known = dict(zip(jaxpr.constvars, widened(program.consts, width), strict=True))
        known |= dict(zip(jaxpr.invars, given, strict=True))

        def read(x):
            return _written(x, width) if isinstance(x, Literal) else known[x]

        for equation in jaxpr.eqns:
            with equation.ctx.manager:  # what `fusion_barrier` says of a call
                found = self.evaluate(jaxpr, equation, [read(x) for x in equation.invars])
            known |= dict(zip(equation.outvars, found, strict=True))
        return [read(x) for x in jaxpr.outvars]

    def evaluate(self, jaxpr: Jaxpr, equation: JaxprEqn, values: list) -> list:
        """Return the results of one operation of ``jaxpr``."""
        name, width = equation.primitive.name, self.width
        were, become = ([*map(_dtype, xs)] for xs in (equation.invars, equation.outvars))
        if name == "jit":
            return self.call(equation.params["jaxpr"], values)
        if NARROW.intersection(were):
            if name == "select_n" and were[0] == BOOL:
                return [lax.select_n(_holds(values[0]), *values[1:])]
            if name == "convert_element_type" and were[0] == BOOL and become[0] != BOOL:
                to = width if become[0] == INT32 else become[0]
                return [_chosen(_holds(values[0]), 1, 0, to)]
            if not (name in OF_BOTH or name in OF_NUMBERS and BOOL not in were):
                values = [_narrowed(x, dtype) for x, dtype in zip(values, were, strict=True)]
        if [*jaxprs_in_params(equation.params)]:  # as where a derivative has a rule of its own
            found = _alone(jaxpr, equation)(*values)
        else:
            found = equation.primitive.bind(*values, **equation.params)
            found = found if equation.primitive.multiple_results else [found]
        return [_widened(x, width) for x in found] if NARROW.intersection(become) else found

    def call(self, program: ClosedJaxpr, values: list) -> list:
        """Return the results of a called ``program``: by a call, too, unless it is short. (One
        without operations is a fusion barrier.)"""
        if 0 < len(program.jaxpr.eqns) < SHORT:
            return self.run(program, *values)
        if id(program) not in self.called:
            self.called[id(program)] = program, jax.jit(partial(self.run, program))
        return self.called[id(program)][1](*values)


def _alone(jaxpr: Jaxpr, equation: JaxprEqn) -> Callable:
    """Return a function of all operands of an operation of ``jaxpr`` that returns its results."""
    operands = {x: None for x in equation.invars if not isinstance(x, Literal)}
    parts = {"invars": [*operands], "outvars": equation.outvars, "eqns": [equation]}
    unnamed = jaxpr.debug_info._replace(arg_names=None, result_paths=None)
    alone = jaxpr.replace(constvars=[], debug_info=unnamed, **parts)
    run = jaxpr_as_fun(ClosedJaxpr(alone, ()))

    def compute(*values):
        given = zip(equation.invars, values, strict=True)
        return run(*{x: value for x, value in given if not isinstance(x, Literal)}.values())

    return compute
