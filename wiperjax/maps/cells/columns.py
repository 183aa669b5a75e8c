"""What the engine leaves of a block of cells, as columns of a map."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ...contact.belts import AbstractBelt, SteadyBelt
from ...engine.carry.state import EventLog
from ...engine.lanes import Outcome
from ...engine.observers.margins import Watched, regime_totals
from ...engine.observers.returns import Returned
from ...engine.observers.told import smooth, told
from ...numerics.arrays import cellwise
from ...systems.build import Built, belt_of
from ...vocabulary.codes import Result
from ...vocabulary.schema import EVENT_COLUMNS, SCHEMA


def columns_of(
    spec, outcome: Outcome, signal, effort, built: Built, linear: dict[str, Any], count: int
) -> dict[str, Any]:
    """Return what `evaluate` returns, from the answers of the engine and of steady slip, `linear`
    (nothing where cells are no blades).
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
    return columns | linear


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


def statistics(watched: Watched, window) -> dict[str, Any]:
    """Return the outcomes that have derivatives by parameters, (cells,) each: of whole periods
    where the motion comes back to itself in the ``window`` [s]."""
    record = watched.totals
    if isinstance(record, Returned):
        return smooth(*record.whole(window)) | {"noise_period": record.period}
    return smooth(regime_totals(record), window)


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


def _columns(outcome: Outcome, run, belt: AbstractBelt | None, count: int) -> dict[str, np.ndarray]:
    """Statistics of the settled window; NaN where a cell did not reach its end."""
    record = outcome.observed
    if isinstance(record, Watched):
        record = record.totals
    columns = {}
    if isinstance(record, Returned):
        columns["noise_period"] = np.asarray(record.period)
        record = record.totals
    columns |= {
        "result": outcome.result,
        **told(record, run.window, outcome.result == Result.FINISHED),
        "steps": outcome.steps - outcome.rejected,
        "rejected_steps": outcome.rejected,
        "unproved_steps": outcome.unproved,
        "final_time": outcome.final_time,
    }
    if belt is not None:
        columns["belt_speed_rms"] = cellwise(belt.rms, count)
    return columns
