"""Online statistics of the reversal: contact force around V = 0 against the rest of the stroke."""

from functools import reduce
from typing import NamedTuple

import jax.numpy as jnp

from .observers import AbstractObserver, RegimeTotals, Totals, outputs
from .results import Event, Regime
from .system import Scalar


class ReversalRecord(NamedTuple):
    """Record of `ReversalTotals`; forces in N/m, impulses in N s/m, times in s."""

    totals: Totals
    force_max_reversal: Scalar  # within the window around V = 0
    force_integral_stroke: Scalar  # outside it
    stroke_time: Scalar
    stick_time_stroke: Scalar
    flight_time_stroke: Scalar
    impulse_max_reversal: Scalar
    vibration_integral: Scalar  # of output^2 in the window after V = 0
    vibration_time: Scalar


class ReversalTotals(AbstractObserver):
    """`RegimeTotals` plus what happens within ``window`` [s] of a passage of V through zero."""

    start: Scalar
    window: Scalar

    @property
    def _regimes(self) -> RegimeTotals:
        return RegimeTotals(self.start)

    def init(self, dtype, shape=()):
        z = jnp.zeros(shape, dtype)
        return ReversalRecord(self._regimes.init(dtype, shape), *[z] * 8)

    def stretch(self, record, stretch):
        s = stretch
        dtype = record.stroke_time.dtype
        on = s.start >= self.start
        since = [s.system.belt.since_reversal(node.time) for node in s.nodes]
        near = [jnp.abs(x) <= self.window for x in since]
        just_after = [(n & (x >= 0)).astype(dtype) for n, x in zip(near, since, strict=True)]
        force = [node.forces.normal for node in s.nodes]
        sizes = [jnp.where(n, jnp.abs(f), 0.0) for n, f in zip(near, force, strict=True)]
        peak = reduce(jnp.maximum, sizes)  # a NaN stays one
        far = [(~n).astype(dtype) for n in near]
        vibration = [w * x * x for w, x in zip(just_after, outputs(s), strict=True)]
        load = [w * f for w, f in zip(far, force, strict=True)]

        def integral(values):
            return jnp.where(on, s.integral(values), 0.0)

        stroke = integral(far)

        return ReversalRecord(
            self._regimes.stretch(record.totals, stretch),
            jnp.where(on, jnp.maximum(record.force_max_reversal, peak), record.force_max_reversal),
            record.force_integral_stroke + integral(load),
            record.stroke_time + stroke,
            record.stick_time_stroke + jnp.where(s.regime == Regime.STICK, stroke, 0.0),
            record.flight_time_stroke + jnp.where(s.regime == Regime.FLIGHT, stroke, 0.0),
            record.impulse_max_reversal,
            record.vibration_integral + integral(vibration),
            record.vibration_time + integral(just_after),
        )

    def event(self, record, happening):
        e = happening
        near = jnp.abs(e.system.belt.since_reversal(e.time)) <= self.window
        hit = (e.kind == Event.IMPACT) | (e.kind == Event.ZENO) | (e.kind == Event.JAM)
        counts = hit & near & (e.time >= self.start)
        largest = jnp.maximum(record.impulse_max_reversal, e.impulse)
        return record._replace(
            totals=self._regimes.event(record.totals, happening),
            impulse_max_reversal=jnp.where(counts, largest, record.impulse_max_reversal),
        )
