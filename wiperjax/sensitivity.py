"""Derivatives of the outcomes of a sweep by parameters, and whether they hold.

Forward mode: the tangents of all parameters travel with the lanes of one batch. A derivative is
stored where it holds and is NaN elsewhere; `schema.VALIDITY` names the reasons, in this order of
precedence: the cell has no settled outcome; its motion is not settled; the sequence of events is
another one a finite-difference step away (checked cells); an event is near grazing. A share of the
cells is checked by central differences of fourth order at a thousandth of the tolerance.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from . import cells
from .columns import cellwise, columns_of, statistics
from .dealing import capacity, deal, dearest_first
from .parameters import BELTS, PARAMETERS
from .results import Result
from .scene import start_state
from .schema import DIFFERENTIABLE, SCHEMA, VALIDITY, sensitivity_name
from .spectrum import dominant_frequency
from .stability import steady_slip
from .wiper import Wiper

FLOOR = 0.01  # a derivative that changes its outcome by less of its scale is compared with that
REST = 1e-5  # of the belt speed: below it the standard deviation of the velocity is rounding
LEFT_OVER = ("final_vx", "final_vy")  # of a quiet cell: what its steps leave of a decayed start
STENCIL = {1: 2 / 3, -1: -2 / 3, 2: -1 / 12, -2: 1 / 12}  # steps -> weight, of fourth order
GRAZING = 1e4  # times the tolerance: at this margin a derivative is 1.5e-4 off
SAME = 1e-5  # relative difference of two derivatives that are one
LARGEST = {  # outcomes that are largest values, by their names in `margins.Peaks`
    "normal_force_max": "normal_force_max",
    "gap_max": "gap_max",
    "impulse_max": "impact_impulse_max",
}
SECOND = {field: f"second_{field}" for field in LARGEST}  # and what comes next


def with_parameters(wiper: Wiper, values: dict[str, Any], kind: str) -> Wiper:
    """Return ``wiper`` with the parameters ``values``, name -> SI value, on a belt of ``kind``."""
    keys = {name: key for key, name in BELTS[kind].items()}

    def leaves(w):
        return [getattr(w.belt, keys[n]) if n in keys else getattr(w, n) for n in values]

    return eqx.tree_at(leaves, wiper, list(values.values()))


def evaluate(spec, index: np.ndarray) -> dict[str, Any]:
    """Return the columns of `cells.evaluate`, and those of the sensitivities that ``spec`` asks."""
    asked, run, kind = spec.sensitivities, spec.run, spec.belt.kind
    names, count = asked.parameters, len(index)
    wiper, _, position, _ = cells.prepare(spec, index)
    size = position[0].shape[-1]
    base = cells._arrays(wiper, run.precision)
    theta = {name: _whole(_value(wiper, name, kind), size) for name in names}
    settings, limit = cells._settings(spec), jnp.int32(run.max_steps)
    sampling = cells.Sampling.of(spec)

    def start(theta):
        return _start(base, theta, spec)

    (state, _), seeds = start(theta), []
    for name in names:
        # per unit of files: an angle in degrees
        unit = float(PARAMETERS[name].to_si(1.0))
        seed = {n: jnp.full(size, unit if n == name else 0.0) for n in names}
        seeds.append((seed, *jax.jvp(start, (theta,), (seed,))[1]))
    seeds = jax.tree.map(lambda *x: jnp.stack(x), *seeds)

    def compute(given, number):
        wiper, theta, state, seeds = given
        *found, samples, effort = _tangents(
            wiper, theta, state, seeds, number, limit, sampling, settings, kind
        )
        return *found, sampling.rows(samples, run.raster), effort

    order = dearest_first(wiper, count)
    (outcome, slopes, signal), effort = deal(compute, (base, theta, state, seeds[:2]), order)
    columns = columns_of(spec, outcome, signal, effort, wiper, count)
    slopes |= {name: np.asarray(x).T[:count] for name, x in seeds[2].items()}

    watched = outcome.observed
    seconds = {SECOND[field]: x for field, x in watched.seconds._asdict().items()}
    code = np.full(count, VALIDITY["fine"], np.int8)
    _mask_contested(slopes, columns | seconds, theta, base, asked)
    _mask_rounding(slopes, columns, spec)
    code[watched.margin < max(asked.grazing, GRAZING * spec.rtol)] = VALIDITY["near_grazing"]
    checked = np.flatnonzero(_drawn(index, asked.check))
    agreement = np.full(count, np.nan)
    if checked.size:
        other, gaps = _check(spec, theta, base, columns, slopes, checked, watched.word)
        agreement[checked] = np.max(list(gaps.values()), axis=0)
        code[checked[other]] = VALIDITY["sequence_changes"]
    code[~_is_settled(columns, spec)] = VALIDITY["unsettled"]
    code[outcome.result != Result.FINISHED] = VALIDITY["not_differentiable"]

    holds = code == VALIDITY["fine"]
    for outcome_name in DIFFERENTIABLE:
        for k, name in enumerate(names):
            slope = slopes[outcome_name][:, k]
            good = holds & np.isfinite(slope)
            columns[sensitivity_name(outcome_name, name)] = np.where(good, slope, np.nan)
    columns["sensitivity_code"] = code
    columns["grazing_margin"] = watched.margin
    columns["sensitivity_agreement"] = np.where(holds, agreement, np.nan)
    return columns


@eqx.filter_jit
def _tangents(wiper, theta, state, seeds, count, limit, sampling, s, kind):
    """Run the cells of one share with all tangents; slopes come as (cells, parameters)."""

    def run(theta, state):
        w = with_parameters(wiper, theta, kind)
        position, velocity = state
        outcome, signal, effort = cells.outcomes(
            w, position, velocity, count, limit, sampling, s, watched=True
        )
        seconds = outcome.observed.seconds._asdict()
        found = statistics(outcome, s.window) | {SECOND[k]: x for k, x in seconds.items()}
        return found, (outcome, signal, effort)

    def push(dtheta, dstate):
        return jax.jvp(run, (theta, state), (dtheta, dstate), has_aux=True)

    _, slopes, (outcome, signal, effort) = jax.vmap(push, out_axes=(None, -1, None))(*seeds)
    return outcome, slopes, signal, effort


@eqx.filter_jit
def _plain(wiper, theta, state, count, limit, sampling, s, kind):
    w = with_parameters(wiper, theta, kind)
    position, velocity = state
    outcome, _, effort = cells.outcomes(
        w, position, velocity, count, limit, sampling, s, watched=True
    )
    return statistics(outcome, s.window), outcome.observed.word, effort


def _mask_contested(slopes, columns, theta, wiper, asked) -> None:
    """Make NaN the derivatives, in ``slopes``, of a largest value that another peak, with another
    derivative, overtakes within the finite-difference step."""
    count = len(columns["result"])
    for field, second in SECOND.items():
        name = LARGEST[field]
        gap = columns[name] - columns[second]
        least = FLOOR * _outcome_scale(name, columns, wiper)
        contested = np.zeros(count, bool)
        for k, parameter in enumerate(theta):
            unit = float(PARAMETERS[parameter].to_si(1.0))
            scale = _scale(parameter, np.asarray(theta[parameter])[:count]) / unit
            slope, jump = scale * slopes[name][:, k], scale * (slopes[name] - slopes[second])[:, k]
            differs = np.abs(jump) > SAME * np.maximum(np.abs(slope), least)
            contested |= differs & (gap < max(STENCIL) * asked.step * np.abs(jump))
        slopes[name] = np.where(contested[:, None], np.nan, slopes[name])


def _mask_rounding(slopes, columns, spec) -> None:
    """Make NaN the derivatives, in ``slopes``, of what is rounding at rest, and of the velocity at
    the end of a quiet cell: there steps are as long as the integrator stays stable, and what the
    start has left decays by its leave, not by the equations.
    """
    rests = columns["velocity_rms"] < REST * np.abs(columns["belt_speed_rms"])
    masked = {"velocity_rms": rests} | dict.fromkeys(LEFT_OVER, _is_quiet(columns, spec))
    for name, where in masked.items():
        slopes[name] = np.where(where[:, None], np.nan, slopes[name])


def _check(spec, theta, base, columns, slopes, checked, word):
    """Return (whether the events are others, relative differences) of the cells ``checked``.

    The second is a dict (outcome, parameter) -> (len(checked),). A difference is relative to the
    larger of the two, or to `FLOOR` of the outcome's scale over the parameter's own size, if that
    is more.
    """
    asked, kind, n = spec.sensitivities, spec.belt.kind, len(checked)
    names = list(theta)
    copies = len(STENCIL) * len(names) * n
    scale = {name: _scale(name, np.asarray(x)[checked]) for name, x in theta.items()}
    size = capacity(copies)
    whole = theta[names[0]].shape[-1]
    # every cell with each parameter at all places of the stencil; filled up with the last
    place = np.tile(checked, len(STENCIL) * len(names))
    place = np.concatenate([place, np.full(size - copies, checked[-1])])
    moved = {name: np.asarray(x)[place].copy() for name, x in theta.items()}
    for k, name in enumerate(names):
        for j, steps in enumerate(STENCIL):
            part = slice((len(STENCIL) * k + j) * n, (len(STENCIL) * k + j + 1) * n)
            moved[name][part] += steps * asked.step * scale[name]
    at = jax.tree.map(lambda x: x[place] if eqx.is_array(x) and x.shape == (whole,) else x, base)
    moved = jax.tree.map(jnp.asarray, moved)
    state, known = _start(at, moved, spec)
    settings, limit = cells._settings(spec), jnp.int32(spec.run.max_steps)
    settings = settings._replace(rtol=max(1e-3 * settings.rtol, 1e-13))
    sampling = cells.Sampling.of(spec)

    def compute(given, number):
        wiper, theta, state = given
        return _plain(wiper, theta, state, number, limit, sampling, settings, kind)

    (found, words), _ = deal(compute, (at, moved, state), np.arange(copies))
    found |= {name: np.asarray(x)[:copies] for name, x in known.items()}
    other = np.any(words.reshape(-1, n) != word[checked], axis=0)
    gaps = {}
    for k, name in enumerate(names):
        unit = float(PARAMETERS[name].to_si(1.0))
        most = max(STENCIL) * asked.step * scale[name]
        inside = _is_inside(name, np.asarray(theta[name])[checked], most)
        for outcome in DIFFERENTIABLE:
            value = found[outcome].reshape(len(names), len(STENCIL), n)[k]
            change = np.tensordot(list(STENCIL.values()), value, 1) / asked.step
            slope = slopes[outcome][checked, k] / unit * scale[name]
            least = FLOOR * _outcome_scale(outcome, columns, base)[checked]
            larger = np.maximum(np.maximum(np.abs(change), np.abs(slope)), least)
            larger = np.where(larger > 0, larger, 1.0)  # both may be zero
            skip = ~inside | ~np.isfinite(slope) | ~np.isfinite(change)
            gaps[outcome, name] = np.where(skip, 0.0, np.abs(change - slope) / larger)
    return other, gaps


def _start(wiper, theta, spec):
    """Return the initial state, and the outcomes that need no trajectory, (cells,) each."""
    w = with_parameters(wiper, theta, spec.belt.kind)
    linear = steady_slip(w, w.belt.peak)
    known = {
        "belt_speed_rms": w.belt.rms,
        "growth_rate": linear.growth_rate,
        "linear_frequency": linear.frequency,
    }
    size = next(iter(theta.values())).shape[-1]
    state = start_state(w, spec.start)
    return jax.tree.map(lambda x: _whole(x, size), (state, known))


def _whole(value, size) -> jax.Array:
    return jnp.broadcast_to(jnp.asarray(value, jnp.float64), (size,))


def _value(wiper: Wiper, name: str, kind: str):
    keys = {parameter: key for key, parameter in BELTS[kind].items()}
    return getattr(wiper.belt, keys[name]) if name in keys else getattr(wiper, name)


def _scale(name: str, value: np.ndarray) -> np.ndarray:
    """Size of a parameter, which its finite-difference step is relative to."""
    if PARAMETERS[name].unit == "rad":
        return np.ones_like(value)
    return np.where(value == 0, PARAMETERS[name].reference or 1.0, np.abs(value))


def _outcome_scale(name: str, columns, wiper: Wiper) -> np.ndarray:
    """Size of an outcome by what it is: the load for forces, the lip for lengths, and so on."""
    speed = np.asarray(columns["belt_speed_rms"])
    load, length, mass = (  # the wiper has some cells more, which fill up
        cellwise(x, len(speed)) for x in (wiper.normal_load, wiper.lip_length, wiper.tip_mass)
    )
    size = {"1": np.ones_like(speed), "m/s": speed, "N/m": load, "m": length, "N s/m": mass * speed}
    return np.asarray(size.get(SCHEMA[name].units, np.abs(columns[name])))


def _is_inside(name: str, value: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Whether a parameter may be changed by ``step`` both ways: at an end of its range it is not
    checked."""
    entry = PARAMETERS[name]
    low, high = entry.to_edge(value - step), entry.to_edge(value + step)
    return (low >= entry.range.low) & (high <= entry.range.high)


