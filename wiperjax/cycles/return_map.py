"""The return map of a family of systems, and Newton's method on it.

On a steady belt the period is unknown as well, and the start lies on a section; with a clock (a
wiping belt, a forced oscillator) the period is known.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..contact.system import AbstractSystem
from ..systems import numbers
from ..vocabulary.codes import FAIR, Result
from .chart import Chart, chart
from .roots import pinned_root
from .shooting import Arc, Lost, shoot

CLOSED = 1e-9  # of the return map, relative to the size of the motion: larger is no cycle
ENOUGH = 1e-11  # closed to rounding
REPEATS = 1e-6  # a motion that comes back so near is periodic, and what is left no creep
HELD = 1e-6  # of the motion: how well its end is back on the contact that it began in
MOST_MOTIONS = 10  # of one correction: a cycle that is there takes 3 to 6


def complete(moved: Arc) -> Arc:
    """Return the motion if it reached its end. Raises `Lost`, which says how it ended, if not."""
    if int(moved.result) not in FAIR:
        raise Lost(f"the motion ended early: {Result(int(moved.result)).name.lower()}")
    return moved


class Found(IntEnum):
    """How the search for a cycle ended."""

    FOUND = 0
    AT_REST = 1  # the motion dies out: quiet
    NOT_PERIODIC = 2  # no return (`first_guess.MOST_RETURNS`): settle for longer, or chaos
    NOT_CONVERGED = 3  # Newton's method did not close the orbit: settle for longer, or a corner
    NOT_ISOLATED = 4  # closed, but with a multiplier (nearly) 1 beside the trivial: fold, or family
    TRAJECTORY_FAILED = 5  # the motion ended early (collapsed, or a failure of the engine)


@dataclass(frozen=True)
class Shooting:
    """The return map of a family of systems: what is varied, what is measured in what units."""

    system: AbstractSystem  # traceable
    over: str | None  # number of the system that is varied
    clock: Callable[[AbstractSystem], Any] | None  # period of what drives it, or None
    section: Callable | None
    repeats: int  # periods of the clock, or returns to the section, in one of the motion
    scale: np.ndarray  # (2n,) sizes of the motion
    period_scale: float
    parameter_scale: float = 1.0
    rtol: float = 1e-10
    max_step: float | None = None  # s; None: as long as the motion is smooth

    @property
    def names(self) -> tuple[str, ...]:
        """Return the name of the parameter, if there is one."""
        return () if self.over is None else (self.over,)

    def at(self, parameter: float) -> AbstractSystem:
        """Return the system at a value of the parameter."""
        if self.over is None:
            return self.system
        return numbers.replaced(self.system, self.over, parameter)

    @cached_property
    def along(self):
        """The tangent of the system along the parameter."""
        return numbers.direction(self.system, self.over)

    def chart(self, system: AbstractSystem, state, time: float, regime: int) -> Chart:
        """Return `chart` in the family's sizes, on its section. Raises `Lost`."""
        return chart(system, state, time, regime, self.scale, self.section)

    def unknowns(self, where: Chart, period: float, *parameters: float) -> np.ndarray:
        """Return the unknowns of a cycle that starts at the origin of ``where``: coordinates, the
        period unless a clock sets it, ``parameters`` (scaled)."""
        free = [period / self.period_scale] if self.clock is None else []
        return np.concatenate([np.zeros(where.basis.shape[1]), free, parameters])

    def period_of(self, where: Chart, unknowns: np.ndarray) -> float:
        """Return the period among the unknowns; NaN where a clock sets it."""
        if self.clock is not None:
            return math.nan
        return float(unknowns[where.basis.shape[1]]) * self.period_scale

    def motion(self, system: AbstractSystem, state, period: float, **stretch) -> Arc:
        """Return `shoot` of one of the family, along the parameter, with the family's steps."""
        steps = {"rtol": self.rtol, "max_step": self.max_step}
        return shoot(system, self.along, state, period, **(steps | stretch))

    def driven_period(self, parameter: float) -> tuple[float, float]:
        """Return the period that the clock sets, and its derivative by the parameter."""
        assert self.clock is not None
        clock, system = self.clock, self.at(parameter)

        def period(parameter):
            varied = system
            if self.over is not None:
                varied = numbers.replaced(system, self.over, parameter)
            return self.repeats * jnp.asarray(clock(varied), float)

        value, slope = jax.jvp(period, (jnp.asarray(parameter, float),), (jnp.ones(()),))
        return float(value), float(slope)

    def returned(self, where: Chart, phase: float, w, period: float, parameter: float):
        """Return (residual, its derivatives by (w, period, parameter), motion) in scaled numbers.

        Raises `Lost` if the motion does not reach the end of the period.
        """
        slope = 0.0
        if self.clock is not None:
            period, slope = self.driven_period(parameter)
        start = where.state(w)
        moved = self.motion(self.at(parameter), start, period, phase=phase, regime=where.regime)
        if not np.all(np.isfinite(complete(moved).by_state)):
            raise Lost("the motion has no finite derivatives")
        residual = where.read(moved.state - moved.samples[0])
        columns = [where.read(moved.by_state @ where.basis - where.basis)]
        if self.clock is None:
            columns.append(where.read(moved.by_period)[:, None] * self.period_scale)
        by_parameter = moved.by_parameter + slope * moved.by_period
        columns.append(where.read(by_parameter)[:, None] * self.parameter_scale)
        return residual, np.concatenate(columns, axis=1), moved


