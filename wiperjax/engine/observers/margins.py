"""How far a trajectory is from one with other events: what decides whether derivatives hold.

A guard that vanishes is the deeper past grazing, the steeper it falls: without the event its
minimum would have been g'^2 / (2 g'') below zero. One that turns round before it vanishes clears
grazing by its minimum. The smaller of the two, relative to the size of the guard, is the margin. At
grazing it is zero and the derivative infinite (di Bernardo et al., "Piecewise-smooth Dynamical
Systems", 2008, chapter 6).

A largest value has two derivatives where two peaks are equally high: the runner-up is kept with its
own, to tell how near the next peak is to overtaking. A peak goes on over all steps until the value
rises again, or jumps: the step beside that of the vertex, whose largest value is where they meet,
is no runner-up.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
from jax.lax import stop_gradient

from ...contact.guards import first_switch, stop_slots
from ...numerics.types import Scalar
from ...vocabulary.codes import Event, Regime
from .base import END_SLOPE, AbstractObserver, extremes, higher, lower
from .returns import Returns
from .reversal import ReversalTotals
from .totals import RegimeTotals, Totals

# corners of the vector field and of the prescribed motion keep its value: no jump of a derivative
HARMLESS = (Event.NONE, Event.KINK, Event.BELT_REVERSAL, Event.BELT_KINK)
ROUGH = 500  # roundings of a guard's size, below which the bend of its five node values is noise
SLIGHT = 1e-6  # of a value: what differs by less has neither jumped nor risen


class Peaks(NamedTuple):
    """One value for each of the largest values that `RegimeTotals` keeps, named alike."""

    normal_force_max: Scalar
    gap_max: Scalar
    impulse_max: Scalar


class Hump(NamedTuple):
    """The peak that a value is on, from where it last began to rise, or jumped."""

    last: Scalar  # value at the end of the last stretch
    down: Scalar  # whether it has come down from the peak
    leads: Scalar  # whether no earlier peak is higher


class Watched(NamedTuple):
    """Record of `Margins`: of another observer, and of the events from the start on."""

    totals: Any
    margin: Scalar  # 1: never near grazing
    word: Scalar  # hash of the sequence of events, and of which come before the window
    falling: tuple  # whether each guard fell at the end of the last stretch
    seconds: Peaks  # the runners-up
    humps: tuple[Hump, Hump]  # of the normal force, and of the gap


class Margins(AbstractObserver):
    """Another observer, and the grazing margin and the word of events beside it."""

    observer: RegimeTotals | ReversalTotals | Returns
    slots: tuple[int, ...]  # of guards that are watched: all but those of corners

    @property
    def begin(self):
        return self.observer.begin

    def init(self, dtype, shape=()):
        no = (jnp.zeros(shape, bool),) * len(self.slots)
        margin, word = jnp.ones(shape, dtype), jnp.zeros(shape, jnp.int32)
        zero = jnp.zeros(shape, dtype)
        seconds, hump = Peaks(zero, zero, zero), Hump(zero, zero > 0, zero > 0)
        totals = self.observer.init(dtype, shape)
        return Watched(totals, margin, word, no, seconds, (hump, hump))

    def stretch(self, record, stretch):
        margin, falling = record.margin, []
        for slot, fell in zip(self.slots, record.falling, strict=True):
            g, size = stretch.guards[slot], stretch.sizes[slot]
            slope = sum(w * x for w, x in zip(END_SLOPE, g, strict=True))
            a, b, c, d, e = g
            bend = (35 * e - 104 * d + 114 * c - 56 * b + 11 * a) / 3 * 4  # d2/dtheta2 at the end
            scale = jnp.where(size > 0, size, 1.0)
            ends = (slope < 0) & (jnp.abs(e) <= 1e-6 * jnp.maximum(size, 1e-300))
            # one too short to tell its bend begins within 1e-6: the one before ends here, too
            told = bend > ROUGH * jnp.finfo(bend.dtype).eps * scale
            depth = jnp.where(told, slope * slope / jnp.where(told, 2 * bend, 1.0), scale)
            inside = jnp.minimum(jnp.minimum(b, c), d)
            turns = (inside < jnp.minimum(a, e)) | (fell & (b > a))
            clear = jnp.maximum(jnp.minimum(inside, a), 0.0)
            here = jnp.where(ends, depth, jnp.where(turns, clear, scale)) / scale
            margin = jnp.minimum(margin, jnp.where(size > 0, here, 1.0))
            falling.append(slope < 0)
        on, best = stretch.start >= self.observer.start, regime_totals(record)
        seconds, humps = record.seconds, []
        names, peaks = ("normal_force_max", "gap_max"), extremes(stretch)
        for name, hump, peak, ends in zip(names, record.humps, peaks, _ends(stretch), strict=True):
            hump, same = _passed(hump, ends, peak, getattr(best, name), on)
            seconds = _beaten(seconds, best, name, peak, on & ~same)
            humps.append(hump)
        totals = self.observer.stretch(record.totals, stretch)
        return Watched(totals, margin, record.word, tuple(falling), seconds, tuple(humps))

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
        best = regime_totals(record)
        seconds = _beaten(record.seconds, best, "impulse_max", happening.impulse, on)
        totals = self.observer.event(record.totals, happening)
        return Watched(totals, record.margin, word, still, seconds, record.humps)


def regime_totals(record) -> Totals:
    """The record of `RegimeTotals` inside that of any observer which keeps one."""
    while not isinstance(record, Totals):
        record = record.totals
    return record


def _beaten(seconds: Peaks, best: Totals, name: str, peak, on) -> Peaks:
    """Return the runners-up after a new ``peak`` of the value ``name``, where ``on``."""
    second, loser = getattr(seconds, name), lower(getattr(best, name), peak)
    return seconds._replace(**{name: jnp.where(on, higher(second, loser), second)})


def _ends(stretch) -> tuple:
    """First and last normal force of a stretch, and its first and last gap (`extremes`)."""
    ends = stretch.nodes[0], stretch.nodes[-1]
    force = [node.forces.normal for node in ends]
    if not stretch.system.unilateral:
        return force, [jnp.zeros_like(x) for x in force]
    flying = stretch.regime == Regime.FLIGHT
    gap = [stretch.system.gap(node.time, node.position) for node in ends]
    return force, [
        jnp.where(flying, g, 0.0).astype(f.dtype) for g, f in zip(gap, force, strict=True)
    ]


def _passed(hump: Hump, ends, peak, best, on) -> tuple[Hump, Scalar]:
    """Return the hump after a stretch between ``ends`` with the largest value ``peak``, and whether
    it went on that of the largest value so far, ``best``."""
    first, last, peak = (stop_gradient(x) for x in (*ends, peak))
    least = SLIGHT * jnp.maximum(jnp.abs(peak), jnp.abs(hump.last))
    goes_on = (jnp.abs(first - hump.last) <= least) & ~(hump.down & (peak - first > least))
    same = goes_on & hump.leads
    down = (peak - last > least) | (goes_on & hump.down)
    return Hump(last, down, on & (same | (peak >= best))), same


def watch(system, observer: RegimeTotals | ReversalTotals | Returns) -> Margins:
    """Return ``observer`` with the margins of the contact's guards and of the stops beside it."""
    return Margins(observer, (*range(first_switch(system)), *stop_slots(system)))
