"""How far a trajectory is from one with other events: what decides whether derivatives hold.

A guard that vanishes is the deeper past grazing, the steeper it falls: without the event its
minimum would have been g'^2 / (2 g'') below zero. One that turns round before it vanishes clears
grazing by its minimum. The smaller of the two, relative to the size of the guard, is the margin. At
grazing it is zero and the derivative infinite (di Bernardo et al., "Piecewise-smooth Dynamical
Systems", 2008, chapter 6).

A largest value has two derivatives where two peaks are equally high: the runner-up is kept with its
own, to tell how near the next peak is to overtaking.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp

from ...contact.guards import first_switch, stop_slots
from ...numerics.types import Scalar
from ...vocabulary.codes import Event
from .base import END_SLOPE, AbstractObserver, extremes
from .reversal import ReversalTotals
from .totals import RegimeTotals, Totals

# corners of the vector field and of the prescribed motion keep its value: no jump of a derivative
HARMLESS = (Event.NONE, Event.KINK, Event.BELT_REVERSAL, Event.BELT_KINK)


class Peaks(NamedTuple):
    """One value for each of the largest values that `RegimeTotals` keeps, named alike."""

    normal_force_max: Scalar
    gap_max: Scalar
    impulse_max: Scalar


class Watched(NamedTuple):
    """Record of `Margins`: of another observer, and of the events from the start on."""

    totals: Any
    margin: Scalar  # 1: never near grazing
    word: Scalar  # hash of the sequence of events, and of which come before the window
    falling: tuple  # whether each guard fell at the end of the last stretch
    seconds: Peaks  # the runners-up


class Margins(AbstractObserver):
    """Another observer, and the grazing margin and the word of events beside it."""

    observer: RegimeTotals | ReversalTotals
    slots: tuple[int, ...]  # of guards that are watched: all but those of corners

    @property
    def begin(self):
        return self.observer.begin

    def init(self, dtype, shape=()):
        no = (jnp.zeros(shape, bool),) * len(self.slots)
        margin, word = jnp.ones(shape, dtype), jnp.zeros(shape, jnp.int32)
        zero = jnp.zeros(shape, dtype)
        seconds = Peaks(zero, zero, zero)
        return Watched(self.observer.init(dtype, shape), margin, word, no, seconds)

    def stretch(self, record, stretch):
        margin, falling = record.margin, []
        for slot, fell in zip(self.slots, record.falling, strict=True):
            g, size = stretch.guards[slot], stretch.sizes[slot]
            slope = sum(w * x for w, x in zip(END_SLOPE, g, strict=True))
            a, b, c, d, e = g
            bend = (35 * e - 104 * d + 114 * c - 56 * b + 11 * a) / 3 * 4  # d2/dtheta2 at the end
            scale = jnp.where(size > 0, size, 1.0)
            ends = (slope < 0) & (jnp.abs(e) <= 1e-6 * jnp.maximum(size, 1e-300))
            depth = jnp.where(bend > 0, slope * slope / jnp.where(bend > 0, 2 * bend, 1.0), scale)
            inside = jnp.minimum(jnp.minimum(b, c), d)
            turns = (inside < jnp.minimum(a, e)) | (fell & (b > a))
            clear = jnp.maximum(jnp.minimum(inside, a), 0.0)
            here = jnp.where(ends, depth, jnp.where(turns, clear, scale)) / scale
            margin = jnp.minimum(margin, jnp.where(size > 0, here, 1.0))
            falling.append(slope < 0)
        force, gap = extremes(stretch)
        on = stretch.start >= self.observer.start
        seconds = _beaten(record, on, normal_force_max=force, gap_max=gap)
        totals = self.observer.stretch(record.totals, stretch)
        return Watched(totals, margin, record.word, tuple(falling), seconds)

    def event(self, record, happening):
        kind = happening.kind
        counts = jnp.ones_like(kind, bool)
        for harmless in HARMLESS:
            counts = counts & (kind != harmless)
        # an event that moves across the edge of the window changes what is counted in it
        symbol = kind + 1 + len(Event) * (happening.time >= self.observer.start)
        word = jnp.where(counts, 31 * record.word + symbol, record.word).astype(jnp.int32)
        still = tuple(f & ~counts for f in record.falling)
        on = happening.time >= self.observer.start
        seconds = _beaten(record, on, impulse_max=happening.impulse)
        totals = self.observer.event(record.totals, happening)
        return Watched(totals, record.margin, word, still, seconds)


def regime_totals(record) -> Totals:
    """The record of `RegimeTotals` inside that of any observer which keeps one."""
    while not isinstance(record, Totals):
        record = record.totals
    return record


def _beaten(record, on, **peaks) -> Peaks:
    """Return the runners-up after new ``peaks``, where ``on``."""
    best, seconds = regime_totals(record), record.seconds
    for name, peak in peaks.items():
        loser = jnp.minimum(getattr(best, name), peak)
        second = getattr(seconds, name)
        seconds = seconds._replace(**{name: jnp.where(on, jnp.maximum(second, loser), second)})
    return seconds


def watch(system, observer: RegimeTotals | ReversalTotals) -> Margins:
    """Return ``observer`` with the margins of the contact's guards and of the stops beside it."""
    return Margins(observer, (*range(first_switch(system)), *stop_slots(system)))
