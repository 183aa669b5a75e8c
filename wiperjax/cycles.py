"""Periodic motion by shooting: the limit cycle that a simulation settles on, and its multipliers.

A cycle is a fixed point of the return map: z(T; z0) = z0. Newton's method on it takes the exact
monodromy matrix, the derivative of the motion through all its events (`shooting`). On a steady belt
the period is unknown as well, and z0 lies on a section (by default where the first coordinate
turns); with a clock (a wiping belt, a forced oscillator) the period is known.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
import scipy.optimize

from . import named
from .results import Event, Regime, Result
from .shooting import Chart, Stretch, chart, stretch, turning_point
from .system import AbstractSystem

CLOSED = 1e-7  # of the return map, relative to the size of the motion: larger is no cycle
ISOLATED = 1e-6  # distance of a multiplier from 1
STILL = 1e-6  # of the typical size: a smaller oscillation is rest
ALIKE = 0.05  # of the size of the motion: how near a settled motion must come back
MOST_RETURNS = 8  # turning points, or periods of the clock, in one period of the motion
_FAIR = (Result.FINISHED, Result.PAINLEVE_INDETERMINATE)


class Found(IntEnum):
    """How the search for a cycle ended."""

    FOUND = 0
    AT_REST = 1  # the motion dies out: quiet
    NOT_PERIODIC = 2  # no return within `MOST_RETURNS`: settle for longer, or it is chaotic
    NOT_CONVERGED = 3  # Newton's method did not close the orbit
    NOT_ISOLATED = 4  # closed, but with a multiplier 1 beside the trivial one: a fold, or a family
    TRAJECTORY_FAILED = 5  # the motion ended early (collapsed, or a failure of the engine)


class Lost(RuntimeError):
    """A motion on the way to a cycle that did not reach its end; its text says why."""


@dataclass(frozen=True)
class Cycle:
    """A periodic motion of ``system``. SI units (the system's own); NaN where none was found.

    ``multipliers`` are the eigenvalues of the return map, complex, largest first; the trivial one
    along the orbit (steady belt) is left out, so there are 2 n - 1 of them, and 2 n with a clock.
    A zero is not rounding but a loss of memory: a phase of stick, or of contact, keeps nothing of
    what it does not hold. ``trivial_error`` is by how much the trivial one misses 1: what the
    multipliers are worth.
    """

    system: AbstractSystem
    found: Found
    why: str = ""  # more on a failure
    period: float = math.nan
    state: np.ndarray | None = None  # (2n,): position and q' at the start
    phase: float = 0.0  # of the start, in periods of the clock
    regime: int = -1  # `Regime` there
    multipliers: np.ndarray | None = None
    trivial_error: float = math.nan
    residual: float = math.nan  # of the return map, relative to the size of the motion
    word: str = ""  # events of a period, in order
    regimes: str = ""  # regimes of a period, in order
    maximum: float = math.nan  # of the first coordinate
    minimum: float = math.nan
    velocity_rms: float = math.nan  # standard deviation of the system's output over a period
    stick_fraction: float = math.nan
    flight_fraction: float = math.nan
    normal_force_max: float = math.nan
    slip_margin: float = math.nan  # smallest slip speed inside a slip phase: 0 where stick begins
    motion: Stretch | None = None  # one period, sampled
    shooting: "Shooting | None" = None

    @property
    def amplitude(self) -> float:
        """Half the range of the first coordinate."""
        return 0.5 * (self.maximum - self.minimum)

    @property
    def stable(self) -> bool:
        """Whether all multipliers lie inside the unit circle."""
        return self.multipliers is not None and bool(np.all(np.abs(self.multipliers) < 1))


@dataclass(frozen=True)
class Shooting:
    """The return map of a family of systems: what is varied, what is measured in what units."""

    system: AbstractSystem  # traceable
    over: str | None  # number of the system that is varied
    clock: Callable[[AbstractSystem], Any] | None  # period of what drives it, or None
    section: Callable | None
    repeats: int  # periods of the clock in one of the motion
    scale: np.ndarray  # (2n,) sizes of the motion
    period_scale: float
    parameter_scale: float = 1.0
    rtol: float = 1e-10
    varied: tuple[str, ...] = ()  # numbers that the compiled program can differentiate by

    def at(self, parameter: float) -> AbstractSystem:
        """Return the system at a value of the parameter."""
        if self.over is None:
            return self.system
        return named.replaced(self.system, self.over, parameter)

    def along(self):
        """Return the tangent of the system along the parameter."""
        return named.direction(self.system, self.over, *self.varied)

    def driven_period(self, parameter: float) -> tuple[float, float]:
        """Return the period that the clock sets, and its derivative by the parameter."""
        assert self.clock is not None
        clock, system = self.clock, self.at(parameter)

        def period(parameter):
            varied = system
            if self.over is not None:
                varied = named.replaced(system, self.over, parameter)
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
        moved = stretch(
            self.at(parameter),
            self.along(),
            start,
            period,
            phase=phase,
            regime=where.regime,
            rtol=self.rtol,
        )
        if int(moved.result) not in _FAIR or not np.all(np.isfinite(moved.by_state)):
            raise Lost(f"the motion ended early: {Result(int(moved.result)).name.lower()}")
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
    motion: Stretch
    period: float
    parameter: float


def correct(
    shooting: Shooting, where: Chart, phase: float, guess, pinned=None, target: float | None = None
) -> Point | None:
    """Return the cycle nearest to ``guess`` (scaled unknowns) by Newton's method, or None.

    The last equation is ``pinned @ unknowns = target``: by default the parameter keeps its value;
    in a continuation the step along the tangent is prescribed. `scipy.optimize.root` (MINPACK's
    hybrid of Newton's method and a trust region) with the exact Jacobian.
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
        return np.append(residual, pinned @ u - target), np.vstack([jacobian, pinned])

    try:
        answer = scipy.optimize.root(
            equations, guess, jac=True, method="hybr", options={"xtol": 1e-10, "factor": 0.1}
        )
        if not np.array_equal(last["u"], answer.x):
            equations(answer.x)
    except Lost:
        return None
    size = float(np.max(np.abs(last["residual"])))
    off = abs(float(pinned @ last["u"]) - target)
    if not (size < CLOSED and off < CLOSED):
        return None
    return Point(
        where,
        phase,
        last["u"],
        last["jacobian"],
        size,
        last["motion"],
        last["period"],
        last["parameter"],
    )


def cycle_at(shooting: Shooting, point: Point) -> Cycle:
    """Return everything that is known of the cycle of a `Point`."""
    motion, where = point.motion, point.where
    n = len(where.origin) // 2
    monodromy = where.read(motion.by_state @ where.wide)
    trivial = math.nan
    if shooting.clock is None:
        flow = where.read(motion.by_period)
        inside = where.read(where.basis)  # (m, d), orthonormal
        across = scipy.linalg.null_space(inside.T)[:, 0]
        back = np.eye(len(flow)) - np.outer(flow, across) / (across @ flow)
        trivial = float(np.linalg.norm(monodromy @ flow - flow) / np.linalg.norm(flow))
        monodromy = inside.T @ back @ monodromy @ inside
    values = np.zeros(2 * n - (shooting.clock is None), complex)
    values[: len(monodromy)] = np.linalg.eigvals(monodromy)
    values = values[np.argsort(-np.abs(values), kind="stable")]
    isolated = np.min(np.abs(values - 1)) > ISOLATED
    totals, period = motion.totals, point.period
    mean = float(totals.output_integral) / period
    square = float(totals.output_square_integral) / period
    high, low = _extremes(motion, n)
    word, regimes = words(motion)
    return Cycle(
        system=shooting.at(point.parameter),
        found=Found.FOUND if isolated else Found.NOT_ISOLATED,
        period=period,
        state=motion.samples[0],
        phase=point.phase,
        regime=int(motion.regimes[0]),
        multipliers=values,
        trivial_error=trivial,
        residual=point.residual,
        word=word,
        regimes=regimes,
        maximum=high,
        minimum=low,
        velocity_rms=math.sqrt(max(square - mean**2, 0.0)),
        stick_fraction=float(totals.stick_time) / period,
        flight_fraction=float(totals.flight_time) / period,
        normal_force_max=float(totals.normal_force_max),
        slip_margin=_slip_margin(motion),
        motion=motion,
        shooting=shooting,
    )


def words(motion: Stretch) -> tuple[str, str]:
    """Return the events of a motion and its regimes, in order, as words.

    Bounces that end in a completed sequence count as one: their number is that of the resolution.
    """
    count = int(motion.events.count)
    if bool(motion.overflow):
        return f"more than {len(motion.events.time)} events", ""
    kinds = [Event(int(k)) for k in motion.events.kind[:count]]
    kept: list[str] = []
    for kind in kinds:
        if kind == Event.ZENO:
            while kept and kept[-1] == "impact":
                kept.pop()
        kept.append(kind.name.lower())
    codes = [int(motion.regimes[0]), *(int(r) for r in motion.events.after[:count])]
    names = [Regime(r).name.lower() for r in codes]
    changed = [b for a, b in zip([None, *names], names, strict=False) if a != b]
    return " ".join(kept), " ".join(changed)


def smooth_intervals(motion: Stretch) -> np.ndarray:
    """Whether each interval between samples is free of events, (samples - 1,)."""
    times = motion.events.time[: int(motion.events.count)]
    holding = np.clip(np.searchsorted(motion.times, times) - 1, 0, len(motion.times) - 2)
    free = np.ones(len(motion.times) - 1, bool)
    free[holding] = False
    return free


def turns(motion: Stretch) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (times, values, is a maximum) of the turning points of the first coordinate."""
    n = motion.samples.shape[1] // 2
    x, v, h = motion.samples[:, 0], motion.samples[:, n], np.diff(motion.times)
    at = np.flatnonzero((np.sign(v[:-1]) != np.sign(v[1:])) & (v[:-1] != 0))
    part = v[at] / (v[at] - v[at + 1])
    a, b, k = x[at], x[at + 1], h[at]
    # Hermite's cubic: fourth order from states at both ends
    value = (
        a * (1 + 2 * part) * (1 - part) ** 2
        + b * part**2 * (3 - 2 * part)
        + k * part * (1 - part) * (v[at] * (1 - part) - v[at + 1] * part)
    )
    return motion.times[at] + part * k, value, v[at] > 0


def _extremes(motion: Stretch, n: int) -> tuple[float, float]:
    """Largest and smallest first coordinate: at turning points, or where an impact turns it."""
    x, v = motion.samples[:, 0], motion.samples[:, n]
    values = [x, turns(motion)[1]]
    events = motion.events
    count = min(int(events.count), len(events.time))
    hits = events.time[:count][events.impulse[:count] != 0]
    at = np.clip(np.searchsorted(motion.times, hits) - 1, 1, len(x) - 2)
    bend = (v[at] - v[at - 1]) / (motion.times[at] - motion.times[at - 1])
    ahead = hits - motion.times[at]
    values.append(x[at] + ahead * (v[at] + 0.5 * ahead * bend))
    every = np.concatenate(values)
    return float(every.max()), float(every.min())


def _slip_margin(motion: Stretch) -> float:
    """Smallest |slip speed| at which slip slows down and speeds up again, inside a smooth piece."""
    speed = np.abs(motion.slip_speed)
    inner = smooth_intervals(motion)
    slips = (motion.regimes == Regime.SLIP_POS) | (motion.regimes == Regime.SLIP_NEG)
    fair = inner[:-1] & inner[1:] & slips[1:-1] & slips[:-2] & slips[2:]
    left, here, right = speed[:-2], speed[1:-1], speed[2:]
    low = fair & (here <= left) & (here <= right)
    if not low.any():
        return math.nan
    bend = left - 2 * here + right
    vertex = here - (left - right) ** 2 / (8 * np.where(bend > 0, bend, np.inf))
    return float(np.min(vertex[low]))


# --- from a simulation ---------------------------------------------------------------------------


def find_cycle(
    system: AbstractSystem,
    *,
    settle: float,
    initial_state=None,
    period: Callable[[AbstractSystem], Any] | float | None = None,
    section: Callable = turning_point,
    over: str | None = None,
    varied: Sequence[str] = (),
    rtol: float = 1e-10,
) -> Cycle:
    """Return the limit cycle that a simulation of ``settle`` seconds comes to.

    **Main arguments:** ``system``; ``settle`` [s], time after which the motion is near its cycle;
    ``initial_state`` = (position, q') (default: the system's own start).

    **Other arguments:** ``period`` of what drives the system [s], a number, or a function of the
    system if it depends on what will be varied; None: nothing depends on time (a steady belt).
    ``section(t, q, v)``, a function of positions and velocities q' on whose zeros the cycle of a
    system without a clock starts (default: where the first coordinate turns). ``over``, name of the
    number that `branch.follow` will vary; ``varied``, numbers that `remedy` will: named here, they
    share its compiled program. ``rtol`` of the integration.

    **Returns** a `Cycle`; ``found`` says whether there is one, else why not.

    Raises ValueError for arguments that cannot be meant.
    """
    if not isinstance(system, AbstractSystem):
        raise ValueError(f"system must be a system such as Wiper(), but was {system!r}")
    if not (isinstance(settle, int | float) and 0 < settle < math.inf):
        raise ValueError(f"settle must be a finite time > 0, but was {settle!r}")
    varied = tuple(varied) if over is None else (over, *varied)
    system = named.traceable(system, *varied)
    start = system.default_state() if initial_state is None else initial_state
    state = np.concatenate([np.asarray(part, float).ravel() for part in start])
    clock = period if callable(period) or period is None else _constant(float(period))
    typical = np.concatenate([np.asarray(s, float) for s in system.scales(len(state) // 2)])
    shooting = Shooting(system, over, clock, None if clock else section, 1, typical, 1.0)
    shooting = replace(shooting, rtol=rtol, varied=varied)
    if over is not None:
        size = abs(named.value(system, over))
        shooting = replace(shooting, parameter_scale=size or 1.0)
    try:
        if clock is None:
            guess = _free_guess(shooting, state, settle)
        else:
            guess = _driven_guess(shooting, state, settle)
    except Lost as lost:
        return Cycle(system, Found.TRAJECTORY_FAILED, why=str(lost))
    if isinstance(guess, Found):
        return Cycle(system, guess)
    shooting, state, phase, regime, length = guess
    return close(shooting, state, regime, length, phase)


def close(shooting: Shooting, state, regime: int, period: float, phase: float = 0.0) -> Cycle:
    """Return the cycle near ``state``, in ``regime`` at ``phase``, by Newton's method."""
    parameter = 0.0 if shooting.over is None else named.value(shooting.system, shooting.over)
    shooting = replace(shooting, period_scale=period)
    where = chart(shooting.system, state, phase * period, regime, shooting.scale, shooting.section)
    guess = np.zeros(where.basis.shape[1])
    if shooting.clock is None:
        guess = np.append(guess, 1.0)
    point = correct(shooting, where, phase, np.append(guess, parameter / shooting.parameter_scale))
    if point is None:
        return Cycle(shooting.system, Found.NOT_CONVERGED, shooting=shooting)
    cycle = cycle_at(shooting, point)
    if cycle.amplitude < STILL * _typical(shooting.system, len(where.origin) // 2):
        return Cycle(shooting.system, Found.AT_REST, shooting=shooting)
    return cycle


class _constant:
    """A period that depends on nothing (compares by value, for the sake of compiled programs)."""

    def __init__(self, value: float):
        self.value = value

    def __call__(self, system):
        return self.value


def _typical(system, n: int) -> float:
    return float(np.asarray(system.scales(n)[0][0]))


def _run(shooting: Shooting, state, regime: int, length: float, rtol: float) -> Stretch:
    """Return a motion that is looked at only. Raises `Lost` if it ends early."""
    moved = stretch(shooting.system, shooting.along(), state, length, regime=regime, rtol=rtol)
    if int(moved.result) not in _FAIR:
        raise Lost(f"the motion ended early: {Result(int(moved.result)).name.lower()}")
    return moved


def _sizes(motion: Stretch, typical: np.ndarray) -> np.ndarray:
    """Half the range of each number of the state; that of its kind if it hardly moves."""
    half = 0.5 * np.ptp(motion.samples, axis=0)
    n = len(half) // 2
    kinds = np.repeat([half[:n].max(), half[n:].max()], n)
    kinds = np.where(kinds > 0, kinds, typical)
    return np.where(half > 1e-3 * kinds, half, kinds)


def _free_guess(shooting: Shooting, state, settle: float):
    """Return (shooting, state, phase, regime, period) near the cycle of a steady system."""
    typical = shooting.scale
    motion = _run(shooting, state, -1, settle, 1e-7)
    window = 0.25 * settle
    for _ in range(8):
        motion = _run(shooting, motion.state, int(motion.regimes[-1]), window, 1e-8)
        if np.ptp(motion.samples[:, 0]) < STILL * typical[0]:
            return Found.AT_REST
        times, _, peak = turns(motion)
        times = times[peak]
        if len(times) < 6 and window < 4 * settle:
            window *= 2
        elif len(times) > 14:  # enough samples for each of them
            window *= 9 / len(times)
        else:
            break
    if len(times) < 2:
        return Found.NOT_PERIODIC
    scale = _sizes(motion, typical)
    at = np.clip(np.searchsorted(motion.times, times) - 1, 0, len(motion.times) - 2)
    part = ((times - motion.times[at]) / np.diff(motion.times)[at])[:, None]
    states = (1 - part) * motion.samples[at] + part * motion.samples[at + 1]
    for k in range(1, min(MOST_RETURNS, len(times) - 1) + 1):
        if np.all(np.abs(states[k:] - states[:-k]) < ALIKE * scale):
            break
    else:
        return Found.NOT_PERIODIC
    length = float(np.mean(times[k:] - times[:-k]))
    whole = (motion.regimes[at] == motion.regimes[at + 1])[-k:]
    heights = np.where(whole | ~whole.any(), states[-k:, 0], -np.inf)
    best = len(states) - k + int(np.argmax(heights))  # the highest one away from events
    shooting = replace(shooting, scale=scale)
    return shooting, states[best], 0.0, int(motion.regimes[at[best]]), length


def _driven_guess(shooting: Shooting, state, settle: float):
    """Return (shooting, state, phase, regime, period) near the cycle of a driven system."""
    parameter = 0.0 if shooting.over is None else named.value(shooting.system, shooting.over)
    one, _ = shooting.driven_period(parameter)
    motion = _run(shooting, state, -1, max(1.0, math.ceil(settle / one)) * one, 1e-8)
    states, motions = [motion.state], []
    for _ in range(MOST_RETURNS):
        motion = _run(shooting, motion.state, int(motion.regimes[-1]), one, shooting.rtol)
        motions.append(motion)
        states.append(motion.state)
    samples = np.concatenate([m.samples for m in motions])
    if np.ptp(samples[:, 0]) < STILL * shooting.scale[0]:
        return Found.AT_REST
    whole = replace_samples(motions[0], samples)
    scale = _sizes(whole, shooting.scale)
    for k in range(1, MOST_RETURNS + 1):
        if np.all(np.abs(states[k] - states[0]) < ALIKE * scale):
            break
    else:
        return Found.NOT_PERIODIC
    shooting = replace(shooting, scale=scale, repeats=k)
    times = np.concatenate([m.times[:-1] + i * one for i, m in enumerate(motions[:k])])
    regimes = np.concatenate([m.regimes[:-1] for m in motions[:k]])
    index = middle_of_longest(regimes, np.concatenate([smooth_intervals(m) for m in motions[:k]]))
    i, j = divmod(index, len(motions[0].times) - 1)
    phase = float(times[index] / (k * one))
    return shooting, motions[i].samples[j], phase, int(regimes[index]), k * one


def replace_samples(motion: Stretch, samples) -> Stretch:
    """Return a motion with other samples."""
    return motion._replace(samples=samples)


def middle_of_longest(regimes, smooth) -> int:
    """Index in the middle of the longest run of one regime without an event, stick left aside.

    The start of a driven cycle lies there: far from events, and where all states are possible.
    """
    best, where, begin = -1, 0, 0
    size = len(regimes)
    for k in range(1, size + 1):
        if k == size or regimes[k] != regimes[begin] or not smooth[k - 1]:
            length = (k - begin) * (0.01 if regimes[begin] == Regime.STICK else 1.0)
            if length > best:
                best, where = length, (begin + k) // 2
            begin = k
    return where
