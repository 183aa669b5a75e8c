"""Tangents of cells: one trajectory with its derivatives by the parameters of a sweep."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from ....blade import numbers
from ....blade.build import start_state
from ....blade.steady_slip import steady_slip
from ....blade.wiper import Wiper
from ....contact.belts import operating_speed
from .. import batch
from ..columns import ended, statistics

LARGEST = {  # outcomes that are largest values, by their names in `margins.Peaks`
    "normal_force_max": "normal_force_max",
    "gap_max": "gap_max",
    "impulse_max": "impact_impulse_max",
}


SECOND = {field: f"second_{field}" for field in LARGEST}  # and what comes next


def with_parameters(wiper: Wiper, values: dict[str, Any]) -> Wiper:
    """Return ``wiper`` with the parameters ``values``, name -> SI value, put in."""
    to = numbers.routes(wiper)

    def leaves(w):
        return [numbers.at(to[name])(w) for name in values]

    return eqx.tree_at(leaves, wiper, list(values.values()))


@eqx.filter_jit
def tangents_of(wiper, theta, state, seeds, count, limit, sampling, s):
    """Run the cells of one share with all tangents; slopes come as (cells, parameters)."""

    def run(theta, state):
        w = with_parameters(wiper, theta)
        position, velocity = state
        outcome, signal, effort = batch.outcomes(
            w, position, velocity, count, limit, sampling, s, watched=True
        )
        seconds = outcome.observed.seconds._asdict()
        found = statistics(outcome, s.window) | ended(outcome, True)
        found |= {SECOND[k]: x for k, x in seconds.items()}
        return found, (outcome, signal, effort)

    def push(dtheta, dstate):
        return jax.jvp(run, (theta, state), (dtheta, dstate), has_aux=True)

    _, slopes, (outcome, signal, effort) = jax.vmap(push, out_axes=(None, -1, None))(*seeds)
    return outcome, slopes, signal, effort


@eqx.filter_jit
def plain(wiper, theta, state, count, limit, sampling, s):
    w = with_parameters(wiper, theta)
    position, velocity = state
    outcome, _, effort = batch.outcomes(
        w, position, velocity, count, limit, sampling, s, watched=True
    )
    found = statistics(outcome, s.window) | ended(outcome, True)
    return found, outcome.observed.word, effort


def start_of(wiper, theta, spec):
    """Return the initial state, and the outcomes that need no trajectory, (cells,) each."""
    w = with_parameters(wiper, theta)
    linear = steady_slip(w, operating_speed(w.belt))
    known = {
        "belt_speed_rms": w.belt.rms,
        "growth_rate": linear.growth_rate,
        "linear_frequency": linear.frequency,
    }
    size = next(iter(theta.values())).shape[-1]
    state = start_state(w, spec.start)
    return jax.tree.map(lambda x: whole(x, size), (state, known))


def whole(value, size) -> jax.Array:
    return jnp.broadcast_to(jnp.asarray(value, jnp.float64), (size,))


def value_of(wiper: Wiper, name: str):
    return numbers.at(numbers.routes(wiper)[name])(wiper)
