"""Values at chosen times, from the dense output of the steps that pass over them."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .regimes import forces
from .stages import dense_weights
from .state import Problem, State
from .system import Scalar, contact
from .trial import Trial

_POINTS = 9  # the dense output of every supported solver has degree < 9


def dense_polynomial(solver_type) -> np.ndarray:
    """Coefficients (degree, stage), lowest first, of the dense output's weights b_i(theta)."""
    # Chebyshev points: an interpolation that loses no digits
    points = 0.5 - 0.5 * np.cos(np.pi * np.arange(_POINTS) / (_POINTS - 1))
    values = np.stack([dense_weights(solver_type, float(p)) for p in points])
    return np.linalg.solve(np.vander(points, increasing=True), values)


def empty_samples(problem: Problem, state: State):
    """Return buffers for ``problem.record`` at every sample time: NaN, or -1 for integers."""
    if problem.sample_times is None:
        return None
    n = problem.sample_times.shape[0]

    def record(state):
        system = problem.system.on_piece(state.piece)
        q, v = state.position, state.velocity
        c = contact(system, state.time, q, v)
        f = forces(system, c, state.regime)
        return problem.record(system, state.time, q, v, state.regime, f)

    shapes = jax.eval_shape(record, state)
    return jax.tree.map(
        lambda s: jnp.full(
            (n, *s.shape), -1 if jnp.issubdtype(s.dtype, jnp.integer) else jnp.nan, s.dtype
        ),
        shapes,
    )


def take_samples(problem: Problem, state: State, trial: Trial, moves, length):
    """Return (index, buffers) after recording the sample times up to the end of a committed step.

    A sample at the very instant of an event shows the motion before it. Buffers have the sample
    first and lanes last.
    """
    if problem.sample_times is None:
        return state.sample_index, state.samples
    times, n = problem.sample_times, problem.sample_times.shape[0]
    system = problem.system.on_piece(state.piece)
    y0 = (state.position, state.velocity)
    polynomial = dense_polynomial(type(problem.solver))
    reach = jnp.where(moves, state.time + length, -jnp.inf)
    # a step that lands on a known time covers it whatever rounding says
    reach = jnp.where(moves & trial.lands, jnp.maximum(reach, trial.mark), reach)

    lanes = jnp.indices(state.time.shape, sparse=True)

    def due(index):
        return (index < n) & (times[jnp.minimum(index, n - 1)] <= reach)

    def write(carry):
        index, buffers = carry
        writes = due(index)
        t = times[jnp.minimum(index, n - 1)]
        theta = ((t - state.time) / jnp.where(trial.h > 0, trial.h, 1.0)).astype(y0[0][0].dtype)
        y = y0
        for stage, column in zip(trial.step.stages, polynomial.T, strict=True):
            weight = jnp.zeros_like(theta)
            for coefficient in column[::-1]:
                weight = weight * theta + float(coefficient)
            y = jax.tree.map(lambda a, k, w=weight: a + w * k, y, stage)
        q, v = y
        f = forces(system, contact(system, t, q, v), state.regime)
        values = problem.record(system, t, q, v, state.regime, f)
        at = (jnp.where(writes, index, n), *lanes)
        buffers = jax.tree.map(lambda b, x: b.at[at].set(x, mode="drop"), buffers, values)
        return index + writes, buffers

    return jax.lax.while_loop(
        lambda carry: jnp.any(due(carry[0])), write, (state.sample_index, state.samples)
    )


