"""Totals of whole periods: between an event of a noise and its last return in the window.

The ends of a window cut a noise that keeps its own time at a phase, and a parameter that changes
its frequency turns that phase, the faster the later the end is: what the ends add to a mean falls
as the window grows, what they add to its derivative does not. From an event to where the state
comes back to it, a mean is that of the noise, and so is its derivative (the first event is the
section of a Poincare map: di Bernardo et al., "Piecewise-smooth Dynamical Systems", 2008).
"""

from functools import reduce
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax.lax import stop_gradient

from ...numerics.arrays import where
from ...numerics.elementary import larger, smaller
from ...numerics.types import Scalar
from ...vocabulary.codes import Regime
from .base import AbstractObserver
from .totals import RegimeTotals, Totals

SUMS = (  # of `Totals`: what adds up over time, and has a derivative
    *("stick_time", "slip_time", "flight_time", "normal_force_integral"),
    *("output_integral", "output_square_integral"),
)
CLOSE = 1e-3  # of the range of each coordinate and velocity: a state so near has come back
STILL = 1e-6  # of its scale: a smaller range is no motion
INSTANT = 1e-9  # of the time: events no farther apart are of one instant
WHOLE = 1e-2  # of the shortest time between two returns, to which others are multiples of it


class Instant(NamedTuple):
    """An event, and what had added up by then."""

    time: Scalar
    sums: tuple[Scalar, ...]  # in the order of `SUMS`


class Returned(NamedTuple):
    """Record of `Returns`."""

    totals: Totals
    change: Scalar  # of regime, in the first event that has one: a code; -1 before it
    state: tuple[Scalar, ...]  # position and velocity behind that event
    first: Instant
    last: Instant  # the last event of that kind in whose state the motion is back
    shortest: Scalar  # time between two returns; inf before the first, NaN of uneven times
    low: tuple[Scalar, ...]  # ends of the range of each number of the state
    high: tuple[Scalar, ...]

    def whole(self, window) -> tuple[Totals, Scalar]:
        """The totals of whole periods and the time [s] they took; where the motion did not come
        back, those of the ``window`` [s]. Counts and extremes are always those of the window."""
        back = jnp.isfinite(self.shortest)
        sums = {
            name: jnp.where(back, last - first, getattr(self.totals, name))
            for name, first, last in zip(SUMS, self.first.sums, self.last.sums, strict=True)
        }
        return self.totals._replace(**sums), jnp.where(back, self._time, window)

    @property
    def period(self) -> Scalar:
        """Mean period [s]; NaN where there was no return, or they came at uneven times."""
        return jnp.where(self.count > 0, self._time / larger(self.count, 1), jnp.nan)

    @property
    def count(self) -> Scalar:
        """Periods, those too after which a motion that still settles was not near enough."""
        back = jnp.isfinite(self.shortest)
        return jnp.where(back, jnp.round(self._time / self.shortest), 0).astype(jnp.int32)

    @property
    def _time(self) -> Scalar:
        return self.last.time - self.first.time


class Returns(AbstractObserver):
    """Regime totals, and beside them those of whole periods, of a motion whose surroundings keep
    the same: on a belt that turns a state that comes back is no period yet."""

    observer: RegimeTotals
    coordinates: int = eqx.field(static=True)

    @property
    def start(self):
        return self.observer.start

    @property
    def begin(self):
        return self.observer.begin

    def init(self, dtype, shape=()):
        zero, none = jnp.zeros(shape, dtype), jnp.full(shape, -1, jnp.int32)
        instant, numbers = Instant(zero, (zero,) * len(SUMS)), 2 * self.coordinates
        ends = (zero - jnp.inf,) * numbers
        totals, low = self.observer.init(dtype, shape), tuple(-x for x in ends)
        state, never = (zero,) * numbers, zero + jnp.inf
        return Returned(totals, none, state, instant, instant, never, low, ends)

    def stretch(self, record, stretch):
        nodes = stop_gradient([(*node.position, *node.velocity) for node in stretch.nodes])
        on = stretch.start >= self.start
        low = tuple(reduce(smaller, values) for values in zip(record.low, *nodes, strict=True))
        high = tuple(reduce(larger, values) for values in zip(record.high, *nodes, strict=True))
        return record._replace(
            totals=self.observer.stretch(record.totals, stretch),
            low=where(on, low, record.low),
            high=where(on, high, record.high),
        )

    def event(self, record, happening):
        e = happening
        totals = self.observer.event(record.totals, e)
        change = jnp.asarray(len(Regime) * e.before + e.after, jnp.int32)
        on = (e.time >= self.start) & (e.before != e.after)
        begins = on & (record.change < 0)
        state = (*e.position, *e.velocity)
        sums = tuple(getattr(totals, name) for name in SUMS)
        here = Instant(jnp.asarray(e.time + e.duration, record.first.time.dtype), sums)
        back = on & (change == record.change) & _is_close(record, e.system, stop_gradient(state))
        back = back & _is_in_phase(e.system, stop_gradient(here.time - record.first.time))
        back = back & (here.time - record.last.time > INSTANT * here.time)
        return record._replace(
            totals=totals,
            change=jnp.where(begins, change, record.change),
            state=where(begins, stop_gradient(state), record.state),
            first=where(begins, here, record.first),
            last=where(begins | back, here, record.last),
            shortest=where(back, _shortest(record, stop_gradient(here.time)), record.shortest),
        )


def _shortest(record: Returned, time) -> Scalar:
    """The shortest time between two returns, after one at a ``time``; NaN where times are no whole
    multiples of it: a motion that settles comes back after some of its periods and is off after
    others, an irregular one comes back whenever it does."""
    before, gap = stop_gradient(record.shortest), time - stop_gradient(record.last.time)
    turns = jnp.maximum(before, gap) / jnp.minimum(before, gap)
    uneven = jnp.isfinite(before) & (jnp.abs(turns - jnp.round(turns)) > WHOLE)
    return jnp.where(uneven, jnp.nan, jnp.minimum(before, gap))


def _is_in_phase(system, time) -> Scalar:
    """Whether what drives a system has come again after the ``time``, too: else a motion of few
    coordinates passes its first state by chance, at any phase of the drive."""
    if system.drive_period is None:
        return True
    turns = time / stop_gradient(system.drive_period)
    return jnp.abs(turns - jnp.round(turns)) <= CLOSE


def _is_close(record: Returned, system, state) -> Scalar:
    """Whether a state is that behind the first event, as nearly as the motion's range tells."""
    lengths, speeds = system.scales(len(state) // 2)
    ranges = zip(record.low, record.high, (*lengths, *speeds), strict=True)
    least = [CLOSE * larger(high - low, STILL * scale) for low, high, scale in ranges]
    off = [jnp.abs(x - begun) for x, begun in zip(state, record.state, strict=True)]
    return reduce(jnp.logical_and, [x <= most for x, most in zip(off, least, strict=True)])
