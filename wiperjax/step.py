"""One turn of the event loop: a trial step, its verdict, and what follows from it."""

import jax
import jax.numpy as jnp
from jax.lax import stop_gradient

from .barrier import keep
from .guards import first_switch
from .locate import Plan, light, locate
from .observers import Happening, Stretch
from .regimes import acceleration
from .results import RUNNING, Regime, Result
from .sampling import take_samples, take_signal
from .state import Problem, State
from .system import rates
from .transition import settle, transition, where
from .trial import Trial, attempt

ZERO_TIME_EVENTS = 24  # events at one instant after which no lasting regime is expected


def advance(problem: Problem, state: State) -> State:
    """Return the state after one trial step, with its event if it has one."""
    trial = attempt(problem, state)
    return conclude(problem, state, trial, locate(problem, state, trial))


def advance_light(problem: Problem, state: State) -> State:
    """`advance` for steps without events; where there is one, or a mark, nothing changes.

    The cheap turn of a batch: no location, no reset maps. Rejections are handled.
    """
    trial = attempt(problem, state)
    calm = keep(light(trial, state), state.unit)
    refused = ~trial.ok & ~trial.jams & (state.target < 0) & (state.result == RUNNING)
    moved = _move(problem, state, trial, calm, jnp.zeros_like(trial.h))
    step = jnp.where(calm | refused, trial.next_step, state.step)
    moved = moved._replace(
        step=step,
        last_error=jnp.where(calm, trial.error, state.last_error),
        attempts=state.attempts + (calm | refused),
        rejected=state.rejected + refused,
    )
    return _fail(problem, moved, trial, refused)


def conclude(problem: Problem, state: State, trial: Trial, plan: Plan) -> State:
    """Return the state after carrying out ``plan``."""
    moves = jnp.logical_or(plan.accept, plan.arrive)
    fires = jnp.logical_or(plan.fire, plan.arrive)
    breaks = (
        plan.accept
        & trial.lands
        & (trial.mark == problem.system.break_time(state.piece))
        & (trial.mark < problem.end)
    )
    piece = state.piece + breaks.astype(jnp.int32)
    before = state
    plan = keep(plan, state.unit)
    state = _move(problem, state, trial, moves, plan.correction)
    landed = plan.accept & trial.lands
    state = state._replace(time=jnp.where(landed, trial.mark, state.time))

    system = problem.system.on_piece(before.piece)
    end = jnp.minimum(problem.end, system.break_time(before.piece))
    after = transition(
        problem,
        state,
        state.time,
        state.position,
        state.velocity,
        plan.slot,
        fires,
        breaks,
        piece,
        end,
    )
    after = keep(after, state.unit)
    happens = keep(fires | breaks, state.unit)
    # the first slots mean something else in another regime, and so do their sizes
    rows = jnp.arange(state.reach.shape[0]).reshape((-1,) + (1,) * state.time.ndim)
    contact_slot = plan.slot < first_switch(problem.system)
    anew = fires & contact_slot & (rows < first_switch(problem.system))
    old, new = _kind(state.regime), _kind(after.regime)
    remembered = tuple(
        jnp.where(happens & (old == i), plan.step, s) for i, s in enumerate(state.step_of)
    )
    resumed = remembered[0]
    for i in (1, 2):
        resumed = jnp.where(new == i, remembered[i], resumed)
    step = jnp.where(happens & (old != new), resumed, plan.step)

    streak = jnp.where(moves, 0, state.streak + fires.astype(jnp.int32))
    result = state.result
    flagged = state.flagged | (happens & after.indeterminate)
    over = landed & (trial.mark >= problem.end)
    good = jnp.where(flagged, int(Result.PAINLEVE_INDETERMINATE), int(Result.FINISHED))
    result = jnp.where(over, good, result)
    result = jnp.where(fires & after.stopped, int(Result.COLLAPSED), result)
    stuck = (streak > ZERO_TIME_EVENTS) | (happens & after.inconsistent)
    result = jnp.where(stuck, int(Result.NO_CONSISTENT_REGIME), result)
    # a flight too short for the clock: impacts pile up faster than time can tell them apart
    piled = happens & (after.regime == Regime.FLIGHT) & (before.regime == Regime.FLIGHT)
    piled = piled & moves & (state.time == before.time)
    result = jnp.where(piled, int(Result.ZENO_UNRESOLVED), result).astype(jnp.int32)

    happening = Happening(system, state.time, after.kind, state.regime, after.regime, after.impulse)
    observed = where(happens, problem.observer.event(state.observed, happening), state.observed)
    log = state.log
    if problem.log_capacity:
        at = jnp.where(happens, log.count, problem.log_capacity)
        log = log._replace(
            time=log.time.at[at].set(after.time, mode="drop"),
            kind=log.kind.at[at].set(after.kind.astype(jnp.int8), mode="drop"),
            before=log.before.at[at].set(state.regime.astype(jnp.int8), mode="drop"),
            after=log.after.at[at].set(after.regime.astype(jnp.int8), mode="drop"),
            impulse=log.impulse.at[at].set(after.impulse, mode="drop"),
            count=log.count + happens.astype(jnp.int32),
        )
    state = state._replace(
        time=jnp.where(happens, after.time, state.time),
        position=where(happens, after.position, state.position),
        velocity=where(happens, after.velocity, state.velocity),
        regime=jnp.where(happens, after.regime, state.regime),
        piece=piece,
        sides=where(happens, after.sides, state.sides),
        orders=jnp.where(happens, after.orders, state.orders),
        reach=jnp.where(anew, after.sizes, state.reach),
        rate=where(happens, after.rate, state.rate),
        step=stop_gradient(step),
        last_error=jnp.where(happens, 1.0, jnp.where(plan.accept, trial.error, state.last_error)),
        step_of=jax.tree.map(stop_gradient, remembered),
        target=plan.target,
        trial=stop_gradient(plan.trial),
        tries=plan.tries,
        result=result,
        flagged=flagged,
        attempts=state.attempts + (before.result == RUNNING),
        rejected=state.rejected + plan.rejected,
        unproved=state.unproved + plan.unproved,
        streak=streak,
        events=state.events + happens,
        log=log,
        observed=observed,
    )
    return _fail(problem, state, trial, plan.rejected)


