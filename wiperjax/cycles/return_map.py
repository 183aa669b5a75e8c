"""The return map of a family of systems, and Newton's method on it.

On a steady belt the period is unknown as well, and the start lies on a section; with a clock (a
wiping belt, a forced oscillator) the period is known.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import scipy.optimize

from ..contact.system import AbstractSystem
from ..systems import numbers
from ..vocabulary.codes import FAIR, Result
from .chart import Chart
from .shooting import Arc, Lost, shoot

CLOSED = 1e-9  # of the return map, relative to the size of the motion: larger is no cycle
ENOUGH = 1e-11  # closed to rounding
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
    NOT_CONVERGED = 3  # Newton's method did not close the orbit
    NOT_ISOLATED = 4  # closed, but with a multiplier (nearly) 1 beside the trivial: fold, or family
    TRAJECTORY_FAILED = 5  # the motion ended early (collapsed, or a failure of the engine)


class _Closed(Exception):
    """The orbit is closed to rounding: no further step is wanted."""


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
    varied: tuple[str, ...] = ()  # numbers that the compiled program can differentiate by

    def at(self, parameter: float) -> AbstractSystem:
        """Return the system at a value of the parameter."""
        if self.over is None:
            return self.system
        return numbers.replaced(self.system, self.over, parameter)

    def along(self):
        """Return the tangent of the system along the parameter."""
        return numbers.direction(self.system, self.over, *self.varied)

    def motion(self, system: AbstractSystem, state, period: float, **stretch) -> Arc:
        """Return `shoot` of one of the family, along the parameter, with the family's steps."""
        steps = {"rtol": self.rtol, "max_step": self.max_step}
        return shoot(system, self.along(), state, period, **(steps | stretch))

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


def correct(
    shooting: Shooting, where: Chart, phase: float, guess, pinned=None, target: float | None = None
) -> Point | None:
    """Return the cycle nearest to ``guess`` (scaled unknowns) by Newton's method, or None.

    The last equation is ``pinned @ unknowns = target``: by default the parameter keeps its value;
    in a continuation the step along the tangent is prescribed. `scipy.optimize.root` (MINPACK's
    Levenberg-Marquardt: Newton's method within a trust region) takes the exact Jacobian of every
    motion, where its hybrid method would update one and take three times as many.
    """
    guess = np.asarray(guess, float)
    if pinned is None:
        pinned = np.zeros(len(guess))
        pinned[-1] = 1.0
    if target is None:
        target = float(pinned @ guess)
    d = where.basis.shape[1]
    last: dict[str, Any] = {}

    def equations(u):
        parameter = u[-1] * shooting.parameter_scale
        period = u[d] * shooting.period_scale if shooting.clock is None else math.nan
        residual, jacobian, motion = shooting.returned(where, phase, u[:d], period, parameter)
        last.update(u=u.copy(), residual=residual, jacobian=jacobian, motion=motion)
        last.update(parameter=parameter, period=float(motion.times[-1] - motion.times[0]))
        values = np.append(residual, pinned @ u - target)
        if np.max(np.abs(values)) < ENOUGH:
            raise _Closed
        return values, np.vstack([jacobian, pinned])

    try:
        options = {"xtol": 1e-10, "ftol": 1e-10, "factor": 0.1, "maxiter": MOST_MOTIONS}
        answer = scipy.optimize.root(equations, guess, jac=True, method="lm", options=options)
        if not np.array_equal(last["u"], answer.x):
            equations(answer.x)
    except _Closed:
        pass
    except Lost:
        return None
    size = float(np.max(np.abs(last["residual"]), initial=0.0))  # contact may leave nothing free
    off = abs(float(pinned @ last["u"]) - target)
    motion = last["motion"]
    aside = np.max(np.abs(motion.state - motion.samples[0]) / where.scale)  # of the contact, too
    if not (size < CLOSED and off < CLOSED and aside < HELD):
        return None
    return Point(
        where,
        phase,
        last["u"],
        last["jacobian"],
        size,
        motion,
        last["period"],
        last["parameter"],
    )
