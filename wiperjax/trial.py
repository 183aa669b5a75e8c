"""A trial step: the Runge-Kutta step, its error, and what the guards do along it.

Everything is elementwise, so the same code serves one trajectory (scalars) and a batch (one entry
a lane); nodes of the step and slots of the guards are tuples, which a compiler takes apart.
"""

from functools import reduce
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.lax import stop_gradient

from .barrier import keep
from .fastmath import exp, larger, log, smaller, within
from .guards import FIRST, JAM, SECOND, guard_values
from .polynomials import (
    control_values,
    deflated,
    descent_cut,
    interpolation_error,
    largest,
    minimum,
    power_of,
)
from .regimes import Forces, acceleration, forces
from .results import Regime
from .sparse import absent, plus, times
from .stages import NODES, Step, node_states, rk_step
from .state import TERM, Problem, State
from .system import Contact, Scalar, contact, rates

LEAST_GROWTH = 0.2  # of a step over the last one, as the controller may ask for
ROUNDINGS = 2  # last digits of a position that its rates may be uncertain by
NOISE = {"float64": 256, "float32": 8}  # rounding errors of a guard, in digits of its size


class Node(NamedTuple):
    """The motion at one instant of a step."""

    time: Scalar
    position: tuple
    velocity: tuple
    forces: Forces


class Guard(NamedTuple):
    """What one guard does along a trial step."""

    value: Scalar  # at the end of the step (differentiable)
    slope: Scalar  # d/dtheta there
    control: tuple  # Bernstein control values of the deflated guard, less its error estimate
    start: Scalar  # deflated value at the start
    blur: Scalar  # its error estimate,
    error: Scalar  # the same before it was set aside as rounding
    cut: Scalar  # lower bound of the first zero
    proved: Scalar  # it has no zero in the step
    falls: Scalar  # it is violated from the start of the step on
    size: Scalar  # so far, this step included
    noise: Scalar  # what it may be off by rounding
    nodes: tuple  # values at the nodes


class Trial(NamedTuple):
    """Everything a trial step of size ``h`` tells."""

    h: Scalar
    lands: Scalar  # it ends on a known time (``mark``)
    braking: Scalar  # slip is just in front of D = 0 under load (MODEL.md section 7)
    mark: Scalar
    step: Step
    ok: Scalar  # finite and within the tolerance
    next_step: Scalar  # the controller's proposal
    error: Scalar  # relative to the tolerance
    finite: Scalar
    nodes: tuple[Node, ...]  # at `NODES`
    last: Contact  # contact space at the end, in this regime
    guards: tuple[Guard, ...]  # one a slot