def _kind(regime):
    """Index of the step memory: stick, slip, flight."""
    return jnp.where(regime == Regime.STICK, 0, jnp.where(regime == Regime.FLIGHT, 2, 1))


def _move(problem: Problem, state: State, trial: Trial, moves, correction) -> State:
    """Commit the trial step where ``moves``, plus a Taylor step of length ``correction``."""
    system = problem.system.on_piece(state.piece)
    q, v = trial.step.y1
    c = trial.last
    a = acceleration(c, jax.tree.map(lambda f: f[-1], trial.contact_forces))
    touching = state.regime != Regime.FLIGHT
    q, v = settle(system, c, q, v, touching, touching, state.regime == Regime.STICK)
    q, v, a = keep((q, v, a), state.unit)
    speeds = rates(system, state.time + trial.h, q, v)
    rate = (speeds, a)
    d = correction.astype(q[0].dtype)
    q = tuple(x + d * (y + 0.5 * d * z) for x, y, z in zip(q, speeds, a, strict=True))
    v = tuple(x + d * y for x, y in zip(v, a, strict=True))
    length = trial.h + correction
    stretch = Stretch(
        system,
        state.time,
        trial.h,
        correction,
        state.regime,
        trial.times,
        trial.positions,
        trial.velocities,
        trial.contact_forces,
    )
    observed = problem.observer.stretch(state.observed, stretch)
    if problem.signal is None:
        index, samples = take_samples(problem, state, trial, moves, length)
    else:
        index, samples = take_signal(problem.signal, system, state, q, v, rate, moves, length)
    return state._replace(
        sample_index=index,
        samples=samples,
        time=jnp.where(moves, state.time + length, state.time),
        position=where(moves, q, state.position),
        velocity=where(moves, v, state.velocity),
        rate=where(moves, rate, state.rate),
        orders=jnp.where(moves, 0, state.orders),
        reach=jnp.where(moves, trial.sizes, state.reach),
        observed=where(moves, observed, state.observed),
    )


def _fail(problem: Problem, state: State, trial: Trial, rejected) -> State:
    """Give the trajectory its failure code where it cannot keep its promise."""
    eps = jnp.finfo(state.time.dtype).eps
    floor = 4 * eps * jnp.maximum(jnp.abs(state.time), 1e-6 * jnp.abs(problem.end))
    too_small = rejected & (state.step < floor)
    why = jnp.where(trial.finite, int(Result.STEP_TOO_SMALL), int(Result.NON_FINITE))
    running = state.result == RUNNING
    result = jnp.where(running & too_small, why, state.result)
    spent = (result == RUNNING) & (state.attempts >= problem.max_steps)
    result = jnp.where(spent, int(Result.STEP_BUDGET_SPENT), result)
    return state._replace(result=result.astype(jnp.int32))
