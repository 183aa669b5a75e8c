"""The scenes that every method is measured on, each a small family of blades.

A family, not one blade: the engine is a batch engine, and one blade can be right by luck. The first
cell of a family is the scene as named; the others differ by a percent or so (fixed seed).
"""

import math
from typing import Any

import numpy as np
from scipy.stats import qmc

from wiperjax import SteadyBelt, TrapezoidBelt, Wiper

from .scene import Scene

LENGTH = 6e-3  # m, the reference lip
TURN_SPEED = 0.8  # m/s, of the belt that turns
SAMPLES = 20
CELLS = 4096  # the engine takes 8 cases a lane at least: fewer would leave lanes out


def _times(duration: float) -> np.ndarray:
    return duration * np.arange(1, SAMPLES + 1) / SAMPLES


def _spread(rng, cells: int, value: float, percent: float = 1.0) -> np.ndarray:
    """Return ``value`` and, for the other cells, values within ``percent`` of it."""
    factor = 1 + 0.01 * percent * rng.uniform(-1, 1, cells)
    factor[0] = 1.0
    return value * factor


def _steady(speed: Any) -> SteadyBelt:
    """Return steady belts, one speed a cell."""
    return SteadyBelt(speed)


def _resting(wiper: Wiper, cells: int) -> np.ndarray:
    """Return the default start: phi = alpha, touching, at rest."""
    start = np.zeros((cells, 4))
    start[:, 0] = wiper.lip_length * np.sin(wiper.attack_angle)
    return start


ALL = ("squeal", "chatter", "reversal", "zeno", "grazing", "block", "batch")


def squeal(cells: int = CELLS) -> Scene:
    """Return the blade at 5 degrees that squeals at 781 Hz (stick-slip on the shoulder)."""
    rng = np.random.default_rng(1)
    wiper = Wiper(
        belt=SteadyBelt(0.3),
        attack_angle=math.radians(5),
        normal_load=_spread(rng, cells, 15.0),
    )
    return Scene(
        "squeal", "stick-slip near 781 Hz", wiper, _resting(wiper, cells), 0.02, _times(0.02),
        (LENGTH, 0.3),
    )  # fmt: skip


def chatter(cells: int = CELLS) -> Scene:
    """Return the leading blade that chatters and flies: stick, slip, impacts."""
    rng = np.random.default_rng(2)
    wiper = Wiper(
        belt=SteadyBelt(0.3),
        attack_angle=math.radians(-35),
        support_stiffness=8000.0,
        normal_load=_spread(rng, cells, 15.0),
    )
    return Scene(
        "chatter", "chattering with flight and bursts of impacts", wiper, _resting(wiper, cells),
        0.05, _times(0.05), (LENGTH, 0.3),
    )  # fmt: skip


def turning(normal_load) -> Wiper:
    """Return blades whose belt turns at 20 ms; ``normal_load`` [N/m], one a blade."""
    frequency = 0.7
    return Wiper(
        # V falls through zero at s = frequency t + phase / (2 pi) = 1/2
        belt=TrapezoidBelt(TURN_SPEED, frequency, 0.02, 2 * math.pi * (0.5 - frequency * 0.02)),
        lip_length=6.5e-3,
        neck_stiffness=0.01,
        support_stiffness=20000.0,
        mu_static=0.7,
        mu_minimum=0.5,
        normal_load=normal_load,
    )


def reversal(cells: int = CELLS) -> Scene:
    """Return the stroke's end: the belt turns at 20 ms and the lip flips over."""
    rng = np.random.default_rng(3)
    wiper = turning(_spread(rng, cells, 15.0))
    return Scene(
        "reversal", "wiping reversal: V passes zero, the lip flips", wiper,
        _resting(wiper, cells), 0.05, _times(0.05), (6.5e-3, TURN_SPEED),
    )  # fmt: skip


def zeno(cells: int = CELLS) -> Scene:
    """Return a lip that falls on the glass and bounces to rest, infinitely often."""
    rng = np.random.default_rng(4)
    wiper = Wiper(
        belt=SteadyBelt(0.3),
        attack_angle=-0.6,
        support_stiffness=8000.0,
        restitution=0.5,
        normal_load=_spread(rng, cells, 15.0),
    )
    start = np.tile([LENGTH * math.sin(-0.6), 5e-4, 0.2, 0.0], (cells, 1))
    return Scene(
        "zeno", "a Zeno landing: bounces that accumulate", wiper, start, 0.006,
        _times(0.006), (LENGTH, 0.3),
    )  # fmt: skip


