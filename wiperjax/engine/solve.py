"""`solve`: the pure function underneath everything, for one trajectory.

`jax.vmap` works, but every lane then waits for the slowest and pays for all events of the others:
for many trajectories `wiperjax.sweep`, or `lanes.run_pool`, is far faster.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from ..contact.own_numbers import as_arguments, check_single, in_full
from ..contact.system import AbstractSystem
from ..numerics.forwards_only import forwards_only
from ..numerics.kept import Kept
from ..numerics.tracing import is_staged
from ..numerics.types import Scalar
from ..vocabulary import checks
from ..vocabulary.codes import RUNNING
from ..vocabulary.ranges import POSITIVE
from .arguments import (
    check_beginning,
    check_integration,
    check_observation,
    check_start,
    check_system,
    check_tolerances,
    checked_start,
    from_start,
)
from .carry.problem import Case, Integration, Problem, Recording, make_case
from .carry.start import initial_state
from .carry.state import EventLog, State, final_velocity, told_regime
from .observers.base import AbstractObserver
from .observers.totals import RegimeTotals
from .reverse import run_reversible
from .sampling.at_times import empty_samples
from .step import advance

BACKWARDS = (
    "reverse must be True where a motion is differentiated backwards (jax.grad, jax.vjp, "
    "jax.jacrev), but was False"
)


class Solution(NamedTuple):
    """What a trajectory leaves behind. Units are the system's own (SI for the wiper)."""

    final_time: Scalar
    final_position: jax.Array  # (n,)
    final_velocity: jax.Array  # (n,)
    final_regime: Scalar  # `wiperjax.Regime`
    events: EventLog  # (max_events,) each, with ``count``
    event_overflow: Scalar  # True where more events happened than the log holds
    statistics: Any  # the observer's record
    samples: Any  # `Sample` at ``sample_times``, or None
    result: Scalar  # `wiperjax.Result`
    steps: Scalar  # trial steps
    rejected_steps: Scalar
    unproved_steps: Scalar  # steps whose guards could not be proved free of zeros


def active(problem: Problem, state: State):
    """True while there is work that can be done without somebody emptying a buffer."""
    on = state.result == RUNNING
    if problem.pause_when_full:
        on = on & (state.log.count < problem.log_capacity)
        if problem.sample_times is not None:
            on = on & (state.sample_index < problem.sample_times.shape[0])
    return on


def run(problem: Problem, state: State, reverse_turns: int | None = None) -> State:
    """Advance until the trajectory ends (or a buffer is full, if the problem pauses).

    With ``reverse_turns``, the most turns there may be, it can be differentiated in reverse mode
    (and not forwards).
    """
    if reverse_turns is None:
        return jax.lax.while_loop(partial(active, problem), partial(advance, problem), state)
    return run_reversible((problem, state), active, reverse_turns)


def begin(case: Case) -> State:
    """Return the loop state at the start, with empty buffers.

    Raises ValueError for a number of coordinates that is not the system's.
    """
    try:
        state = initial_state(*case)
    except (IndexError, ValueError) as error:  # of a tuple that is too short, or too long
        raise ValueError(
            f"initial_state must have the coordinates of {type(case.problem.system).__name__}, "
            f"but had {len(case.position)}; or a function or number of the system is wrong: {error}"
        ) from error
    times, index = case.problem.sample_times, state.sample_index
    if times is not None:  # no motion is known before it begins
        index = index + jnp.sum(times < state.time).astype(index.dtype)
    samples = empty_samples(case.problem, state)
    return state._replace(samples=samples, sample_index=index)


def solve(
    system: AbstractSystem,
    duration,
    *,
    initial_state=None,
    solver=None,
    rtol=1e-8,
    atol=None,
    sample_times=None,
    max_events: int = 256,
    max_steps=1_000_000,
    max_step=None,
    zeno_time=1e-8,
    observer: AbstractObserver | None = None,
    statistics_start=None,
    start=0.0,
    reverse: bool = False,
) -> Solution:
    """Return the `Solution` of one trajectory over ``duration`` [s] from ``start`` on.

    A pure function: it works under `jax.jit`, `jax.vmap` over any parameter of ``system`` (an
    equinox module), and `jax.jvp`; with ``reverse`` under `jax.grad` instead. By itself it is
    compiled at the first call, once for all values of the system's numbers. It never raises for a
    numerical failure; look at ``result``.

    **Main arguments:** ``system``; ``duration`` [s]; ``initial_state`` = (position, velocity), n
    values each (default: the system's own start).

    **Other arguments:** ``solver``, an explicit diffrax Runge-Kutta solver with error estimate
    and dense output (default `diffrax.Tsit5`); ``rtol``; ``atol``, one number or (positions,
    velocities) (default: rtol times the system's scales); ``sample_times``, increasing, (m,), from
    ``start`` on; of those that the motion does not reach samples are NaN, and -1 the regime;
    ``max_events``, capacity of the event log (more are counted, flagged, and not stored);
    ``max_steps``, trial steps; ``max_step`` [s]; ``zeno_time`` [s], flights shorter than this are
    completed by the limit of their sequence; ``observer``, online statistics (default
    `RegimeTotals` from ``statistics_start`` on, a time before the end); ``start``, time at which it
    begins [s]; ``reverse``, differentiable in reverse mode instead of forward mode: memory is then
    2 sqrt(``max_steps``) loop states (about 1 kB each, and the event log once more in each);
    ``sample_times`` must be left out.

    Raises ValueError, naming the argument, for what cannot be meant, a derivative backwards without
    ``reverse`` among it. Values that are traced are not looked at: a tolerance that is no number
    > 0, or an end before the start, then ends as ``non_finite``.
    """
    check_system(system)
    check_single(system, known=False)
    staged = is_staged()
    system = in_full(system) if staged else as_arguments(system)
    checks.numbers("duration", duration, POSITIVE, arrays=False)
    check_integration(solver, rtol, zeno_time, max_steps, reverse)
    initial_state = checked_start(system, initial_state)
    check_tolerances(atol, len(initial_state[0]))
    check_observation(sample_times, max_events, max_step, observer, start, reverse)
    check_start(system, start)
    check_beginning(observer, statistics_start, start + duration)
    if observer is None:
        observer = RegimeTotals(start if statistics_start is None else statistics_start)
    mark = statistics_start if observer.begin is None else observer.begin
    case = make_case(
        system,
        duration,
        initial_state,
        Integration(solver, rtol, atol, max_steps, max_step, zeno_time),
        Recording(
            from_start(sample_times, start), max_events=max_events, observer=observer, mark=mark
        ),
        start,
    )
    # by itself it is a program of its own, kept for the next call
    found = (_alone.function if staged else _alone)(case, int(max_steps) if reverse else None)
    return found if reverse else forwards_only(found, BACKWARDS)


@Kept
def _alone(case: Case, reverse_turns: int | None) -> Solution:
    return solution(case.problem, run(case.problem, begin(case), reverse_turns))


def solution(problem: Problem, state: State) -> Solution:
    """Return what a finished loop state says to the outside."""
    return Solution(
        final_time=state.time,
        final_position=jnp.stack(state.position),
        final_velocity=jnp.stack(final_velocity(problem, state)),
        final_regime=told_regime(problem, state),
        events=state.log,
        event_overflow=state.log.count > problem.log_capacity,
        statistics=state.observed,
        samples=state.samples,
        result=state.result,
        steps=state.attempts,
        rejected_steps=state.rejected,
        unproved_steps=state.unproved,
    )