def _drawn(index: np.ndarray, share: float) -> np.ndarray:
    """Which cells are checked: by their number alone, whatever block they are in."""
    return (np.asarray(index, np.uint64) * np.uint64(2654435761)) % 2**32 < share * 2**32


def _is_settled(columns, spec) -> np.ndarray:
    """Whether the standard deviation of the tip velocity agrees in the first and the last whole
    periods of the settled window.

    A resting tip is settled; one with less than two periods in the window is not. Under a belt that
    reverses, the window is a stroke and cannot be judged.
    """
    run = spec.run
    if spec.belt.kind != "steady":
        return np.ones(len(columns["result"]), bool)
    signal = np.asarray(columns["signal"], np.float64)
    settled = np.zeros(len(signal), bool)
    for i, f in enumerate(dominant_frequency(signal, run.window / spec.samples)):
        periods = np.floor(0.5 * f * run.window) if np.isfinite(f) else 0
        if periods >= 1:
            n = int(round(periods / f / run.window * spec.samples))
            a, b = np.std(signal[i, :n]), np.std(signal[i, -n:])
            settled[i] = abs(a - b) <= spec.sensitivities.settled * max(a, b)
    return settled | _is_quiet(columns, spec)


def _is_quiet(columns, spec) -> np.ndarray:
    return columns["velocity_rms"] < spec.classes.quiet_velocity_ratio * columns["belt_speed_rms"]