# m/s, of a tip that touches the glass at zero speed (found by bisection, rtol 1e-13)
GRAZE_SPEED = -0.61453705229868


def grazing(cells: int = CELLS) -> Scene:
    """Return a flying tip that passes the glass: half the cells just miss it, half just touch.

    The lip is bent far past its shoulder and the support pulls up. Approach speeds differ from the
    grazing one by 1e-7 to 1e-2 of it, either way.
    """
    off = np.logspace(-7, -2, (cells + 1) // 2)
    change = np.stack([-off, off], axis=1).ravel()[:cells]
    wiper = Wiper(belt=SteadyBelt(0.3), support_stiffness=8000.0, normal_load=1.0)
    start = np.tile([LENGTH * math.sin(0.7), 5e-5, 0.0, 0.0], (cells, 1))
    start[:, 3] = GRAZE_SPEED * (1 + change)
    return Scene(
        "grazing", "a grazing pass: the gap closes to within a hair, or just touches", wiper,
        start, 3e-4, _times(3e-4), (LENGTH, 0.3),
    )  # fmt: skip


BLOCK_LENGTH, BLOCK_START = 1e6, 4.3  # m


def block(cells: int = CELLS) -> Scene:
    """Return a block on a belt under Coulomb friction, whose answer is exact (`exact.block`).

    A lip of 1e6 m turns by a few millionths of a radian: 1 kg on a spring of 1 N/m under 1 N, to
    1e-11 relative. It slips over the belt both ways, is captured, and is released again.
    """
    rng = np.random.default_rng(6)
    load = 1.0
    stiffness = (1.0 + load / BLOCK_LENGTH) * BLOCK_LENGTH**2
    wiper = Wiper(
        belt=_steady(_spread(rng, cells, 0.5)),
        tip_mass=1.0,
        lip_length=BLOCK_LENGTH,
        support_stiffness=0.0,
        support_damping=0.0,
        neck_stiffness=stiffness,
        shoulder_stiffness=stiffness,
        normal_load=load,
        mu_static=0.5,
        mu_minimum=0.5,
        viscous_slope=0.0,
    )
    start = np.tile([BLOCK_START, 0.0, 0.0, 0.0], (cells, 1))
    return Scene(
        "block", "block on a belt, exact answer", wiper, start, 15.0, _times(15.0), (1.0, 0.5)
    )


def batch(cells: int = 4096, duration: float = 0.02, seed: int = 20261121) -> Scene:
    """Return random blades of the reference sweep: alpha, load and speed over its whole box."""
    rng = np.random.default_rng(seed)
    speed = np.exp(rng.uniform(math.log(0.02), math.log(1.0), cells))
    wiper = Wiper(
        belt=_steady(speed),
        attack_angle=np.radians(rng.uniform(-40, 40, cells)),
        normal_load=rng.uniform(5, 30, cells),
    )
    return Scene(
        "batch", f"{cells} random blades of the reference sweep", wiper, _resting(wiper, cells),
        duration, _times(duration), (LENGTH, speed),
    )  # fmt: skip


def workload(cells: int, duration: float = 0.1, seed: int = 20261121) -> Scene:
    """Return the blades of the speed table: alpha -40..40 deg, N0 5..30 N/m, V 0.02..1 m/s.

    The first of one scrambled Sobol sequence: a slow method that is given a few of them meets the
    same share of dear ones as a fast one that is given them all (a few independent draws do not:
    32 of them were 4 % cheaper than the rest, 8 of them a fifth dearer).
    """
    sequence = qmc.Sobol(3, rng=np.random.default_rng(seed))
    drawn = sequence.random_base2(max(cells - 1, 0).bit_length())[:cells]
    speed, angle, load = qmc.scale(drawn, [0.02, -40, 5], [1.0, 40, 30]).T
    wiper = Wiper(belt=_steady(speed), attack_angle=np.radians(angle), normal_load=load)
    return Scene(
        "workload", "random blades, uniform", wiper, _resting(wiper, cells), duration,
        _times(duration), (LENGTH, speed),
    )  # fmt: skip
