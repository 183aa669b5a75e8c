"""Numbers of a system, its belt and its law: which fields they are, and in which precision."""

from collections.abc import Callable, Iterator
from dataclasses import fields
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..numerics.arrays import fields_of
from ..numerics.tracing import is_staged
from ..vocabulary.checks import is_traced
from ..vocabulary.declared import marked
from ..vocabulary.kinds import BELTS, FRICTIONS, is_absent, of_fields
from ..vocabulary.wording import shown
from .system import AbstractSystem

S = TypeVar("S", bound=AbstractSystem)


def routes(system: AbstractSystem) -> dict[str, tuple[str, ...]]:
    """Parameter of files -> the fields that lead to it: of the system, its belt or its law."""
    known = {**marked(system), **system.known}
    own = (field.name for field in fields(system) if field.name not in system.idle)
    found = {name: (name,) for name in own if name in known}
    for field, kinds in (("belt", BELTS), ("friction", FRICTIONS)):
        part = getattr(system, field, None)
        if isinstance(part, eqx.Module):
            keys = kinds.get(getattr(part, "kind", "")) or {key: key for key in marked(part)}
            found |= {name: (field, key) for key, name in keys.items()}
    return found


def numbers(system: AbstractSystem) -> set[str]:
    """Return the fields of a system that are numbers: its parameters, and those of type float."""
    declared = {".".join(route) for route in routes(system).values()}
    return declared | {".".join(route) for route in _floats(system)}


def check_known(system: AbstractSystem) -> None:
    """Raises ValueError within `jax.jit`, `jax.vmap` and derivatives, where numbers are not known
    to what computes on the host."""
    if is_staged() or any(map(is_traced, jax.tree.leaves(system))):
        must = "must be given outside of jax.jit, jax.vmap and derivatives"
        raise ValueError(f"system {must} (wiperjax.solve works there), but was within one of them")


def check_single(system: AbstractSystem, known: bool = True) -> None:
    """Raises ValueError for a system with an array in place of a number, which is a batch; unless
    its numbers need not be ``known``, as `check_known` too."""
    if known:
        check_known(system)
    for name in sorted(numbers(system)):
        if np.ndim(found := at(tuple(name.split(".")))(system)):
            raise ValueError(
                f"system must have one number as {name}, a float, but had {shown(found)}"
            )


def in_full(system: S) -> S:
    """Return ``system`` with its numbers in full precision, whatever type they were given in.

    JAX computes in the type of a number: the reciprocal of a float32 has the digits of one, and
    the negative of a uint8 1 is 255. NumPy's scalars become Python's, which have no type there;
    whole numbers in arrays stay where they are no number of the system (an index).
    """
    known = numbers(system)

    def leaf(path, x):
        to, kind = fields_of(path), getattr(getattr(x, "dtype", None), "kind", "-")
        counts = kind == "f" or (kind in "iu" and (".".join(to) in known or of_fields(to)))
        if isinstance(x, np.generic):
            return float(x) if counts else x.item()
        return jnp.asarray(x, float) if counts and x.dtype != float else x

    return jax.tree_util.tree_map_with_path(leaf, system)


def as_arguments(system: S) -> S:
    """Return ``system`` with its numbers as arrays: one compiled program serves all their values.

    A Python number whose terms are then not computed at all stays one (`kinds.is_absent`: no
    hinge mass, say, or any 0 of a system of one's own).
    """

    def leaf(path, x):
        to = fields_of(path)
        number = isinstance(x, float) or (isinstance(x, int) and of_fields(to))
        counts = number and not is_absent(to, float(x), (0,))
        return jnp.asarray(x, float) if counts or isinstance(x, np.ndarray) else x

    return jax.tree_util.tree_map_with_path(leaf, in_full(system))


def at(route: tuple[str, ...]) -> Callable[[Any], Any]:
    """Return the function that takes from a tree what the fields ``route`` lead to."""

    def where(tree: Any) -> Any:
        for key in route:
            tree = getattr(tree, key)
        return tree

    return where


def _floats(module: eqx.Module, before: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    for field in fields(module):  # type: ignore[arg-type]
        inner, route = getattr(module, field.name), (*before, field.name)
        if isinstance(inner, eqx.Module):
            yield from _floats(inner, route)
        elif field.type in (float, "float"):
            yield route
