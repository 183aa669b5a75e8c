"""The engine's side of a sweep: cells of a specification in, columns of the map out."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .belts import SteadyBelt
from .dataset import raster_index
from .lanes import Outcome, Pool, run_pool
from .noise import ReversalTotals
from .observers import RegimeTotals
from .results import Result
from .sampling import SAMPLES_PER_STEP, Signal
from .scene import SOLVERS, build_wiper, start_state
from .solve import make_problem
from .stability import steady_slip
from .wiper import Wiper

LANES = {"float64": 256, "float32": 512}  # a device; as much as its cache holds
FLOWS = 3  # a jump


def identity() -> dict[str, str]:
    """What of this machine has a part in the numbers, beside the versions: the kind of device."""
    return {"device": jax.devices()[0].device_kind}


def evaluate(spec: Any, index: np.ndarray) -> dict[str, Any]:
    """Return the columns of the cells ``index`` of a `SweepSpec`, each of shape (len(index),).

    Beside columns of `dataset.SCHEMA`: ``signal`` (cells, samples), the tip velocity [m/s] at
    ``sample_interval`` [s], and ``occupancy`` of the batch.
    """
    devices = jax.devices()
    shares = len(devices)
    run = spec.run
    # every call of a sweep has the same shapes (one compilation): short blocks are filled up
    size = _capacity(len(index), shares)
    padded = np.concatenate([index, np.full(size - len(index), index[-1])]).astype(np.int64)
    wiper = build_wiper(spec.cells(padded), spec.belt.kind)
    position, velocity = start_state(wiper, spec.start)
    cells = (
        _arrays(wiper, run.precision),
        _full(position, size, run.precision),
        _full(velocity, size, run.precision),
    )
    varying, fixed = eqx.partition(cells, eqx.is_array)
    settings = _settings(spec)
    if devices[0].platform == "cpu":
        devices = devices[:1] * shares  # one compilation; a thread for each share fills a core

    def compute(share):
        # neighbours cost alike: deal the cells out like cards, so that the shares end together
        mine = jax.tree.map(lambda x: np.asarray(x)[share::shares] if x.ndim else x, varying)
        count = jnp.asarray(len(index[share::shares]), jnp.int32)
        mine, count = jax.device_put((mine, count), devices[share])
        wiper, position, velocity = eqx.combine(mine, fixed)
        found = _compute(wiper, position, velocity, count, settings)
        return jax.tree.map(np.asarray, found)

    with ThreadPoolExecutor(shares) as pool:
        answers = list(pool.map(compute, range(shares)))
    outcome, signal = jax.tree.map(
        lambda *parts: np.stack(parts, 1).reshape(-1, *parts[0].shape[1:])[: len(index)],
        *(answer[:2] for answer in answers),
    )
    useful, executed = np.sum([answer[2] for answer in answers], axis=0)
    back = np.arange(len(index))
    columns: dict[str, Any] = _columns(outcome, run, wiper, back)
    columns["signal"] = signal.output
    if run.raster is not None:
        columns["regime_raster"] = signal.regime
    columns["sample_interval"] = run.window / run.samples
    columns["occupancy"] = float(useful / executed)
    linear = steady_slip(wiper, wiper.belt.peak)
    columns["growth_rate"] = _cellwise(linear.growth_rate, back)
    columns["linear_frequency"] = _cellwise(linear.frequency, back)
    return columns


def _cellwise(value, back) -> np.ndarray:
    """One value a cell, in the order of the caller, of something that may be the same for all."""
    value = np.asarray(value)
    return value[back] if value.ndim else np.full(len(back), value)


class _Settings(NamedTuple):
    """What a compilation depends on beside shapes: plain numbers, so static."""

    transient: float
    window: float
    rtol: float
    atol: float | None
    precision: str
    solver: str
    max_steps: int
    zeno_time: float
    samples: int
    raster: int | None
    reversal_window: float


def _settings(spec) -> _Settings:
    given = {name: getattr(spec.run, name) for name in _Settings._fields[:-1]}
    return _Settings(**given, reversal_window=spec.classes.reversal_window)


def _capacity(cells: int, shares: int) -> int:
    """Cells a block is filled up to: the next power of two, at least 64 a device."""
    return max(1 << (cells - 1).bit_length(), 64 * shares)


def _arrays(wiper: Wiper, precision: str) -> Wiper:
    """Turn parameters into arrays, (cells,) where they vary and () where they do not.

    A Python 0 stays one: its terms are left out of the compiled program.
    """

    def leaf(value):
        if isinstance(value, int | float) and value == 0:
            return value
        return jnp.asarray(value, precision)

    return jax.tree.map(leaf, wiper)


def _full(pair, size, precision):
    return tuple(jnp.broadcast_to(jnp.asarray(x, precision), (size,)) for x in pair)


@eqx.filter_jit
def _compute(wiper, position, velocity, count, s: _Settings) -> tuple[Outcome, Any, Any]:
    """Run the cells of one share. A program for one device: compiled for several together it
    would round otherwise, and a map would depend on the number of cores.
    """
    interval = s.window / s.samples
    if isinstance(wiper.belt, SteadyBelt):
        totals = RegimeTotals(s.transient)
    else:
        totals = ReversalTotals(s.transient, s.reversal_window)
    problem, q, v, start = make_problem(
        wiper,
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
        max_steps=s.max_steps,
        max_step=SAMPLES_PER_STEP * interval,
        zeno_time=s.zeno_time,
        mark=s.transient,
        observer=totals,
        dtype=jnp.dtype(s.precision),
    )
    pool = Pool(problem, q, v, start, count)
    lanes = min(LANES[s.precision], q[0].shape[-1])
    outcome, signal, effort = run_pool(pool, lanes, FLOWS)
    if s.raster is not None:
        kept = np.array(raster_index(s.samples, s.raster))
        signal = signal._replace(regime=signal.regime[:, kept])
    return outcome, signal, effort


def _columns(outcome: Outcome, run, wiper: Wiper, back) -> dict[str, np.ndarray]:
    """Statistics of the settled window; NaN where a cell did not reach its end."""
    record = outcome.observed
    totals = getattr(record, "totals", record)
    finished = outcome.result == Result.FINISHED

    def settled(values):
        return np.where(finished, values, np.nan)

    mean = totals.output_integral / run.window
    variance = totals.output_square_integral / run.window - mean**2
    columns = {
        "result": outcome.result,
        "stick_fraction": settled(totals.stick_time / run.window),
        "slip_fraction": settled(totals.slip_time / run.window),
        "flight_fraction": settled(totals.flight_time / run.window),
        "velocity_mean": settled(mean),
        "velocity_rms": settled(np.sqrt(np.maximum(variance, 0.0))),
        "belt_speed_rms": _cellwise(wiper.belt.rms, back),
        "normal_force_mean": settled(totals.normal_force_integral / run.window),
        "normal_force_max": settled(totals.normal_force_max),
        "gap_max": settled(totals.gap_max),
        "impact_count": totals.impact_count,
        "stick_count": totals.stick_count,
        "lift_off_count": totals.lift_off_count,
        "impact_impulse_max": settled(totals.impulse_max),
        "steps": outcome.steps - outcome.rejected,
        "rejected_steps": outcome.rejected,
        "unproved_steps": outcome.unproved,
        "final_time": outcome.final_time,
        "final_x": outcome.position[0],
        "final_y": outcome.position[1],
        "final_vx": outcome.velocity[0],
        "final_vy": outcome.velocity[1],
    }
    if record is not totals:
        with np.errstate(invalid="ignore", divide="ignore"):
            columns["normal_force_max_reversal"] = settled(record.force_max_reversal)
            columns["normal_force_mean_stroke"] = settled(
                record.force_integral_stroke / record.stroke_time
            )
            columns["impact_impulse_reversal"] = settled(record.impulse_max_reversal)
            columns["velocity_rms_reversal"] = settled(
                np.sqrt(record.vibration_integral / record.vibration_time)
            )
    return columns
