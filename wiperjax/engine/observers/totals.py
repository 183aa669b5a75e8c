"""Integrals and counts over each regime of a trajectory."""

from functools import reduce
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax.lax import stop_gradient

from ...contact.regimes import slips
from ...contact.system import like
from ...numerics.bernstein import largest
from ...numerics.elementary import larger, smaller, within
from ...numerics.types import Scalar
from ...numerics.unknown import unknown
from ...vocabulary import checks
from ...vocabulary.codes import Event, Regime
from ...vocabulary.ranges import FINITE
from .base import AbstractObserver, extremes, higher, is_hit, outputs

DIGITS = 1e3  # last digits of a change over a step, and of the step by the clock, that tell a slope


class Totals(NamedTuple):
    """Record of `RegimeTotals`. Times in s, output in the system's own unit (m/s for the wiper).

    `stick_force_max`, `slip_force_min` and `acceleration_max` are of the nodes of steps, and carry
    no derivative: JAX's is 0.
    """

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
    slip_count: Scalar  # begun out of stick
    friction_work: Scalar  # done on friction in slip: what it takes in impacts is not in it
    stick_force_max: Scalar  # largest friction force in stick
    slip_force_min: Scalar  # smallest in slip; inf without slip
    acceleration_max: Scalar  # of the output
    blow_count: Scalar | None = None  # against stops, where they are counted

    def variance(self, time, xp=jnp) -> Scalar:
        """Variance of the output over the ``time`` [s] that the integrals stand for."""
        return variance(self.output_integral, self.output_square_integral, time, xp)

    def deviation(self, time, xp=jnp) -> Scalar:
        """Standard deviation of the output; its derivative is 0 where it is 0."""
        found = self.variance(time, xp)
        return xp.where(found > 0, xp.sqrt(xp.where(found > 0, found, 1)), 0)


def variance(integral, square_integral, time, xp=jnp) -> Scalar:
    """Variance of what has these integrals, of itself and of its square, over ``time``; of arrays
    of ``xp`` (jax.numpy or numpy).
    """
    mean = integral / time
    return xp.maximum(square_integral / time - mean * mean, 0.0)


class RegimeTotals(AbstractObserver):
    """Times in the regimes, moments of the output, extremes and event counts from ``start`` on;
    ``blows``: those of blows, too."""

    start: Scalar = 0.0
    blows: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        checks.numbers("start", self.start, FINITE)
        checks.flag("blows", self.blows)

    @property
    def begin(self):
        return self.start

    def init(self, dtype, shape=()):
        z = jnp.zeros(shape, dtype)
        n = jnp.zeros(shape, jnp.int32)
        blows = n if self.blows else None
        return Totals(z, z, z, z, z, z, z, z, n, n, n, z, n, z, z, z + jnp.inf, z, blows)

    def stretch(self, record, stretch):
        s = stretch
        dtype = record.stick_time.dtype
        counts = s.start >= self.start
        h = jnp.where(counts, s.counted, 0.0).astype(dtype)
        out = outputs(s)
        force = [node.forces.normal for node in s.nodes]
        highest, widest = extremes(s)
        friction = [stop_gradient(abs(node.forces.tangential)) for node in s.nodes]
        sticks, slips, flies = counts_as(s)

        def integral(values):
            return jnp.where(counts, s.integral(values), 0.0)

        return record._replace(
            stick_time=record.stick_time + jnp.where(sticks, h, 0.0),
            flight_time=record.flight_time + jnp.where(flies, h, 0.0),
            slip_time=record.slip_time + jnp.where(slips, h, 0.0),
            output_integral=record.output_integral + integral(out),
            output_square_integral=record.output_square_integral + integral([x * x for x in out]),
            normal_force_integral=record.normal_force_integral + integral(force),
            normal_force_max=jnp.where(
                counts, higher(record.normal_force_max, highest), record.normal_force_max
            ),
            gap_max=jnp.where(counts, higher(record.gap_max, widest), record.gap_max),
            friction_work=record.friction_work + integral(_powers(s)),
            stick_force_max=jnp.where(
                counts & sticks,
                larger(record.stick_force_max, reduce(larger, friction)),
                record.stick_force_max,
            ),
            slip_force_min=jnp.where(
                counts & slips,
                smaller(record.slip_force_min, reduce(smaller, friction)),
                record.slip_force_min,
            ),
            acceleration_max=jnp.where(
                counts, larger(record.acceleration_max, _steepest(s, out)), record.acceleration_max
            ),
        )

    def flown(self, happening) -> Scalar:
        """Time [s] from `start` on that a completed sequence of impacts takes: of flight, in which
        the output hardly changes."""
        return larger(happening.duration - larger(self.start - happening.time, 0.0), 0.0)

    def event(self, record, happening):
        e = happening
        on = e.time >= self.start
        hit = on & is_hit(e.kind)

        def count(condition):
            return (on & condition).astype(jnp.int32)

        flown = self.flown(e).astype(record.flight_time.dtype)
        seen = record.stick_time + record.slip_time + record.flight_time > 0
        jams = (e.kind == Event.JAM) & seen  # forces in front of it, if any, have no bound
        if self.blows:
            record = record._replace(blow_count=record.blow_count + count(e.kind == Event.BLOW))
        return record._replace(
            normal_force_integral=unknown(record.normal_force_integral, jams),
            normal_force_max=unknown(record.normal_force_max, jams),
            friction_work=unknown(record.friction_work, jams),
            flight_time=record.flight_time + flown,
            output_integral=record.output_integral + flown * e.output,
            output_square_integral=record.output_square_integral + flown * e.output * e.output,
            impact_count=record.impact_count + hit.astype(jnp.int32),
            stick_count=record.stick_count
            + count((e.after == Regime.STICK) & (e.before != Regime.STICK)),
            lift_off_count=record.lift_off_count + count(e.kind == Event.LIFT_OFF),
            slip_count=record.slip_count + count((e.before == Regime.STICK) & slips(e.after)),
            impulse_max=jnp.where(hit, higher(record.impulse_max, e.impulse), record.impulse_max),
        )


