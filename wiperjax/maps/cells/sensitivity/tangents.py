"""Tangents of cells: one trajectory with its derivatives by the parameters of a sweep."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ....blade.steady_slip import judged_slip
from ....blade.wiper import Wiper
from ....contact.own_numbers import at
from ....contact.system import AbstractSystem
from ....numerics.kept import Kept
from ....specs.tables import Start
from ....systems.build import Built, belt_of, build, start_at
from .. import batch
from ..batch import Run, Settings
from ..columns import ended, statistics

LARGEST = {  # outcomes that are largest values, by their names in `margins.Peaks`
    "normal_force_max": "normal_force_max",
    "gap_max": "gap_max",
    "impulse_max": "impact_impulse_max",
}


SECOND = {field: f"second_{field}" for field in LARGEST}  # and what comes next


def with_parameters(
    system: AbstractSystem, ways: dict[str, tuple[str, ...]], values: dict[str, Any]
) -> AbstractSystem:
    """Return ``system`` with the parameters ``values``, name -> SI value, put in where the ``ways``
    (`build.routes`) lead."""

    def leaves(s):
        return [at(ways[name])(s) for name in values]

    return eqx.tree_at(leaves, system, list(values.values()))


def check_fields(spec, ways, names) -> None:
    """Raises ValueError where a system makes other fields of its parameters when it is made: a
    parameter is differentiated in its place, and those would not follow.
    """
    given = spec.cells(np.array([0]))
    system = build(spec, given).system
    for name in names:
        step = 1e-6 * (np.abs(given[name]) + 1e-3)
        for moved in (given[name] + step, given[name] - step):
            try:
                made = build(spec, {**given, name: moved}).system
            except ValueError:  # beyond an end of what it may be
                continue
            if not eqx.tree_equal(made, with_parameters(system, ways, {name: moved})):
                must = f"must not name {name!r}: {spec.system} makes other fields of it"
                raise ValueError(f"sensitivities.parameters {must}, which would not follow")


def is_the_wiper(system: AbstractSystem) -> bool:
    """Whether a system is the wiper itself: one made of it, such as `SoftLip`, has the columns of a
    system of one's own."""
    return type(system) is Wiper


def found_of(system, outcome, window) -> dict[str, Any]:
    """Return what a trajectory leaves that has derivatives, and the runners-up of largest values,
    (cells,) each."""
    seconds = outcome.observed.seconds._asdict()
    found = statistics(outcome.observed, window) | {SECOND[k]: x for k, x in seconds.items()}
    return found | (ended(outcome, True) if is_the_wiper(system) else {})


@Kept
def tangents_of(system, ways, theta, state, seeds, count, run: Run, s: Settings):
    """Run the cells of one share with all tangents; slopes come as (cells, parameters)."""

    def motion(theta, state):
        moved = with_parameters(system, ways, theta)
        position, velocity = state
        rows, signal, effort = batch.outcomes(
            moved, position, velocity, count, run, s, watched=True
        )
        outcome = rows.tree()
        return found_of(system, outcome, run.window), (outcome, signal, effort)

    def push(dtheta, dstate):
        return jax.jvp(motion, (theta, state), (dtheta, dstate), has_aux=True)

    _, slopes, (outcome, signal, effort) = jax.vmap(push, out_axes=(None, -1, None))(*seeds)
    return outcome, slopes, signal, effort


@Kept
def plain(system, state, count, run: Run, s: Settings):
    """Run the cells of one share without tangents, whatever parameters are asked for."""
    position, velocity = state
    rows, _, effort = batch.outcomes(system, position, velocity, count, run, s, watched=True)
    outcome = rows.tree()
    return found_of(system, outcome, run.window), outcome.observed.word, effort


def starts_to_bounce(system, ways, theta) -> dict[str, np.ndarray]:
    """Return where a coefficient of restitution that is 0 grows with a parameter, name -> (cells,):
    the bounces that come then are not in the motion whose derivatives are taken."""

    def bounce(theta):
        size = next(iter(theta.values())).shape
        found = with_parameters(system, ways, theta).bounce
        return jnp.broadcast_to(jnp.asarray(found, float), size)

    still = jax.tree.map(jnp.zeros_like, theta)
    found = {}
    for name, value in theta.items():
        e, change = jax.jvp(bounce, (theta,), (still | {name: jnp.ones_like(value)},))
        found[name] = np.asarray((e == 0) & (change != 0))
    return found


@Kept
def start_of(system, ways, theta, stated: Start, names: tuple[str, ...]):
    """Return the initial state, as ``stated`` for coordinates of these ``names``, and the outcomes
    that need no trajectory, (cells,) each."""
    moved = with_parameters(system, ways, theta)
    belt = belt_of(moved)
    known = {} if belt is None else {"belt_speed_rms": belt.rms}
    wiper: Any = moved if is_the_wiper(moved) else None
    if wiper is not None:
        linear = judged_slip(wiper)
        known |= {"growth_rate": linear.growth_rate, "linear_frequency": linear.frequency}
    size = next(iter(theta.values())).shape[-1]
    state = start_at(Built(moved, wiper), stated, names)
    return jax.tree.map(lambda x: whole(x, size), (state, known))


@Kept
def start_with_tangents(system, ways, theta, seeds, stated: Start, names: tuple[str, ...]):
    """Return what `start_of` does, and the tangents of all of it, (parameters, cells) each.
    ``seeds``: changes of ``theta``, of the same shape."""

    def begin(theta):
        found = start_of.function(system, ways, theta, stated, names)
        return found, found

    def push(seed):
        return jax.jvp(begin, (theta,), (seed,), has_aux=True)

    _, tangents, found = jax.vmap(push, out_axes=(None, 0, None))(seeds)
    return found, tangents


def whole(value, size) -> jax.Array:
    return jnp.broadcast_to(jnp.asarray(value, jnp.float64), (size,))
