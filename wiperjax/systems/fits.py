"""Whether a system of one's own says what the engine asks, before anything is computed."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..contact.system import AbstractSystem


def check(system: AbstractSystem, names: tuple[str, ...], position: tuple, velocity: tuple) -> None:
    """Raises ValueError, one line that names the method, unless each method of ``system`` answers
    at its start with as many numbers as it has coordinates ``names``.
    """
    n, kind = len(names), type(system).__name__
    for what, state in (("position", position), ("velocity", velocity)):
        if len(state) != n:
            must = f"must have {n} numbers ({', '.join(names)})"
            raise ValueError(f"start.{what} {must}, had {len(state)}")
    leaves = jax.tree.leaves((system, position, velocity))
    t = jnp.zeros(np.broadcast_shapes(*(np.shape(leaf) for leaf in leaves)))  # of the cells
    q, v = (tuple(x + t for x in part) for part in (position, velocity))
    system = system.on_piece(system.first_piece(t))
    _coordinates(f"{kind}.free_acceleration", system.free_acceleration, (t, q, v), n)
    for direction in _answer(f"{kind}.directions", system.directions, (t, q), 2):
        _length(f"{kind}.directions", "two lists of", direction, n)
    scales = _answer(f"{kind}.scales", lambda: system.scales(n), (), 2)
    for part in scales:
        _length(f"{kind}.scales", "two lists of", part, n)
    touches = ("gap", (t, q)) if system.unilateral else ("normal_force", (t, q, v))
    for name, given in (touches, ("slip_speed", (t, q, v)), ("output", (t, q, v))):
        _number(f"{kind}.{name}", getattr(system, name), given)
    if system.stops:
        _stops(kind, system, (t, q, v), n)


def _stops(kind: str, system: AbstractSystem, state: tuple, n: int) -> None:
    """Raises ValueError unless the stops are switches, and each has as many velocities behind it as
    there are coordinates."""
    count = len(_called(f"{kind}.switches", system.switches, state))
    for stop in system.stops:
        if stop not in range(count):
            must = f"must be places of its {count} switches, counted from 0"
            raise ValueError(f"{kind}.stops {must}, but were {system.stops}")

        def rebound(t, q, v, stop=stop):
            return system.rebound(stop, t, q, v, t > 0)

        _coordinates(f"{kind}.rebound", rebound, state, n)


def _called(name: str, method: Any, given: tuple) -> Any:
    try:
        return jax.eval_shape(method, *given)
    except NotImplementedError as error:
        raise ValueError(f"{name} is missing: {error}") from None
    except Exception as error:  # whatever it does wrong
        said = str(error).splitlines()[0] if str(error) else ""
        raise ValueError(f"{name} fails: {type(error).__name__}: {said}") from error


def _answer(name: str, method: Any, given: tuple, count: int) -> tuple:
    found = _called(name, method, given)
    if not isinstance(found, tuple | list) or len(found) != count:
        raise ValueError(f"{name} must return {count} tuples, one number a coordinate each")
    return tuple(found)


def _coordinates(name: str, method: Any, given: tuple, n: int) -> None:
    _length(name, "", _called(name, method, given), n)


def _length(name: str, what: str, found: Any, n: int) -> None:
    if not isinstance(found, tuple | list):
        had = "a single number or array"
    elif len(found) != n:
        had = f"{len(found)}"
    else:
        return
    must = f"must return {what} {n} numbers, one a coordinate".replace("  ", " ")
    raise ValueError(f"{name} {must}, but returned {had}")


def _number(name: str, method: Any, given: tuple) -> None:
    found = _called(name, method, given)
    if isinstance(found, tuple | list):
        raise ValueError(f"{name} must return a number, but returned {len(found)}")
