"""Prescribed motion of the glass (docs/model.md, section 8), piece by smooth piece.

A belt is smooth between its breaks (corners and reversals). Breaks are known in advance, so the
engine steps exactly onto them; piece ``k`` ends at ``break_time(k)``. ``velocity(t, k)`` is the
formula of piece ``k``, continued smoothly past its ends, so that no stage of a step ever sees
the other side of a corner.
"""

from abc import abstractmethod
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from ..vocabulary import checks, declared, kinds
from ..vocabulary.kinds import BELTS
from ..vocabulary.parameters import REFERENCE, longest_ramp
from .card import card, kind_parameters

TURN = 6.283185307179586


class AbstractBelt(eqx.Module):
    """Belt velocity V(t) [m/s] along +x."""

    kind: ClassVar[str] = ""  # its name in files (`kinds.BELTS`), if it has one

    def __check_init__(self):
        names = BELTS.get(self.kind, {})
        checks.parameters({key: getattr(self, key) for key in names}, names)
        declared.check(self)

    def _repr_html_(self) -> str:
        """Its parameters with their units, as a notebook shows them."""
        return card(self, kind_parameters(BELTS.get(self.kind, {})))

    @abstractmethod
    def velocity(self, time, piece):
        """V [m/s] at ``time`` [s] by the formula of piece ``piece``, smooth within it (twice
        continuously differentiable) and going on in the next where it ends: what slips keeps its
        side of V there.
        """

    def motion(self, time, piece):
        """V [m/s] and V' [m/s^2] at ``time`` [s] by the formula of piece ``piece``."""

        def velocity(t):
            found = jnp.asarray(self.velocity(t, piece))
            if not jnp.issubdtype(found.dtype, jnp.floating):  # a whole number has no derivative
                found = found.astype(float)
            return jnp.broadcast_to(found, jnp.shape(t))

        return jax.jvp(velocity, (time,), (jnp.ones_like(time),))

    @abstractmethod
    def break_time(self, piece):
        """Time [s] at which piece ``piece`` ends; inf if never."""

    @abstractmethod
    def first_piece(self, time):
        """Index of the piece that holds just after ``time``."""

    @abstractmethod
    def reverses(self, piece):
        """True where the break that ends ``piece`` is a passage of V through zero."""

    def since_reversal(self, time):
        """Time [s] since the nearest passage of V through zero (negative: until it); inf of a belt
        that does not turn: one that does says it itself."""
        return jnp.full_like(time, jnp.inf)

    @property
    def wiping_frequency(self) -> Any:
        """Frequency [Hz] of the belt's motion; 0 if it is steady."""
        return 0.0

    @property
    def judged_at(self) -> Any:
        """Time [s] at which a motion on it is linearised: of a belt that turns, at its peak."""
        return 0.0

    @property
    def judged_speed(self) -> Any:
        """V [m/s] at the time `judged_at`, of its sign."""
        return _judged(self)

    @property
    @abstractmethod
    def peak(self) -> Any:
        """Largest belt speed [m/s]: the scale of velocities."""

    @property
    @abstractmethod
    def rms(self) -> Any:
        """Root mean square of V [m/s] over a period."""


class SteadyBelt(AbstractBelt):
    """Constant velocity ``speed`` [m/s]."""

    kind = "steady"
    speed: float = REFERENCE["belt_speed"]

    def velocity(self, time, piece):
        return self.speed

    def break_time(self, piece):
        return jnp.inf

    def first_piece(self, time):
        return 0

    def reverses(self, piece):
        return False

    @property
    def judged_speed(self):
        return self.speed if type(self) is SteadyBelt else _judged(self)

    @property
    def peak(self):
        return jnp.abs(self.speed)

    @property
    def rms(self):
        return kinds.steady_rms(self.speed, jnp)


