"""A trial step: the Runge-Kutta step, its error, and what the guards do along it.

Everything is elementwise, so the same code serves one trajectory (scalars) and a batch (one entry
a lane); nodes of the step and slots of the guards are tuples, which a compiler takes apart.
"""

from functools import reduce
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.lax import stop_gradient

from ...contact.guards import FIRST, JAM, SECOND, guard_values, stop_slots
from ...contact.regimes import Forces, acceleration, forces
from ...contact.space import Contact, contact
from ...contact.system import rates
from ...numerics.elementary import larger, smaller
from ...numerics.fusion_barrier import keep
from ...numerics.known_zeros import absent
from ...numerics.runge_kutta import NODES, Step, node_states, rk_step
from ...numerics.types import Scalar
from ...vocabulary.codes import Regime
from ..carry.problem import Problem
from ..carry.recall import aim
from ..carry.state import TERM, State
from .guard_proof import COARSE, Guard, examine
from .step_control import error_norm, propose, rounding_share


class Node(NamedTuple):
    """The motion at one instant of a step."""

    time: Scalar
    position: tuple
    velocity: tuple
    forces: Forces


class Trial(NamedTuple):
    """Everything a trial step of size ``h`` tells."""

    h: Scalar
    target: Scalar  # slot of the event that it is to end on, or -1
    cut: Scalar  # it is shorter than that asks for
    lands: Scalar  # it ends on a known time (``mark``)
    braking: Scalar  # slip is just in front of D = 0 under load (docs/model.md, section 7)
    mark: Scalar
    step: Step
    ok: Scalar  # finite and within the tolerance
    next_step: Scalar  # the controller's proposal
    error: Scalar  # relative to the tolerance
    finite: Scalar
    nodes: tuple[Node, ...]  # at `NODES`
    last: Contact  # contact space at the end, in this regime
    guards: tuple[Guard, ...]  # one a slot


class Size(NamedTuple):
    """How long a trial step is, and why."""

    h: Scalar
    target: Scalar  # as in `Trial`
    cut: Scalar
    lands: Scalar
    mark: Scalar
    sliver: Scalar  # hardly any time is left before the mark


def trial_size(problem: Problem, state: State) -> Size:
    """Return the size of the next trial step."""
    end, break_time = problem.end, problem.system.break_time(state.piece)
    # a piece of no length does not end before it begins, whatever rounding says
    break_time = break_time + stop_gradient(larger(state.time - break_time, 0.0))
    # a break at the very end is none: what is there moves with the end, not with the break
    mark = jnp.where(end <= break_time, end, break_time).astype(state.time.dtype)
    mark = jnp.where(problem.mark > state.time, smaller(problem.mark, mark), mark)
    to_mark = mark - state.time
    # a rest that the clock cannot divide: an event in it fires after the mark, if ever
    sliver = to_mark <= 4 * jnp.finfo(mark.dtype).eps * jnp.abs(mark)
    target, length = aim(state)
    wanted = stop_gradient(jnp.where(target >= 0, length, state.step))
    wanted = jnp.where(state.time >= problem.mark, smaller(wanted, problem.longest), wanted)
    if problem.max_step is not None:
        wanted = smaller(wanted, problem.max_step)
    # a sliver left over before a known time would be a step of rounding errors only
    lands = wanted >= to_mark * (1 - 1e-9)
    h = jnp.where(lands, to_mark, wanted)
    return keep(Size(h, target, h < length, lands, mark, sliver))


def attempt(problem: Problem, state: State) -> Trial:
    """Return the trial step from ``state``; nothing is committed."""
    system, solver = problem.system.on_piece(state.piece).on_sides(state.sides), problem.solver
    y0 = (state.position, state.velocity)
    size = trial_size(problem, state)
    h = size.h

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
    begin = (state.time, y0, h, state.rate)
    step = rk_step(solver, TERM, *begin, args, arrive, state.rest, not problem.brief)
    last_node, last, end_values = step.end

    inner = zip(NODES[1:-1], keep(node_states(solver, y0, step)), strict=True)
    looks = [look(state.time + theta * h, *y) for theta, y in inner]
    nodes = (
        Node(state.time, state.position, state.velocity, state.reactions),
        *(node for node, _, _ in looks),
        last_node,
    )
    slots = zip(state.guards, *(values for _, _, values in looks), end_values, strict=True)
    share = keep(rounding_share(problem, state, step, h))
    unsure: tuple = (0.0,) * len(state.guards)
    if not absent(share.path):
        # of what the state does to a guard: what time does to it is no rounding
        ends = zip(state.guards, look(state.time, *step.y1)[2], strict=True)
        unsure = keep(tuple(share.path * jnp.abs(stop_gradient(y - x)) for x, y in ends))
    # what is gathered along a stick, where nothing else limits a step, is as good as the motion
    coarse = smaller(COARSE, 100 * problem.rtol)
    highest = {FIRST: 3} | dict.fromkeys(stop_slots(system), 2)
    guards = tuple(
        keep(examine(values, order, reach, noise, size.sliver, highest.get(slot, 1), coarse))
        for slot, (values, order, reach, noise) in enumerate(
            zip(slots, state.orders, state.reach, unsure, strict=True)
        )
    )

    error = keep(stop_gradient(error_norm(problem, state, step, h, share)))
    # a guard that is no number somewhere has an error that is none
    finite = jnp.isfinite(error) & jnp.isfinite(sum(g.error for g in guards))
    for leaf in jax.tree.leaves(step.y1):
        finite = finite & jnp.isfinite(leaf)
    ok = finite & (error <= 1) & state.active  # other lanes of a batch stay put
    error = jnp.where(finite, larger(error, 1e-8), 1e10)
    length = stop_gradient(h)
    next_step = propose(problem, state, length, error, ok)
    # a guard may change faster than the motion, which in stick has no error at all: of a step too
    # long for its polynomial nothing could be proved, and zeros would hide between its nodes
    coarse = reduce(jnp.logical_or, (g.coarse for g in guards))
    next_step = jnp.where(coarse, smaller(next_step, length), next_step)
    ok, finite, error, next_step = keep((ok, finite, error, next_step))
    return Trial(
        h=h,
        target=size.target,
        cut=size.cut,
        lands=size.lands,
        braking=_braking(problem, state),
        mark=size.mark,
        step=step,
        ok=ok,
        next_step=next_step,
        error=error,
        finite=finite,
        nodes=nodes,
        last=last,
        guards=guards,
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
