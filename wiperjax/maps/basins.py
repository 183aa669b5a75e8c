"""Many starts of one system, a person's own too: which of its motions each of them ends in."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..contact import fits
from ..contact.own_numbers import check_known, numbers
from ..contact.system import AbstractSystem, system_attributes
from ..engine.arguments import check_coordinates, check_integration, check_system, tolerances
from ..engine.carry.problem import Integration, Recording, make_case
from ..engine.lanes import Outcome, Pool, run_pool
from ..engine.observers.totals import RegimeTotals
from ..machine.provenance import maker
from ..numerics.arrays import fields_of
from ..numerics.kept import Kept
from ..systems.numbers import traceable
from ..vocabulary import cf, checks
from ..vocabulary.codes import FAIR, REGIMES, RESULTS
from ..vocabulary.ranges import COUNT, FINITE, NON_NEGATIVE, POSITIVE
from .cells.devices import capacity, deal, lane_count

MOST_STEPS = 10**6


def basins(
    system: AbstractSystem,
    starts: Any,
    settle: float,
    window: float,
    *,
    solver=None,
    rtol: float = 1e-6,
    atol=None,
    max_steps: int = MOST_STEPS,
    zeno_time: float = 1e-8,
) -> xr.Dataset:
    """Return where motions of ``system`` go from many starts, as a batch on all cores.

    **Main arguments:** ``system``, a `Wiper` or any other; a number of it (a field of type float,
    or made by `parameter`) may be an array with one entry a start; ``starts`` = (position,
    velocity), n arrays (starts,) each; a number among arrays is that of all starts (of numbers
    alone there is one start); ``settle`` [s], which is not looked at; ``window`` [s] after it.

    **Other arguments:** as those of `simulate`; ``max_steps`` of each motion.

    **Returns** a dataset with the dimensions ``start`` and ``axis`` (coordinates of the system):
    ``initial_position``, ``initial_velocity``, ``final_position``, ``final_velocity``,
    ``final_regime``; over the window ``stick_fraction``, ``slip_fraction``, ``flight_fraction``,
    ``velocity_mean`` and ``velocity_rms`` (about the mean) of the system's output; ``result``. What
    did not reach the end has NaN over the window (``painleve_indeterminate`` did). The share of
    starts that end in a motion, and its standard error: ``found = ds.velocity_rms < 1e-3``,
    ``share_error(found.sum(), found.size)``.

    **Raises** `ValueError` for arguments that cannot be meant.
    """
    check_system(system)
    check_known(system)
    settle = checks.number("settle", settle, NON_NEGATIVE)
    window = checks.number("window", window, POSITIVE)
    check_integration(solver, rtol, zeno_time, max_steps)
    max_steps = checks.whole("max_steps", max_steps, COUNT)
    zeno_time = checks.number("zeno_time", zeno_time, POSITIVE)
    position, velocity = _arrays(starts)
    check_coordinates("starts", system, len(position))
    atol = tolerances(atol, len(position))
    # as arrays: other times and tolerances compile nothing
    times, precision = jnp.asarray((settle, window)), jnp.asarray((rtol, zeno_time), float)
    integration = Integration(
        solver, precision[0], atol, jnp.asarray(max_steps, jnp.int32), zeno_time=precision[1]
    )
    count = position[0].size
    room = capacity(count)

    varying, fixed = eqx.partition(traceable(system), _dealt(system, count))
    fits.check(traceable(system), position, velocity, (count,))
    padding = np.minimum(np.arange(room), count - 1)
    cells = jax.tree.map(lambda x: x[..., padding], (varying, position, velocity))

    def compute(cells, number):
        return _run(cells, fixed, number, *times, integration)

    (rows,), _ = deal(compute, cells, np.arange(count))
    return _labelled(system, (position, velocity), rows.tree(), settle, window)


@Kept
def _run(cells, fixed, number, settle, window, integration: Integration):
    varying, position, velocity = cells
    recording = Recording(observer=RegimeTotals(settle), mark=settle)
    system = eqx.combine(varying, fixed)
    case = make_case(system, settle + window, (position, velocity), integration, recording)
    cases = position[0].shape[-1]
    rows, _, effort = run_pool(Pool(case, number), lane_count("float64", cases))
    return rows, effort


def _dealt(system: AbstractSystem, count: int) -> Any:
    """Which leaves of a system have an entry for each start, as a tree. Raises ValueError where it
    cannot be known: each motion needs the whole of a table that happens to be as long.
    """
    known = set(numbers(system))

    def each(keys, leaf) -> bool:
        length = np.shape(leaf)[-1] if np.ndim(leaf) else None
        name = ".".join(fields_of(keys))
        if name in known and length not in (None, count):
            one = f"a number or have one entry a start ({count})"
            raise ValueError(f"system: {name} must be {one}, but had {length}")
        if name not in known and length == count:
            must = "must be made by wiperjax.parameter, or of type float, to have one entry a start"
            why = f"a table must not have as many as there are starts ({count})"
            raise ValueError(f"system: {name} {must}; {why}")
        return length == count

    return jax.tree_util.tree_map_with_path(each, system)


def _arrays(starts: Any) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
    """Position and velocity as n arrays (starts,) each. Raises ValueError for anything else."""
    must = "starts must be (position, velocity), each n >= 1 arrays of finite numbers, one a start"
    try:
        parts = [tuple(np.asarray(x) for x in part) for part in starts]
        fine = len(parts) == 2 and len(parts[0]) == len(parts[1]) >= 1
        fine = fine and all(checks.is_number(x) for part in parts for x in part)
        full = np.broadcast_arrays(*parts[0], *parts[1], np.zeros(1)) if fine else []
    except (TypeError, ValueError):
        full = []
    if not full or full[0].ndim != 1 or not full[0].size:
        raise ValueError(f"{must}, but was {checks.shown(starts)}")
    for values in full:
        if (wrong := FINITE.outside(values)) is not None:
            raise ValueError(f"{must}, but had {wrong}")
    n, kept = len(parts[0]), [np.asarray(x, float) for x in full[:-1]]
    return tuple(kept[:n]), tuple(kept[n:])


def _labelled(system, starts, outcome: Outcome, settle: float, window: float) -> xr.Dataset:
    totals, fair = outcome.observed, np.isin(outcome.result, FAIR)

    def each(values, long_name, units=None):
        unit = {} if units is None else {"units": units}
        return "start", np.asarray(values), {"long_name": long_name, **unit}

    def settled(values, long_name, units=None):
        return each(np.where(fair, values, np.nan), f"{long_name} in the window", units)

    def state(values, long_name):
        return ("start", "axis"), np.stack(values, axis=-1), {"long_name": long_name}

    def code(values, long_name, codes):
        flags = {"long_name": long_name} | cf.flags(codes, np.uint8)
        return "start", values.astype(np.uint8), flags

    variables = {
        "initial_position": state(starts[0], "position at the start"),
        "initial_velocity": state(starts[1], "velocity at the start"),
        "final_position": state(outcome.position, "position at the end"),
        "final_velocity": state(outcome.velocity, "velocity at the end"),
        "final_regime": code(outcome.regime, "regime at the end", REGIMES),
        "stick_fraction": settled(totals.stick_time / window, "share of stick", "1"),
        "slip_fraction": settled(totals.slip_time / window, "share of slip", "1"),
        "flight_fraction": settled(totals.flight_time / window, "share of flight", "1"),
        "velocity_mean": settled(totals.output_integral / window, "mean output velocity"),
        "velocity_rms": settled(totals.deviation(window), "rms output velocity about its mean"),
        "result": code(outcome.result, "how the trajectory ended", RESULTS),
    }
    attrs = maker() | system_attributes(system) | {"settle": settle, "window": window}
    axis = list(system.coordinates) or [f"q{k}" for k in range(len(starts[0]))]
    return xr.Dataset(variables, coords={"axis": axis}, attrs=attrs)
