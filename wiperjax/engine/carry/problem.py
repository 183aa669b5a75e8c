"""What a trajectory is asked to do: the system, the tolerances, and what to keep."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp

from ...contact.belts import AbstractBelt
from ...contact.regimes import ROUNDINGS, as_told
from ...contact.system import AbstractSystem, rates
from ...numerics.arrays import check_settings
from ...numerics.bernstein import largest
from ...numerics.types import Scalar
from ..observers.base import AbstractObserver
from ..observers.totals import RegimeTotals

PERIOD_PARTS = 16  # of a belt that turns: a sine is within 1e-6 of the quartic through such a step
DRIVE_PARTS = 4  # of what drives a system: enough to see how it goes, and where a step is too long


class Sample(NamedTuple):
    """State of motion at one time."""

    position: tuple
    velocity: tuple
    regime: Scalar
    normal_force: Scalar
    friction_force: Scalar


def record_sample(system, t, q, v, regime, forces) -> Sample:
    """Everything a person plots."""
    speeds = rates(system, t, q, v)
    told = as_told(system, regime).astype(jnp.int8)
    return Sample(q, speeds, told, forces.normal, forces.tangential)


class Problem(eqx.Module):
    """One trajectory to compute: the system, the tolerances, and what to keep."""

    system: AbstractSystem
    end: Scalar
    rtol: Scalar
    atol: tuple  # (positions, velocities), one value a coordinate
    longest: Scalar  # step, from `mark` on
    max_step: Scalar | None  # throughout; None: no limit
    zeno_time: Scalar
    max_steps: Scalar
    mark: Scalar  # a time to be stepped onto exactly (start of observation)
    observer: AbstractObserver
    sample_times: jax.Array | None  # increasing
    signal: Any  # a `sampling.means.Signal`, or None
    log_start: Scalar  # time of the first event that is logged
    solver: diffrax.AbstractERK = eqx.field(static=True)
    record: Callable = eqx.field(static=True)  # (system, t, q, v, regime, forces) -> pytree
    log_capacity: int = eqx.field(static=True, default=0)
    pause_when_full: bool = eqx.field(static=True, default=False)
    brief: bool = eqx.field(static=True, default=False)  # see `Integration`

    @property
    def speed(self) -> Scalar:
        """Typical speed of the motion."""
        return largest(tuple(a / self.rtol for a in self.atol[1]))

    @property
    def least_speed(self) -> Scalar:
        """Speed below which there is none but rounding."""
        return ROUNDINGS * float(jnp.finfo(self.speed.dtype).eps) * self.speed


class Integration(NamedTuple):
    """How a trajectory is integrated; see `solve` for the meaning of each."""

    solver: Any = None
    rtol: Any = 1e-8
    atol: Any = None
    max_steps: Any = 2**31 - 1
    max_step: Any = None
    zeno_time: Any = 1e-8
    longest: Any = None  # step while it is observed; `max_step` holds before, too
    brief: bool = False  # its program shall rather be compiled fast than run fast


class Recording(NamedTuple):
    """What is kept of a trajectory; see `Problem`."""

    sample_times: Any = None
    signal: Any = None
    max_events: int = 0
    log_start: Any = -math.inf
    observer: AbstractObserver | None = None
    mark: Any = None
    record: Callable = record_sample
    pause_when_full: bool = False


INTEGRATION, RECORDING = Integration(), Recording()


class Case(NamedTuple):
    """A problem, and where it begins; a batch of cases has them as last axis."""

    problem: Problem
    position: tuple
    velocity: tuple  # q'
    start: Scalar


def make_case(
    system: AbstractSystem,
    duration,
    initial_state=None,
    integration: Integration = INTEGRATION,
    recording: Recording = RECORDING,
    start=0.0,
    dtype=None,
) -> Case:
    """Return the `Case` of arguments that were checked; state and tolerances in ``dtype``, times
    always in full precision. Raises ValueError as `check_settings` does.
    """
    check_settings()
    if dtype is None:
        dtype = jnp.result_type(float)
    if initial_state is None:
        initial_state = system.default_state()
    position, velocity = (tuple(jnp.asarray(x, dtype) for x in part) for part in initial_state)
    clock = jnp.result_type(float)
    start = jnp.asarray(start, clock)
    rtol = jnp.asarray(integration.rtol, dtype)
    times = recording.sample_times
    problem = Problem(
        system=system.prepared(),
        end=start + jnp.asarray(duration, clock),
        rtol=rtol,
        atol=_absolute(integration.atol, rtol, system, len(position)),
        longest=_longest(integration.longest, system, clock),
        max_step=_most(integration.max_step, system, clock),
        zeno_time=jnp.asarray(integration.zeno_time, dtype),
        max_steps=jnp.asarray(integration.max_steps, jnp.int32),
        mark=start if recording.mark is None else jnp.asarray(recording.mark, clock),
        observer=_as_arrays(
            RegimeTotals() if recording.observer is None else recording.observer, clock
        ),
        sample_times=None if times is None else jnp.asarray(times, clock),
        signal=recording.signal,
        solver=diffrax.Tsit5() if integration.solver is None else integration.solver,
        record=recording.record,
        log_start=jnp.asarray(recording.log_start, clock),
        log_capacity=int(recording.max_events),
        pause_when_full=recording.pause_when_full,
        brief=integration.brief,
    )
    return Case(problem, position, velocity, start)


def _as_arrays(observer: AbstractObserver, clock) -> AbstractObserver:
    """Return an observer with its numbers as arrays: another time to begin at compiles nothing."""
    return jax.tree.map(lambda x: jnp.asarray(x, clock) if isinstance(x, float) else x, observer)


def _most(max_step, system: AbstractSystem, clock):
    """Return the longest step [s] at all, None for no limit: of a system that says how often what
    drives it comes again, a part of that (`DRIVE_PARTS`). What swings more quickly than its body
    is no part of the error of the motion: a step of some swings would show any of them, or none.
    """
    most = None if max_step is None else jnp.asarray(max_step, clock)
    if system.drive_period is None:
        return most
    part = jax.lax.stop_gradient(jnp.asarray(system.drive_period, clock)) / DRIVE_PARTS
    return part if most is None else jnp.minimum(most, part)


def _longest(longest, system: AbstractSystem, clock):
    """Return the longest step [s] of what is observed: of a system on a belt that turns no more
    than a part of a period (`PERIOD_PARTS`), for in stick, where the motion is the belt's, there is
    no error to limit it.
    """
    most = jnp.asarray(jnp.inf if longest is None else longest, clock)
    belt = getattr(system, "belt", None)
    if not isinstance(belt, AbstractBelt):
        return most
    frequency = jax.lax.stop_gradient(jnp.abs(jnp.asarray(belt.wiping_frequency, clock)))
    part = 1 / (PERIOD_PARTS * jnp.where(frequency > 0, frequency, 1.0))
    return jnp.where(frequency > 0, jnp.minimum(most, part), most)


def _absolute(atol, rtol, system: AbstractSystem, n: int) -> tuple:
    """Return (positions, velocities) of absolute tolerances, n values each."""
    dtype = rtol.dtype
    if atol is None:
        return jax.tree.map(lambda s: rtol * jnp.asarray(s, dtype), system.scales(n))
    if isinstance(atol, tuple | list):
        return tuple(
            tuple(jnp.asarray(a, dtype) for a in part) * (n // len(part))
            if isinstance(part, tuple | list)
            else (jnp.asarray(part, dtype),) * n
            for part in atol
        )
    return ((jnp.asarray(atol, dtype),) * n,) * 2
