"""Blades drawn wide: every parameter over decades, all belts, elastic and plastic impacts.

A blade is told by its group and its number alone: it can be drawn again, by itself, at any time.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from wiperjax import SteadyBelt, TrapezoidBelt, Wiper, WipingBelt

KINDS = ("steady", "wiping", "trapezoid")
GROUPS = tuple((kind, hinge) for hinge in (False, True) for kind in KINDS)
BELTS = {"steady": SteadyBelt, "wiping": WipingBelt, "trapezoid": TrapezoidBelt}
DECADES = {  # SI units: evenly in the logarithm
    "tip_mass": (5e-4, 5e-2),
    "lip_length": (2e-3, 2e-2),
    "support_stiffness": (1e1, 1e5),
    "support_damping": (1e-2, 2e1),
    "neck_stiffness": (2e-3, 2.0),
    "shoulder_stiffness": (2e-2, 20.0),
    "normal_load": (0.1, 100.0),
    "stribeck_speed": (1e-3, 10.0),
}
EVENLY = {
    "attack_angle": (-1.2, 1.2),
    "shoulder_angle": (0.1, 1.5),
    "mu_static": (0.0, 3.0),
    "viscous_slope": (0.0, 0.2),
    "collapse_angle": (1.25, 1.56),
}
HINGE = {"hinge_mass": (1e-5, 5e-2), "hinge_damping": (1e-8, 1e-4)}
SPECIAL = (0.0, 0.9, 0.99, 1.0)  # restitutions that half of the blades have


class Drawn(NamedTuple):
    """Blades of one group, (count,) each. SI units, radians."""

    blade: dict[str, np.ndarray]
    belt: dict[str, np.ndarray]  # fields of the group's belt
    start: np.ndarray  # (count, 4): x, y, x', y'


def draw(group: int, seed: int, chunk: int, count: int) -> Drawn:
    """Return ``count`` blades of ``GROUPS[group]``; the same ones for the same arguments."""
    rng = np.random.default_rng([seed, chunk, group])
    kind, hinge = GROUPS[group]

    def decades(low, high):
        return np.exp(rng.uniform(math.log(low), math.log(high), count))

    blade = {name: decades(*ends) for name, ends in DECADES.items()}
    blade |= {name: rng.uniform(*ends, count) for name, ends in EVENLY.items()}
    blade["mu_minimum"] = blade["mu_static"] * rng.uniform(0, 1, count)
    blade["restitution"] = _either(rng, rng.choice(SPECIAL, count), rng.uniform(0, 1, count))
    blade["stribeck_shape"] = _either(rng, np.ones(count), rng.uniform(1, 4, count))
    if hinge:
        blade |= {name: decades(*ends) for name, ends in HINGE.items()}
        blade["gravity"] = _either(rng, np.full(count, 9.81), rng.uniform(-10, 10, count))
    speed = decades(1e-3, 5.0)
    belt = {"amplitude" if kind == "wiping" else "speed": speed}
    if kind == "steady":
        belt["speed"] = speed * rng.choice([-1.0, 1.0], count)
    else:
        belt |= {"frequency": decades(1.0, 500.0), "phase": rng.uniform(0, 2 * np.pi, count)}
    if kind == "trapezoid":
        belt["ramp"] = 0.5 / belt["frequency"] * rng.uniform(0.02, 1, count)
    return Drawn(blade, belt, _starts(rng, blade, count))


def wiper(group: int, drawn: Drawn) -> Wiper:
    """Return the wiper whose leaves are those arrays."""
    blade: dict[str, Any] = drawn.blade
    return Wiper(belt=BELTS[GROUPS[group][0]](**drawn.belt), **blade)


def _either(rng, first, second):
    return np.where(rng.random(len(first)) < 0.5, first, second)


def _starts(rng, blade, count) -> np.ndarray:
    """Half at rest and touching; half bent, of these half in the air, moving either way."""
    thrown, high = rng.random((2, count)) < 0.5
    bent = np.clip(blade["attack_angle"] + rng.uniform(-0.4, 0.4, count), -1.24, 1.24)
    high &= thrown
    start = np.zeros((count, 4))
    start[:, 0] = blade["lip_length"] * np.sin(np.where(thrown, bent, blade["attack_angle"]))
    start[:, 1] = np.where(high, rng.uniform(0, 1e-3, count), 0)
    start[:, 2] = np.where(thrown, rng.uniform(-0.5, 0.5, count), 0)
    start[:, 3] = np.where(high, rng.uniform(-0.5, 0.5, count), 0)
    return start