@dataclass(frozen=True)
class Point:
    """A solution (w, period, parameter) in the coordinates of a chart, with the motion there."""

    where: Chart
    phase: float
    unknowns: np.ndarray  # (w..., period unless driven, parameter), scaled
    jacobian: np.ndarray  # (m, m + 1) of the residual by the unknowns
    residual: float
    motion: Arc
    period: float
    parameter: float


def correct(shooting: Shooting, where: Chart, phase: float, guess, pinned=None) -> Point | None:
    """Return the cycle that `corrected` does, or None."""
    try:
        return corrected(shooting, where, phase, guess, pinned)
    except Lost:
        return None


def corrected(shooting: Shooting, where: Chart, phase: float, guess, pinned=None) -> Point:
    """Return the cycle nearest to ``guess`` (scaled unknowns) by Newton's method.

    ``pinned @ unknowns`` keeps its value: by default that is the parameter; in a continuation the
    step along the tangent. Raises `Lost`, which says why, where it comes to none.
    """
    guess = np.asarray(guess, float)
    if pinned is None:
        pinned = np.eye(len(guess))[-1]
    d = where.basis.shape[1]
    missed = []

    def equations(u):
        parameter = u[-1] * shooting.parameter_scale
        found = shooting.returned(where, phase, u[:d], shooting.period_of(where, u), parameter)
        missed.append(float(np.max(np.abs(found[0]), initial=0.0)))  # nothing may be left free
        return found

    found = pinned_root(equations, guess, pinned, enough=ENOUGH, tolerance=1e-10, most=MOST_MOTIONS)
    size, motion = missed[-1], found.more
    if not (size < CLOSED and found.off < CLOSED):
        raise Lost(_why_open(missed), min(missed))
    aside = np.max(np.abs(motion.state - motion.samples[0]) / where.scale)
    if not aside < HELD:
        raise Lost("its end is off the contact that it begins in", float(aside))
    return Point(
        where,
        phase,
        found.unknowns,
        found.jacobian,
        size,
        motion,
        period=float(motion.times[-1] - motion.times[0]),
        parameter=found.unknowns[-1] * shooting.parameter_scale,
    )


def _why_open(missed: list[float]) -> str:
    """Say why motions that ``missed`` their starts by so much, of their size, were not closed."""
    if min(missed) < REPEATS:
        return (
            f"the motion comes back to {min(missed):.0e} of its size, but no nearer: "
            "a corner in a law or a force?"
        )
    return (
        f"the motion still changes by {missed[0]:.0e} of its size in a period: it creeps, and must "
        "settle for longer, or is quasi-periodic or chaotic"
    )
