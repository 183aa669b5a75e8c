"""The event loop's two halves: a stretch of smooth motion, and the event it leads to.

`flow` tries a step and moves; where it arrives at an event, or a break of the prescribed motion, it
leaves the slot in ``State.due``. `jump` carries out what is due. One trajectory does both in turn;
a batch does several flows for one jump, since few of its lanes have an event at any time.
"""

import jax
import jax.numpy as jnp
from jax.lax import stop_gradient

from ..contact.guards import first_switch, stop_slots
from ..contact.projection import project
from ..contact.regimes import drives, pulls
from ..contact.system import like, rates
from ..numerics.arrays import put, where
from ..numerics.fusion_barrier import keep
from ..vocabulary.codes import RUNNING, Regime, Result
from .carry.problem import Problem
from .carry.recall import remember
from .carry.state import BREAK, State, told_regime
from .event.event_time import drift, time_to_event
from .event.plan import Plan, locate
from .event.transition import Outcome, transition
from .event.unmoved import unmoved
from .observers.base import Happening, Stretch, gathered
from .sampling.at_times import take_samples
from .sampling.means import take_means
from .trial.attempt import Trial, attempt

ZERO_TIME_EVENTS = 24  # events at one instant after which no lasting regime is expected
PACE_TURNS = 4096  # after each so many turns (a power of two) the pace is looked at:
HOPELESS = 30  # so many times the budget of steps would be spent, were it to stay
LEAST_BUDGET = 1e5  # steps; a smaller one says nothing about the pace


def advance(problem: Problem, state: State) -> State:
    """Return the state after one trial step, with its event if it has one."""
    state = flow(problem, state)
    return jax.lax.cond(jnp.any(state.due >= 0), lambda s: jump(problem, s), lambda s: s, state)


def flow(problem: Problem, state: State) -> State:
    """Return the state after one trial step, up to the event it leads to.

    Where an event is due, or the trajectory has ended, nothing changes.
    """
    trial = attempt(problem, state)
    plan = locate(problem, state, trial)
    moves = jnp.logical_or(plan.accept, plan.arrive)
    fires = jnp.logical_or(plan.fire, plan.arrive)
    landed = plan.accept & trial.lands
    breaks = landed & (trial.mark >= problem.system.break_time(state.piece))
    breaks = breaks & (trial.mark < problem.end)

    moved = _move(problem, state, trial, moves, plan)
    due = jnp.where(fires, plan.slot, jnp.where(breaks, BREAK, state.due)).astype(jnp.int32)
    over = landed & (trial.mark >= problem.end)
    good = jnp.where(state.flagged, int(Result.PAINLEVE_INDETERMINATE), int(Result.FINISHED))
    result = jnp.where(over, good, state.result).astype(jnp.int32)
    moved = moved._replace(
        # an event just before a known time may be rounded past it, and time never goes back
        time=jnp.where(landed | (moved.time > trial.mark), trial.mark, moved.time),
        due=due,
        step=stop_gradient(plan.step),
        last_error=jnp.where(plan.accept, trial.error, state.last_error),
        last_step=stop_gradient(jnp.where(plan.accept, jnp.maximum(trial.h, 0.0), state.last_step)),
        target=plan.target,
        trial=stop_gradient(plan.trial),
        tries=plan.tries,
        result=result,
        attempts=state.attempts + state.active,
        rejected=state.rejected + plan.rejected,
        unproved=state.unproved + plan.unproved,
        streak=jnp.where(moves, 0, state.streak + fires),
    )
    return _fail(problem, moved, trial, plan, state.active)


