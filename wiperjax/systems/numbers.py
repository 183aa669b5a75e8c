"""Numbers of a system by name: read one, replace one, or a direction to differentiate along.

A name is the path of a field, ``belt.speed`` or ``attack_angle``; the names of sweep files
(``belt_speed``) hold as well.
"""

from collections.abc import Callable, Mapping
from dataclasses import fields
from inspect import signature
from itertools import product
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..contact.own_numbers import as_arguments, at, numbers, routes
from ..contact.system import AbstractSystem
from ..numerics.arrays import fields_of
from ..vocabulary import checks
from ..vocabulary.declared import SET_BY_THE_ENGINE, marked
from ..vocabulary.parameters import PARAMETERS, Parameter
from ..vocabulary.wording import digits, shown


def path(system: AbstractSystem, name: str) -> tuple[str, ...]:
    """Return the fields that lead to the number ``name`` of ``system``.

    Raises ValueError, listing the names there are, if it has no such number.
    """
    names = routes(system)
    if not isinstance(name, str) or name not in names:
        names = {n: to for n, to in _names(system).items() if n not in system.idle} | names
    if not isinstance(name, str) or name not in names:
        raise ValueError(
            f"parameter must be a number of {type(system).__name__} ({', '.join(sorted(names))}), "
            f"but was {shown(name)}"
        )
    return names[name]


def known(system: AbstractSystem, name: str) -> Parameter | None:
    """Return what is known of the parameter of files ``name`` of ``system``, if anything is."""
    law = getattr(system, "friction", None)
    own = {**(marked(law) if law is not None else {}), **marked(system)}
    return own.get(name) or PARAMETERS.get(name)


def entry_of(system: AbstractSystem, name: str) -> Parameter | None:
    """Return what is known of the number ``name``, of a path as of a name of files, if anything is.

    Raises ValueError if ``system`` has no such number.
    """
    route = path(system, name)
    same = (each for each, to in routes(system).items() if to == route)
    return next((entry for each in same if (entry := known(system, each)) is not None), None)


def check_bounds(argument: str, system: AbstractSystem, bounds: Any) -> None:
    """Raises ValueError unless ``bounds``, name -> (low, high), are of numbers of ``system`` and
    both ends are what these may be, at all `check_corners` too; each by one of its names, for with
    two of them it would have two values and be paid for twice."""
    checks.bounds(argument, bounds)
    named: dict[tuple[str, ...], str] = {}
    for name in bounds:
        if (first := named.setdefault(path(system, name), name)) != name:
            must = f"{argument} must have each number once"
            raise ValueError(f"{must}, but {first} and {name} are names of one")
    for name, ends in bounds.items():
        if (entry := entry_of(system, name)) is not None:
            for end in ends:
                checks.parameter(f"{argument} of {name}", end, entry)
    check_corners(argument, system, bounds)


def check_corners(
    argument: str, system: AbstractSystem, bounds: Mapping[str, tuple[float, float]]
) -> None:
    """Raises ValueError where ``system``, its belt, its law or another part of it is none at some
    corner of ``bounds``, name -> (low, high): what one number may be can hang on another one
    (a ramp is half a period at most), and `replaced` asks no one.
    """
    parts: dict[tuple[str, ...], list[str]] = {}
    for name in bounds:
        parts.setdefault(path(system, name)[:-1], []).append(name)
    for name, ends in bounds.items():
        check_followed(argument, system, name, ends)
    for part, names in parts.items():
        for corner in product(*(bounds[name] for name in names)):
            changed = at(part)(system)
            for name, end in zip(names, corner, strict=True):
                key = path(system, name)[-1:]
                changed = eqx.tree_at(at(key), changed, float(end))
            try:
                _check_made(changed)
            except ValueError as error:
                pairs = zip(names, corner, strict=True)
                there = ", ".join(f"{name} = {digits(end)}" for name, end in pairs)
                must = f"{argument} must stay within what {type(changed).__name__} may be"
                raise ValueError(f"{must}, but at {there}: {error}") from None


def check_followed(
    argument: str, system: AbstractSystem, name: str, ends: tuple[float, float]
) -> None:
    """Raises ValueError where ``system`` makes other fields of the number ``name`` as it is made:
    `replaced` puts a number in its place, and those would not follow."""
    to = path(system, name)
    try:
        made = [
            eqx.tree_at(at(to), _made_anew(system, to, float(end)), 0.0) for end in (ends[0], *ends)
        ]
        differ = not eqx.tree_equal(*made[:2])  # a NaN, a function made anew: it tells nothing
        follows = differ or bool(eqx.tree_equal(*made))
    except Exception:  # it cannot be made of its fields, or not with such a number
        return
    if not follows:
        must = f"{argument} must not be of {name}: {type(system).__name__} makes other fields of it"
        raise ValueError(f"{must}, which would not follow; a property would")


