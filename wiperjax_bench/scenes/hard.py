"""Scenes at which methods fail, small families of four blades each.

Every family moves far enough that a missed or invented event shows in the position. An independent
code confirms the reference of each (`tests/bench/test_failures.py`).
"""

import math
from collections.abc import Callable

import numpy as np

from wiperjax import SteadyBelt, Wiper

from .families import GRAZE_SPEED, LENGTH, TURN_SPEED, turning
from .scene import Scene

CELLS = 4
SAMPLES = 60


def _scene(name, about, wiper, start, duration, speed) -> Scene:
    times = np.minimum(duration * np.arange(1, SAMPLES + 1) / SAMPLES, duration)
    scales = (float(wiper.lip_length), speed)
    return Scene(name, about, wiper, start, duration, times, scales)


def _spread(value: float) -> np.ndarray:
    """Return ``value`` and three values within a percent of it."""
    return value * (1 + 0.01 * np.arange(CELLS) / (CELLS - 1))


def _at(angle: float, height=0.0, along=0.0, upward=0.0, length=LENGTH) -> np.ndarray:
    return np.tile([length * math.sin(angle), height, along, upward], (CELLS, 1))


def grazing() -> Scene:
    """Return passes whose approach is 1 % and 0.1 % too slow, or too fast, to touch."""
    start = _at(0.7, 1e-4)
    start[:, 3] = GRAZE_SPEED * (1 + np.array([-1e-2, -1e-3, 1e-3, 1e-2]))
    wiper = Wiper(belt=SteadyBelt(0.3), support_stiffness=8000.0, normal_load=5.0)
    return _scene(
        "grazing", "the gap closes to a hair, or opens on a touch", wiper, start, 6e-4, 0.3
    )


def zeno() -> Scene:
    """Return a lip that falls on the glass and bounces to rest, infinitely often."""
    wiper = Wiper(
        belt=SteadyBelt(0.3),
        attack_angle=-0.6,
        support_stiffness=8000.0,
        restitution=0.5,
        normal_load=_spread(15.0),
    )
    start = _at(-0.6, 5e-4, 0.2)
    return _scene("Zeno landing", "infinitely many bounces in finite time", wiper, start, 6e-3, 0.3)


def steep_stribeck() -> Scene:
    """Return a friction curve that falls within 1 mm/s: stick-slip with sharp corners."""
    wiper = Wiper(belt=SteadyBelt(0.3), stribeck_speed=1e-3, normal_load=_spread(15.0))
    return _scene("steep Stribeck", "friction falls within 1 mm/s", wiper, _at(0.0), 0.03, 0.3)


def stiff_shoulder() -> Scene:
    """Return a shoulder 100 times stiffer than the reference: the lip hits it and rings."""
    wiper = Wiper(belt=SteadyBelt(0.3), shoulder_stiffness=200.0, normal_load=_spread(15.0))
    return _scene(
        "stiff shoulder", "a spring 4000 times the neck past a corner", wiper, _at(0.0), 0.03, 0.3
    )


def reversal() -> Scene:
    """Return the end of a stroke: V passes zero at 20 ms and the lip flips over."""
    wiper = turning(_spread(15.0))
    start = _at(0.0, length=6.5e-3)
    return _scene("reversal", "V(t) passes zero, the lip flips", wiper, start, 0.05, TURN_SPEED)


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
        normal_load=_spread(15.0),
    )
    start = _at(math.atan(0.51427), along=0.6)
    return _scene("near Painleve", "slip runs into D = 0 under load", wiper, start, 1e-3, 0.3)


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
    start = _at(0.0, upward=fall)
    start[:, 1] = fall**2 / (2 * pull) - depth
    return _scene("large step", "a dip through the glass in free fall", wiper, start, 0.02, 0.5)


SCENES: dict[str, Callable[[], Scene]] = {
    make.__name__: make
    for make in (
        grazing,
        zeno,
        steep_stribeck,
        stiff_shoulder,
        reversal,
        near_painleve,
        large_step,
    )
}
