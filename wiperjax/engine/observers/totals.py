"""Integrals and counts over each regime of a trajectory."""

from typing import NamedTuple

import jax.numpy as jnp
from jax.lax import stop_gradient

from ...numerics.elementary import larger
from ...numerics.types import Scalar
from ...vocabulary import checks
from ...vocabulary.codes import Event, Regime
from ...vocabulary.ranges import FINITE
from .base import AbstractObserver, extremes, is_hit, outputs


class Totals(NamedTuple):
    """Record of `RegimeTotals`. Times in s, output in the system's own unit (m/s for the wiper)."""

    stick_time: Scalar
    slip_time: Scalar
    flight_time: Scalar
    output_integral: Scalar
    output_square_integral: Scalar
    normal_force_integral: Scalar
    normal_force_max: Scalar
    gap_max: Scalar
    impact_count: Scalar
    stick_count: Scalar
    lift_off_count: Scalar
    impulse_max: Scalar

    def variance(self, time) -> Scalar:
        """Variance of the output over the ``time`` [s] that the integrals stand for."""
        return variance(self.output_integral, self.output_square_integral, time)

    def deviation(self, time) -> Scalar:
        """Standard deviation of the output; its derivative is 0 where it is 0."""
        found = self.variance(time)
        return jnp.where(found > 0, jnp.sqrt(jnp.where(found > 0, found, 1)), 0)


def variance(integral, square_integral, time) -> Scalar:
    """Variance of what has these integrals, of itself and of its square, over ``time``."""
    mean = integral / time
    return jnp.maximum(square_integral / time - mean * mean, 0.0)


class RegimeTotals(AbstractObserver):
    """Times in the regimes, moments of the output, extremes and event counts from ``start`` on."""

    start: Scalar = 0.0

    def __check_init__(self):
        checks.numbers("start", self.start, FINITE)

    def init(self, dtype, shape=()):
        z = jnp.zeros(shape, dtype)
        n = jnp.zeros(shape, jnp.int32)
        return Totals(z, z, z, z, z, z, z, z, n, n, n, z)

    def stretch(self, record, stretch):
        s = stretch
        dtype = record.stick_time.dtype
        counts = s.start >= self.start
        h = jnp.where(counts, s.length, 0.0).astype(dtype)
        out = outputs(s)
        force = [node.forces.normal for node in s.nodes]
        highest, widest = extremes(s)

        def integral(values):
            return jnp.where(counts, s.integral(values), 0.0)

        return record._replace(
            stick_time=record.stick_time + jnp.where(s.regime == Regime.STICK, h, 0.0),
            flight_time=record.flight_time + jnp.where(s.regime == Regime.FLIGHT, h, 0.0),
            slip_time=record.slip_time
            + jnp.where((s.regime == Regime.SLIP_POS) | (s.regime == Regime.SLIP_NEG), h, 0.0),
            output_integral=record.output_integral + integral(out),
            output_square_integral=record.output_square_integral + integral([x * x for x in out]),
            normal_force_integral=record.normal_force_integral + integral(force),
            normal_force_max=jnp.where(
                counts, jnp.maximum(record.normal_force_max, highest), record.normal_force_max
            ),
            gap_max=jnp.where(counts, jnp.maximum(record.gap_max, widest), record.gap_max),
        )

    def event(self, record, happening):
        e = happening
        on = e.time >= self.start
        hit = on & is_hit(e.kind)

        def count(condition):
            return (on & condition).astype(jnp.int32)

        return record._replace(
            impact_count=record.impact_count + hit.astype(jnp.int32),
            stick_count=record.stick_count
            + count((e.after == Regime.STICK) & (e.before != Regime.STICK)),
            lift_off_count=record.lift_off_count + count(e.kind == Event.LIFT_OFF),
            impulse_max=jnp.where(
                hit, jnp.maximum(record.impulse_max, e.impulse), record.impulse_max
            ),
        )


class Reached(NamedTuple):
    """Record of `Reach`: of `RegimeTotals`, and the ends of the first coordinate's range."""

    totals: Totals
    highest: Scalar
    lowest: Scalar


class Reach(AbstractObserver):
    """Regime totals, and beside them the largest and smallest first coordinate from their start on:
    vertices within the steps, without derivatives. Samples would miss a quick swing."""

    observer: RegimeTotals

    def init(self, dtype, shape=()):
        none = jnp.full(shape, -jnp.inf, dtype)
        return Reached(self.observer.init(dtype, shape), none, -none)

    def stretch(self, record, stretch):
        x = [stop_gradient(node.position[0]) for node in stretch.nodes]
        on = stretch.start >= self.observer.start
        highest = jnp.where(on, larger(record.highest, stretch.peak(x)), record.highest)
        low = -stretch.peak([-y for y in x])
        lowest = jnp.where(on, -larger(-record.lowest, -low), record.lowest)
        return Reached(self.observer.stretch(record.totals, stretch), highest, lowest)

    def event(self, record, happening):
        return record._replace(totals=self.observer.event(record.totals, happening))
