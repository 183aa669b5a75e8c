"""What `diffrax_trajectory` is given, carries from phase to phase, and returns."""

from typing import Any, NamedTuple

from .diffrax_wiper import State


class Marks(NamedTuple):
    """Times that end a phase, all cells' alike: breaks of the belt, and samples, the end last."""

    times: Any  # (marks,) s
    kinds: Any  # an `Event`, or 0 for a sample
    samples: Any  # number of the sample, or -1 for a break


class Records(NamedTuple):
    """What is kept of a trajectory."""

    samples: Any  # (marks, 4): x, y, x', y'; more rows than samples
    times: Any  # (LOG,) s, of events
    kinds: Any  # (LOG,)
    count: Any  # of events, also of those beyond the log


class Found(NamedTuple):
    """The trajectory of one cell."""

    records: Records
    stopped: Any
    steps: Any


class Cell(NamedTuple):
    """What does not change along a trajectory."""

    wiper: Any
    marks: Marks
    scales: Any  # m, m/s
    rtol: Any
    solver: Any
    fastest: Any  # angular frequency of the blade, 1/s


class Motion(NamedTuple):
    """What goes on from phase to phase."""

    time: Any
    state: State
    regime: Any
    zone: Any
    piece: Any  # of the belt
    order: Any  # of the guards' zeros, as in `Constants`
    mark: Any  # number of the one to come
    usual_steps: Any  # (3,) s: of stick, slip, flight
    records: Records
    steps: Any
    streak: Any  # phases without length, one after the other
    bad: Any
    over: Any
    phases: Any


class Solved(NamedTuple):
    """What diffrax finds of one phase."""

    time: Any
    state: State
    guard: Any  # number of the smallest one
    fired: Any
    failed: Any
    accepted: Any
    steps: Any
