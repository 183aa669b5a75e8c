"""The engine's side of a sweep: cells of a specification in, columns of the map out."""

from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ...contact.system import AbstractSystem
from ...datasets.map_dataset import raster_index
from ...engine.carry.problem import Integration, Recording, make_case
from ...engine.lanes import Pool, run_pool
from ...engine.observers.margins import watch
from ...engine.observers.returns import Returns
from ...engine.observers.reversal import totals_of
from ...engine.observers.totals import RegimeTotals
from ...engine.sampling.means import Samples, Signal
from ...numerics.kept import Kept
from ...numerics.runge_kutta import SOLVERS
from ...specs.tables import Start
from ...systems.build import Built, belt_of, build, go_on, start
from . import compiling
from .columns import columns_of, sampled
from .devices import (
    alike,
    capacity,
    deal,
    dearest_first,
    devices,
    is_brief,
    lane_count,
    sample_room,
)
from .linear import growth, slips

PARTS, MOST_PARTS = 40, 10_000  # see `longest_step`
RING = 8  # samples of a lane between two flushes; with more a turn costs more, with fewer it waits


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

    ``ended``: columns of as many motions that these go on from (`systems.build.go_on`); default:
    the start of ``spec``.
    """
    built, position, velocity = prepare(spec, index, room, ended)
    settings, run = Settings.of(spec, position[0].shape[-1]), Run.of(spec, finer)

    def compute_share(cells, count):
        system, position, velocity = cells
        rows, samples, effort = compute(system, position, velocity, count, run, settings)
        return rows, run.rows(samples, spec.run.raster), effort

    precision, size = spec.run.precision, position[0].shape[-1]
    cells = (
        alike(built.system, precision, size),
        _full(position, size, precision),
        _full(velocity, size, precision),
    )
    order = dearest_first(built.wiper, len(index))
    with ThreadPoolExecutor(1) as beside:  # a small program compiles while the engine's does
        slip = None
        if built.wiper is not None and finer == 1:
            slip = beside.submit(slips, built.wiper, size)
        (rows, signal), effort = deal(compute_share, cells, order)
        if finer > 1:
            return sampled(spec, signal, belt_of(built.system), len(index))
        with compiling.apart("naming"):
            linear = {} if slip is None else growth(slip.result(), len(index))
            return columns_of(spec, rows.tree(), signal, effort, built, linear, len(index))


def program(spec, index: np.ndarray, room: int | None = None) -> Callable[[int], Any]:
    """Return what runs the first so many cells of one share of the block of `evaluate`, and nothing
    else; of none it does no more than compile.
    """
    built, position, velocity = prepare(spec, index, room)
    precision, size = spec.run.precision, position[0].shape[-1]
    position, velocity = (_full(part, size, precision) for part in (position, velocity))
    cells = alike(built.system, precision, size), position, velocity
    arrays, plain = eqx.partition(cells, eqx.is_array)
    share = jax.tree.map(lambda x: x[..., : size // len(devices())] if x.ndim else x, arrays)
    run, settings = Run.of(spec), Settings.of(spec, size)

    def first(count: int) -> Any:
        # put there as `deal` does: what is put elsewhere is another program
        given, number = jax.device_put((share, jnp.int32(count)), devices()[0])
        return jax.block_until_ready(compute(*eqx.combine(given, plain), number, run, settings))

    return first


def compile_all(specs: Iterable[Any], room: int, threads: int) -> None:
    """Compile what `evaluate` runs of each of some sweeps with this ``room``, so many at once
    (but tracing, which holds Python's lock). One that cannot be started is left out.
    """

    def compile_one(spec) -> None:
        with suppress(ValueError):
            program(spec, np.zeros(1), room)(0)

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(compile_one, specs))


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
        last = {name: padded(np.asarray(x)) for name, x in ended.items()}
        there, goes_on = go_on(spec, built, last)
        begun = jax.tree.map(lambda x, y: jnp.where(goes_on, x, y), there, begun)
    position, velocity = (_full(part, size, "float64") for part in begun)
    return built, position, velocity


class Settings(NamedTuple):
    """What a compilation depends on beside shapes: static."""

    precision: str
    solver: str
    room: int  # samples that a case has room for
    regimes: bool  # whether they are sampled, too
    event_log: int
    brief: bool  # see `Integration`

    @classmethod
    def of(cls, spec, size: int) -> "Settings":
        """Return those of ``spec`` for a block that is filled up to ``size`` cells."""
        run = spec.settings
        regimes, log = run.raster is not None, run.event_log or 0
        # by the whole sweep, not the block, its share or a few points of a refinement: numbers do
        # not depend on those
        room = sample_room(size, run.samples)
        return cls(run.precision, run.solver, room, regimes, log, is_brief(spec))


class Run(NamedTuple):
    """How cells are integrated and sampled, traced: another window or tolerance, and a finer look,
    compile nothing. Times in s.
    """

    transient: jax.Array
    window: jax.Array
    rtol: jax.Array
    atol: jax.Array | None
    max_step: jax.Array | None
    zeno_time: jax.Array
    reversal_window: jax.Array
    max_steps: jax.Array
    interval: jax.Array  # of samples
    count: jax.Array

    @classmethod
    def of(cls, spec, finer: int = 1) -> "Run":
        """Return what ``spec`` asks for, with ``finer`` times as many samples."""
        run, count = spec.settings, finer * spec.samples
        names = ("transient", "window", "rtol", "atol", "max_step", "zeno_time")
        given = {name: getattr(run, name) for name in names}
        given["reversal_window"] = spec.classes.reversal_window
        given["interval"] = run.window / count
        numbers = {name: None if x is None else jnp.asarray(x, float) for name, x in given.items()}
        wholes = {"max_steps": run.max_steps, "count": count}
        return cls(**numbers, **{name: jnp.asarray(x, jnp.int32) for name, x in wholes.items()})

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


def longest_step(system: AbstractSystem, coordinates: int, window) -> Any:
    """Longest step [s] of a motion whose largest values are to have derivatives: a part of the time
    in which the first coordinate goes as far as it is large.

    A largest value is the vertex of a quartic through a step. In stick no error limits a step, and
    while the value of the vertex was right to 1e-9, its derivative, by how fast the vertex moves in
    time, was 5e-2 off. The cap is never below a small part of the window, whatever the scales.
    """
    (length, *_), (speed, *_) = system.scales(coordinates)
    return jax.lax.stop_gradient(jnp.maximum(length / (PARTS * speed), window / MOST_PARTS))


def _full(pair, size, precision):
    return tuple(jnp.broadcast_to(jnp.asarray(x, precision), (size,)) for x in pair)


def outcomes(system, position, velocity, count, run: Run, s: Settings, watched=False):
    """Return what `run_pool` does of cells; to be called inside `jax.jit`. ``watched``: with
    `margins` in the record.
    """
    totals = totals_of(system, belt_of(system), run.transient, run.reversal_window)
    steady = isinstance(totals, RegimeTotals)
    observer: Any = Returns(totals, len(position)) if watched and steady else totals
    if watched:
        observer = watch(system, observer)
    longest = longest_step(system, len(position), run.window) if watched else None
    solver = SOLVERS[s.solver]()
    cases = position[0].shape[-1]
    signal = Signal(
        run.transient,
        run.interval,
        run.count,
        room=cases * (s.room + RING),
        ring=RING,
        inner=not steady,  # of a steady belt the statistics tell it
        regimes=s.regimes,
    )
    case = make_case(
        system,
        run.transient + run.window,
        (position, velocity),
        Integration(
            *(solver, run.rtol, run.atol, run.max_steps, run.max_step, run.zeno_time, longest),
            brief=s.brief,
        ),
        Recording(
            signal=signal,
            max_events=s.event_log,
            log_start=run.transient,
            observer=observer,
            mark=run.transient,
        ),
        dtype=jnp.dtype(s.precision),
    )
    return run_pool(Pool(case, count), lane_count(s.precision, cases))


compute = Kept(outcomes)
"""`outcomes`, compiled. A program for one device: compiled for several together it would round
otherwise, and a map would depend on the number of cores.
"""
