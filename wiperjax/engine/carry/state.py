"""What a trajectory carries through the event loop."""

from typing import Any, NamedTuple

import diffrax
import jax

from ...contact.regimes import Forces, as_told, vector_field
from ...contact.system import rates
from ...numerics.types import Scalar
from ...vocabulary.codes import RUNNING
from .problem import Problem
from .recall import Memory

BREAK = 1000  # in place of a slot: a smooth piece of the prescribed motion ends


class EventLog(NamedTuple):
    """The first ``capacity`` events, (capacity, lanes), and how many there were: ``count`` goes on
    past the capacity, so nothing is lost unnoticed.
    """

    time: jax.Array
    kind: jax.Array
    before: jax.Array
    after: jax.Array
    impulse: jax.Array
    count: Scalar


class State(NamedTuple):
    """The loop carry of one trajectory, or of a batch (lanes last)."""

    # evolving
    time: Scalar
    position: tuple
    velocity: tuple
    rest: Any  # what rounding has left out of both, as (positions, velocities); None in float64
    regime: Scalar
    piece: Scalar  # smooth piece of the prescribed motion
    sides: tuple  # sign of each switching function
    orders: tuple  # multiplicity of each guard's known zero at `time`, one a slot
    reach: tuple  # largest size of each guard so far: what its rounding errors scale with
    due: Scalar  # slot of the event that happens now, BREAK, or -1
    # at `time`, for the next step
    rate: Any  # vector field (its first stage)
    guards: tuple  # values of the guards
    reactions: Forces
    # step control
    step: Scalar  # the controller's next step
    memory: Memory  # of steps and stays, see `recall`
    last_event: Scalar  # time; in flight that of its beginning
    last_error: Scalar  # of the last accepted step, relative to the tolerance,
    last_step: Scalar  # and its length; 1 and 0 after an event
    target: Scalar  # slot of an event being located or foreseen, or -1
    trial: Scalar  # step that should end on it
    tries: Scalar  # steps that did not; 0 where it is only foreseen
    # outcome
    result: Scalar
    flagged: Scalar  # an indeterminate Painleve state was passed
    # counters
    attempts: Scalar
    rejected: Scalar
    unproved: Scalar  # committed steps whose guards could not be proved free of zeros
    streak: Scalar  # events in a row without time passing
    paced_time: Scalar  # when the pace was last looked at (`step.PACE_TURNS`)
    events: Scalar
    # output buffers
    log: EventLog
    sample_index: Scalar
    samples: Any
    full: Scalar  # no room for the samples of another step
    observed: Any

    @property
    def active(self) -> Scalar:
        """True where a trial step counts: the trajectory runs, no event waits to be done and no
        samples to be put away.
        """
        return (self.result == RUNNING) & (self.due < 0) & ~self.full

    @property
    def ended(self) -> Scalar:
        """True where nothing is left to be done."""
        return (self.result != RUNNING) & ~self.full


TERM = diffrax.ODETerm(vector_field)


def final_velocity(problem: Problem, state: State):
    """Return q' at the end, a tuple of n."""
    system = problem.system.on_piece(state.piece)
    return rates(system, state.time, state.position, state.velocity)


def told_regime(problem: Problem, state: State) -> Scalar:
    """Regime of this instant, as it is told (`as_told`)."""
    return as_told(problem.system.on_piece(state.piece).on_sides(state.sides), state.regime)
