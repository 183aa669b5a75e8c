"""Shooting: the motion over a stretch of time as a map of its start, with exact derivatives.

The derivative is taken by forward mode through the event loop, so that every event, its reset and
its time are in it (the saltation matrices). One compiled program serves a type of system, whatever
the start, the period, the parameter that is varied and its value.
"""

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..contact.projection import put_back
from ..contact.regimes import vector_field
from ..contact.space import contact
from ..contact.system import AbstractSystem
from ..engine.carry.problem import Integration, Recording, make_case, record_sample
from ..engine.carry.state import EventLog
from ..engine.observers.totals import Reach, RegimeTotals, Totals
from ..engine.solve import begin, run, solution
from ..numerics.kept import Kept
from ..vocabulary.codes import Regime

SAMPLES = 257  # of an arc
EVEN = np.linspace(0.0, 1.0, SAMPLES)  # shares of its time at which they are taken
GROWING = EVEN * (1 + EVEN) / 2  # no motion is in step with these: their distances grow threefold
EVENTS = 256  # of an arc, that are told apart
UNKNOWN = -1  # regime of a state: the engine finds it


class Lost(RuntimeError):
    """A motion on the way to a cycle that did not come to it; its text says why.

    ``residual``: how near it came, of the size of the motion, if it was one that returned.
    """

    def __init__(self, why: str, residual: float = math.nan):
        super().__init__(why)
        self.residual = residual


class Arc(NamedTuple):
    """The motion over a stretch of time. n coordinates; a state is (position, q'), 2 n numbers.

    ``by_state``, ``by_period`` and ``by_parameter`` are the derivatives of ``state`` (2n, 2n),
    (2n,), (2n,); ``totals_by`` those of ``totals`` by the same 2 n + 2 numbers, last axis.
    """

    state: np.ndarray  # (2n,) at the end
    by_state: np.ndarray
    by_period: np.ndarray
    by_parameter: np.ndarray
    totals: Totals
    totals_by: Totals
    highest: float  # first coordinate
    lowest: float
    times: np.ndarray  # (samples,)
    samples: np.ndarray  # (samples, 2n)
    regimes: np.ndarray  # (samples,)
    normal_force: np.ndarray  # (samples,)
    slip_speed: np.ndarray  # (samples,)
    gap: np.ndarray  # (samples,)
    events: EventLog
    overflow: bool
    result: int


def shoot(
    system: AbstractSystem,
    along,
    state,
    period: float,
    *,
    phase: float = 0.0,
    part: float = 1.0,
    regime: int = UNKNOWN,
    rtol: float = 1e-10,
    max_step: float | None = None,
    grid: np.ndarray = EVEN,
) -> Arc:
    """Return the motion from ``state`` at ``phase * period`` over ``part * period``.

    ``along`` is the tangent of ``system`` that ``by_parameter`` is taken along
    (`numbers.direction`). ``regime`` is that of ``state`` if known: see `tidy`. No step is longer
    than ``max_step`` [s]. Samples are taken at the shares ``grid`` of its time, (samples,).
    """
    longest = None if max_step is None else np.asarray(max_step, float)
    numbers = (np.asarray(x, float) for x in (period, phase, part, rtol, grid))
    given = np.asarray(state, float), np.asarray(regime, np.int32), *numbers, longest
    found = _shoot(system, along, *jax.device_put(given))  # all at once: each alone is slow
    return Arc(**jax.tree.map(np.asarray, found))


def _looked_at(*state):
    """Samples are looked at, not differentiated: half the time of a motion."""
    return jax.lax.stop_gradient(record_sample(*state))


def at_state(system: AbstractSystem, time, state):
    """Return ``system`` as it is at ``time``, and positions and velocities of ``state`` (2n,)."""
    n = state.shape[0] // 2
    local = system.prepared().on_piece(system.first_piece(time))
    q = tuple(state[:n])
    return local, q, local.from_rates(time, q, tuple(state[n:]))


def flow(local: AbstractSystem, time, q, v, regime):
    """Return the change of the state (q, q') within ``regime``, (2n,).

    q'' is the change of q' as the system says it, whatever velocities it computes with.
    """
    rates, slope = vector_field(time, (q, v), (local, regime))
    moved = jax.jvp(local.rates, (time, q, v), (jnp.ones(()), rates, slope))[1]
    return jnp.stack([*rates, *moved])


def tidy(system: AbstractSystem, time, state, regime):
    """Return ``state`` (2n,) exactly on the contact that ``regime`` means; differentiable.

    A contact is closed where its gap and its rate are exactly zero, and sticks where its slip speed
    is; a state that was stored, moved or corrected misses that by rounding, and would begin with a
    bounce of 1e-40 m. Nothing is done for a regime below 0.
    """
    local, q, v = at_state(system, time, state)
    closed = (regime >= 0) & (regime != Regime.FLIGHT)
    q, v = put_back(local, time, q, v, closed, regime == Regime.STICK)
    return jnp.stack([*q, *local.rates(time, q, v)])


@Kept
def _shoot(system, along, state, regime, period, phase, part, rtol, grid, longest) -> Any:
    varied = jax.tree.map(lambda d: d is not None, along, is_leaf=lambda d: d is None)
    moving, fixed = eqx.partition(system, varied)
    n = state.shape[0] // 2

    def motion(state, period, moving):
        start, duration = phase * period, part * period
        state = tidy(eqx.combine(moving, fixed), start, state, regime)
        case = make_case(
            eqx.combine(moving, fixed),
            duration,
            (tuple(state[:n]), tuple(state[n:])),
            Integration(rtol=rtol, max_step=longest),
            Recording(
                start + duration * grid,
                max_events=EVENTS,
                observer=Reach(RegimeTotals(start)),
                record=_looked_at,
            ),
            start,
        )
        s = solution(case.problem, run(case.problem, begin(case)))
        end = jnp.concatenate([s.final_position, s.final_velocity])
        whole, counts = eqx.partition(s.statistics.totals, eqx.is_inexact_array)
        return (end, whole), (s, counts)

    eye = jnp.eye(2 * n + 2)
    columns = (
        eye[:, : 2 * n],
        eye[:, 2 * n],
        jax.tree.map(lambda d: eye[:, -1].reshape((-1,) + (1,) * d.ndim) * d, along),
    )
    (end, whole), slopes, (s, counts) = jax.vmap(
        lambda tangent: jax.jvp(motion, (state, period, moving), tangent, has_aux=True),
        out_axes=(None, 0, None),
    )(columns)
    by, whole_by = jax.tree.map(lambda x: jnp.moveaxis(x, 0, -1), slopes)
    times = phase * period + part * period * grid
    samples = jnp.stack([*s.samples.position, *s.samples.velocity], axis=-1)

    def touching(t, state):
        local, q, v = at_state(system, t, state)
        c = contact(local, t, q, v)
        return c.slip_speed, c.gap

    slip_speed, gap = jax.vmap(touching)(times, samples)

    return dict(
        state=end,
        by_state=by[:, : 2 * n],
        by_period=by[:, 2 * n],
        by_parameter=by[:, -1],
        totals=eqx.combine(whole, counts),
        totals_by=whole_by,
        highest=jax.lax.stop_gradient(s.statistics.highest),
        lowest=jax.lax.stop_gradient(s.statistics.lowest),
        times=times,
        samples=samples,
        regimes=s.samples.regime,
        normal_force=s.samples.normal_force,
        slip_speed=slip_speed,
        gap=gap,
        events=s.events,
        overflow=s.event_overflow,
        result=s.result,
    )
