"""The engine's side of a sweep: cells of a specification in, columns of the map out."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ...contact.belts import SteadyBelt
from ...contact.system import AbstractSystem
from ...datasets.map_dataset import raster_index
from ...engine.carry.problem import Integration, Recording, make_case
from ...engine.lanes import Outcome, Pool, run_pool
from ...engine.observers.margins import watch
from ...engine.observers.reversal import ReversalTotals
from ...engine.observers.totals import RegimeTotals
from ...engine.sampling.means import Samples, Signal
from ...numerics.runge_kutta import SOLVERS
from ...specs.tables import Start
from ...systems.build import Built, belt_of, build, go_on, start
from ...vocabulary.schema import ENDED, ENDED_ELSEWHERE
from . import compiling
from .columns import columns_of, sampled
from .devices import capacity, deal, dearest_first, lane_count

RING = 4  # samples of a lane between two flushes; with more a turn costs more, with fewer it waits


def evaluate(
    spec: Any,
    index: np.ndarray,
    finer: int = 1,
    room: int | None = None,
    ended: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Return the columns of the cells ``index`` of a `SweepSpec`, each of shape (len(index),).

    Beside columns of `schema.SCHEMA`: ``signal`` (cells, samples), the mean tip velocity [m/s] over
    each ``sample_interval`` [s] of the window, on a belt that reverses ``signal_inner``, its
    variance inside each, and ``occupancy`` of the batch.

    ``finer``: times as many samples, which are then all that is returned. ``room`` (default: the
    number of cells): for so many cells with the plain number of samples the program is compiled.
    Calls of one room share it, if they have at most room / finer cells.

    ``ended``: columns of as many motions that these go on from (`build.continued_state`); default:
    the start of ``spec``.
    """
    built, position, velocity = prepare(spec, index, room, ended)
    settings, limit = _settings(spec), jnp.int32(spec.run.max_steps)
    sampling = Sampling.of(spec, finer)

    def compute(cells, count):
        system, position, velocity = cells
        outcome, samples, effort = _compute(
            system, position, velocity, count, limit, sampling, settings
        )
        return outcome, sampling.rows(samples, spec.run.raster), effort

    precision, size = spec.run.precision, position[0].shape[-1]
    cells = (
        _arrays(built.system, precision),
        _full(position, size, precision),
        _full(velocity, size, precision),
    )
    order = dearest_first(built.wiper, len(index))
    (outcome, signal), effort = deal(compute, cells, order)
    if finer > 1:
        return sampled(spec, signal, belt_of(built.system), len(index))
    with compiling.apart("naming"):
        return columns_of(spec, outcome, signal, effort, built, len(index))


def prepare(
    spec, index, room: int | None = None, ended: Mapping[str, Any] | None = None
) -> tuple[Built, tuple, tuple]:
    """Return the system, positions and velocities of the cells ``index``, and of some that fill up
    to ``room``.

    Every call of a sweep has the same shapes (one compilation).
    """
    size = capacity(max(len(index), room or 0))

    def padded(values):
        return np.concatenate([values, np.repeat(values[-1:], size - len(values), axis=0)])

    cells = padded(index).astype(np.int64)
    built = build(spec, spec.cells(cells))
    begun = start(spec, built)
    if spec.starts is not None and spec.start.kind == "equilibrium":  # none: at rest
        rest = start(spec, built, Start())
        begun = jax.tree.map(lambda x, y: jnp.where(jnp.isfinite(x), x, y), begun, rest)
    if ended is not None:
        names = ENDED if built.wiper is not None else ENDED_ELSEWHERE
        last = {name: padded(np.asarray(ended[name])) for name in names}
        there, goes_on = go_on(spec, built, last)
        begun = jax.tree.map(lambda x, y: jnp.where(goes_on, x, y), there, begun)
    position, velocity = (_full(part, size, "float64") for part in begun)
    return built, position, velocity


class _Settings(NamedTuple):
    """What a compilation depends on beside shapes: plain numbers, so static."""

    transient: float
    window: float
    rtol: float
    atol: float | None
    precision: str
    solver: str
    zeno_time: float
    samples: int
    raster: int | None
    event_log: int | None
    reversal_window: float


def _settings(spec) -> _Settings:
    run = spec.settings
    given = {name: getattr(run, name) for name in _Settings._fields[:-1]}
    return _Settings(**given, reversal_window=spec.classes.reversal_window)


class Sampling(NamedTuple):
    """How the settled window is sampled; traced, so that a finer look compiles nothing."""

    interval: jax.Array  # [s]
    count: jax.Array

    @classmethod
    def of(cls, spec, finer: int = 1) -> "Sampling":
        """Return the sampling that ``spec`` asks for, ``finer`` times as fine."""
        count = finer * spec.samples
        return cls(jnp.asarray(spec.run.window / count), jnp.asarray(count, jnp.int32))

    def rows(self, samples: Samples, raster: int | None) -> Samples:
        """Return what the engine has recorded as (cases, samples) each; of the regimes the
        ``raster``."""
        count = int(self.count)

        def row(flat):
            flat, length = np.asarray(flat), count + RING
            cases = len(flat) // length
            return flat[: cases * length].reshape(cases, length)[:, :count]

        found = jax.tree.map(row, samples)
        if raster is None:
            return found
        return found._replace(regime=found.regime[:, raster_index(count, raster)])


def _arrays(system: AbstractSystem, precision: str) -> AbstractSystem:
    """Turn parameters into arrays, (cells,) where they vary and () where they do not.

    A Python 0 or 1 stays one: its terms, or a power of 1, are left out of the compiled program.
    """

    def leaf(value):
        if isinstance(value, int | float) and value in (0, 1):
            return value
        return jnp.asarray(value, precision)

    return jax.tree.map(leaf, system)


def _full(pair, size, precision):
    return tuple(jnp.broadcast_to(jnp.asarray(x, precision), (size,)) for x in pair)


@eqx.filter_jit
def _compute(
    system, position, velocity, count, max_steps, sampling: Sampling, s: _Settings
) -> tuple[Outcome, Any, Any]:
    """Run the cells of one share. A program for one device: compiled for several together it
    would round otherwise, and a map would depend on the number of cores.
    """
    return outcomes(system, position, velocity, count, max_steps, sampling, s)


def outcomes(
    system, position, velocity, count, max_steps, sampling: Sampling, s: _Settings, watched=False
):
    """`_compute`, to be called inside `jax.jit`; ``watched``: with `margins` in the record."""
    steady = isinstance(belt_of(system), SteadyBelt | None)
    totals = RegimeTotals(s.transient)
    if not steady:
        totals = ReversalTotals(s.transient, s.reversal_window)
    if watched:
        totals = watch(system, totals)
    solver = SOLVERS[s.solver]()
    cases = position[0].shape[-1]
    signal = Signal(
        s.transient,
        sampling.interval,
        sampling.count,
        room=cases * (s.samples + RING),
        ring=RING,
        inner=not steady,  # of a steady belt the statistics tell it
        regimes=s.raster is not None,
    )
    case = make_case(
        system,
        s.transient + s.window,
        (position, velocity),
        Integration(solver, s.rtol, s.atol, max_steps, zeno_time=s.zeno_time),
        Recording(
            signal=signal,
            max_events=s.event_log or 0,
            log_start=s.transient,
            observer=totals,
            mark=s.transient,
        ),
        dtype=jnp.dtype(s.precision),
    )
    return run_pool(Pool(case, count), lane_count(s.precision, cases))