def jump(problem: Problem, state: State) -> State:
    """Return the state after the event that is due, if one is; impacts to rest take time."""
    state = unmoved(problem, state)
    happens = state.due >= 0
    breaks = state.due == BREAK
    fires = happens & ~breaks
    piece = state.piece + breaks.astype(jnp.int32)
    before = problem.system.on_piece(state.piece)
    end = jnp.minimum(problem.end, before.break_time(state.piece))
    after = keep(transition(problem, state, fires, breaks, piece, end))

    # the first slots mean something else in another regime; a switch is the difference of the same
    # numbers on its other side, as well known as on this one
    contact_slots = first_switch(problem.system)
    others = fires & (state.due < contact_slots)
    # what a flight only passes, a break or a switch, does not begin it anew
    passes = (state.regime == Regime.FLIGHT) & (state.due >= contact_slots)
    if after.struck is not None:  # a blow does, and may end a regime
        passes = passes & ~after.struck
        others = others | (after.struck & (after.regime != state.regime))
    begun = where(others, after.sizes, state.reach[:contact_slots])
    memory, step = remember(state, after.regime, after.time, after.bounce, happens, fires)
    result = _result_after(problem, state, after, happens, fires)
    later = state._replace(regime=after.regime, piece=piece, sides=after.sides)
    regimes = told_regime(problem, state), told_regime(problem, later)
    # the observer and the log see the event on the piece of the motion that it ends
    output = like(before.output(after.time, after.position, after.velocity), after.velocity[0])
    happening = Happening(
        *(before, state.time, after.kind, *regimes),
        *(after.impulse, after.time - state.time, output, after.position, after.velocity),
    )
    observed = gathered(problem.observer, "event", state.observed, happening, happens)
    logs = happens & (state.time >= problem.log_start)
    log = state.log._replace(count=state.log.count + logs.astype(jnp.int32))
    if problem.log_capacity:
        row = jnp.where(logs, state.log.count, problem.log_capacity)
        at = (row, *jnp.indices(row.shape, sparse=True))  # lanes last
        log = log._replace(
            time=put(log.time, at, after.time),
            kind=put(log.kind, at, after.kind),
            before=put(log.before, at, regimes[0]),
            after=put(log.after, at, regimes[1]),
            impulse=put(log.impulse, at, after.impulse),
        )
    return state._replace(
        time=jnp.where(happens, after.time, state.time),
        position=where(happens, after.position, state.position),
        velocity=where(happens, after.velocity, state.velocity),
        rest=_rest_after(state, happens, after),
        regime=jnp.where(happens, after.regime, state.regime),
        piece=piece,
        sides=where(happens, after.sides, state.sides),
        orders=where(happens, after.orders, state.orders),
        reach=(*begun, *state.reach[contact_slots:]),
        due=jnp.full_like(state.due, -1),
        rate=where(happens, after.rate, state.rate),
        guards=where(happens, after.guards, state.guards),
        reactions=where(happens, after.reactions, state.reactions),
        step=step,
        memory=memory,
        last_error=jnp.where(happens, 1.0, state.last_error),
        last_step=jnp.where(happens, 0.0, state.last_step),
        last_event=jnp.where(happens & ~passes, after.time, state.last_event),
        result=result,
        flagged=state.flagged | (happens & after.indeterminate),
        events=state.events + happens,
        log=log,
        observed=observed,
    )


def _result_after(problem: Problem, state: State, after: Outcome, happens, fires):
    """Return the outcome of the trajectory behind an event: `RUNNING` where it goes on."""
    result = jnp.where(fires & after.stopped, int(Result.COLLAPSED), state.result)
    stuck = (state.streak > ZERO_TIME_EVENTS) | (happens & after.inconsistent)
    stuck = stuck & (state.result == RUNNING)
    result = jnp.where(stuck, int(Result.NO_CONSISTENT_REGIME), result)
    # a flight too short for the clock: impacts pile up faster than time can tell them apart
    piled = fires & (after.regime == Regime.FLIGHT) & (state.regime == Regime.FLIGHT)
    piled = piled & (state.streak == 0) & (state.time == state.last_event)
    if after.struck is not None:  # likewise blows, and what presses against a stop
        soon = (state.streak == 0) & (state.time - state.last_event <= _tick(problem, state))
        piled = after.struck & (soon | after.presses) | piled & ~after.struck
        at_stop = after.struck
        for slot in stop_slots(problem.system):
            at_stop = at_stop | (state.orders[slot] > 0)
        much = (state.streak > ZERO_TIME_EVENTS) & (state.result == RUNNING)
        piled = piled | (at_stop & much)
    return jnp.where(piled, int(Result.ZENO_UNRESOLVED), result).astype(jnp.int32)


def _tick(problem: Problem, state: State):
    """Return the shortest step that the clock can tell from none."""
    eps = jnp.finfo(state.time.dtype).eps
    return 4 * eps * jnp.maximum(jnp.abs(state.time), 1e-6 * jnp.abs(problem.end))


def _rest_after(state: State, happens, after):
    """Return what rounding has left out behind an event: of velocities nothing, which are new; of a
    coordinate that the event leaves alone as much as before. Stays far shorter than a digit of the
    position add up so: where each was forgotten, slip between two of them never got anywhere.
    """
    if state.rest is None:
        return None
    positions, velocities = state.rest
    places = zip(positions, state.position, after.position, strict=True)
    return (
        tuple(jnp.where(happens & (old != new), 0.0, x) for x, old, new in places),
        tuple(jnp.where(happens, 0.0, x) for x in velocities),
    )


