"""Step control: a step's error over its tolerance, what of it is rounding, and the next step."""

from functools import reduce
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.lax import stop_gradient

from ...numerics.bernstein import largest
from ...numerics.elementary import exp, larger, log, smaller, within
from ...numerics.known_zeros import plus, times
from ...numerics.runge_kutta import Step
from ...numerics.types import Scalar
from ..carry.problem import Problem
from ..carry.state import TERM, State

LEAST_GROWTH = 0.2  # of a step over the last one, as the controller may ask for
ROUNDINGS = 2  # last digits of a position that its rates may be uncertain by


class Share(NamedTuple):
    """Last digit of the position over the way that it goes in a step, at most 1: of all that
    changes along the step with the position, this share is rounding. 0.0 in double precision.
    """

    net: Scalar  # of the way from the step's start to its end,
    path: Scalar  # and of the longer one that its speeds allow: it may turn round in between


def error_norm(problem: Problem, state: State, step: Step, h, share: Share):
    """Largest ratio of the error estimate to atol + rtol |y| over the coordinates.

    The largest, not the mean: in contact half of the wiper's coordinates rest and would dilute it.
    What is rounding in the estimate does not count (``share``), for no shorter step would lower
    it: without that, steps in single precision shrink to nothing behind a stiff shoulder.
    """
    y0 = (state.position, state.velocity)
    leaves = zip(
        jax.tree.leaves(step.error),
        jax.tree.leaves(y0),
        jax.tree.leaves(step.y1),
        jax.tree.leaves(problem.atol),
        rate_noise(state, step, share),
        strict=True,
    )
    h = h.astype(state.velocity[0].dtype)
    ratios = tuple(
        jnp.abs(e) / (a + problem.rtol * larger(jnp.abs(y), jnp.abs(z)) + plus(1e-30, times(h, n)))
        for e, y, z, a, n in leaves
    )
    return reduce(jnp.maximum, ratios)  # a NaN stays one


def rounding_share(problem: Problem, state: State, step: Step, h) -> Share:
    """Return the share of rounding in what changes along a step of ``h``."""
    if state.position[0].dtype == jnp.float64:  # below any tolerance, and not free
        return Share(0.0, 0.0)
    scales = [a / problem.rtol for a in problem.atol[0]]
    h = h.astype(state.position[0].dtype)
    ends = zip(state.position, step.y1[0], scales, strict=True)
    net = largest(tuple((z - y) / s for y, z, s in ends))
    speeds = zip(state.rate[0], step.rate1[0], scales, strict=True)
    path = larger(net, largest(tuple(h * x / s for u, w, s in speeds for x in (u, w))))
    reach = largest(tuple(y / s for y, s in zip(state.position, scales, strict=True)))
    digit = ROUNDINGS * float(jnp.finfo(reach.dtype).eps) * reach
    shares = (digit / larger(larger(way, digit), 1e-30) for way in (net, path))
    return Share(*map(stop_gradient, shares))


def rate_noise(state: State, step: Step, share: Share) -> list[Scalar]:
    """Return the rounding errors of the rates, one a coordinate."""
    rates = zip(jax.tree.leaves(state.rate), jax.tree.leaves(step.rate1), strict=True)
    return [times(share.net, jnp.abs(y - x)) for x, y in rates]


def step_factor(error, last_error, growth, ok, order: int):
    """Return next step over this one: the smaller of PI and predictive control (Gustafsson) where
    ``ok``, else the plain rule.

    ``growth``: this step over the last accepted one. Where friction steepens towards v_t = 0 the
    steps have to shrink at a steady rate: the plain rule has every other one refused there, PI
    control still a good part of them; the predictive rule expects the error to go on changing as it
    did. In single precision: a step size needs no more digits.
    """
    now, before, growth = (log(e.astype(jnp.float32)) for e in (error, last_error, growth))
    proportional = (0.4 * before - 0.7 * now) / order
    predictive = growth + (before - 2 * now) / order
    exponent = jnp.where(ok, smaller(proportional, predictive), -now / order)
    return within(0.2, 0.9 * exp(exponent), 5.0)


def propose(problem: Problem, state: State, h, error, ok) -> Scalar:
    """Return the step to try after one of ``h`` with ``error`` relative to the tolerance."""
    order = problem.solver.order(TERM)
    assert order is not None  # check_solver: a Runge-Kutta pair
    # infinite after an event; of a step cut short for other reasons the rule learns nothing
    least = larger(LEAST_GROWTH * state.last_step, jnp.finfo(h.dtype).tiny)
    growth = larger(h, least) / state.last_step
    return h * step_factor(error, state.last_error, growth, ok, order).astype(h.dtype)
