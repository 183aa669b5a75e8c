"""A system and its start, as a sweep or a scene file asks for them."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..blade.build import build_wiper, continued_state, make_law, start_state
from ..blade.rungs import on_rung, start_on_rung
from ..blade.steady_slip import map_shape
from ..blade.wiper import Wiper
from ..contact import fits, own_numbers
from ..contact.belts import CLASSES as BELT_CLASSES
from ..contact.belts import AbstractBelt
from ..contact.projection import kicked, put_back
from ..contact.system import AbstractSystem
from ..numerics.arrays import fields_of
from ..specs.declared import Declared
from ..specs.laws import law_of
from ..specs.system import System
from ..specs.tables import Start
from ..vocabulary import checks
from ..vocabulary.codes import Regime, Result
from ..vocabulary.kinds import BELTS
from .numbers import traceable


class Built(NamedTuple):
    """A system of some parameters.

    Attributes:
        system: what the engine runs.
        wiper: the blade that it stands for (`blade.rungs`); None of another system.
        shape: of its parameters, () or (cells,); None: of all that it holds.
    """

    system: AbstractSystem
    wiper: Wiper | None
    shape: tuple[int, ...] | None = None


def belt_of(system: AbstractSystem) -> AbstractBelt | None:
    """Return the belt of a system that has one, in its field ``belt``."""
    return getattr(system, "belt", None)


def build(spec: System, parameters: Mapping[str, Any]) -> Built:
    """Return the system of ``spec`` with ``parameters`` (SI units, radians): floats, or arrays with
    one entry a cell, as `SweepSpec.cells` and `SceneSpec.parameters` give them.

    Raises ValueError for values that the system refuses and, where there are arrays, for fields
    that have no place in a map.
    """
    made = _made(spec, parameters)._replace(shape=map_shape(parameters))
    if made.shape:
        first = {name: x[..., 0] if np.ndim(x) else x for name, x in parameters.items()}
        _check_fields(_made(spec, first).system)
    return made


def _check_fields(system: AbstractSystem) -> None:
    """Raises ValueError for a system of one cell that holds more than numbers: nothing could tell
    a table from what has one entry a cell, and one of as many points would be read as such.
    """
    for path, leaf in jax.tree_util.tree_leaves_with_path(system):
        if isinstance(leaf, bool) or (checks.is_number(leaf) and np.ndim(leaf) == 0):
            continue
        field, name = ".".join(fields_of(path)), type(system).__name__
        must = "must be a number, a tuple of them or static (equinox.field(static=True)) in a sweep"
        was = f"an array of shape {shape}" if (shape := np.shape(leaf)) else checks.shown(leaf)
        raise ValueError(f"system: field {field!r} of {name} {must}, but was {was}")


def _made(spec: System, parameters: Mapping[str, Any]) -> Built:
    family = spec.family
    if not isinstance(family, Declared):
        law = law_of("blade.friction", spec.blade.friction)
        wiper = build_wiper(parameters, spec.belt.kind, law)
        return Built(on_rung(wiper, spec.model), wiper)
    given = {name: parameters[name] for name in family.own}
    if (kind := family.belt_kind(spec)) is not None:
        keys = BELTS[kind].items()
        given["belt"] = BELT_CLASSES[kind](**{key: parameters[name] for key, name in keys})
    if (law := family.law(spec)) is not None:
        given["friction"] = make_law(law, parameters)
    try:
        return Built(family.found(**given), None)
    except TypeError as error:
        raise ValueError(
            f"system: {family.name} cannot be made of its parameters: {error}"
        ) from error


def routes(spec: System, built: Built) -> dict[str, tuple[str, ...]]:
    """Return, for each parameter of files, the fields that lead to it from the system."""
    family = spec.family
    if not isinstance(family, Declared):
        return own_numbers.routes(built.system)
    found = {name: (name,) for name in family.own}
    if (kind := family.belt_kind(spec)) is not None:
        found |= {name: ("belt", key) for key, name in BELTS[kind].items()}
    if (law := family.law(spec)) is not None:
        found |= {name: ("friction", key) for key, name in law.keys.items()}
    return found


def start(spec: System, built: Built, stated: Start | None = None):
    """Return (position, velocity), a tuple of n values each, of the start ``stated`` (default: that
    of ``spec``). An equilibrium that does not exist is NaN.

    Raises ValueError where the system has no start of its own and none is stated.
    """
    return start_at(built, spec.start if stated is None else stated, spec.family.coordinates)


def start_at(built: Built, stated: Start, names: tuple[str, ...]):
    """`start` of a system whose coordinates have these ``names``; it needs no more of a file."""
    system, wiper, shape = built
    if wiper is not None:
        if wiper.friction is not None:
            fits.check_law(wiper.friction, map_shape(wiper.friction))
        return start_on_rung(system, start_state(wiper, stated), stated.kind)
    if stated.position is not None:
        position, velocity = stated.position, stated.velocity or (0.0,) * len(stated.position)
        for what, state in (("position", position), ("velocity", velocity)):
            if len(state) != len(names):
                must = f"must have {len(names)} numbers ({', '.join(names)})"
                raise ValueError(f"start.{what} {must}, had {len(state)}")
    else:
        position, velocity = _default_state(system, len(names))
    shape = map_shape(system, position, velocity) if shape is None else shape
    fits.check(traceable(system), position, velocity, shape)
    return position, velocity


def _default_state(system: AbstractSystem, n: int) -> tuple[tuple, tuple]:
    try:
        found = system.default_state()
    except ValueError:
        must = "is missing; [start] must have it, for this system has no start of its own"
        raise ValueError(f"start.position: {must}") from None
    parts = found if isinstance(found, tuple | list) else ()
    lengths = [len(x) if isinstance(x, tuple | list) or np.ndim(x) else 0 for x in parts]
    if lengths != [n, n]:
        must = f"must return {n} positions and {n} velocities (coordinates), but returned"
        raise ValueError(f"{type(system).__name__}.default_state {must} {checks.shown(found)}")
    return found


def go_on(spec: System, built: Built, ended: Mapping[str, Any]):
    """Return the state (position, velocity) of motions that go on where others ``ended`` (columns
    `schema.ENDED`), and where they can: not where the other failed or the model ends. Of a system
    other than the wiper the first coordinate is moved by the column ``kick``, if there is one.
    """
    system, wiper, _ = built
    if wiper is not None:
        there, can = continued_state(wiper, ended)
        return start_on_rung(system, there, "state"), can
    position, rates = (
        tuple(jnp.asarray(ended[f"final_{key}"], float).T) for key in ("position", "velocity")
    )
    can = jnp.asarray(ended["result"]) == Result.FINISHED
    regime = jnp.asarray(ended["final_regime"])
    kick = jnp.asarray(ended.get("kick", 0.0))
    return _carried(system, position, rates, regime, kick), can


def _carried(system: AbstractSystem, q, rates, regime, kick):
    """Return (q, q') after a ``kick``, of what touches kept on its partner, and of what sticks
    moved as that moves now: a kick may be along the gap, and another cell's belt may have had
    another speed.
    """
    t = jnp.zeros_like(q[0])
    system = system.prepared()
    system = system.on_piece(system.first_piece(t))
    q = kicked(system, t, q, rates, kick)
    v = system.from_rates(t, q, rates)
    q, v = put_back(system, t, q, v, regime != Regime.FLIGHT, regime == Regime.STICK)
    return q, system.rates(t, q, v)