def _made_anew(module: eqx.Module, to: tuple[str, ...], number: float) -> Any:
    """Return ``module``, made of its fields once more, with ``number`` at the end of ``to``."""
    first, *rest = to
    changed = _made_anew(getattr(module, first), tuple(rest), number) if rest else number
    taken = signature(type(module)).parameters.values()  # of an `__init__` of its own, too
    names = {each.name for each in taken}
    every = any(each.kind is each.VAR_KEYWORD for each in taken)
    init = (f.name for f in fields(module) if f.init and (every or f.name in names))
    given = {name: getattr(module, name) for name in init}
    return type(module)(**given | {first: changed})


def _check_made(module: eqx.Module) -> None:
    """Check ``module`` as it is checked when it is made."""
    for kind in type(module).__mro__:
        if (check := vars(kind).get("__check_init__")) is not None:
            check(module)


def value(system: AbstractSystem, name: str) -> float:
    """Return the number ``name`` of ``system``."""
    return float(np.asarray(at(path(system, name))(system)))


def replaced(system: AbstractSystem, name: str, number) -> AbstractSystem:
    """Return ``system`` with the number ``name`` replaced."""
    return eqx.tree_at(at(path(system, name)), system, jnp.asarray(number, float))


def traceable(system: AbstractSystem, *names: str) -> AbstractSystem:
    """Return ``system`` with its numbers `as_arguments` of a compiled program, all ``names`` among
    them."""
    system = as_arguments(system)
    for name in names:
        system = replaced(system, name, at(path(system, name))(system))
    return system


def direction(system: AbstractSystem, name: str | None):
    """Return the tangent of ``system`` along the number ``name`` (or zero): 1 there.

    It is 0 at its other numbers, so that one compiled program serves every direction, and None at
    what is no number, or is left out of the program: ``system`` must be `traceable` for ``name``.
    """
    known, route = numbers(system), None if name is None else path(system, name)
    one, zero = jnp.ones(()), jnp.zeros(())

    def leaf(keys, x):
        to = fields_of(keys)
        if not eqx.is_inexact_array(x) or (to != route and ".".join(to) not in known):
            return None
        part = one if to == route else zero
        return part if x.shape == () else jnp.broadcast_to(part, x.shape)

    return jax.tree_util.tree_map_with_path(leaf, system)


def moved(system: AbstractSystem, along: Any, number) -> AbstractSystem:
    """Return ``system`` with the number replaced that ``along``, a `direction`, tells: so that one
    compiled program serves all of them, where `replaced` has one for each."""

    def leaf(d, x):
        return x if d is None else jnp.where(d == 1, number, x)

    return jax.tree.map(leaf, along, system, is_leaf=lambda x: x is None)


def attributes(system: AbstractSystem, name: str) -> dict[str, str]:
    """Return the attributes of the number ``name`` as it is in code: in SI units and radians."""
    if (entry := entry_of(system, name)) is not None:
        return {"long_name": entry.long_name, "units": entry.unit}
    return {"long_name": ".".join(path(system, name))}


def stored(system: AbstractSystem, name: str) -> tuple[str, dict[str, str], Callable]:
    """Return how the number ``name`` is called in files, its attributes, and SI -> unit of files.

    Parameters of files have their names and units there (angles in degrees).
    """
    attrs = attributes(system, name)
    if (entry := entry_of(system, name)) is not None:
        return entry.name, attrs | {"units": entry.edge_unit}, entry.to_edge
    return "_".join(path(system, name)), attrs, lambda x: x


def words(system: AbstractSystem) -> dict[str, str]:
    """Return what the first coordinate and the output of ``system`` are called: ``position`` and
    ``velocity``."""
    if system.of_a_blade:
        return {"position": "tip position along the glass", "velocity": "tip velocity"}
    named = f"coordinate {system.coordinates[0]}" if system.coordinates else "first coordinate"
    return {"position": named, "velocity": "output velocity"}


def _names(module: eqx.Module, before: tuple[str, ...] = ()) -> dict[str, tuple[str, ...]]:
    found: dict[str, tuple[str, ...]] = {}
    for field in fields(module):  # type: ignore[arg-type]
        inner = getattr(module, field.name)
        route = (*before, field.name)
        if isinstance(inner, eqx.Module):
            found |= _names(inner, route)
        elif field.name not in SET_BY_THE_ENGINE and np.ndim(inner) == 0:
            if not isinstance(inner, bool | str | type(None)):
                found[".".join(route)] = route
    return found
