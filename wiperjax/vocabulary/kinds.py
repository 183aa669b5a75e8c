"""Kinds of what a file names: belts, friction laws, models, solvers; and what is known of each
without computing a motion.

The classes are `contact.belts`, `contact.friction`, `blade.rungs` and `numerics.runge_kutta`: each
is found by the name that stands here. Imports no jax; a formula that compiled code shares is given
the library it computes with.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from .parameters import PARAMETERS, Parameter

WIPER = "wiper"
"""Name of the system that a file means by itself."""

SYSTEMS: Mapping[str, str] = MappingProxyType(
    {
        "flutter": "wiperjax.systems.flutter:ModeCoupling",
        "soft_lip": "wiperjax.systems.soft_lip:SoftLip",
        "head_and_tip": "wiperjax.systems.head_and_tip:HeadAndTip",
        "oscillator": "wiperjax.systems.oscillator:Oscillator",
        "chain2": "wiperjax.systems.chain:Chain2",
        "chain3": "wiperjax.systems.chain:Chain3",
        "chain8": "wiperjax.systems.chain:Chain8",
        "woodpecker": "wiperjax.systems.woodpecker:Woodpecker",
    }
)
"""Further systems that come with the package, by the name that a file may use -> import path."""

STEADY_KINDS = (None, "steady")
"""Kinds of belt on which a noise keeps its own time: none that turns, or no belt."""

MODELS: Mapping[str, str] = MappingProxyType(
    {
        "block": "at rest where the spring is relaxed",
        "bar": "touching at the attack angle, at rest",
        "lip": "touching at the attack angle, at rest",
    }
)
"""Rung of the ladder, the poorest first -> how its motion starts by default."""

AUTO = "auto"
"""Instead of a rung: the poorest that says the same as the lip of some cells of a sweep."""

WAYS = ("up", "down")
"""Ways in which a parameter is swept, each value from where the motion at its neighbour ended."""

STARTS: Mapping[str, str] = MappingProxyType(
    {
        "at_rest": "touching at the attack angle, at rest",
        "steady_slip": "at steady slip, but for a kick",
        "up": "where the next lower cell of the swept axis ended",
        "down": "where the next higher cell of the swept axis ended",
    }
)
"""Starts that `[starts]` of a sweep file can name."""

SOLVERS = ("tsit5", "dopri5", "dopri8", "bosh3")
"""Runge-Kutta methods; diffrax has each under its name with a capital."""


def since_reversal(time: Any, frequency: Any, turns: Any, library: Any = np) -> Any:
    """Time [s] since the nearest V = 0 (docs/model.md, section 8) of a belt that reverses twice a
    period, at phase 0 and half a turn on; ``turns``: its phase, 1 for a whole turn.
    """
    halves = 2 * (frequency * time + turns)
    return (halves - library.round(halves)) / (2 * frequency)


def usual_transient(duration: float, kind: str) -> float:
    """Time [s] that is left out of a run on a belt of this kind, unless another is asked for."""
    return duration / (2 if kind in ("", "steady") else 8)


def steady_rms(speed: Any, library: Any = np) -> Any:
    """Root mean square [m/s] of a constant speed."""
    return library.abs(speed)


def wiping_rms(amplitude: Any, library: Any = np) -> Any:
    """Root mean square [m/s] of a sine."""
    return library.abs(amplitude) / library.sqrt(2.0)


def trapezoid_rms(speed: Any, frequency: Any, ramp: Any, library: Any = np) -> Any:
    """Root mean square [m/s] of a trapezoid: a ramp holds a third of the plateau's mean square."""
    return library.abs(speed) * library.sqrt(1 - 2 * frequency * ramp * 2 / 3)