def _move(problem: Problem, state: State, trial: Trial, moves, plan: Plan) -> State:
    """Commit the trial step where ``moves``, and the rest of the time to an event."""
    system = problem.system.on_piece(state.piece)
    q, v = trial.step.y1
    touching = state.regime != Regime.FLIGHT
    sticking = state.regime == Regime.STICK
    q, v = keep(project(system, trial.last, q, v, touching, touching, sticking))
    rate = (rates(system, state.time + trial.h, q, v), trial.step.rate1[1])
    correction = time_to_event(
        plan.correction,
        plan.arrive,
        system.on_sides(state.sides),
        state.time + trial.h + plan.correction,
        *drift(state, trial.h, q, v, rate, plan.correction.astype(q[0].dtype)),
        state.regime,
        state.sides,
        plan.slot,
    )
    q, v = drift(state, trial.h, q, v, rate, correction.astype(q[0].dtype))
    length, begins = trial.h + correction, state.time == problem.mark
    nothing = begins & (state.time + length == problem.mark)  # the next one begins statistics
    h, rest = (jnp.where(nothing, stop_gradient(x), x) for x in (trial.h, correction))
    stretch = Stretch(
        system,
        state.time,
        h,
        rest,
        state.regime,
        trial.nodes,
        tuple(g.nodes for g in trial.guards),
        tuple(g.size for g in trial.guards),
        (system.on_sides(state.sides), state.time + length, q, v),
        jnp.where(begins & ~nothing, state.time - problem.mark, 0.0),
    )
    observed = gathered(problem.observer, "stretch", state.observed, stretch, moves)
    index, full = state.sample_index, state.full
    if problem.signal is None:
        index, samples = take_samples(problem, state, trial, moves, length)
    else:
        samples, full = take_means(problem.signal, state.samples, stretch, moves)
    return state._replace(
        sample_index=index,
        samples=samples,
        full=full,
        time=jnp.where(moves, state.time + length, state.time),
        position=where(moves, q, state.position),
        velocity=where(moves, v, state.velocity),
        rest=where(moves, trial.step.rest, state.rest),
        rate=where(moves, rate, state.rate),
        guards=where(moves, tuple(g.value for g in trial.guards), state.guards),
        reactions=where(moves, trial.nodes[-1].forces, state.reactions),
        orders=where(moves, tuple(jnp.zeros_like(o) for o in state.orders), state.orders),
        reach=where(moves, tuple(g.size for g in trial.guards), state.reach),
        observed=observed,
    )


def _fail(problem: Problem, state: State, trial: Trial, plan: Plan, counted) -> State:
    """Give the trajectory, whose step counts where ``counted``, its code where it fails."""
    floor = _tick(problem, state)
    # a lane that gets nowhere, as at the end of a state's digits, must not keep its batch
    paced = counted & (state.attempts & (PACE_TURNS - 1) == 0)
    budget = HOPELESS * jnp.maximum(problem.max_steps, LEAST_BUDGET)
    least = (problem.end - state.time) * (PACE_TURNS / budget)
    stalls = paced & (state.time - state.paced_time < least)
    too_small = (plan.rejected & (state.step < floor)) | stalls
    # in a flight that began just now it is the impacts that pile up, behind a blow the blows, and
    # what begins at rest at a stop presses against it
    piles = state.regime == Regime.FLIGHT
    for slot in stop_slots(problem.system):
        piles = piles | (state.orders[slot] > 0) | (state.guards[slot] <= 0)
    piles = piles & (state.time - state.last_event <= floor)
    few = state.position[0].dtype != state.time.dtype  # no shorter step lowers what is rounding
    small = int(Result.TOO_FEW_DIGITS if few else Result.STEP_TOO_SMALL)
    why = jnp.where(piles, int(Result.ZENO_UNRESOLVED), small)
    why = jnp.where(trial.finite, why, int(Result.NON_FINITE))
    running = state.result == RUNNING
    result = jnp.where(running & too_small, why, state.result)
    seen = [n.forces for n in trial.nodes]
    unfit = pulls(problem.system, [f.normal for f in seen])
    unfit = unfit | drives(problem.system, state.regime, seen)
    result = jnp.where(running & plan.accept & unfit, int(Result.NO_CONSISTENT_REGIME), result)
    spent = (result == RUNNING) & (state.attempts >= problem.max_steps)
    result = jnp.where(spent, int(Result.STEP_BUDGET_SPENT), result)
    return state._replace(
        result=result.astype(jnp.int32),
        paced_time=stop_gradient(jnp.where(paced, state.time, state.paced_time)),
    )
