"""The first zero of all guards: in a trial step, where it is in the way, or else in the next one.

Where nothing is in the way the polynomials of the step are followed past its end: the next trial
step can then be made to end on the event that is coming, and none is computed over it in vain. It
is a guess, and `locate` takes no more from it than the length of a step.
"""

from typing import NamedTuple

import jax.numpy as jnp

from ...numerics.arrays import pick
from ...numerics.bernstein import first_root
from ...numerics.elementary import larger, smaller
from ...numerics.fusion_barrier import keep
from ...numerics.types import Scalar
from ..trial.attempt import Trial

CLEAR, VIOLATED, MURKY = 2.0, -1.0, -0.5  # bounds of a first zero in [0, 1] that are none


class Obstacle(NamedTuple):
    """The first thing in the way of a trial step, or ahead of it."""

    slot: Scalar
    violated: Scalar  # the guard of ``slot`` is negative from the start
    murky: Scalar  # its error estimate is as large as itself: nothing can be said of this step
    found: Scalar  # it vanishes at ``theta``
    undecided: Scalar  # nothing is known beyond ``theta``
    ahead: Scalar  # nothing is in the way, and it will vanish at ``theta`` > 1, in the next step
    theta: Scalar
    doubtful: Scalar  # a guard taken for free of zeros with less certainty than its error asks

    @property
    def blocks(self) -> Scalar:
        """True where the step cannot be taken whole."""
        return self.violated | self.murky | self.found | self.undecided


def first_obstacle(trial: Trial, pending, there) -> Obstacle:
    """Return the earliest of what all guards put in the way, whatever their order in the list.

    A root is sought for the guard whose lower bound comes first. Another one that vanishes earlier
    after all shows up when the step has been shortened; where the first turns out to have no root
    and another might, the step is shortened to what is proved free. Past the end of the step the
    guards are ranked by their tangents. Where ``pending`` the step is to end on the zero of its
    target, which is then not in the way; and where it does end ``there``, neither is another that
    vanishes with it. (Where it does not, as on the other side of a stay that was recalled, that one
    is the event: taken whole, the step would lose the derivative of its time.)
    """
    earliest = second = jnp.full_like(trial.guards[0].cut, CLEAR)
    slot = upcoming = jnp.zeros_like(trial.target)
    value, fall = jnp.ones_like(earliest), jnp.zeros_like(earliest)  # of the upcoming one
    for i, g in enumerate(trial.guards):
        clear = jnp.logical_or(g.proved, pending & (trial.target == i))
        bound = jnp.where(g.falls, VIOLATED, jnp.where(g.murky, MURKY, g.cut))
        bound = keep(jnp.where(clear, CLEAR, bound))
        first = bound < earliest
        second = jnp.where(first, earliest, smaller(second, bound))
        earliest = jnp.where(first, bound, earliest)
        slot = jnp.where(first, i, slot)
        sooner = g.value * fall < -value * g.slope
        upcoming = jnp.where(sooner, i, upcoming)
        value, fall = jnp.where(sooner, g.value, value), jnp.where(sooner, -g.slope, fall)
    earliest, second, slot, upcoming = keep((earliest, second, slot, upcoming))

    nothing = earliest == CLEAR
    slot = jnp.where(nothing, upcoming, slot)
    control, error, blur = keep(pick([(g.control, g.error, g.blur) for g in trial.guards], slot))
    next_step = (trial.next_step / larger(trial.h, 1e-300)).astype(blur.dtype)
    root = keep(first_root(control, jnp.where(nothing, next_step, 0.0), blur))
    violated, murky = earliest == VIOLATED, earliest == MURKY
    asked = (earliest >= 0) & (earliest < CLEAR)
    tied = asked & pending & there & root.found & (root.theta > 1 - 1e-6)
    quiet = asked & (root.free | tied)
    # a second one that is violated or murky would have come first
    unknown = quiet & (second < CLEAR)
    return keep(
        Obstacle(
            slot=slot,
            violated=violated,
            murky=murky,
            found=asked & root.found & ~quiet,
            undecided=(asked & ~root.found & ~quiet) | unknown,
            ahead=nothing & root.found,
            theta=jnp.where(quiet, second, root.theta),
            doubtful=quiet & ~tied & (root.low <= error),
        )
    )