class _Turning:
    """What a belt has that turns round twice a period: V is zero where 2 ``frequency`` t +
    ``phase`` / pi is a whole number, and rises there if that is even. No module itself: its fields
    would come before those of the belt, as type checkers read them."""

    frequency: Any  # Hz
    phase: Any  # rad
    peak: Any  # m/s

    @property
    def wiping_frequency(self):
        return self.frequency

    @property
    def judged_speed(self):
        # without the rounding of a time, also where two ramps meet there
        return self.peak if type(self) in CLASSES.values() else _judged(self)

    def since_reversal(self, time):
        return kinds.since_reversal(time, self.frequency, self.phase / TURN, jnp)

    def _half(self, time):
        """Index of the half period that holds at ``time``, to rounding."""
        return jnp.floor(2 * (self.frequency * time + self.phase / TURN)).astype(int)

    def _zero(self, half):
        """Time at which half period ``half`` begins."""
        return (0.5 * half - self.phase / TURN) / self.frequency

    def _middle(self, speed):
        """Time of the middle of a stroke of positive velocity; ``speed`` has the sign of the stroke
        that half period 0 is."""
        return (0.5 - 0.25 * jnp.sign(speed) - self.phase / TURN) / self.frequency


class WipingBelt(_Turning, AbstractBelt):
    """``amplitude sin(2 pi frequency t + phase)``; amplitude [m/s], frequency [Hz], phase [rad]."""

    kind = "wiping"
    amplitude: float
    frequency: float
    phase: float = REFERENCE["belt_phase"]

    @property
    def judged_at(self):
        return self._middle(self.amplitude)

    def velocity(self, time, piece):
        return self.amplitude * jnp.sin(TURN * self.frequency * time + self.phase)

    def break_time(self, piece):
        return self._zero(piece)

    def first_piece(self, time):
        guess = self._half(time)
        return guess + (self.break_time(guess) <= time) + (self.break_time(guess + 1) <= time)

    def reverses(self, piece):
        return True

    @property
    def peak(self):
        return jnp.abs(self.amplitude)

    @property
    def rms(self):
        return kinds.wiping_rms(self.amplitude, jnp)


class TrapezoidBelt(_Turning, AbstractBelt):
    """Plateaus of +-``speed`` joined by linear ramps of duration ``ramp`` [s] centred on V = 0.

    With s = frequency t + phase / (2 pi), V rises through 0 at integer s and falls through 0 at
    s = 1/2 (docs/model.md, section 8). Every half period j has three breaks: start of the ramp,
    V = 0 (s = j/2) and end of the ramp; pieces are numbered 3 j + (0: plateau, 1 and 2: ramp).
    """

    kind = "trapezoid"
    speed: float
    frequency: float
    ramp: float
    phase: float = REFERENCE["belt_phase"]

    def __check_init__(self):
        super().__check_init__()  # equinox calls it too, but after this one
        checks.at_most("ramp", self.ramp, longest_ramp(self.frequency), "half a period")

    @property
    def judged_at(self):
        return self._middle(self.speed)

    def velocity(self, time, piece):
        half, part = piece // 3, piece % 3
        rising = 1.0 - 2.0 * (half % 2)
        slope = 2.0 * self.speed / self.ramp
        on_ramp = slope * (time - self._zero(half))
        return rising * jnp.where(part == 0, -self.speed, on_ramp)

    def break_time(self, piece):
        return self._zero(piece // 3) + 0.5 * self.ramp * (piece % 3 - 1)

    def first_piece(self, time):
        start = 3 * self._half(time)
        passed = [self.break_time(start + i) <= time for i in range(6)]
        return start + sum(p.astype(int) for p in passed)

    def reverses(self, piece):
        return piece % 3 == 1

    @property
    def peak(self):
        return jnp.abs(self.speed)

    @property
    def rms(self):
        return kinds.trapezoid_rms(self.speed, self.frequency, self.ramp, jnp)


CLASSES = {belt.kind: belt for belt in (SteadyBelt, WipingBelt, TrapezoidBelt)}
"""Kind -> class of the belts that files can ask for."""


def _judged(belt: Any) -> Any:
    """Return V [m/s] at the time `judged_at`, as a belt says it: one made of a belt of this package
    may move in another way, or be judged at another time."""
    time = jnp.asarray(belt.judged_at, float)
    return belt.velocity(time, belt.first_piece(time))
