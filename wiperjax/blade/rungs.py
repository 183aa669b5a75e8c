"""The model ladder: poorer models of the same blade, for the scenes that need no more.

    block   1 dof: the tip on a spring and dashpot, pressed on the glass by a constant force
    bar     1 dof: the lip without lift-off; its normal force is that of the constraint y = 0
    lip     2 dof: the full model (`Wiper`), with `hinge_mass` > 0 its richest form

Every rung is a system of the same engine, made from the same wiper by `on_rung`, so one scene or
sweep file runs on any of them. Their one coordinate is the tip's place x along the glass.
"""

import numpy as np

from ..contact.system import AbstractSystem
from ..vocabulary import checks
from ..vocabulary.kinds import MODELS
from .bar import Bar
from .block import Block, block_of
from .wiper import Wiper


def on_rung(wiper: Wiper, model: str) -> AbstractSystem:
    """Return the system of ``model`` (one of `MODELS`) that stands for ``wiper``.

    Raises ValueError for another name, and for a block or bar of a wiper with hinge mass: its
    normal force depends on the acceleration, which only the full model resolves.
    """
    checks.choice("model", model, MODELS)
    if model == "lip":
        return wiper
    if np.any(np.asarray(wiper.hinge_mass) != 0):
        raise ValueError(f"hinge_mass must be 0 with model {model!r}, but was {wiper.hinge_mass}")
    if model == "bar":
        return Bar(wiper)  # pyright: ignore[reportCallIssue] its belt is a property, not a field
    return block_of(wiper)


def start_on_rung(system: AbstractSystem, start, kind: str):
    """Return ((x, ...), (x', ...)) of a lip's start ((x, y), (x', y')) for ``system``.

    ``kind`` is that of a `specs.tables.Start`. The default start is phi = alpha for lip and bar. A
    block has no such place (its spring is that of the steadily leaning lip, far from there, and
    would throw it off): it starts at rest where its spring is relaxed.

    Raises ValueError for a start in the air on a rung that cannot leave the glass.
    """
    if isinstance(system, Wiper):
        return start
    if isinstance(system, Block) and kind == "default":
        return system.default_state()
    if any(np.any(np.asarray(part[1]) != 0) for part in start):
        raise ValueError("start must touch the glass at rest along y with model 'block' or 'bar'")
    return tuple(part[:1] for part in start)