def error_norm(problem: Problem, state: State, step: Step, h, share):
    """Largest ratio of the error estimate to atol + rtol |y| over the coordinates.

    The largest, not the mean: in contact half of the wiper's coordinates rest and would dilute it.
    What is rounding in the estimate does not count (``share``: see `rounding_share`), for no
    shorter step would lower it: without that, steps in single precision shrink to nothing behind a
    stiff shoulder.
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


def rounding_share(problem: Problem, state: State, y1) -> Scalar:
    """Return the last digit of the position over the way that it goes in a step to ``y1``, at most
    1: of all that changes along the step with the position, this share is rounding.
    """
    if state.position[0].dtype == jnp.float64:  # below any tolerance, and not free
        return 0.0
    scales = [a / problem.rtol for a in problem.atol[0]]
    ends = zip(state.position, y1[0], scales, strict=True)
    way = largest(tuple((z - y) / s for y, z, s in ends))
    reach = largest(tuple(y / s for y, s in zip(state.position, scales, strict=True)))
    digit = ROUNDINGS * float(jnp.finfo(reach.dtype).eps) * reach
    return stop_gradient(digit / larger(larger(way, digit), 1e-30))


def rate_noise(state: State, step: Step, share) -> list[Scalar]:
    """Return the rounding errors of the rates, one a coordinate."""
    rates = zip(jax.tree.leaves(state.rate), jax.tree.leaves(step.rate1), strict=True)
    return [times(share, jnp.abs(y - x)) for x, y in rates]


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


def trial_size(problem: Problem, state: State):
    """Return (step, whether it lands on a known time, that time, whether hardly any is left)."""
    mark = smaller(problem.end, problem.system.break_time(state.piece)).astype(state.time.dtype)
    mark = jnp.where(problem.mark > state.time, smaller(problem.mark, mark), mark)
    to_mark = mark - state.time
    # a rest that the clock cannot divide: an event in it fires after the mark, if ever
    sliver = to_mark <= 4 * jnp.finfo(mark.dtype).eps * jnp.abs(mark)
    wanted = stop_gradient(jnp.where(state.target >= 0, state.trial, state.step))
    wanted = jnp.where(state.time >= problem.mark, smaller(wanted, problem.max_step), wanted)
    # a sliver left over before a known time would be a step of rounding errors only
    lands = wanted >= to_mark * (1 - 1e-9)
    return keep((jnp.where(lands, to_mark, wanted), lands, mark, sliver))


def attempt(problem: Problem, state: State) -> Trial:
    """Return the trial step from ``state``; nothing is committed."""
    system, solver = problem.system.on_piece(state.piece).on_sides(state.sides), problem.solver
    y0 = (state.position, state.velocity)
    h, lands, mark, sliver = trial_size(problem, state)

    def look(t, q, v) -> tuple[Node, Contact, tuple]:
        """The motion at an instant, its contact, and its guards."""
        c = contact(system, t, q, v)
        reactions = forces(system, c, state.regime)
        values = guard_values(system, c, t, q, v, state.regime, state.sides)
        return Node(t, q, v, reactions), c, keep(values)

    def arrive(t, y):
        node, c, values = look(t, *y)
        rate = keep((rates(system, t, *y), acceleration(c, node.forces)))
        return rate, (node, c, values)

    args = (system, state.regime)
    step = rk_step(solver, TERM, state.time, y0, h, state.rate, args, arrive, state.rest)
    last_node, last, end_values = step.end

    inner = zip(NODES[1:-1], keep(node_states(solver, y0, step)), strict=True)
    looks = [look(state.time + theta * h, *y) for theta, y in inner]
    nodes = (
        Node(state.time, state.position, state.velocity, state.reactions),
        *(node for node, _, _ in looks),
        last_node,
    )
    slots = zip(state.guards, *(values for _, _, values in looks), end_values, strict=True)
    share = keep(rounding_share(problem, state, step.y1))
    guards = tuple(
        keep(examine(values, order, size, share, sliver, 3 if slot == FIRST else 1))
        for slot, (values, order, size) in enumerate(
            zip(slots, state.orders, state.reach, strict=True)
        )
    )

    error = keep(stop_gradient(error_norm(problem, state, step, h, share)))
    # a guard that is no number somewhere has an error that is none
    finite = jnp.isfinite(error) & jnp.isfinite(sum(g.error for g in guards))
    for leaf in jax.tree.leaves(step.y1):
        finite = finite & jnp.isfinite(leaf)
    ok = finite & (error <= 1) & state.active  # other lanes of a batch stay put
    order = solver.order(TERM)
    assert order is not None  # check_solver: a Runge-Kutta pair
    error = jnp.where(finite, larger(error, 1e-8), 1e10)
    # infinite after an event; of a step cut short for other reasons the rule learns nothing
    least = larger(LEAST_GROWTH * state.last_step, jnp.finfo(h.dtype).tiny)
    growth = larger(stop_gradient(h), least) / state.last_step
    factor = step_factor(error, state.last_error, growth, ok, order)
    next_step = stop_gradient(h) * factor.astype(h.dtype)
    ok, finite, error, next_step = keep((ok, finite, error, next_step))
    return Trial(
        h=h,
        lands=lands,
        braking=_braking(problem, state),
        mark=mark,
        step=step,
        ok=ok,
        next_step=next_step,
        error=error,
        finite=finite,
        nodes=nodes,
        last=last,
        guards=guards,
    )


def guard_noise(nodes, size, share) -> Scalar:
    """Return what a guard of ``size`` may be off by rounding: its own, and that of the position
    that it is taken at, which counts where the guard is steep.
    """
    own = NOISE[size.dtype.name] * float(jnp.finfo(size.dtype).eps) * size
    if absent(share):
        return own
    return own + share * largest(tuple(x - nodes[0] for x in nodes[1:]))


def examine(values, order, size, share, sliver, highest: int) -> Guard:
    """Return what a guard with ``values`` at the nodes does.

    ``order``, at most ``highest``, is its zero at the start; ``size`` is the largest that was
    committed so far: what its rounding errors scale with. ``share``: see `rounding_share`.
    ``sliver``: hardly any time is left before a known time, and no event fires in it.
    """
    nodes = tuple(stop_gradient(x) for x in values)
    noise = rounding = guard_noise(nodes, size, share)
    # A guard within its own rounding errors of zero says nothing by its sign: it is treated like
    # one that starts at zero, by the way it goes.
    order = jnp.where((order == 0) & (jnp.abs(nodes[0]) <= noise), 1, order)
    noise = noise * power_of(10.0, order, highest).astype(noise.dtype)
    start, *rest = deflated(nodes, order, highest)
    order, rounding, noise, start, rest = keep((order, rounding, noise, start, rest))
    height = largest(rest)
    if highest > 1:
        # A double or triple zero is left upwards by construction (release, lift-off). Its event was
        # located to within the tolerance, so a hair's breadth downwards is not a new event.
        upwards = (order >= 2) & (start > -0.05 * height)
        start = jnp.where(upwards, larger(start, 1e-6 * height), start)
    # Only a guard that goes down from its zero all along counts as violated there; an extrapolation
    # that merely turns negative asks for a shorter step.
    top = rest[0]
    for x in rest[1:]:
        top = larger(top, x)
    falls = (top <= 0) & (start <= -0.5 * height)
    falls = jnp.where(order == 0, start <= 0, falls & (start < -noise))
    quotient = (start, *rest)
    control, error = keep((control_values(quotient), interpolation_error(quotient, order)))
    low = minimum(control)
    proved = (low > error) | ((order > 0) & (low > -noise) & (error <= noise)) | sliver
    # below this the estimate is rounding: the polynomial itself decides
    floor = larger(1e-9 * larger(height, jnp.abs(start)), noise)
    blur = jnp.where(error > floor, error, 0.0)
    control, blur, start = keep((tuple(b - blur for b in control), blur, start))
    return Guard(
        value=values[-1],
        # of theta^m p(theta), at 1
        slope=order * nodes[-1] + (len(control) - 1) * (control[-1] - control[-2]),
        control=control,
        start=start,
        blur=blur,
        error=error,
        cut=descent_cut(control),
        proved=proved,
        falls=falls,
        size=larger(size, jnp.abs(nodes[-1])),
        noise=rounding,
        nodes=nodes,
    )


def _braking(problem: Problem, state: State):
    """True where slip runs into D = 0 under load: the normal force grows without bound there, so
    that steps shrink to nothing in front of it and never reach it."""
    if not problem.system.coupled:
        return jnp.zeros_like(state.flagged)
    sliding = (state.regime == Regime.SLIP_POS) | (state.regime == Regime.SLIP_NEG)
    d, pressing = state.guards[JAM], state.guards[SECOND]
    near = (d > 0) & (d < 1e-2) & (pressing > 0)
    return sliding & near & state.active


def pick(slots, index):
    """Entry ``index`` (traced, one a lane) of a tuple; entries may be tuples of the same shape."""
    out = slots[0]
    for i, entry in enumerate(slots[1:], 1):
        out = jax.tree.map(lambda a, b, i=i: jnp.where(index == i, b, a), out, entry)
    return out
