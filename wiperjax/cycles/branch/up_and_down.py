"""Brute-force bifurcation diagrams: simulate up and down a range, each step from the last state.

What differs between the way up and the way down is coexisting motion: quiet and squeal at the same
setting, say. Only stable motions show; `branch.follow` gives the unstable ones between.

A mean over a window that is no whole number of periods misses that of the cycle by some per cent,
another one at each value. So where no clock says how long a period is, the motion is looked at
twice: over the window asked for, to find a time in which it comes back to itself, and then over
that time.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ...contact.own_numbers import check_single
from ...contact.projection import kicked
from ...contact.system import AbstractSystem, system_attributes
from ...engine.arguments import check_system, coordinates, longest_step
from ...engine.observers.totals import Reach, RegimeTotals
from ...engine.solve import solve
from ...machine.provenance import maker
from ...numerics.kept import Kept
from ...systems import numbers
from ...vocabulary import cf, checks
from ...vocabulary.codes import FAIR, RESULTS, Result
from ...vocabulary.kinds import WAYS
from ...vocabulary.ranges import POSITIVE, SETTINGS, Range
from ..clock import check_clock, refuse_a_clock, scattered
from ..cycle import typical
from ..drift import may_drift
from ..shooting import UNKNOWN, at_state, tidy
from .peaks import peaks
from .repeats import comes_back, repeat_time

FLAT = 1e-9  # of the typical size: a smaller range is a motion at rest


def up_and_down(
    system: AbstractSystem,
    over: str,
    values,
    *,
    settle: float,
    window: float,
    initial_state=None,
    period: Callable[[Any], Any] | None = None,
    kick: float = 1e-6,
    samples: int = 1024,
    rtol: float = 1e-7,
    max_step: float | None = None,
) -> xr.Dataset:
    """Return the motions met on the way up and down ``values`` of the number ``over``.

    **Main arguments:** ``system``; ``over``, its name (`numbers.path`); ``values``, increasing (SI
    units, radians); ``settle`` [s] simulated at each value before it is looked at, for ``window``
    [s] or, if it is periodic, whole periods that fill half of it or more (in a second look).

    **Other arguments:** ``initial_state`` = (position, q') at either end (default: the system's
    own); ``period(system)`` of what drives it [s], without which nothing may: settle and window are
    then rounded up to whole periods, so that the clock goes on as it was, and there is one look;
    ``kick``, by which the first coordinate is moved before each value, of its typical size (the
    other way where that leads into what it touches, or a stop): without it an equilibrium that has
    become unstable is left only when rounding has grown (delayed loss of stability); ``samples``
    of a window: swings shorter than a few of them have no ``maximum`` of their own; ``rtol`` and
    ``max_step`` [s] of the integration.

    **Returns** a dataset with the dimensions ``way`` (up, down), the parameter (in the unit of
    files) and ``peak``: ``maximum`` of the first coordinate (the largest first; NaN-padded; of a
    motion at rest, where it rests), ``velocity_rms``, ``stick_fraction``, ``flight_fraction``,
    ``result``, and ``repeat_time`` [s], the whole periods that these means are over: NaN where the
    motion did not come back to itself, and they are over the window. A coordinate on which nothing
    depends (the height of what falls) need not come back, and has no ``maximum``. After a motion
    that failed or collapsed the next value starts from ``initial_state``. A wall that a step moves
    over the state of the value before is one such failure (``inconsistent_start``): by chance of
    the phase, so that other values or times may do.

    Both ways run side by side in one compiled program.

    Raises ValueError for values that do not increase, a name that is not there, and a system that
    something drives, if there is no ``period`` or what drives it does not come again after it.
    """
    check_system(system)
    check_single(system)
    values = checks.increasing("values", values, 2)
    settle, window = (
        checks.number(name, x, POSITIVE) for name, x in (("settle", settle), ("window", window))
    )
    kick = checks.number("kick", kick, Range(0, 1))
    samples = checks.whole("samples", samples, SETTINGS["samples"])
    rtol = checks.number("rtol", rtol, SETTINGS["rtol"])
    max_step = longest_step(max_step)
    if period is not None and not callable(period):
        must = "period must be a function of the system that gives its period"
        raise ValueError(f"{must}, but was {checks.shown(period)}")
    coordinates(system, initial_state)
    given, system = system, numbers.traceable(system, over)
    numbers.check_corners("values", given, {over: (values[0], values[-1])})
    state = _ends(system, over, values, initial_state)
    sizes = typical(system, state.shape[1] // 2)
    _check_drive(system, over, period, values, state[:, None] + 0.1 * sizes, settle + window)
    ways = jnp.stack([values, values[::-1]])
    spans = tuple(jnp.asarray(x, float) for x in (settle, window, kick, rtol))
    spans += (None if max_step is None else jnp.asarray(max_step, float),)
    drifts = may_drift(system, state[0])
    along = numbers.direction(system, over)
    found = _march(system, along, period, ways, state, spans, jnp.asarray(~drifts), samples)
    states, *columns = (np.array(x) for x in found)
    # a shaken wall, say, is seen in states that it pushes
    settled = states[:, 0, scattered(samples)]
    _check_drive(system, over, period, values, settled, settle + window)
    for array in (states, *columns):
        array[1] = array[1, ::-1]
    first = states[..., [0, state.shape[1] // 2]]  # coordinate, and its rate
    highs = np.where(drifts[0], np.nan, peaks(first, columns[3], columns[4], FLAT * sizes[0]))
    ds = _table(given, over, values, highs, columns)
    return ds.assign_attrs(settle=settle, window=window)


def _ends(system: AbstractSystem, over: str, values, initial_state) -> jax.Array:
    """Return the states that the two ways begin in, (2, 2n)."""
    if initial_state is not None:
        state = jnp.concatenate([jnp.asarray(part, float).ravel() for part in initial_state])
        return jnp.broadcast_to(state, (2, *state.shape))
    # the default start may depend on what is varied
    ends = [numbers.replaced(system, over, v).default_state() for v in (values[0], values[-1])]
    return jnp.stack([jnp.concatenate([jnp.stack(p) * 1.0 for p in end]) for end in ends])


def _check_drive(system: AbstractSystem, over: str, period, values, states, span: float) -> None:
    """Raises ValueError if something drives the system at either end of ``values``, in ``states``
    (2, k, 2n), within ``span`` [s] and there is no ``period``, or that is not its own.
    """
    for value, seen in zip((values[0], values[-1]), states, strict=True):
        local = numbers.replaced(system, over, value)
        if period is None:
            refuse_a_clock(local, seen, span)
        else:
            check_clock(local, period, (), seen)


def _table(given: AbstractSystem, over: str, values, highs: np.ndarray, columns) -> xr.Dataset:
    """Return the dataset of `up_and_down`, of ``columns`` (ways, values) as `_march` gives them."""
    stick, flight, rms, _, _, repeats, result = columns
    fair = np.isin(result, FAIR)
    name, attrs, to_file = numbers.stored(given, over)
    plane = ("way", name)

    def settled(values, long_name, units):
        return plane, np.where(fair, values, np.nan), {"long_name": long_name, "units": units}

    flags = {"long_name": "how the trajectory ended"} | cf.flags(RESULTS)
    words = numbers.words(given)
    maximum = np.where(fair[..., None], highs, np.nan)
    about = {"long_name": f"maxima of the {words['position']}"}
    about |= {"units": "m"} if given.of_a_blade else {}
    return xr.Dataset(
        {
            "maximum": ((*plane, "peak"), maximum, about),
            "velocity_rms": settled(rms, f"rms of the {words['velocity']} about its mean", "m/s"),
            "stick_fraction": settled(stick, "share of the window in stick", "1"),
            "flight_fraction": settled(flight, "share of the window in flight", "1"),
            "repeat_time": settled(repeats, "time in which the motion came back to itself", "s"),
            "result": (plane, result.astype(np.int8), flags),
        },
        coords={"way": list(WAYS), name: (name, to_file(values), attrs)},
        attrs={**maker(), "over": name, **system_attributes(given)},
    )


@Kept
def _march(system, along, period, ways, states, spans, counted, samples: int):
    settle, window, kick, rtol, max_step = spans
    grid = jnp.linspace(0.0, 1.0, samples)

    def one(initial, carry, value):
        state, regime = carry
        local = numbers.moved(system, along, value)
        n = state.shape[0] // 2
        before, after = settle, window
        if period is not None:
            turn = period(local)
            before = jnp.ceil(before / turn * (1 - 1e-9)) * turn
            after = jnp.ceil(after / turn * (1 - 1e-9)) * turn

        def look(carry, _):
            state, regime, before, after, repeats, result = carry
            state = tidy(local, jnp.zeros(()), state, regime)
            s = solve(
                local,
                before + after,
                initial_state=(tuple(state[:n]), tuple(state[n:])),
                rtol=rtol,
                max_step=max_step,
                sample_times=before + after * grid,
                statistics_start=before,
                observer=Reach(RegimeTotals(before)),
                max_events=0,
            )
            totals = s.statistics.totals
            rms = totals.deviation(after)
            shares = totals.stick_time / after, totals.flight_time / after
            q, v = s.samples.position, s.samples.velocity
            states = jnp.stack([*q, *v], axis=-1)
            if period is not None:
                repeats = jnp.where(comes_back(states, sizes, counted), after, jnp.nan)
            step = after / (samples - 1)
            found = states, *shares, rms, s.statistics.highest, step, repeats
            result = jnp.where(_fair(result), s.result, result)  # what went wrong first
            end = jnp.concatenate([s.final_position, s.final_velocity])
            end = jnp.where(_fair(result), end, initial)
            # x' = 0 in a slip that the kick has just begun is left to the engine to decide
            regime = jnp.where(_fair(result), s.final_regime, UNKNOWN)
            again = repeat_time(states, after, sizes, counted)
            onward = jnp.where(jnp.isnan(again), after, again)
            return (end, regime, jnp.zeros_like(before), onward, again, result), found

        sizes = jnp.stack([jnp.asarray(x, float) for kind in local.scales(n) for x in kind])
        here, q, _ = at_state(local, jnp.zeros(()), state)
        q = kicked(here, jnp.zeros(()), q, tuple(state[n:]), kick * sizes[0])
        state = jnp.stack([*q, *state[n:]])
        finished = jnp.asarray(Result.FINISHED, jnp.int32)
        begin = state, regime, before, after, jnp.full_like(after, jnp.nan), finished
        looks = 2 if period is None else 1  # of one compiled program
        (end, regime, *_, result), found = jax.lax.scan(look, begin, None, looks)
        return (end, regime), (*(x[-1] for x in found), result)

    def way(values, initial):
        begin = initial, jnp.asarray(UNKNOWN, jnp.int32)
        return jax.lax.scan(partial(one, initial), begin, values)[1]

    return jax.vmap(way)(ways, states)


def _fair(result):
    return jnp.isin(result, jnp.asarray(FAIR))
