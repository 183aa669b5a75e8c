"""A wiper and its start from the parameters of one cell."""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np

from ..contact.belts import CLASSES as BELT_CLASSES
from ..contact.friction import CLASSES as LAW_CLASSES
from ..contact.friction import AbstractFriction
from ..specs.laws import Law, law_of
from ..specs.tables import Start
from ..vocabulary import checks
from ..vocabulary.codes import Regime, Result
from ..vocabulary.kinds import BELTS, LAW_PARAMETERS
from ..vocabulary.parameters import BLADE
from .steady_slip import map_shape, steady_slip
from .wiper import Wiper


def build_wiper(
    parameters: Mapping[str, Any], belt_kind: str, friction: str | Law = "stribeck"
) -> Wiper:
    """Return the wiper of ``parameters`` (SI units, radians) on a belt of ``belt_kind``, with the
    law ``friction``: a kind, or one that a file names.

    **Arguments:** ``parameters``, name -> value as `SweepSpec.cells` and `SceneSpec.parameters`
    give them: floats, or arrays with one entry a cell; left out: the reference value. They are
    kept as they are, so a float 0.0 (of ``hinge_mass``, say) stays one and its terms are skipped.

    Raises ValueError for an unknown kind or name, and for impossible values.
    """
    keys = BELTS[checks.choice("belt_kind", belt_kind, BELTS)]
    if isinstance(friction, str):
        friction = law_of("friction", friction)
    law = friction.keys
    own = {*BLADE} - LAW_PARAMETERS
    if strange := sorted(set(parameters) - own - {*keys.values(), *law.values()}):
        raise ValueError(
            f"parameters must suit belt_kind {belt_kind!r} and friction {friction.name!r}, "
            f"but had {strange[0]!r}"
        )
    if friction.name == "stribeck":  # the law that a wiper has by itself
        own, given = own | set(law.values()), None
    else:
        given = make_law(friction, parameters)
    belt = {key: parameters[name] for key, name in keys.items() if name in parameters}
    return Wiper(
        belt=BELT_CLASSES[belt_kind](**belt),
        friction=given,
        **{name: value for name, value in parameters.items() if name in own},
    )


def continued_state(wiper: Wiper, ended: Mapping[str, Any]):
    """Return ((x, y), (x', y')) [m, m/s] of motions that go on where others ``ended``, and whether
    they can: not where the other failed or collapsed.

    ``ended``: the columns ``result``, ``final_x``, ``final_y``, ``final_vx``, ``final_vy`` and
    ``final_regime`` of those, one entry a cell.

    What sticks rides on the glass at this belt's own speed; what touches it is on it exactly.
    """
    x, y, vx, vy = (jnp.asarray(ended[f"final_{key}"], float) for key in ("x", "y", "vx", "vy"))
    regime = jnp.asarray(ended["final_regime"])
    belt = wiper.belt
    glass = jnp.asarray(belt.velocity(0.0, belt.first_piece(jnp.asarray(0.0))))
    flies, sticks = regime == Regime.FLIGHT, regime == Regime.STICK
    goes_on = jnp.asarray(ended["result"]) == Result.FINISHED
    velocity = jnp.where(sticks, glass, vx), jnp.where(flies, vy, 0.0)
    return ((x, jnp.where(flies, y, 0.0)), velocity), goes_on


def make_law(law: Law, parameters: Mapping[str, Any]) -> AbstractFriction:
    """Return the friction law that a file names, of the numbers in ``parameters`` and, where one is
    left out, of its reference value.

    Raises ValueError, one line that names the law and the keys of files, for numbers that do not
    go together.
    """
    usual = {name: entry.reference for name, entry in law.parameters.items()}
    numbers = {key: parameters.get(name, usual[name]) for key, name in law.keys.items()}
    try:
        if law.default is not None:  # it may have more than numbers
            return replace(law.default, **numbers)
        return (law.found or LAW_CLASSES[law.name])(**numbers)
    except (TypeError, ValueError) as error:
        said = re.sub(r"\w+", lambda word: law.keys.get(word[0], word[0]), str(error))
        raise ValueError(f"friction = {law.name!r}: {said}") from error


def start_state(wiper: Wiper, start: Start):
    """Return ((x, y), (x', y')) [m, m/s] of a `Start`, each shaped as the wiper's parameters.

    An ``equilibrium`` start rests at steady slip (the branch that leans farthest along the belt's
    motion, for V at t = 0) plus that fraction of the lip length; NaN where there is no steady slip.
    """
    length, shape = wiper.lip_length, map_shape(wiper)
    position, velocity = wiper.default_state()
    if start.kind == "angle" and start.angle is not None:
        position = (length * np.sin(np.radians(start.angle)), 0.0)
    elif start.kind == "equilibrium" and start.equilibrium is not None:
        position = (steady_slip(wiper).x + start.equilibrium * length, 0.0)
    elif start.kind == "state" and start.position is not None:
        position, velocity = start.position, start.velocity or (0.0, 0.0)

    def full(pair):
        return tuple(jnp.broadcast_to(jnp.asarray(x, float), shape) for x in pair)

    return full(position), full(velocity)