class Signal(eqx.Module):
    """A uniform record of the system's output velocity, cheap enough for every lane of a batch.

    A turn puts its samples into a short ring (selects, no scatter: XLA's CPU scatters run one lane
    after the other); the owner of the loop moves the ring into the record every few turns.
    """

    start: Scalar
    interval: Scalar
    count: int = eqx.field(static=True)
    ring: int = eqx.field(static=True)  # samples between two flushes, at most
    regimes: bool = eqx.field(static=True, default=False)  # record the regime as well

    def empty(self, lanes) -> "Ring":
        """Return an empty ring for a batch of shape ``lanes``."""
        output = jnp.zeros((self.ring, *lanes), jnp.float32)
        regimes = jnp.zeros((self.ring, *lanes), jnp.uint8) if self.regimes else None
        return Ring(output, regimes, jnp.zeros(lanes, jnp.int32))

    def record(self, cases: int) -> "Record":
        """Return empty records, (cases, samples), with room for a ring behind the last sample."""
        shape = (cases, self.count + self.ring)
        output = jnp.full(shape, jnp.nan, jnp.float32)
        return Record(output, jnp.full(shape, 255, jnp.uint8) if self.regimes else None)


class Ring(NamedTuple):
    """Samples taken since the last flush, (ring, lanes), and the index of the first of them."""

    output: jax.Array
    regime: jax.Array | None
    first: jax.Array


class Record(NamedTuple):
    """Samples of every case, (cases, samples and more); NaN and 255 where there is none."""

    output: jax.Array
    regime: jax.Array | None


SAMPLES_PER_STEP = 2  # as many as a step may pass: `Problem.max_step` is set to match


def take_signal(signal: Signal, system, state: State, q, v, rate, moves, length):
    """Return (index, ring) after recording a committed step that ends at (q, v).

    Between the ends of the step the output is the cubic with its values and rates there: an error
    far below a spectrum's floor, at a tenth of the cost of the dense output. A step passes at most
    `SAMPLES_PER_STEP` samples.
    """
    h = length.astype(v[0].dtype)

    def output(t, q, v, rate):
        value, slope = jax.jvp(system.output, (t, q, v), (jnp.ones_like(t), *rate))
        return value, slope * h

    end = state.time + length
    f0, s0 = output(state.time, state.position, state.velocity, state.rate)
    f1, s1 = output(end, q, v, rate)
    rise = f1 - f0
    index, ring = state.sample_index, state.samples
    # a step that ends on a sample takes it, whatever rounding says
    reach = end + 1e-9 * signal.interval
    for _ in range(SAMPLES_PER_STEP):
        t = signal.start + signal.interval * index
        due = moves & (index < signal.count) & (t <= reach)
        u = ((t - state.time) / jnp.where(length > 0, length, 1.0)).astype(h.dtype)
        bend = (s0 - rise) * (1 - u) - (s1 - rise) * u
        value = f0 + u * (rise + (1 - u) * bend)
        value = jax.lax.stop_gradient(value).astype(jnp.float32)  # tangents would fill memory
        slots = jnp.arange(signal.ring).reshape((-1,) + (1,) * index.ndim)
        here = due & (index - ring.first == slots)
        regime = ring.regime
        if regime is not None:
            regime = jnp.where(here, state.regime.astype(jnp.uint8), regime)
        ring = Ring(jnp.where(here, value, ring.output), regime, ring.first)
        index = index + due
    return index, ring


def flush(record: Record, ring: Ring, case, index) -> tuple[Record, Ring]:
    """Move the ring of every lane into the row ``case`` of the record, if there is such a row;
    ``index`` samples are then recorded."""
    at = jnp.stack([case, ring.first], axis=-1)
    taken = jnp.arange(ring.output.shape[0])[:, None] < index - ring.first
    windows = jax.lax.ScatterDimensionNumbers(
        update_window_dims=(1,), inserted_window_dims=(0,), scatter_dims_to_operand_dims=(0, 1)
    )

    def write(rows, new, none):
        new = jnp.where(taken, new, jnp.asarray(none, new.dtype)).T
        drop = jax.lax.GatherScatterMode.FILL_OR_DROP
        return jax.lax.scatter(rows, at, new, windows, mode=drop)

    regime = record.regime
    if regime is not None:
        regime = write(regime, ring.regime, 255)
    return Record(write(record.output, ring.output, jnp.nan), regime), ring._replace(first=index)
