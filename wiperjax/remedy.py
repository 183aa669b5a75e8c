"""Remedies by gradient: which parameter buys most quiet, and the way there.

Two questions, two tools. `stabilise` asks for steady slip that is stable: a smooth function of the
blade, minimised from many starts at once. But loss of stability is subcritical: a blade whose
steady slip is stable may squeal all the same. `descend` therefore follows the noise itself, the
limit cycle, downhill until it ends. The cycle's derivatives are exact (implicit function theorem on
the return map); those of a simulated window are not worth much, since its cut through the last
period moves with the parameter, by an error that no longer window mends.

A gradient holds while the events keep their order. Each step that changes them is marked, and what
counts in the end is a simulation of the final blade from the default start (`verdict`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import xarray as xr

from . import named
from .belts import SteadyBelt
from .branch import same_word
from .cycles import Cycle, Found, Lost, close, find_cycle
from .dataset import LABELS
from .labels import label
from .results import Regime
from .shooting import chart, stretch
from .spectrum import dominant_frequency
from .stability import equilibria
from .trajectory import simulate
from .wiper import Wiper

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
    shooting, state = cycle.shooting, cycle.state
    if shooting is None or state is None or cycle.found != Found.FOUND:
        raise ValueError(f"cycle must be a found one, but was {cycle.found.name.lower()}")
    if measure not in MEASURES:
        raise ValueError(f"measure must be one of {', '.join(MEASURES)}, but was {measure!r}")
    bounds = names if isinstance(names, Mapping) else None
    every = tuple(dict.fromkeys((*shooting.varied, *names)))
    system = named.traceable(cycle.system, *every)
    where = chart(
        system, state, cycle.phase * cycle.period, cycle.regime, shooting.scale, shooting.section
    )
    slopes, value = [], getattr(cycle, measure)
    for name in names:
        along = named.direction(system, name, *every)
        m = stretch(
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
                named.value(system, name)
            )
            right = right + period_slope * where.read(m.by_period)
        change = np.linalg.solve(matrix, -right)
        d = where.basis.shape[1]
        if shooting.clock is None:
            period_slope = change[d]
        moved = np.concatenate([where.basis @ change[:d], [period_slope, 1.0]])
        slopes.append(_slope(cycle, m, moved, measure))
    slope = np.array(slopes)
    at = np.array([named.value(system, name) for name in names])
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
    mean = totals.output_integral / period
    mean_slope = (by.output_integral @ moved - mean * change) / period
    square = totals.output_square_integral / period
    square_slope = (by.output_square_integral @ moved - square * change) / period
    return float((square_slope - 2 * mean * mean_slope) / (2 * cycle.velocity_rms))


# --- downhill along the cycle --------------------------------------------------------------------


class Path(NamedTuple):
    """The way to a remedy."""

    steps: xr.Dataset  # over ``step``: the parameters, the measure, the word, ``same_events``
    blade: Any  # the last system
    end: str  # why it ends
    label: str  # class of the last blade, simulated from its default start ("" for other systems)


def descend(
    cycle: Cycle,
    bounds: Mapping[str, tuple[float, float]],
    *,
    measure: str = "velocity_rms",
    step: float = 0.04,
    most: int = 60,
    settle: float = 0.1,
) -> Path:
    """Return the path of steepest descent of a cycle's noise inside ``bounds``, until it ends.

    **Arguments:** ``cycle`` to begin with; ``bounds``, name -> (low, high), SI units: a step is
    measured in these ranges, so a wide range is a cheap parameter; ``measure`` (see
    `sensitivities`); ``step``, its length; ``most`` steps; ``settle`` [s] of the simulations that
    look for another motion where the cycle has ended.

    **Returns** a `Path`. ``end`` is one of: the cycle ends and nothing replaces it (quiet); bounds
    that leave no way down; the number of steps. ``same_events`` is False at a step whose events are
    not those of the step before: the gradient that led there did not know of them.
    """
    low, high = (np.array([pair[i] for pair in bounds.values()], float) for i in (0, 1))
    at = np.array([named.value(cycle.system, name) for name in bounds])
    if np.any(at < low) or np.any(at > high):
        worst = list(bounds)[int(np.argmax((at < low) | (at > high)))]
        raise ValueError(f"bounds must hold the blade as it is, but {worst} lies outside")
    x = (at - low) / (high - low)
    rows = [_row(cycle, bounds, measure, True)]
    if cycle.shooting is None:
        raise ValueError(f"cycle must be a found one, but was {cycle.found.name.lower()}")
    varied = tuple(dict.fromkeys((*cycle.shooting.varied, *bounds)))
    end, system = f"{most} steps", named.traceable(cycle.system, *varied)
    cycle = replace(cycle, system=system, shooting=replace(cycle.shooting, varied=varied))
    for _ in range(most):
        slope = sensitivities(cycle, bounds, measure)["buys"].values
        free = ~(((x <= 0) & (slope > 0)) | ((x >= 1) & (slope < 0)))
        downhill = np.where(free, -slope, 0.0)
        if np.linalg.norm(downhill) < 1e-6:
            end = "the bounds leave no way down"
            break
        x = np.clip(x + step * downhill / np.linalg.norm(downhill), 0.0, 1.0)
        for name, value in zip(bounds, low + x * (high - low), strict=True):
            system = named.replaced(system, name, value)
        following = _tracked(cycle, system)
        if following is None:  # the cycle ends here; is there another motion?
            following = _settled(cycle, system, settle)
        if following.found == Found.AT_REST:  # quiet from here; from the default start as well?
            other = _settled(cycle, system, settle, default=True)
            following = other if other.found == Found.FOUND else following
        if following.found != Found.FOUND:
            end = f"the cycle has ended: {following.found.name.lower()}"
            rows.append(_row(replace(following, system=system), bounds, measure, False))
            break
        rows.append(_row(following, bounds, measure, same_word(cycle, following)))
        cycle = following
    names = list(bounds)
    columns = {name: ("step", np.array([row[name] for row in rows])) for name in names}
    columns |= {
        measure: ("step", np.array([row[measure] for row in rows])),
        "word": ("step", np.array([row["word"] for row in rows], object)),
        "same_events": ("step", np.array([row["same_events"] for row in rows])),
    }
    said = verdict(system, settle=settle)["label"] if isinstance(system, Wiper) else ""
    return Path(xr.Dataset(columns, attrs={"end": end}), system, end, said)


def _settled(cycle: Cycle, system, settle: float, default: bool = False) -> Cycle:
    """Return the cycle that ``system`` settles on from where ``cycle`` was, or its own start."""
    shooting, state = cycle.shooting, cycle.state
    assert shooting is not None and state is not None
    n = len(state) // 2
    return find_cycle(
        system,
        settle=settle,
        initial_state=None if default and isinstance(system, Wiper) else (state[:n], state[n:]),
        period=None if shooting.clock is None else shooting.clock,
        varied=shooting.varied,
        rtol=shooting.rtol,
    )


def _row(cycle: Cycle, bounds, measure: str, same: bool) -> dict[str, Any]:
    row: dict[str, Any] = {name: named.value(cycle.system, name) for name in bounds}
    noise = getattr(cycle, measure)
    rests = cycle.found == Found.AT_REST and measure == "velocity_rms"
    return row | {
        measure: 0.0 if rests else noise,
        "word": cycle.word,
        "same_events": same,
    }


def _tracked(cycle: Cycle, system) -> Cycle | None:
    """Return the cycle of ``system`` near ``cycle``, or None."""
    shooting = cycle.shooting
    assert shooting is not None and cycle.state is not None
    shooting = replace(shooting, system=system, over=None)
    try:
        found = close(shooting, cycle.state, cycle.regime, cycle.period, cycle.phase)
    except Lost:
        return None
    near = found.found == Found.FOUND and abs(found.period / cycle.period - 1) < 0.2
    # a cycle that has lost its stick and repels is not what is heard
    return found if near and found.stable else None


def verdict(blade: Wiper, *, settle: float = 0.2, window: float = 0.1, rtol: float = 1e-8) -> dict:
    """Return the class of noise of ``blade`` from its default start, with what it rests on.

    A simulation of ``settle`` seconds, and of ``window`` seconds that are looked at; the thresholds
    are the defaults of `labels`.
    """
    interval = window / 4096
    run = simulate(blade, settle + window, sample_interval=interval, rtol=rtol)
    late = run.isel(time=slice(-4096, None))
    velocity = late["velocity"].sel(axis="x").values
    whole = len(velocity) == 4096
    regime = late["regime"].values
    columns = {
        "result": int(run["result"]),
        "velocity_rms": float(np.std(velocity)),
        "belt_speed_rms": float(blade.belt.rms),
        "dominant_frequency": float(dominant_frequency(velocity, interval)) if whole else np.nan,
        "stick_fraction": float(np.mean(regime == Regime.STICK)),
        "flight_fraction": float(np.mean(regime == Regime.FLIGHT)),
    }
    names = {code: name for name, code in LABELS.items()}
    return columns | {"label": names[int(label(columns))]}


# --- steady slip that is stable ------------------------------------------------------------------


class Stabilised(NamedTuple):
    """Cheapest changes that make steady slip stable, one from each start, best first."""

    parameters: xr.Dataset  # over ``start``: the parameters, ``cost``, ``growth_rate``
    blade: Wiper  # the best one


def stabilise(
    blade: Wiper,
    bounds: Mapping[str, tuple[float, float]],
    *,
    margin: float = 50.0,
    starts: int = 8,
    seed: int = 0,
) -> Stabilised:
    """Return the smallest change of ``blade`` whose steady slip decays at ``margin`` [1/s] or more.

    **Arguments:** ``bounds``, name -> (low, high), SI units; a change costs the square of its share
    of that range; ``starts``, points in the bounds that the search begins from, the blade itself
    and random ones of ``seed``, all in one batch (`optimistix.BFGS`, bounds by a sine).

    **Returns** a `Stabilised`. Stable steady slip is no promise of quiet: see `verdict`.
    """
    names = tuple(bounds)
    low, high = (jnp.array([pair[i] for pair in bounds.values()], float) for i in (0, 1))
    system: Any = named.traceable(blade, *names)
    given = (jnp.array([named.value(blade, name) for name in names]) - low) / (high - low)
    others = np.random.default_rng(seed).uniform(0.05, 0.95, (starts - 1, len(names)))
    # an angle whose sine spans the box: the bounds hold by themselves
    angle = jnp.arcsin(2 * jnp.clip(jnp.vstack([given, others]), 0.01, 0.99) - 1)
    shares, rate = _stabilise(system, names, low, high, given, angle, jnp.asarray(margin, float))
    shares, rate = np.asarray(shares), np.asarray(rate)
    cost = np.sum((shares - np.asarray(given)) ** 2, axis=1)
    rank = np.argsort(np.where(rate < 0, cost, np.inf))
    values = np.asarray(low) + shares[rank] * np.asarray(high - low)
    found = xr.Dataset(
        {name: ("start", values[:, i]) for i, name in enumerate(names)}
        | {
            "cost": ("start", cost[rank], {"long_name": "squared share of the ranges"}),
            "growth_rate": ("start", rate[rank], {"units": "1/s"}),
        }
    )
    for name, value in zip(names, values[0], strict=True):
        system = named.replaced(system, name, value)
    return Stabilised(found, system)


@eqx.filter_jit
def _stabilise(system, names, low, high, given, angles, margin):
    def rate(share):
        changed: Any = system
        for i, name in enumerate(names):
            changed = named.replaced(changed, name, low[i] + share[i] * (high[i] - low[i]))
        slip = equilibria(replace(changed, belt=SteadyBelt(changed.belt.peak)), 1)
        return slip.growth_rate[0]

    def share(angle):
        return 0.5 * (1 + jnp.sin(angle))

    def price(angle, _):
        excess = jnp.maximum(rate(share(angle)) / margin + 1, 0.0)
        return jnp.sum((share(angle) - given) ** 2) + 10.0 * excess**2

    def one(angle):
        found = optx.minimise(
            price,
            optx.BFGS(rtol=1e-6, atol=1e-8),
            angle,
            max_steps=100,
            throw=False,
            options={"autodiff_mode": "fwd"},
        ).value
        return share(found), rate(share(found))

    return jax.vmap(one)(angles)
