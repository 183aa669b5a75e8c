"""Online statistics of the reversal: contact force around V = 0 against the rest of the stroke."""

from functools import reduce
from operator import or_
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp

from ...contact.belts import SteadyBelt
from ...numerics import quartic
from ...numerics.elementary import horner, larger, smaller
from ...numerics.runge_kutta import NODES
from ...numerics.types import Scalar
from ...vocabulary import checks
from ...vocabulary.ranges import FINITE, NON_NEGATIVE
from .base import AbstractObserver, Stretch, higher, highest, is_hit, led, outputs
from .totals import RegimeTotals, Totals, counts_as


class ReversalRecord(NamedTuple):
    """Record of `ReversalTotals`; forces in N/m, impulses in N s/m, times in s."""

    totals: Totals
    force_max_reversal: Scalar  # within the window around V = 0; -inf where no time lay there
    force_integral_stroke: Scalar  # outside it
    stroke_time: Scalar
    stick_time_stroke: Scalar
    flight_time_stroke: Scalar
    impulse_max_reversal: Scalar
    vibration_integral: Scalar  # of output^2 in the window after V = 0
    vibration_time: Scalar


class ReversalTotals(AbstractObserver):
    """`RegimeTotals` plus what happens within ``window`` [s] of a passage of V through zero.

    It looks at the nearest passage: a window above a quarter of the belt's period is that quarter.
    `simulate` refuses one above a fifth.
    """

    start: Scalar
    window: Scalar
    blows: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        checks.numbers("start", self.start, FINITE)
        checks.numbers("window", self.window, NON_NEGATIVE)
        checks.flag("blows", self.blows)

    @property
    def begin(self):
        return self.start

    @property
    def _regimes(self) -> RegimeTotals:
        return RegimeTotals(self.start, self.blows)

    def init(self, dtype, shape=()):
        z = jnp.zeros(shape, dtype)
        return ReversalRecord(self._regimes.init(dtype, shape), z - jnp.inf, *[z] * 7)

    def stretch(self, record, stretch):
        s = stretch
        dtype = record.stroke_time.dtype
        on = s.start >= self.start
        step = s.step.astype(dtype)
        force = [node.forces.normal for node in s.nodes]
        load, squares = quartic.powers(force), quartic.powers([x * x for x in outputs(s)])
        windows, (sticks, _, flies) = self._windows(s), counts_as(s)

        def within(coefficients, parts):
            """Integral over parts of the step."""
            ends = [(_integral(coefficients, x) for x in part) for part in parts]
            starts = reduce(or_, ((low == 0) & (high > 0) for low, high in parts))
            first = jnp.where(starts, coefficients[0], 0.0)
            return led(step * sum(high - low for low, high in ends), first, s.lead)

        def counted(value):
            return jnp.where(on, value, 0.0)

        after = [(low, high) for low, high, behind in windows for low in (larger(low, behind),)]
        after = [(low, larger(low, high)) for low, high in after]
        near = [(low, high) for low, high, _ in windows]
        one = (jnp.ones_like(step),)
        stroke = s.counted.astype(dtype) - within(one, near)
        # rounding of a step within the window is no stroke: a share > 0 names a mechanism
        rounding = 16 * jnp.finfo(dtype).eps * s.length.astype(dtype)
        stroke = counted(jnp.where(stroke > rounding, stroke, 0.0))
        peak = jnp.where(on, self._peak(load, near), -jnp.inf)

        return ReversalRecord(
            self._regimes.stretch(record.totals, stretch),
            higher(record.force_max_reversal, peak),
            record.force_integral_stroke + counted(s.integral(force) - within(load, near)),
            record.stroke_time + stroke,
            record.stick_time_stroke + jnp.where(sticks, stroke, 0.0),
            record.flight_time_stroke + jnp.where(flies, stroke, 0.0),
            record.impulse_max_reversal,
            record.vibration_integral + counted(within(squares, after)),
            record.vibration_time + counted(within(one, after)),
        )

    def _windows(self, s: Stretch):
        """Parts of the step, (from, to, where V = 0 lies), within the window of the reversal behind
        it, and of the one ahead; exact wherever a step ends. Empty ones begin where they end.
        """
        since = s.system.belt.since_reversal
        size = jnp.where(s.step > 0, s.step, 1.0)
        end = s.length / size
        behind, ahead = since(s.start), since(s.start + s.length)
        dtype = s.nodes[0].velocity[0].dtype
        found = []
        # in mid-stroke the nearest reversal becomes the next one: two windows, else one
        same = jnp.abs(ahead - behind - s.length) < 0.5 * self.window
        for zero, counts in ((-behind / size, True), (end - ahead / size, ~same)):
            low, high = zero - self.window / size, zero + self.window / size
            low, high = (jnp.clip(x, 0.0, end) for x in (low, high))
            high = jnp.where(counts, high, low)
            found.append(tuple(x.astype(dtype) for x in (low, high, zero)))
        return found

    @staticmethod
    def _peak(load, near) -> Scalar:
        """Largest normal force in parts of the step. Empty parts have none: -inf."""
        peaks = []
        for low, high in near:
            places = [smaller(low + u * (high - low), 1.0) for u in NODES]
            nodes = [horner(load, u) for u in places]
            peaks.append(jnp.where(high > low, highest(nodes, nodes[-1]), -jnp.inf))
        return reduce(higher, peaks)

    def event(self, record, happening):
        e = happening
        near = jnp.abs(e.system.belt.since_reversal(e.time)) <= self.window
        hit = is_hit(e.kind)
        counts = hit & near & (e.time >= self.start)
        largest = higher(record.impulse_max_reversal, e.impulse)
        flown = jnp.where(near, 0.0, self._regimes.flown(e)).astype(record.stroke_time.dtype)
        return record._replace(
            totals=self._regimes.event(record.totals, happening),
            stroke_time=record.stroke_time + flown,
            flight_time_stroke=record.flight_time_stroke + flown,
            impulse_max_reversal=jnp.where(counts, largest, record.impulse_max_reversal),
        )


def totals_of(system, belt, start, window) -> RegimeTotals | ReversalTotals:
    """Return what gathers the totals of a motion of ``system`` on ``belt`` (None: on none) from
    ``start`` [s] on: on one that turns also those within ``window`` [s] of a reversal."""
    blows = bool(system.stops)
    if isinstance(belt, SteadyBelt | None):
        return RegimeTotals(start, blows)
    return ReversalTotals(start, window, blows)


def _integral(coefficients, u) -> Scalar:
    """Integral from 0 to ``u`` of what is a quartic up to the end of the step, u = 1, and keeps its
    value behind it: the correction to an event may be many times as long as a step of no length.
    """
    inside = smaller(u, 1.0)
    return quartic.integral(coefficients, inside) + (u - inside) * sum(coefficients)
