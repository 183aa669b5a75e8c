"""Names of everything discrete that a trajectory reports: regimes, event kinds and result codes.

Plain integers, because they live in arrays of compiled loops and in CF ``flag_values`` of files.
"""

from enum import IntEnum


class Regime(IntEnum):
    """Contact state of the tip (docs/model.md, section 5)."""

    STICK = 0
    SLIP_POS = 1
    SLIP_NEG = 2
    FLIGHT = 3


class Event(IntEnum):
    """What happened at a located instant."""

    NONE = 0
    RELEASE = 1  # stick -> slip: the friction cone was reached
    CAPTURE = 2  # slip -> stick
    REVERSAL = 3  # slip -> slip of the other sign
    LIFT_OFF = 4  # the normal force vanished
    IMPACT = 5  # the gap closed at a finite speed
    ZENO = 6  # an accumulating sequence of impacts, completed by its limit
    KINK = 7  # a switching function of the system (the shoulder) changed sign
    BELT_REVERSAL = 8  # V(t) passed through zero
    BELT_KINK = 9  # V(t) has a corner
    JAM = 10  # Painleve: slip reached D = 0 under load; an impact without collision
    COLLAPSE = 11  # the system's own limit (phi = phi_max) was reached
    TOUCH = 12  # the gap closed at zero speed; or a regime was re-decided at a tie
    BLOW = 13  # a stop of the system was struck: its velocities jumped


HITS = (Event.IMPACT, Event.ZENO, Event.JAM)
"""Events that count as a hit: those with an impulse of the contact (of a stop's none is known)."""


class Result(IntEnum):
    """How a trajectory ended. All but FINISHED and COLLAPSED are failures of that one alone."""

    FINISHED = 0
    COLLAPSED = 1
    STEP_TOO_SMALL = 2
    STEP_BUDGET_SPENT = 3
    NON_FINITE = 4
    ZENO_UNRESOLVED = 5
    PAINLEVE_INDETERMINATE = 6
    NO_CONSISTENT_REGIME = 7
    INCONSISTENT_START = 8
    TOO_FEW_DIGITS = 9


class CurveEnd(IntEnum):
    """Why a curve in the plane of two parameters ends. FAILED alone is a failure."""

    RANGE = 0  # a parameter left its range
    CLOSED = 1  # it came back to where it began
    BAUTIN = 2  # a curve of folds comes to the Hopf curve
    DOUBLE_ZERO = 3  # the frequency of a Hopf point is zero
    CONTACT_LOST = 4  # steady slip lifts off
    STICK = 5  # steady slip comes to rest on the glass
    CORNER = 6  # the forces have a corner at steady slip, where its linearisation jumps
    OTHER_FOLD = 7  # the fold goes on as one of the other kind, smooth or at a corner
    EVENTS = 8  # the order of events of the cycle changes
    POINTS = 9  # as many points as were allowed
    FAILED = 10  # no solution was found, even at the smallest step


RUNNING = -1  # inside the loop only; never reported

FAIR = (Result.FINISHED, Result.PAINLEVE_INDETERMINATE)
"""How what reached its end may have ended. A map counts the first alone as finished."""

RESULTS = {result.name.lower(): int(result) for result in Result}


def result_name(code: int) -> str:
    """Name of a result in files; of a code that nobody knows that it is one."""
    known = {int(result): name for name, result in RESULTS.items()}
    return known.get(code, f"code {code}, of another version or program")


ADVICE = {
    Result.FINISHED: "reached the end of the time asked for",
    Result.COLLAPSED: "the lip reached collapse_angle: a result of the model, not an error",
    Result.STEP_TOO_SMALL: "the step shrank to the resolution of time, or thousands of steps got "
    "nowhere: loosen rtol, look for a parameter many decades off, or for a max_step far too small",
    Result.STEP_BUDGET_SPENT: "max_steps were spent before the end: raise max_steps",
    Result.NON_FINITE: "an acceleration became infinite or undefined, or a tolerance was no number "
    "> 0, or the end lies before the start: look at the parameters and the initial state",
    Result.ZENO_UNRESOLVED: "impacts accumulate and could not be completed by their limit: "
    "raise zeno_time, or check restitution (of blows against a stop there is no limit: it cannot "
    "be rested against)",
    Result.PAINLEVE_INDETERMINATE: "at some instant several motions were possible (D <= 0 with a "
    "separating free acceleration); the one that lifts off was followed",
    Result.NO_CONSISTENT_REGIME: "many events at one instant without a regime that lasts; or the "
    "load, or the friction coefficient, of a system of one's own is below zero: mend these, else "
    "please report the parameters",
    Result.INCONSISTENT_START: "the initial state is impossible (tip inside the glass, beyond a "
    "stop, or at rest where no contact force can hold it): choose another one",
    Result.TOO_FEW_DIGITS: "the motion cannot be told in single precision (steps shrink to "
    "nothing): take precision float64",
}


LABELS = {
    "quiet": 0,
    "squeal": 1,
    "chattering": 2,
    "reversal": 3,
    "other": 4,
    "collapsed": 5,
    "failed": 6,
}


MECHANISMS = {
    "none": 0,  # quiet, or no motion to speak of
    "self_excited_slip": 1,  # slips all the time
    "stick_slip": 2,
    "flight": 3,  # leaves the glass, whether it sticks or not
    "carried": 4,  # rides on the belt for the whole window, or for all of it that is heard
    "reversal_pulse": 5,  # pressed hard at the reversal, without a hit
    "reversal_impulse": 6,  # hits the glass at the reversal
    "vibro_impact": 7,  # slips all the time, and strikes a stop
}


BANDS = {"none": 0, "chatter": 1, "low": 2, "squeal": 3, "high": 4}


SETTLED = {"no": 0, "yes": 1, "unknown": 2}


TOLD = {"no": 0, "yes": 1, "unknown": 2}  # whether the samples tell the frequency


CROSSINGS = {
    "smooth": 0,  # a stored number crosses a threshold, and the point is interpolated
    "jump": 1,
    "irregular": 2,  # the answer changes there and back: no border that becomes sharper
    "unresolved": 3,  # the budget was spent before the bracket was reached
}
"""Kinds of points on the borders of a refined map."""


NOT_COMPUTED = -1  # of an integer column, in a partly finished store only


NONE = 255  # of an unsigned column: there is no such instant, no such event


REGIMES = {regime.name.lower(): int(regime) for regime in Regime} | {"none": NONE}


EVENTS = {event.name.lower(): int(event) for event in Event if event != Event.NONE} | {"none": NONE}


VALIDITY = {
    "fine": 0,
    "near_grazing": 1,
    "sequence_changes": 2,
    "unsettled": 3,
    "not_differentiable": 4,
}
"""Whether the derivatives of a cell hold; where they do not, they are NaN."""