@dataclass(frozen=True)
class Kind:
    """A belt or a friction law as files know it.

    Attributes:
        keys: argument of its class (and key in `[belt]`) -> name in `parameters.PARAMETERS`.
        value: what is worked out of it without jax, from those arguments that it takes: of a belt
            its rms speed [m/s], of a law mu at slip speeds [m/s] (the first argument).
        takes: those arguments.
    """

    keys: Mapping[str, str]
    value: Callable[..., Any]
    takes: tuple[str, ...]

    def of(self, attrs: Mapping[str, Any], *first: Any) -> Any:
        """`value` with its arguments from attributes that bear the names of parameters."""
        return self.value(*first, *(float(attrs[self.keys[key]]) for key in self.takes))


BELT_KINDS: Mapping[str, Kind] = MappingProxyType(
    {
        "steady": Kind({"speed": "belt_speed"}, steady_rms, ("speed",)),
        "wiping": Kind(
            {
                "amplitude": "belt_speed",
                "frequency": "belt_frequency",
                "phase": "belt_phase",
            },
            wiping_rms,
            ("amplitude",),
        ),
        "trapezoid": Kind(
            {
                "speed": "belt_speed",
                "frequency": "belt_frequency",
                "ramp": "belt_ramp",
                "phase": "belt_phase",
            },
            trapezoid_rms,
            ("speed", "frequency", "ramp"),
        ),
    }
)

BELTS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {kind: entry.keys for kind, entry in BELT_KINDS.items()}
)
"""Kinds of belt: key in `[belt]`, which is also the argument of the belt's class -> parameter."""

_OF_BELTS = {key: name for keys in BELTS.values() for key, name in keys.items()}


def of_fields(fields: Sequence[str]) -> Parameter | None:
    """Parameter that the fields lead to, `lip.attack_angle` or `belt.speed`, if it is one."""
    *_, owner, field = ("", "", *fields)
    return PARAMETERS.get(_OF_BELTS.get(field, "") if owner == "belt" else field)


def is_absent(fields: Sequence[str], value: float, others: tuple[float, ...]) -> bool:
    """Whether the number that the fields lead to is one whose terms compiled programs leave out: it
    stays a Python number there, and another value is another program. ``others``: values at which
    that holds for what is no parameter of a blade or belt, such as a number of a system of one's
    own.
    """
    entry = of_fields(fields)
    return value in (others if entry is None else (entry.absent_at,))


def stribeck(
    speed: Any,
    static: Any,
    minimum: Any,
    stribeck_speed: Any,
    shape: Any,
    viscous_slope: Any,
    decay: Callable[[Any, Any], Any] = lambda ratio, shape: np.exp(-(ratio**shape)),
) -> Any:
    """mu at slip speeds >= 0 [m/s] (docs/model.md, section 4); ``decay(|v|/v_s, delta)``: its
    exponential, which compiled code takes to be smooth beyond 0.
    """
    falling = decay(speed * (1 / stribeck_speed), shape)
    return minimum + (static - minimum) * falling + viscous_slope * speed


def coulomb(speed: Any, dynamic: Any) -> Any:
    """mu at slip speeds > 0 [m/s]: the same at all."""
    return dynamic + 0 * speed


FRICTION_KINDS: Mapping[str, Kind] = MappingProxyType(
    {
        "stribeck": Kind(
            {
                "static": "mu_static",
                "minimum": "mu_minimum",
                "stribeck_speed": "stribeck_speed",
                "shape": "stribeck_shape",
                "viscous_slope": "viscous_slope",
            },
            stribeck,
            ("static", "minimum", "stribeck_speed", "shape", "viscous_slope"),
        ),
        "coulomb": Kind({"static": "mu_static", "dynamic": "mu_minimum"}, coulomb, ("dynamic",)),
    }
)

FRICTIONS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {kind: entry.keys for kind, entry in FRICTION_KINDS.items()}
)
"""Friction laws: argument of the law's class -> parameter, which stands in `[blade]`."""


LAW_PARAMETERS = frozenset(name for keys in FRICTIONS.values() for name in keys.values())
"""Parameters of the blade that are numbers of some law: a blade has those of its own law."""
