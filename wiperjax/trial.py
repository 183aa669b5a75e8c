"""A trial step: the Runge-Kutta step, its error, and what the guards do along it.

Everything is elementwise, so the same code serves one trajectory (scalars) and a batch (one entry
a lane, last axis); nodes of the step and slots of the guards are leading axes.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.lax import stop_gradient

from .barrier import keep
from .guards import JAM, SECOND, guard_values
from .polynomials import control_values, deflated, hull_cut, interpolation_error, minimum
from .regimes import Forces, forces
from .results import RUNNING, Regime
from .stages import NODES, Step, node_states, rk_step
from .state import TERM, Problem, State
from .system import Contact, Scalar, contact

NOISE = 256  # rounding errors of a guard, in units of its size's last digit


class Trial(NamedTuple):
    """Everything a trial step of size ``h`` tells."""

    h: Scalar
    lands: Scalar  # it ends on a known time (``mark``)
    jams: Scalar  # the step has shrunk to nothing in front of D = 0 (MODEL.md section 7)
    mark: Scalar
    step: Step
    ok: Scalar  # finite and within the tolerance
    next_step: Scalar  # the controller's proposal
    error: Scalar  # relative to the tolerance
    finite: Scalar
    # along the step, nodes first
    times: jax.Array
    positions: tuple
    velocities: tuple
    contact_forces: Forces
    last: Contact  # contact space at the end, in this regime
    # guards, slots first
    end_values: jax.Array  # at the end of the step (differentiable)
    end_slopes: jax.Array  # d/dtheta there
    controls: tuple  # Bernstein control values of the deflated guards, less their error estimates
    proved: jax.Array  # the guard has no zero in the step
    cuts: jax.Array  # lower bound of each guard's first zero
    starts: jax.Array  # deflated value at the start, and its error estimate
    blurs: jax.Array
    falls: jax.Array  # the guard is violated from the start of the step on
    sizes: jax.Array  # of each guard so far, this step included
    errors: jax.Array  # the estimate before it was set aside as rounding


def error_norm(problem: Problem, y0, step: Step):
    """Largest ratio of the error estimate to atol + rtol |y| over the coordinates.

    The largest, not the mean: in contact half of the wiper's coordinates rest and would dilute it.
    """
    leaves = zip(
        jax.tree.leaves(step.error),
        jax.tree.leaves(y0),
        jax.tree.leaves(step.y1),
        jax.tree.leaves(problem.atol),
        strict=True,
    )
    ratios = [
        jnp.abs(e) / (a + problem.rtol * jnp.maximum(jnp.abs(y), jnp.abs(z)) + 1e-30)
        for e, y, z, a in leaves
    ]
    return jnp.max(jnp.stack(ratios), axis=0)


def attempt(problem: Problem, state: State) -> Trial:
    """Return the trial step from ``state``; nothing is committed."""
    system, solver = problem.system.on_piece(state.piece).on_sides(state.sides), problem.solver
    y0 = (state.position, state.velocity)

    mark = jnp.minimum(problem.end, system.break_time(state.piece)).astype(state.time.dtype)
    mark = jnp.where(problem.mark > state.time, jnp.minimum(problem.mark, mark), mark)
    to_mark = mark - state.time
    # a rest that the clock cannot divide: an event in it fires after the mark, if ever
    sliver = 4 * jnp.finfo(mark.dtype).eps * jnp.abs(mark)
    wanted = stop_gradient(jnp.where(state.target >= 0, state.trial, state.step))
    wanted = jnp.where(state.time >= problem.mark, jnp.minimum(wanted, problem.max_step), wanted)
    # a sliver left over before a known time would be a step of rounding errors only
    lands = wanted >= to_mark * (1 - 1e-9)
    h = jnp.where(lands, to_mark, wanted)

    args = (system, state.regime, state.unit)
    unit = state.unit
    step = rk_step(solver, TERM, state.time, y0, h, state.rate, args, unit)
    error = keep(stop_gradient(error_norm(problem, y0, step)), unit)
    finite = jnp.isfinite(error)
    for leaf in jax.tree.leaves(step.y1):
        finite = finite & jnp.isfinite(leaf)
    ok = finite & (error <= 1) & (state.result == RUNNING)  # an ended lane of a batch stays put
    order = solver.order(TERM)
    assert order is not None  # check_solver: a Runge-Kutta pair
    error = jnp.where(finite, jnp.maximum(error, 1e-8), 1e10)
    # PI control (Gustafsson): the step shrinks steadily where friction steepens towards v_t = 0,
    # and the plain rule would have every other step refused there
    exponent = -(0.7 * jnp.log(error) - 0.4 * jnp.where(ok, jnp.log(state.last_error), 0.0)) / order
    plain = -jnp.log(error) / order
    factor = jnp.clip(0.9 * jnp.exp(jnp.where(ok, exponent, plain)), 0.2, 5.0)
    next_step = keep(stop_gradient(h) * factor.astype(h.dtype), unit)
    ok, finite = keep((ok, finite), unit)

    theta = jnp.reshape(jnp.asarray(NODES, h.dtype), (-1,) + (1,) * h.ndim)
    times = state.time + theta * h
    positions, velocities = keep(node_states(solver, y0, step), unit)
    c = keep(contact(system, times, positions, velocities, unit), unit)
    reactions = forces(system, c, state.regime)
    values = guard_values(system, c, times, positions, velocities, state.regime, state.sides)
    values = keep(values, unit)

    nodes = tuple(stop_gradient(values[:, i]) for i in range(len(NODES)))
    # A guard within its own rounding errors of zero says nothing by its sign: it is treated like
    # one that starts at zero, by the way it goes.
    sizes = jnp.maximum(state.reach, jnp.max(jnp.abs(jnp.stack(nodes)), axis=0))
    # sizes of what was committed: a wild trial step must not widen its own doubt
    noise = keep(NOISE * jnp.finfo(sizes.dtype).eps * state.reach, unit)
    orders = jnp.where((state.orders == 0) & (jnp.abs(nodes[0]) <= noise), 1, state.orders)
    noise = noise * jnp.where(orders == 0, 1.0, 10.0**orders).astype(noise.dtype)
    start, *rest = keep(deflated(nodes, orders), unit)
    # A double or triple zero is left upwards by construction (release, lift-off). Its event was
    # located to within the tolerance, so a hair's breadth downwards is not a new event.
    height = jnp.max(jnp.abs(jnp.stack(rest)), axis=0)
    upwards = (orders >= 2) & (start > -0.05 * height)
    start = jnp.where(upwards, jnp.maximum(start, 1e-6 * height), start)
    # Only a guard that goes down from its zero all along counts as violated there; an extrapolation
    # that merely turns negative asks for a shorter step.
    falls = (jnp.max(jnp.stack(rest), axis=0) <= 0) & (start <= -0.5 * height)
    falls = keep(jnp.where(orders == 0, start <= 0, falls & (start < -noise)), unit)
    quotient = (start, *rest)
    control = control_values(quotient)
    size = jnp.max(jnp.abs(jnp.stack(quotient)), axis=0)
    blur = interpolation_error(quotient, orders)
    clear = minimum(control) > blur
    clear = clear | ((orders > 0) & (minimum(control) > -noise) & (blur <= noise))
    error_of_guards = blur
    # below this the estimate is rounding: the polynomial itself decides
    blur = keep(jnp.where(blur > jnp.maximum(1e-9 * size, noise), blur, 0.0), unit)
    control = keep(tuple(b - blur for b in control), unit)
    g0, g1, g2, g3, g4 = nodes
    return Trial(
        h=h,
        lands=lands,
        jams=_jams(problem, state, ok, next_step, nodes[0]),
        mark=mark,
        step=step,
        ok=ok,
        next_step=next_step,
        error=error,
        finite=finite,
        times=times,
        positions=positions,
        velocities=velocities,
        contact_forces=reactions,
        last=jax.tree.map(lambda x: x[-1], c),
        end_values=values[:, -1],
        end_slopes=(25 * g4 - 48 * g3 + 36 * g2 - 16 * g1 + 3 * g0) / 3,
        controls=control,
        proved=keep(clear | (to_mark <= sliver), unit),
        cuts=hull_cut(control),
        starts=quotient[0],
        blurs=blur,
        falls=falls,
        sizes=sizes,
        errors=error_of_guards,
    )


def _jams(problem: Problem, state: State, ok, next_step, values):
    """True where slip runs into D = 0 under load: the normal force grows without bound there, so
    that steps shrink to nothing in front of it and never reach it."""
    if not problem.system.coupled:
        return jnp.zeros_like(ok)
    sliding = (state.regime == Regime.SLIP_POS) | (state.regime == Regime.SLIP_NEG)
    floor = 64 * jnp.finfo(state.time.dtype).eps
    floor = floor * jnp.maximum(jnp.abs(state.time), 1e-6 * jnp.abs(problem.end))
    near = (values[JAM] > 0) & (values[JAM] < 1e-2) & (values[SECOND] > 0)
    return sliding & ~ok & (next_step < floor) & near & (state.result == RUNNING)


def pick(slots, index):
    """Entry ``index`` (traced, one a lane) of an array with slots first."""
    out = slots[0]
    for i in range(1, slots.shape[0]):
        out = jnp.where(index == i, slots[i], out)
    return out
