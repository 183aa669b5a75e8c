"""Derivatives of a cycle's noise by any number of its system: what each parameter buys."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from scipy.optimize import brentq

from ..cycles.branch.dataset import column_attributes
from ..cycles.chart import Chart
from ..cycles.clock import STATES, check_clock
from ..cycles.cycle import Cycle, shooting_of
from ..cycles.return_map import Shooting
from ..cycles.shooting import SAMPLES, Arc
from ..engine.observers.totals import variance
from ..systems import numbers
from ..vocabulary import checks
from ..vocabulary.cf import quotient

MEASURES = ("velocity_rms", "stick_fraction", "maximum", "period")
TURNS = 1e-9  # of the largest velocity: there a coordinate turns


def sensitivities(
    cycle: Cycle,
    names: Sequence[str] | Mapping[str, tuple[float, float]],
    measure: str = "velocity_rms",
) -> xr.Dataset:
    """Return the derivatives of a cycle's noise by the numbers ``names`` of its system.

    **Arguments:** ``cycle`` of `find_cycle`; ``names``, or name -> (low, high), bounds in SI units;
    ``measure``, one of `MEASURES`; what is relative to one of 0 is NaN.

    **Returns** a dataset over ``parameter``: ``derivative`` (SI units, that of each is in
    ``derivative_units``), ``elasticity`` (change of the measure over its size, by relative change
    of the parameter) and, with bounds, ``buys``: change of the measure in per cent of its size for
    one per cent of the range between the bounds; ``measure``. Whichever sign the measure has, a
    negative ``buys`` is a way down. Of a cycle with impacts all are NaN by a coefficient of
    restitution that is 0: the bounces that a first trace of it brings take time, of which the cycle
    knows nothing.

    Raises ValueError for a cycle that was not found, an unknown measure, a maximum at an impact, or
    a ``period`` given to `find_cycle` that is another where one of the numbers is.
    """
    checks.instance("cycle", cycle, Cycle, "a cycle of find_cycle(...)")
    if isinstance(names, Mapping):
        numbers.check_bounds("names", cycle.system, names)
    else:
        checks.names("names", names, 1)
    checks.choice("measure", measure, MEASURES)
    shooting_of(cycle)  # raises for what was not found
    bounds = names if isinstance(names, Mapping) else None
    shooting = _family(cycle, names)
    system, state = shooting.system, cycle.state
    where = shooting.chart(system, state, cycle.phase * cycle.period, cycle.regime)
    slopes, value = [], getattr(cycle, measure)

    def motion(name: str, part: float = 1.0) -> Arc:
        stretch = {"phase": cycle.phase, "part": part, "regime": cycle.regime}
        return replace(shooting, over=name).motion(system, state, cycle.period, **stretch)

    part = _top(cycle, partial(motion, next(iter(names)))) if measure == "maximum" else 1.0
    for name in names:
        m = motion(name)
        unknown = _starts_to_bounce(system, name, m)
        moved = _moved(replace(shooting, over=name), where, m)
        if measure == "maximum":
            m = motion(name, part)
        slopes.append(math.nan if unknown else _slope(cycle, m, moved, measure))
    slope = np.array(slopes)
    relative = slope / (abs(value) or math.nan)
    at = np.array([numbers.value(system, name) for name in names])
    words = measure.replace("_", " ")
    about = column_attributes(cycle.system, measure)
    units = [numbers.attributes(cycle.system, name).get("units", "") for name in names]
    per = [quotient(about["units"], unit) if about.get("units") and unit else "" for unit in units]
    variables: dict[str, Any] = {
        "derivative": ("parameter", slope, {"long_name": f"derivative of {words}"}),
        "elasticity": (
            "parameter",
            relative * at,
            {"long_name": f"relative change of {words} by relative change", "units": "1"},
        ),
        "value": ("parameter", at, {"long_name": "value of the parameter, SI units"}),
        "measure": ((), value, about),
    }
    if bounds is not None:
        size = np.array([high - low for low, high in bounds.values()])
        variables["buys"] = (
            "parameter",
            relative * size,
            {"long_name": f"change of {words} in % for 1 % of the range", "units": "1"},
        )
    coords = {
        "parameter": list(names),
        "parameter_units": ("parameter", units, {"long_name": "unit of the parameter"}),
        "derivative_units": ("parameter", per, {"long_name": "unit of the derivative"}),
    }
    return xr.Dataset(variables, coords=coords, attrs={"of": measure})


def _family(cycle: Cycle, names) -> Shooting:
    """Return the family of a cycle over ``names``, too.

    Raises ValueError if the period of what drives it is another where one of them is: `find_cycle`
    has asked about those only that it was told of.
    """
    shooting, motion = cycle.shooting, cycle.motion
    assert shooting is not None and motion is not None
    family = replace(shooting, system=numbers.traceable(cycle.system, *names))
    if family.clock is not None:
        check_clock(family.system, family.clock, names, motion.samples[:: SAMPLES // STATES])
    return family


def _starts_to_bounce(system, name: str, m: Arc) -> bool:
    """Whether there are impacts in a motion, and a coefficient of restitution that is 0 grows with
    the number ``name``: the bounces that come then are not in it."""

    def bounce(system):
        return jnp.asarray(system.bounce, float)

    e, change = eqx.filter_jvp(bounce, (system,), (numbers.direction(system, name),))
    grows = change is not None and float(change) != 0
    return grows and float(e) == 0 and int(m.totals.impact_count) > 0


def _moved(shooting: Shooting, where: Chart, m: Arc) -> np.ndarray:
    """Changes of start (2n), period and parameter along the cycles, by that of the parameter."""
    by_w = where.read(m.by_state @ where.basis - where.basis)
    columns = [by_w] if shooting.clock else [by_w, where.read(m.by_period)[:, None]]
    matrix, right = np.concatenate(columns, axis=1), where.read(m.by_parameter)
    period_slope = 0.0
    if shooting.clock is not None:
        assert shooting.over is not None
        value = numbers.value(shooting.system, shooting.over)
        _, period_slope = shooting.driven_period(value)
        right = right + period_slope * where.read(m.by_period)
    change = np.linalg.solve(matrix, -right)
    d = where.basis.shape[1]
    if shooting.clock is None:
        period_slope = change[d]
    return np.concatenate([where.basis @ change[:d], [period_slope, 1.0]])


def _slope(cycle: Cycle, m: Arc, moved, measure: str) -> float:
    """Derivative of ``measure`` where start, period and parameter change by ``moved``; ``m`` is the
    motion of a period, or for the maximum up to there."""
    period, change = cycle.period, moved[-2]
    totals, by = m.totals, m.totals_by
    if measure == "period":
        return float(change)
    if measure == "maximum":
        whole = np.concatenate([m.by_state[0], [m.by_period[0], m.by_parameter[0]]])
        return float(whole @ moved)
    if measure == "stick_fraction":
        return float((by.stick_time @ moved - totals.stick_time * change / period) / period)
    integrals = totals.output_integral, totals.output_square_integral, period
    changes = by.output_integral @ moved, by.output_square_integral @ moved, change
    integrals, changes = (
        tuple(jnp.asarray(x, float) for x in part) for part in (integrals, changes)
    )
    return float(jax.jvp(variance, integrals, changes)[1] / (2 * cycle.velocity_rms))


def _top(cycle: Cycle, motion: Callable[[float], Arc]) -> float:
    """Share of the period, up to a sample more than 1, after which the first coordinate is largest.

    It turns there, so that its slope needs no change of that time.
    """
    assert cycle.motion is not None
    samples = cycle.motion.samples
    n, last = samples.shape[1] // 2, len(samples) - 1
    speed, at = samples[:, n], 1 + int(np.argmax(samples[1:, 0]))
    still = TURNS * np.max(np.abs(speed))
    if abs(speed[at]) <= still:
        return at / last
    low = at if speed[at] > 0 else at - 1 or last  # not from the start: that motion has no length

    def velocity(share: float) -> float:
        return float(motion(share).state[n])

    try:
        share = float(brentq(velocity, low / last, (low + 1) / last, xtol=1e-14))  # type: ignore[arg-type]
    except ValueError:  # it has one sign there
        share = math.nan
    if not (math.isfinite(share) and abs(velocity(share)) <= still):
        raise ValueError("measure must not be maximum of a cycle whose first coordinate jumps back")
    return share
