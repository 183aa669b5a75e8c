"""Hard scenes of contact that opens and closes: touches, bounces, a jam, a load that vanishes."""

import math

import numpy as np

from wiperjax import SteadyBelt, TrapezoidBelt, Wiper

from .families import GRAZE_SPEED
from .four import ABOUT_A_BORDER, at, four, spread
from .scene import Scene

LIFT_LOAD = 2.8947521009  # N, at which the load of `load_to_zero` touches zero (by bisection)


def grazing() -> Scene:
    """Return passes whose approach is 1 % and 0.1 % too slow, or too fast, to touch."""
    start = at(0.7, 1e-4, upward=GRAZE_SPEED * (1 + ABOUT_A_BORDER))
    wiper = Wiper(belt=SteadyBelt(0.3), support_stiffness=8000.0, normal_load=5.0)
    return four(
        "grazing",
        "the gap closes to a hair, or opens on a touch",
        "no double zero of a guard is passed over: each step is proved free of them or cut",
        wiper, start, 6e-4, 0.3,
    )  # fmt: skip


def zeno() -> Scene:
    """Return a lip that falls on the glass and bounces to rest, infinitely often."""
    wiper = Wiper(
        belt=SteadyBelt(0.3),
        attack_angle=-0.6,
        support_stiffness=8000.0,
        restitution=0.5,
        normal_load=spread(15.0),
    )
    return four(
        "Zeno landing",
        "infinitely many bounces in finite time",
        "bounces that accumulate are completed by their limit; the motion after it knows nothing "
        "of `zeno_time`",
        wiper, at(-0.6, 5e-4, 0.2), 6e-3, 0.3,
    )  # fmt: skip


def near_painleve() -> Scene:
    """Return slip on a heavy hinge that runs into D = 0 under load (a jam), then bounces."""
    wiper = Wiper(
        belt=SteadyBelt(0.1),
        hinge_mass=2e-2,
        hinge_damping=2e-5,
        gravity=9.81,
        attack_angle=0.3205,
        mu_static=1.2797,
        stribeck_speed=0.2834,
        normal_load=spread(15.0),
    )
    return four(
        "near Painleve",
        "slip runs into D = 0 under load",
        "ends in an impact without collision; where several motions are possible it is flagged",
        wiper, at(math.atan(0.51427), along=0.6), 1e-3, 0.3,
    )  # fmt: skip


def large_step() -> Scene:
    """Return a parabola that dips through the glass: no error, so nothing keeps a step short.

    Gravity pulls away from the glass. The smooth motion is a polynomial, which a Runge-Kutta
    method follows exactly at any step, and the gap is open again at the end of a long one.
    """
    pull, fall = 50.0, -0.5  # m/s^2, m/s
    depth = 1e-3 * np.array([-0.2, 0.1, 0.2, 0.4])  # of the parabola below the glass; one misses
    wiper = Wiper(
        belt=SteadyBelt(0.3),
        support_stiffness=0.0,
        support_damping=0.0,
        neck_stiffness=1e-9,
        shoulder_stiffness=1e-9,
        normal_load=1e-6,
        gravity=-pull,
    )
    start = at(0.0, fall**2 / (2 * pull) - depth, upward=fall)
    return four(
        "large step",
        "a dip through the glass in free fall",
        "however long a step, no event inside it is missed",
        wiper, start, 0.02, 0.5,
    )  # fmt: skip


def two_at_once() -> Scene:
    """Return a lip that lands, upright and at rest, at the very instant the belt turns round.

    The support neither springs nor damps, so it falls as a stone: 0.2 mm in sqrt(2 h m / F). Two
    cells land at that instant, one 1e-9 of it sooner, one later.
    """
    height, load, mass, frequency = 2e-4, 15.0, 2.4e-3, 50.0
    fall = math.sqrt(2 * height * mass / load)
    wiper = Wiper(
        belt=TrapezoidBelt(0.8, frequency, 5e-3, -2 * math.pi * frequency * fall),
        tip_mass=mass,
        normal_load=load * (1 + 2e-9 * np.array([0, 0, 1, -1])),
        support_stiffness=0.0,
        support_damping=0.0,
    )
    return four(
        "two at once",
        "impact without slip at the instant V passes zero",
        "events of one instant are taken one by one, in any order that rounding makes of them; "
        "the motion after them is one",
        wiper, at(0.0, height), 0.02, 0.8,
    )  # fmt: skip


def chatter_in_slip() -> Scene:
    """Return a landing whose slip runs out as its bounces accumulate.

    Friction of each bounce slows the slip. Two cells come to stick 67 and 27 us after the
    accumulation, the others slip on.
    """
    wiper = Wiper(
        belt=SteadyBelt(0.3), attack_angle=-0.6, restitution=0.6, mu_static=0.6, mu_minimum=0.3
    )
    return four(
        "chatter in slip",
        "bounces accumulate while slip runs out: stick or slip?",
        "the limit of a sequence holds its change of slip speed, too",
        wiper, at(-0.6, 5e-4, np.array([6.2, 6.3, 6.5, 7.0])), 3e-3, 0.3,
    )  # fmt: skip


def load_to_zero() -> Scene:
    """Return a swing at whose end the glass presses with nothing: three cells lift off, one not.

    Supports pull up by 30, 10 and 1 % of the load that would just keep contact; the fourth keeps
    1 % of it.
    """
    wiper = Wiper(
        belt=SteadyBelt(8.0),
        mu_static=0.3,
        mu_minimum=0.3,
        support_damping=0.0,
        normal_load=LIFT_LOAD * (1 + np.array([-0.3, -0.1, -0.01, 0.01])),
    )
    return four(
        "load to zero",
        "the pressing force touches zero, or just not",
        "the glass never pulls: contact opens at the first zero of the force, a double one too",
        wiper, at(0.0, along=4.0), 2e-3, 4.0,
    )  # fmt: skip
