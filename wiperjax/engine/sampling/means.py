"""A uniform record of the system's output velocity, cheap enough for every lane of a batch.

A sample is the MEAN over its interval, not the value at an instant: what is faster than the samples
is damped instead of folded down at full height, and a slip between two instants is not lost. What
the means leave out, the variance inside an interval, can be recorded beside them; both together are
the exact mean square.

The motion does not know of its samples. A step's output, a quartic, is spread over the intervals
that it covers, as many at a time as a short ring holds; a lane whose step covers more waits until
the owner of the loop has moved the ring into the record. So a finer record is one of the same
motion, bit for bit. (Selects, no scatter: XLA's CPU scatters run one lane after the other.)
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.lax import stop_gradient

from ...numerics import quartic
from ...numerics.arrays import where
from ...numerics.elementary import larger, smaller
from ...numerics.fusion_barrier import keep
from ...numerics.runge_kutta import NODES
from ...numerics.types import Scalar
from ...vocabulary.codes import Regime
from ..observers.base import Stretch, outputs

ROUNDING = 1e-6  # of an interval, or of a step
UNTOLD = 255  # regime of what was not sampled


class Signal(eqx.Module):
    """Which samples to record: ``count`` of every case, from ``start`` [s] on, ``interval`` [s]
    each.

    One compiled program serves few cases with many samples and many with few: start, interval and
    count may be traced, the room that all cases share is fixed.
    """

    start: Scalar
    interval: Scalar
    count: Scalar
    room: int = eqx.field(static=True)  # samples of all cases, `length` of each
    ring: int = eqx.field(static=True)  # samples between two flushes, at most
    inner: bool = eqx.field(static=True, default=False)  # record the variance inside as well,
    regimes: bool = eqx.field(static=True, default=False)  # and the regime at each beginning

    @property
    def length(self) -> Scalar:
        """Room that a case takes: a ring behind its last sample is overwritten by the flush."""
        return self.count + self.ring

    @property
    def end(self) -> Scalar:
        """Time at which the last sample ends [s]."""
        return self.start + self.interval * self.count

    def empty(self, like: Scalar) -> "Ring":
        """Return an empty ring for a batch of the shape and precision of the state ``like``."""
        slots = jnp.zeros((self.ring, *like.shape), like.dtype)
        codes = jnp.full(slots.shape, UNTOLD, jnp.uint8) if self.regimes else None
        none = jnp.zeros(like.shape, jnp.int32)
        begin = jnp.zeros(like.shape) + self.start
        zero = jnp.zeros_like(like)
        powers = (zero,) * len(NODES)
        squares, regime = powers if self.inner else None, none if self.regimes else None
        still = Segment(begin, zero, zero - 1, begin, powers, squares, regime)  # it tells no regime
        square = slots if self.inner else None
        return Ring(Samples(slots, square, codes), none, begin, still)

    def record(self) -> "Samples":
        """Return the empty record of all cases, (room,) each."""
        empty = jnp.full(self.room, jnp.nan, jnp.float32)
        codes = jnp.full(self.room, UNTOLD, jnp.uint8) if self.regimes else None
        return Samples(empty, empty if self.inner else None, codes)


class Samples(NamedTuple):
    """Samples taken, NaN and 255 where there is none; in a ring the integrals of output and of its
    square over the intervals.
    """

    output: jax.Array  # mean of the output velocity
    inner: jax.Array | None  # its variance within the interval
    regime: jax.Array | None  # at the beginning of the interval


class Segment(NamedTuple):
    """The output along a step, a quartic in its part u; it carries no derivative."""

    start: Scalar  # time
    step: Scalar
    end: Scalar  # of the motion, in units of the step: an event may lie off its end;
    last: Scalar  # and its time, as exact as the clock: a long step has too few digits for it
    powers: tuple  # coefficients of u^0 .. u^4,
    squares: tuple | None  # and those of its square
    regime: Scalar | None


class Ring(NamedTuple):
    """Samples since the last flush, (ring, lanes), and the step that they are taken from."""

    samples: Samples
    first: jax.Array  # index of the first of them
    until: jax.Array  # time up to which the motion is in them
    segment: Segment


def segment_of(signal: Signal, stretch: Stretch) -> Segment:
    """Return the output along a committed stretch of motion: as much of it as is recorded, for
    each number is one more that every lane carries."""
    values = [stop_gradient(x) for x in outputs(stretch)]
    powers = quartic.powers(values)
    squares = quartic.powers([x * x for x in values]) if signal.inner else None
    regime = stretch.told if signal.regimes else None
    dtype = values[0].dtype
    step = stop_gradient(stretch.step)
    # behind a step of next to no length it would be far from where the quartic holds
    end = smaller(stop_gradient(stretch.length) / jnp.where(step > 0, step, 1.0), 2.0)
    start = stop_gradient(stretch.start)
    last = start + stop_gradient(stretch.length)
    step, end = step.astype(dtype), end.astype(dtype)
    return Segment(start, step, end, last, powers, squares, regime)


def take_means(signal: Signal, ring: Ring, stretch: Stretch, moves) -> tuple[Ring, Scalar]:
    """Return the ring after a turn that has committed ``stretch`` where ``moves``, and whether it
    is full: the lane must not move on before it has been flushed.
    """
    fresh = segment_of(signal, stretch)
    part = where(moves, fresh, ring.segment)
    dtype = part.step.dtype
    step = jnp.where(part.step > 0, part.step, 1.0).astype(ring.until.dtype)
    slots = jnp.arange(signal.ring + 1).reshape((-1,) + (1,) * ring.first.ndim)
    borders = signal.start + signal.interval * (ring.first + slots)
    low = ((ring.until - part.start) / step).astype(dtype)
    u = ((borders - part.start) / step).astype(dtype)
    low, u = keep((smaller(low, part.end), u))
    inside = smaller(larger(u, low), part.end)
    # before a step a completed sequence of impacts takes its time: the output hardly changes in it
    within, before = larger(inside, 0.0), smaller(inside, 0.0)

    def spread(old, powers):
        whole = part.step * (quartic.integral(powers, within) + before * powers[0])
        return old + (whole[1:] - whole[:-1])

    output, square, regime = ring.samples
    output = spread(output, part.powers)
    if square is not None:
        square = spread(square, part.squares)
    if regime is not None:
        # at an event's own instant the motion before it counts; where a ring begins within a step,
        # that instant is as far as the motion already is in the samples
        first = (borders[:-1] == signal.start) & (u[:-1] >= low)
        untold = (regime == UNTOLD) & (u[:-1] >= smaller(low, 0.0) - ROUNDING)
        here = (untold | first) & (u[:-1] <= part.end)
        code = jnp.where(u[:-1] < -ROUNDING, int(Regime.FLIGHT), part.regime)
        regime = jnp.where(here, code.astype(jnp.uint8), regime)
    until = larger(ring.until, smaller(part.last, borders[-1]))
    slack = ROUNDING * signal.interval
    full = (part.last > borders[-1] + slack) & (borders[-1] + slack < signal.end)
    return Ring(Samples(output, square, regime), ring.first, until, part), full


def flush(signal: Signal, record: Samples, ring: Ring, case) -> tuple[Samples, Ring]:
    """Move the finished samples of every lane into the record of its ``case``, if there is one."""
    index = jnp.floor((ring.until - signal.start) / signal.interval + ROUNDING)
    index = jnp.clip(index, 0, signal.count).astype(jnp.int32)
    slots = jnp.arange(signal.ring)[:, None]
    taken = slots < index - ring.first
    at = (case * signal.length + ring.first)[:, None]
    windows = jax.lax.ScatterDimensionNumbers(
        update_window_dims=(1,), inserted_window_dims=(), scatter_dims_to_operand_dims=(0,)
    )

    def write(rows, new, none) -> Any:
        if rows is None:
            return None
        new = jnp.where(taken, new, none).astype(rows.dtype).T
        drop = jax.lax.GatherScatterMode.FILL_OR_DROP
        return jax.lax.scatter(rows, at, new, windows, mode=drop)

    def begun(new, none) -> Any:
        """The interval that is not over becomes the first."""
        if new is None:
            return None
        kept = jnp.where(slots == index - ring.first, new, jnp.zeros_like(new)).sum(0)
        outside = index - ring.first >= signal.ring
        kept = jnp.where(outside, none, kept).astype(new.dtype)
        return jnp.full_like(new, none).at[0].set(kept)

    output, square, regime = ring.samples
    mean = output / jnp.asarray(signal.interval).astype(output.dtype)
    inner = square
    if square is not None:
        whole = square / jnp.asarray(signal.interval).astype(square.dtype)
        inner = jnp.maximum(whole - mean * mean, 0.0)
    record = Samples(
        write(record.output, mean, jnp.nan),
        write(record.inner, inner, jnp.nan),
        write(record.regime, regime, UNTOLD),
    )
    rest = Samples(begun(output, 0), begun(square, 0), begun(regime, UNTOLD))
    return record, ring._replace(samples=rest, first=index)
