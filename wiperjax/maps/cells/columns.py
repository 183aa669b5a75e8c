"""What the engine leaves of a block of cells, as columns of a map."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ...blade.steady_slip import SteadySlip
from ...contact.belts import AbstractBelt, SteadyBelt
from ...engine.carry.state import EventLog
from ...engine.lanes import Outcome
from ...engine.observers.margins import Watched, regime_totals
from ...numerics.arrays import cellwise
from ...systems.build import Built, belt_of
from ...vocabulary.codes import Result
from ...vocabulary.schema import EVENT_COLUMNS, SCHEMA
from .linear import growth


def columns_of(
    spec, outcome: Outcome, signal, effort, built: Built, slip: SteadySlip | None, count: int
) -> dict[str, Any]:
    """Return what `evaluate` returns, from the answers of the engine and the steady slip of the
    blades, if they are blades.
    """
    run = spec.run
    useful, executed = effort
    belt, blade = belt_of(built.system), built.wiper is not None
    columns = _columns(outcome, run, belt, count) | sampled(spec, signal, belt, count)
    columns |= ended(outcome, blade)
    if run.raster is not None:
        columns["regime_raster"] = signal.regime
    if spec.starts is not None:
        columns["final_regime"] = outcome.regime
    if outcome.log is not None:
        columns |= _events(outcome.log, run)
    columns["occupancy"] = float(useful / max(executed, 1))  # all may fail at the start
    return columns if slip is None else columns | growth(slip, count)


def sampled(spec, signal, belt: AbstractBelt | None, count: int) -> dict[str, Any]:
    """Return what is told of samples: what `maps.block.naming` takes."""
    run, samples = spec.run, signal.output.shape[1]
    columns: dict[str, Any] = {"signal": signal.output, "sample_interval": run.window / samples}
    if signal.inner is not None:
        columns["signal_inner"] = signal.inner
    if not isinstance(belt, SteadyBelt | None):
        times = run.transient + run.window / samples * (np.arange(samples) + 0.5)
        per_cell = jax.tree.map(lambda x: cellwise(x, count)[:, None], belt)
        columns["since_reversal"] = np.asarray(per_cell.since_reversal(times))
        columns["wiping_frequency"] = cellwise(belt.wiping_frequency, count)
    return columns


def statistics(outcome: Outcome, window) -> dict[str, Any]:
    """Return the outcomes that have derivatives by parameters, (cells,) each."""
    record = regime_totals(outcome.observed)
    # Of the time as it was added up, which is the window but for rounding: what sticks throughout
    # has the share 1 itself, in any precision. By that `labels` tells a tip that is carried.
    counted = record.stick_time + record.slip_time + record.flight_time
    counted = jnp.where(counted > 0, counted, 1.0)
    return {
        "stick_fraction": record.stick_time / counted,
        "slip_fraction": record.slip_time / counted,
        "flight_fraction": record.flight_time / counted,
        "velocity_mean": record.output_integral / window,
        "velocity_rms": record.deviation(window),
        "normal_force_mean": record.normal_force_integral / window,
        "normal_force_max": record.normal_force_max,
        "gap_max": record.gap_max,
        "impact_impulse_max": record.impulse_max,
    }


def ended(outcome: Outcome, of_a_blade: bool) -> dict[str, Any]:
    """Return the state that motions ended in: of the tip (cells,), else (cells, coordinates)."""
    if not of_a_blade:
        return {
            "final_position": jnp.stack(outcome.position, axis=-1),
            "final_velocity": jnp.stack(outcome.velocity, axis=-1),
        }
    rest = 0.0 * outcome.position[0]  # a rung of one coordinate stays on the glass
    return {
        "final_x": outcome.position[0],
        "final_y": (*outcome.position, rest)[1],
        "final_vx": outcome.velocity[0],
        "final_vy": (*outcome.velocity, rest)[1],
    }


def _events(log: EventLog, run) -> dict[str, np.ndarray]:
    """Columns of the event log; the room that a cell leaves empty holds NaN and `codes.NONE`."""
    used = np.arange(run.event_log) < log.count[:, None]

    log = log._replace(time=log.time - run.transient)
    columns = {"event_count": log.count, "event_overflow": log.count > run.event_log}
    for field, name in EVENT_COLUMNS.items():
        column = SCHEMA[name]
        columns[name] = np.where(used, getattr(log, field), column.missing).astype(column.dtype)
    return columns


def _each(whole, count) -> np.ndarray:
    """A whole shared among some; 0 where there are none."""
    count = np.asarray(count)
    return np.where(count > 0, np.asarray(whole) / np.maximum(count, 1), 0.0)


def _columns(outcome: Outcome, run, belt: AbstractBelt | None, count: int) -> dict[str, np.ndarray]:
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
        "normal_force_mean": settled(found["normal_force_mean"]),
        "normal_force_max": settled(found["normal_force_max"]),
        "gap_max": settled(found["gap_max"]),
        "impact_count": totals.impact_count,
        "stick_count": totals.stick_count,
        "lift_off_count": totals.lift_off_count,
        "slip_rate": settled(totals.slip_count / run.window),
        "force_drop": settled(totals.force_drop),
        "energy_per_slip": settled(_each(totals.friction_work, totals.slip_count)),
        "acceleration_max": settled(totals.acceleration_max),
        "impact_impulse_max": settled(found["impact_impulse_max"]),
        "steps": outcome.steps - outcome.rejected,
        "rejected_steps": outcome.rejected,
        "unproved_steps": outcome.unproved,
        "final_time": outcome.final_time,
    }
    if belt is not None:
        columns["belt_speed_rms"] = cellwise(belt.rms, count)
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
