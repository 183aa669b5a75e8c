"""Derivatives of a cycle's noise by any number of its system: what each parameter buys."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..blade import numbers
from ..cycles.chart import chart
from ..cycles.cycle import Cycle, Found
from ..cycles.shooting import shoot
from ..engine.observers.totals import variance
from ..vocabulary import checks

MEASURES = ("velocity_rms", "stick_fraction", "maximum", "period")


def sensitivities(
    cycle: Cycle,
    names: Sequence[str] | Mapping[str, tuple[float, float]],
    measure: str = "velocity_rms",
) -> xr.Dataset:
    """Return the derivatives of a cycle's noise by the numbers ``names`` of its system.

    **Arguments:** ``cycle`` of `find_cycle`; ``names``, or name -> (low, high), bounds in SI units;
    ``measure``, one of `MEASURES`.

    **Returns** a dataset over ``parameter``: ``derivative`` (SI units), ``elasticity`` (relative
    change of the measure by relative change of the parameter) and, with bounds, ``buys``: change of
    the measure in per cent of it for one per cent of the range between the bounds; ``measure``.

    Raises ValueError for a cycle that was not found, or an unknown measure.
    """
    checks.instance("cycle", cycle, Cycle, "a cycle of find_cycle(...)")
    if isinstance(names, Mapping):
        checks.bounds("names", names)
    else:
        checks.names("names", names, 1)
    shooting, state = cycle.shooting, cycle.state
    if shooting is None or state is None or cycle.found != Found.FOUND:
        raise ValueError(f"cycle must be a found one, but was {cycle.found.name.lower()}")
    checks.choice("measure", measure, MEASURES)
    bounds = names if isinstance(names, Mapping) else None
    every = tuple(dict.fromkeys((*shooting.varied, *names)))
    system = numbers.traceable(cycle.system, *every)
    where = chart(
        system, state, cycle.phase * cycle.period, cycle.regime, shooting.scale, shooting.section
    )
    slopes, value = [], getattr(cycle, measure)
    for name in names:
        along = numbers.direction(system, name, *every)
        m = shoot(
            system,
            along,
            state,
            cycle.period,
            phase=cycle.phase,
            regime=cycle.regime,
            rtol=shooting.rtol,
        )
        by_w = where.read(m.by_state @ where.basis - where.basis)
        columns = [by_w] if shooting.clock else [by_w, where.read(m.by_period)[:, None]]
        matrix, right = np.concatenate(columns, axis=1), where.read(m.by_parameter)
        period_slope = 0.0
        if shooting.clock is not None:
            _, period_slope = replace(shooting, system=system, over=name).driven_period(
                numbers.value(system, name)
            )
            right = right + period_slope * where.read(m.by_period)
        change = np.linalg.solve(matrix, -right)
        d = where.basis.shape[1]
        if shooting.clock is None:
            period_slope = change[d]
        moved = np.concatenate([where.basis @ change[:d], [period_slope, 1.0]])
        slopes.append(_slope(cycle, m, moved, measure))
    slope = np.array(slopes)
    at = np.array([numbers.value(system, name) for name in names])
    words = measure.replace("_", " ")
    variables: dict[str, Any] = {
        "derivative": ("parameter", slope, {"long_name": f"derivative of {words}"}),
        "elasticity": (
            "parameter",
            slope * at / value,
            {"long_name": f"relative change of {words} by relative change", "units": "1"},
        ),
        "value": ("parameter", at, {"long_name": "value of the parameter, SI units"}),
        "measure": ((), value, {"long_name": words}),
    }
    if bounds is not None:
        size = np.array([high - low for low, high in bounds.values()])
        variables["buys"] = (
            "parameter",
            slope * size / value,
            {"long_name": f"change of {words} in % for 1 % of the range", "units": "1"},
        )
    return xr.Dataset(variables, coords={"parameter": list(names)}, attrs={"of": measure})


def _slope(cycle: Cycle, m, moved, measure: str) -> float:
    """Derivative of ``measure`` where start, period and parameter change by ``moved``."""
    period, change = cycle.period, moved[-2]
    totals, by = m.totals, m.totals_by
    if measure == "period":
        return float(change)
    if measure == "maximum":
        return float(moved[0])  # a cycle without a clock starts at its highest turning point
    if measure == "stick_fraction":
        return float((by.stick_time @ moved - totals.stick_time * change / period) / period)
    integrals = totals.output_integral, totals.output_square_integral, period
    changes = by.output_integral @ moved, by.output_square_integral @ moved, change
    integrals, changes = (
        tuple(jnp.asarray(x, float) for x in part) for part in (integrals, changes)
    )
    return float(jax.jvp(variance, integrals, changes)[1] / (2 * cycle.velocity_rms))
