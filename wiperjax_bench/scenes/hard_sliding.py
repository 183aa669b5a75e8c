"""Hard scenes of a tip on the glass: steep friction, corners, long stick, growth out of nothing."""

import numpy as np

from wiperjax import SteadyBelt, TrapezoidBelt, Wiper

from .families import LENGTH, TURN_SPEED, turning
from .four import ABOUT_A_BORDER, SAMPLES, at, four, spread
from .scene import Scene

# places [m] of steady slip, and what cells lie about, by the tests' reference at rtol 1e-12
SPIKE_PLACE, SPIKE_SWING = 9.873814070614238e-05, 6.683909722093e-05
COLLAPSE_SPEED = 27.6694157238  # m/s
GROWTH_PLACE = 0.0034757819863845568


def steep_stribeck() -> Scene:
    """Return a friction curve that falls within 1 mm/s: stick-slip with sharp corners."""
    wiper = Wiper(belt=SteadyBelt(0.3), stribeck_speed=1e-3, normal_load=spread(15.0))
    return four(
        "steep Stribeck",
        "friction falls within 1 mm/s",
        "stick is set-valued: no speed below which friction is another one",
        wiper, at(0.0), 0.03, 0.3,
    )  # fmt: skip


def friction_spike() -> Scene:
    """Return slip that nearly comes to rest: friction trebles within 1 mm/s of it.

    The lip swings about steady slip; at the end of a swing the tip all but keeps pace with the
    belt. Two cells pass, by 8 and 5 mm/s, the others are caught and carried off. A step longer
    than the 20 us that the pass takes sees no rise of friction.
    """
    wiper = Wiper(belt=SteadyBelt(0.3), shoulder_angle=2e-3, stribeck_speed=1e-3)
    start = at(0.0)
    start[:, 0] = SPIKE_PLACE + SPIKE_SWING * (1 + ABOUT_A_BORDER)
    return four(
        "friction spike",
        "slip within mm/s of rest, where friction trebles: caught or not",
        "no zero of the slip speed is missed; what friction near it makes of the motion is known "
        "to the tolerance",
        wiper, start, 4e-3, 0.3,
    )  # fmt: skip


def stiff_shoulder() -> Scene:
    """Return a shoulder 100 times stiffer than the reference: the lip hits it and rings."""
    wiper = Wiper(belt=SteadyBelt(0.3), shoulder_stiffness=200.0, normal_load=spread(15.0))
    return four(
        "stiff shoulder",
        "a spring 4000 times the neck past a corner",
        "every corner of the spring ends a step: orders of convergence hold across it",
        wiper, at(0.0), 0.03, 0.3,
    )  # fmt: skip


def kink_chain() -> Scene:
    """Return a lip that rings through both corners of its spring, 24 um and 2 us apart."""
    wiper = Wiper(
        belt=SteadyBelt(0.3),
        shoulder_angle=2e-3,
        mu_static=0.05,
        mu_minimum=0.05,
        support_damping=0.1,
        normal_load=spread(15.0),
    )
    return four(
        "chain of kinks",
        "two corners of the spring, passed within 2 us, thirty times",
        "no corner is passed over, however near the next",
        wiper, at(0.7), 0.01, 0.3,
    )  # fmt: skip


def reversal() -> Scene:
    """Return the end of a stroke: V passes zero at 20 ms and the lip flips over."""
    return four(
        "reversal",
        "V(t) passes zero, the lip flips",
        "steps end on V = 0, and the regime after it is decided by forces",
        turning(spread(15.0)), at(0.0, length=6.5e-3), 0.05, TURN_SPEED,
    )  # fmt: skip


def belt_corners() -> Scene:
    """Return a belt that turns from 1 m/s to -1 m/s within 50 us: no friction can follow."""
    wiper = Wiper(belt=TrapezoidBelt(1.0, 200.0, 5e-5, 0.4), normal_load=spread(15.0))
    return four(
        "belt with corners",
        "V' jumps by 40000 m/s^2, in stick and in slip",
        "steps end on the corners, and no stage sees the other side of one",
        wiper, at(0.0), 0.01, 1.0,
    )  # fmt: skip


def long_stick() -> Scene:
    """Return 3.6 s of stick on a slow belt and a slip of 0.7 ms, then stick again."""
    times = np.concatenate([np.arange(1, 31) * 0.118, np.linspace(3.56, 3.59, SAMPLES - 30)])
    load = 15.0 * (1 + 1e-3 * np.arange(4) / 3)
    wiper = Wiper(belt=SteadyBelt(1e-3), normal_load=load)
    return four(
        "long stick",
        "3.6 s of stick, then a slip of 0.7 ms",
        "stick ends when forces reach the edge of the cone, however long it takes",
        wiper, at(0.0), 3.59, 1e-3, times,
    )  # fmt: skip


def near_collapse() -> Scene:
    """Return a lip thrown over until 1.65 to 0.08 degrees are left to the angle of collapse.

    The tip nears the end of the lip's reach, where its lever, and all rates, have a pole.
    """
    wiper = Wiper(belt=SteadyBelt(0.3), support_stiffness=500.0, support_damping=0.01)
    speed = COLLAPSE_SPEED * (1 - np.array([3e-2, 1e-2, 3e-3, 1e-3]))
    return four(
        "near collapse",
        "the lip leans to 88.92 degrees, and collapses at 89",
        "collapse is an event: it is reported where the lip gets there, which is known to the "
        "tolerance",
        wiper, at(0.3, along=speed), 1e-3, 20.0,
    )  # fmt: skip


def growth() -> Scene:
    """Return steady slip, left by 1e-12 of the lip: it grows by 1e10 before it shows.

    Samples are of the last 8 ms, in which the swing grows until the glass catches the tip.
    """
    start = at(0.0)
    start[:, 0] = GROWTH_PLACE + 1e-12 * LENGTH * np.array([1.0, 1.5, 2.0, -1.0])
    duration = 0.032
    return four(
        "growth from 1e-12",
        "unstable steady slip, its oscillation grown out of 1e-12",
        "none: when it shows is set by the tolerance; `solve` with a `max_step` of a tenth of its "
        "period sees it",
        Wiper(belt=SteadyBelt(0.3)), start, duration, 0.3, np.linspace(0.024, duration, SAMPLES),
    )  # fmt: skip
