"""The engine's side of a sweep: cells of a specification in, columns of the map out."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .belts import SteadyBelt
from .dataset import raster_index
from .ladder import on_rung, operating_speed, start_on_rung
from .lanes import Outcome, Pool, run_pool
from .margins import Watched, regime_totals, watch
from .noise import ReversalTotals
from .observers import RegimeTotals
from .results import Result
from .sampling import SAMPLES_PER_STEP, Signal
from .scene import SOLVERS, build_wiper, start_state
from .schema import NONE
from .solve import make_problem
from .stability import steady_slip
from .state import EventLog
from .system import AbstractSystem
from .wiper import Wiper

# a device, at most: kernels start seldom enough, and what a turn touches is near in the caches
LANES = {"float64": 512, "float32": 1024}
CASES_PER_LANE = 8  # at least: the last cases of a block leave lanes empty
FLOWS = 3  # a jump


def lane_count(precision: str, cases: int) -> int:
    """Return how many trajectories of ``cases`` are in flight at a time on one device."""
    lanes = min(LANES[precision], cases // CASES_PER_LANE)
    return max(1, lanes - lanes % 64 if lanes > 64 else lanes)  # whole vectors


def identity() -> dict[str, str]:
    """What of this machine has a part in the numbers, beside the versions: the kind of device."""
    return {"device": jax.devices()[0].device_kind}


def evaluate(spec: Any, index: np.ndarray) -> dict[str, Any]:
    """Return the columns of the cells ``index`` of a `SweepSpec`, each of shape (len(index),).

    Beside columns of `schema.SCHEMA`: ``signal`` (cells, samples), the tip velocity [m/s] at
    ``sample_interval`` [s], and ``occupancy`` of the batch.
    """
    if spec.sensitivities is not None:
        from . import sensitivity  # it stands on this module

        return sensitivity.evaluate(spec, index)
    wiper, system, position, velocity = prepare(spec, index)
    settings, limit = _settings(spec), jnp.int32(spec.run.max_steps)

    def compute(cells, count):
        system, position, velocity = cells
        return _compute(system, position, velocity, count, limit, settings)

    precision, size = spec.run.precision, position[0].shape[-1]
    cells = (
        _arrays(system, precision),
        _full(position, size, precision),
        _full(velocity, size, precision),
    )
    order = dearest_first(wiper, len(index))
    (outcome, signal), effort = deal(compute, cells, order)
    return columns_of(spec, outcome, signal, effort, wiper, len(index))


def prepare(spec, index) -> tuple[Wiper, Any, tuple, tuple]:
    """Return wiper, system (its rung), positions and velocities of the cells ``index``, and
    of some that fill up.

    Every call of a sweep has the same shapes (one compilation).
    """
    size = _capacity(len(index), len(_devices()))
    padded = np.concatenate([index, np.full(size - len(index), index[-1])]).astype(np.int64)
    wiper = build_wiper(spec.cells(padded), spec.belt.kind)
    system = on_rung(wiper, spec.model)
    position, velocity = start_on_rung(system, start_state(wiper, spec.start), spec.start.kind)
    return wiper, system, position, velocity


def dearest_first(wiper: Wiper, count: int) -> np.ndarray:
    """Return the first ``count`` cells in the order to run them in, (count,).

    A cell that takes many turns and begins late keeps its lane busy while the others are empty. The
    more load and the slower the glass, the more sticking and slipping there is: of random blades
    with load / speed^(1/3) falling, 16 a lane, 98 % of the turns are used, in any order 87 % (list
    scheduling of turns that were counted; a lane that waits for others to jump is not in it).
    """
    load, speed = (_cellwise(x, count) for x in (wiper.normal_load, wiper.belt.peak))
    return np.argsort(-load / np.cbrt(np.maximum(speed, 1e-30)), kind="stable")


def deal(compute, cells, order: np.ndarray):
    """Return (answers in the order of the cells, effort) of ``compute``, one call for each device.

    ``compute(cells, count)`` gets arrays with the cells as last axis and returns (answers with the
    cells as first axis, effort). ``order``: the cells to run, first to last; there may be more, so
    that every call has the same shapes.
    """
    devices, count = _devices(), len(order)
    shares = len(devices)
    varying, fixed = eqx.partition(cells, eqx.is_array)

    def work(share):
        # dealt out like cards, so that the shares end together
        def pick(x):
            mine = order[share::shares]
            fill = np.full(x.shape[-1] // shares - len(mine), order[-1])
            return np.asarray(x)[..., np.concatenate([mine, fill])]

        mine = jax.tree.map(lambda x: pick(x) if x.ndim else x, varying)
        number = jnp.asarray(len(range(share, count, shares)), jnp.int32)
        mine, number = jax.device_put((mine, number), devices[share])
        *found, effort = compute(eqx.combine(mine, fixed), number)
        return jax.tree.map(np.asarray, (found, effort))

    def collect(*parts):
        whole = np.empty((count, *parts[0].shape[1:]), parts[0].dtype)
        for share, part in enumerate(parts):
            mine = order[share::shares]
            whole[mine] = part[: len(mine)]
        return whole

    with ThreadPoolExecutor(shares) as pool:
        answers = list(pool.map(work, range(shares)))
    whole = jax.tree.map(collect, *(answer[0] for answer in answers))
    return whole, np.sum([answer[1] for answer in answers], axis=0)


def columns_of(spec, outcome: Outcome, signal, effort, wiper: Wiper, count: int) -> dict[str, Any]:
    """Return what `evaluate` returns, from the answers of the engine."""
    run = spec.run
    useful, executed = effort
    columns: dict[str, Any] = _columns(outcome, run, wiper, count)
    columns["signal"] = signal.output[:, : run.samples]
    if run.raster is not None:
        columns["regime_raster"] = signal.regime
    if outcome.log is not None:
        columns |= _events(outcome.log, run)
    columns["sample_interval"] = interval = run.window / run.samples
    if not isinstance(wiper.belt, SteadyBelt):
        times = run.transient + interval * np.arange(run.samples)
        per_cell = jax.tree.map(lambda x: _cellwise(x, count)[:, None], wiper.belt)
        columns["since_reversal"] = np.asarray(per_cell.since_reversal(times))
        columns["wiping_frequency"] = _cellwise(wiper.belt.wiping_frequency, count)
    columns["occupancy"] = float(useful / max(executed, 1))  # all may fail at the start
    linear = steady_slip(wiper, operating_speed(wiper.belt))
    columns["growth_rate"] = _cellwise(linear.growth_rate, count)
    columns["linear_frequency"] = _cellwise(linear.frequency, count)
    return columns


def _cellwise(value, count: int) -> np.ndarray:
    """One value for each of ``count`` cells of something that may be the same for all."""
    value = np.asarray(value)
    return value[:count] if value.ndim else np.full(count, value)


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
    given = {name: getattr(spec.run, name) for name in _Settings._fields[:-1]}
    return _Settings(**given, reversal_window=spec.classes.reversal_window)


def _devices() -> list:
    """Return the device of each share of a block: every accelerator; or, for each of the host's
    devices, the first of them: one compilation, and a thread for each share fills a core.
    """
    devices = jax.devices()
    return devices[:1] * len(devices) if devices[0].platform == "cpu" else devices


def _capacity(cells: int, shares: int) -> int:
    """Cells a block is filled up to, so that blocks of about the same size have the same shapes."""
    share = -(-cells // shares)
    step = max(64, (1 << (share - 1).bit_length()) // 8)
    return -(-share // step) * step * shares


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
    system, position, velocity, count, max_steps, s: _Settings
) -> tuple[Outcome, Any, Any]:
    """Run the cells of one share. A program for one device: compiled for several together it
    would round otherwise, and a map would depend on the number of cores.
    """
    return outcomes(system, position, velocity, count, max_steps, s)


def outcomes(system, position, velocity, count, max_steps, s: _Settings, watched=False):
    """`_compute`, to be called inside `jax.jit`; ``watched``: with `margins` in the record."""
    interval = s.window / s.samples
    if isinstance(system.belt, SteadyBelt):
        totals = RegimeTotals(s.transient)
    else:
        totals = ReversalTotals(s.transient, s.reversal_window)
    if watched:
        totals = watch(system, totals)
    problem, q, v, start = make_problem(
        system,
        s.transient + s.window,
        initial_state=(position, velocity),
        solver=SOLVERS[s.solver](),
        rtol=s.rtol,
        atol=s.atol,
        signal=Signal(
            s.transient,
            interval,
            s.samples,
            SAMPLES_PER_STEP * FLOWS,
            s.raster is not None,
        ),
        max_events=s.event_log or 0,
        log_start=s.transient,
        max_steps=max_steps,
        max_step=SAMPLES_PER_STEP * interval,
        zeno_time=s.zeno_time,
        mark=s.transient,
        observer=totals,
        dtype=jnp.dtype(s.precision),
    )
    pool = Pool(problem, q, v, start, count)
    lanes = lane_count(s.precision, q[0].shape[-1])
    outcome, signal, effort = run_pool(pool, lanes, FLOWS)
    if s.raster is not None:
        kept = np.array(raster_index(s.samples, s.raster))
        signal = signal._replace(regime=signal.regime[:, kept])
    return outcome, signal, effort


def statistics(outcome: Outcome, window) -> dict[str, Any]:
    """Return the outcomes that have derivatives by parameters, (cells,) each."""
    record = regime_totals(outcome.observed)
    mean = record.output_integral / window
    variance = jnp.maximum(record.output_square_integral / window - mean * mean, 0.0)
    return {
        "stick_fraction": record.stick_time / window,
        "slip_fraction": record.slip_time / window,
        "flight_fraction": record.flight_time / window,
        "velocity_mean": mean,
        # at rest the root has no derivative
        "velocity_rms": jnp.where(variance > 0, jnp.sqrt(jnp.where(variance > 0, variance, 1)), 0),
        "normal_force_mean": record.normal_force_integral / window,
        "normal_force_max": record.normal_force_max,
        "gap_max": record.gap_max,
        "impact_impulse_max": record.impulse_max,
        # a rung of one coordinate stays on the glass
        "final_x": outcome.position[0],
        "final_y": (*outcome.position, 0.0 * outcome.position[0])[1],
        "final_vx": outcome.velocity[0],
        "final_vy": (*outcome.velocity, 0.0 * outcome.velocity[0])[1],
    }


def _events(log: EventLog, run) -> dict[str, np.ndarray]:
    """Columns of the event log; the room that a cell leaves empty holds NaN and `schema.NONE`."""
    used = np.arange(run.event_log) < log.count[:, None]

    def code(values):
        return np.where(used, values, NONE).astype(np.uint8)

    return {
        "event_count": log.count,
        "event_overflow": log.count > run.event_log,
        "event_time": np.where(used, log.time - run.transient, np.nan),
        "event_kind": code(log.kind),
        "regime_before": code(log.before),
        "regime_after": code(log.after),
        "event_impulse": np.where(used, log.impulse, np.nan),
    }


def _columns(outcome: Outcome, run, wiper: Wiper, count: int) -> dict[str, np.ndarray]:
    """Statistics of the settled window; NaN where a cell did not reach its end."""
    found = {name: np.asarray(x) for name, x in statistics(outcome, run.window).items()}
    record = outcome.observed
    if isinstance(record, Watched):
        record = record.totals
    totals = getattr(record, "totals", record)
    finished = outcome.result == Result.FINISHED

    def settled(values):
        return np.where(finished, values, np.nan)

    columns = {
        "result": outcome.result,
        "stick_fraction": settled(found["stick_fraction"]),
        "slip_fraction": settled(found["slip_fraction"]),
        "flight_fraction": settled(found["flight_fraction"]),
        "velocity_mean": settled(found["velocity_mean"]),
        "velocity_rms": settled(found["velocity_rms"]),
        "belt_speed_rms": _cellwise(wiper.belt.rms, count),
        "normal_force_mean": settled(found["normal_force_mean"]),
        "normal_force_max": settled(found["normal_force_max"]),
        "gap_max": settled(found["gap_max"]),
        "impact_count": totals.impact_count,
        "stick_count": totals.stick_count,
        "lift_off_count": totals.lift_off_count,
        "impact_impulse_max": settled(found["impact_impulse_max"]),
        "steps": outcome.steps - outcome.rejected,
        "rejected_steps": outcome.rejected,
        "unproved_steps": outcome.unproved,
        "final_time": outcome.final_time,
        **{name: found[name] for name in ("final_x", "final_y", "final_vx", "final_vy")},
    }
    if record is not totals:
        with np.errstate(invalid="ignore", divide="ignore"):
            columns["normal_force_max_reversal"] = settled(record.force_max_reversal)
            columns["normal_force_mean_stroke"] = settled(
                record.force_integral_stroke / record.stroke_time
            )
            columns["stick_fraction_stroke"] = settled(
                record.stick_time_stroke / record.stroke_time
            )
            columns["flight_fraction_stroke"] = settled(
                record.flight_time_stroke / record.stroke_time
            )
            columns["impact_impulse_reversal"] = settled(record.impulse_max_reversal)
            columns["velocity_rms_reversal"] = settled(
                np.sqrt(record.vibration_integral / record.vibration_time)
            )
    return columns