def counts_as(stretch) -> tuple[Scalar, Scalar, Scalar]:
    """Whether a stretch counts as stick, as slip and as flight."""
    regime = stretch.told
    return regime == Regime.STICK, slips(regime), regime == Regime.FLIGHT


def _powers(stretch) -> list[Scalar]:
    """Power that friction takes at the nodes of a stretch; none where there is no slip speed."""
    nodes = stretch.nodes
    speeds = [stretch.system.slip_speed(n.time, n.position, n.velocity) for n in nodes]
    return [
        -n.forces.tangential * like(speed, n.velocity[0])
        for n, speed in zip(nodes, speeds, strict=True)
    ]


def _steepest(stretch, out) -> Scalar:
    """Largest slope of the output in a step, by the quartic through its nodes; steps too short to
    tell, by `DIGITS` of the speeds that it is made of and of the clock, are left out."""
    rise = steepest([stop_gradient(x) for x in out])
    step, last = stop_gradient(stretch.step), stretch.nodes[-1]
    speed = stop_gradient(largest([out[-1], *last.velocity]))
    digit, tick = (DIGITS * float(jnp.finfo(x.dtype).eps) for x in (rise, step))
    long = (rise > digit * speed) & (step > tick * jnp.abs(stretch.start))
    return jnp.where(long, rise / jnp.where(long, step, 1.0).astype(rise.dtype), 0.0)


def steepest(values) -> Scalar:
    """Largest |slope|, by the whole length, of the quartic through five ``values`` at equal
    distances: at an end, the middle, or where the parabola through these three turns.
    """
    a, b, c, d, e = values
    begin = -25 / 3 * a + 16 * b - 12 * c + 16 / 3 * d - e
    middle = (a - e) / 3 + 8 / 3 * (d - b)
    end = 25 / 3 * e - 16 * d + 12 * c - 16 / 3 * b + a
    bend = begin - 2 * middle + end
    s = (begin - end) / (2 * jnp.where(bend != 0, bend, 1.0))  # half lengths from the middle
    s = within(-1.0, s, 1.0)
    # the slope is a cubic: the parabola, and what vanishes at its three places
    cubic = 16 / 3 * (a - 4 * b + 6 * c - 4 * d + e)
    turn = middle + 0.5 * s * (end - begin + s * bend) + cubic * s * (s * s - 1)
    return larger(larger(abs(begin), abs(middle)), larger(abs(end), abs(turn)))


class Reached(NamedTuple):
    """Record of `Reach`: of `RegimeTotals`, and the ends of the first coordinate's range."""

    totals: Totals
    highest: Scalar
    lowest: Scalar


class Reach(AbstractObserver):
    """Regime totals, and beside them the largest and smallest first coordinate from their start on:
    vertices within the steps, without derivatives. Samples would miss a quick swing."""

    observer: RegimeTotals

    @property
    def begin(self):
        return self.observer.begin

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
