"""`simulate`: one trajectory for a person, as a labelled dataset, with no limit on its events.

The loop is that of `solve`; here it pauses whenever its event log is full, the log is emptied on
the host, and it goes on. Values of parameters are arguments of the compiled program, not constants
in it: a second call for a system of the same type does not compile again.
"""

import json
import time
from collections.abc import Callable
from datetime import timedelta
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..contact.belts import AbstractBelt
from ..contact.fits import turns
from ..contact.guards import starting_sides
from ..contact.on_belt import OnBelt
from ..contact.own_numbers import check_single, in_full
from ..contact.regimes import forces
from ..contact.space import contact
from ..contact.system import AbstractSystem
from ..engine.arguments import (
    check_integration,
    check_system,
    coordinates,
    longest_step,
    regular_times,
    tolerances,
)
from ..engine.carry.problem import Case, Integration, Problem, Recording, make_case
from ..engine.carry.state import EventLog, State
from ..engine.observers.base import Nothing
from ..engine.observers.reversal import ReversalTotals
from ..engine.observers.totals import RegimeTotals
from ..engine.solve import active, begin
from ..engine.step import advance
from ..machine import provenance
from ..machine.files import log
from ..numerics.kept import Kept
from ..specs.windows import check_strokes
from ..systems.numbers import traceable
from ..vocabulary import checks
from ..vocabulary.codes import ADVICE, RUNNING, Result
from ..vocabulary.ranges import COUNT, POSITIVE, SAMPLES, Range
from .dataset import labelled, with_statistics

EVENTS_AT_ONCE = 1024  # capacity of the log on the device
STEPS_AT_ONCE = 16384  # about a second: Ctrl-C is heard between
PATIENCE = 10.0  # s, after which a run says how far it is
TINY = 1e-4  # of scales that nobody has stated: a motion so small has lost four of its digits
ROUNDING = 1e-14  # of these: a motion that is none
FEWEST_SLOTS = 65536  # of the sample buffer: 4 MB


def simulate(
    system: AbstractSystem,
    duration: float,
    *,
    initial_state=None,
    solver=None,
    rtol: float = 1e-8,
    atol=None,
    sample_interval: float | None = None,
    max_steps: int | None = None,
    max_step: float | None = None,
    zeno_time: float = 1e-8,
    observer: RegimeTotals | ReversalTotals | None = None,
) -> xr.Dataset:
    """Return one trajectory of ``system`` from t = 0 to ``duration`` [s], with all its events.

    **Main arguments:** ``system``, a `Wiper` or any other; ``duration`` [s]; ``initial_state`` =
    (position, velocity), n values each (for the wiper ((x, y), (x', y')); default: the system's
    own start).

    **Other arguments:** ``solver``, an explicit diffrax Runge-Kutta solver with error estimate
    and dense output (default `diffrax.Tsit5`); ``rtol``; ``atol``, one number or (positions,
    velocities) (default: rtol times the system's scales); ``sample_interval`` [s] (default:
    1/2000 of the duration); ``max_steps``, trial steps (default: no limit); ``max_step`` [s]
    (default: as long as the motion is smooth); ``zeno_time`` [s], flights shorter than this are
    completed by the limit of their sequence; ``observer``, a
    `RegimeTotals` or `ReversalTotals`: what it gathers from its start on is in the dataset, too, as
    scalars named as the columns of a map (``statistics_start`` is an attribute; default: none).

    **Returns** a dataset with the dimensions ``time`` (samples up to the end reached), ``axis``
    (coordinates of the system) and ``event``: ``position``, ``velocity``, ``regime``,
    ``normal_force``, ``friction_force``; with a belt ``belt_velocity``; with friction
    ``slip_speed``, that of the contact over its partner; of a system that is no blade ``output``,
    the velocity it is judged by, and of one that can lift off its ``gap``; ``event_time``,
    ``event_kind``, ``regime_before``, ``regime_after``, ``event_impulse``; ``final_time``,
    ``final_position``, ``final_velocity``, ``final_regime``; ``result``. A sample at the very
    instant of an event shows the motion before it. Attributes hold the parameters of the system (SI
    units, radians), the tolerances, the solver's counts (``steps``: trial ones, unlike a map's) and
    ``result_message``, the result in words: a numerical failure ends the run, and is no exception.

    **Raises** `ValueError` for arguments that cannot be meant, an impossible initial state (inside
    its partner; held by no finite force), and within `jax.jit` and the like, where `solve` works.
    """
    check_system(system)
    check_single(system)
    duration = checks.number("duration", duration, POSITIVE)
    most = int(COUNT.high) if max_steps is None else checks.whole("max_steps", max_steps, COUNT)
    check_integration(solver, rtol, zeno_time, most)
    zeno_time = checks.number("zeno_time", zeno_time, POSITIVE)
    max_step = longest_step(max_step)
    sample_interval = duration / SAMPLES if sample_interval is None else sample_interval
    within = Range(0, duration, low_open=True)
    sample_interval = checks.number("sample_interval", sample_interval, within)
    begins = _begins(observer, duration, system)
    times = regular_times(duration, sample_interval)

    given, system = in_full(system), traceable(system)
    start = coordinates(system, initial_state)
    atol = tolerances(atol, len(start[0]))
    integration = Integration(solver, float(rtol), atol, most, max_step, zeno_time)
    padded = _padded(times)
    recording = Recording(
        padded,
        max_events=EVENTS_AT_ONCE,
        observer=Nothing() if observer is None else observer,
        mark=begins,
        pause_when_full=True,
    )
    case = make_case(system, duration, start, integration, recording)
    state, events = _watched(case, lambda code: _check_start(system, start, code))
    attributes = {
        "duration": duration,
        "sample_interval": sample_interval,
        "initial_position": np.asarray(start[0]),
        "initial_velocity": np.asarray(start[1]),
        **_account(case, integration, state),
    }
    run = labelled(given, case.problem, state, events, attributes)
    _note_on_scales(given, atol, run)
    return run if begins is None else with_statistics(given, run, state.observed, begins)


def _note_on_scales(system: AbstractSystem, atol: Any, run: xr.Dataset) -> None:
    """Logs a note where a motion is far below the scales, 1, that nobody has stated for it."""
    if atol is not None or type(system).scales is not AbstractSystem.scales:
        return
    q, v = (float(np.max(np.abs(run[name]))) for name in ("position", "velocity"))
    if ROUNDING < max(q, v) < TINY:
        must = f"{type(system).__name__}.scales must state the sizes of a motion that is so small"
        was = f"its positions reached {q:.2g} and its velocities {v:.2g}, absolute tolerances"
        log.warning("note: %s: %s were those of 1 and 1 (SI units)", must, was)


def _begins(observer: Any, duration: float, system: Any) -> float | None:
    """Return the time [s] from which an observer gathers. Raises ValueError for no observer of
    totals, one that begins at no time of the run, or one of the reversal on a belt that turns
    and does not say when, or so often that its window leaves no stroke.
    """
    if observer is None:
        return None
    checks.instance("observer", observer, (RegimeTotals, ReversalTotals), "RegimeTotals(start)")
    start = float(observer.start)
    if not 0 <= start < duration:
        raise ValueError(
            f"observer must begin within the run, [0, {duration:g}) s, but began at {start:g}"
        )
    if isinstance(observer, ReversalTotals):
        checks.instance("system", system, OnBelt, "on a belt, to have statistics of its reversal")
        belt = type(system.belt)
        if belt.since_reversal is AbstractBelt.since_reversal and turns(system):
            must = "must be its own where a belt turns: all would count as stroke"
            raise ValueError(f"{belt.__name__}.since_reversal {must}, but was that of AbstractBelt")
        if (frequency := float(system.belt.wiping_frequency)) > 0:
            check_strokes(float(observer.window), frequency, "observer.window")
    return start


def _padded(times: np.ndarray) -> np.ndarray:
    """Sample times in a buffer whose length is part of the compiled program: few lengths, few
    compilations. At least one is never reached, so that a full buffer does not pause the loop.
    """
    padded = np.full(max(FEWEST_SLOTS, 1 << len(times).bit_length()), np.inf)
    padded[: len(times)] = times
    return padded


def _watched(case: Case, check_start: Callable[[int], None]) -> tuple[State, EventLog]:
    """Return (the final state, all events) of a case whose start was checked by its code."""
    state = _begin(case)
    check_start(int(state.result))
    pieces = [_logged(state.log)]  # none yet, and none at all if it ends where it begins
    pace = None
    while int(state.result) == RUNNING:
        state = _advance(case.problem, state)
        pieces.append(_logged(state.log))
        pace = pace or _Pace(float(state.time), float(case.problem.end))  # compiled by now
        pace.look(float(state.time))
    columns: Any = [np.concatenate(column) for column in zip(*pieces, strict=True)]
    return state, EventLog(*columns, count=len(columns[0]))


class _Pace:
    """Logs once, after `PATIENCE`, how far a run is and what the rest of it takes."""

    def __init__(self, start: float, end: float):
        self.start, self.end, self.begun, self.told = start, end, time.monotonic(), False

    def look(self, now: float) -> None:
        spent = time.monotonic() - self.begun
        if self.told or spent < PATIENCE or now <= self.start:
            return
        self.told = True
        rest = spent * (self.end - now) / (now - self.start)
        rest = timedelta(seconds=round(min(rest, 1e12)))
        log.warning("note: at %.3g of %.3g s; the rest takes %s at this pace", now, self.end, rest)


def _logged(log: EventLog) -> list[np.ndarray]:
    """Return the columns of a log as far as they are filled."""
    return [np.asarray(column)[: int(log.count)] for column in log[:-1]]


def _account(case: Case, integration: Integration, state: State) -> dict[str, Any]:
    """Return the attributes that say how a run was made, and how it ended."""
    return {
        "solver": type(case.problem.solver).__name__,
        "rtol": integration.rtol,
        "atol_position": np.asarray(case.problem.atol[0]),
        "atol_velocity": np.asarray(case.problem.atol[1]),
        "zeno_time": integration.zeno_time,
        "max_steps": integration.max_steps,
        **({} if integration.max_step is None else {"max_step": integration.max_step}),
        "steps": int(state.attempts),
        "rejected_steps": int(state.rejected),
        "unproved_steps": int(state.unproved),
        "result_message": ADVICE[Result(int(state.result))],
        "versions": json.dumps(provenance.versions(), sort_keys=True),
    }


@Kept
def _begin(case: Case) -> State:
    """Return the loop state at the start, with the first sample taken: no run is without any."""
    problem, state = case.problem, begin(case)
    system = problem.system.on_piece(state.piece).on_sides(state.sides)
    f = forces(system, contact(system, state.time, state.position, state.velocity), state.regime)
    first = problem.record(system, state.time, state.position, state.velocity, state.regime, f)
    samples = jax.tree.map(lambda buffer, x: buffer.at[0].set(x), state.samples, first)
    return state._replace(samples=samples, sample_index=state.sample_index + 1)


@Kept
def _advance(problem: Problem, state: State) -> State:
    """Go on with an empty event log until it is full, enough steps are done, or all is over."""
    state = state._replace(log=state.log._replace(count=jnp.zeros_like(state.log.count)))
    pause = state.attempts + STEPS_AT_ONCE
    return jax.lax.while_loop(
        lambda s: active(problem, s) & (s.attempts < pause), partial(advance, problem), state
    )


def _check_start(system: AbstractSystem, start, result: int) -> None:
    """Raises ValueError, saying why, for a state in which no motion can begin."""
    t = jnp.asarray(0.0)
    q, v = (tuple(jnp.asarray(x) for x in part) for part in start)
    sides = starting_sides(system, t, q, v)
    system = system.on_sides(sides)
    found = zip(sides, system.switches(t, q, v), system.ends(t, q, v), strict=True)
    if any(side * s < 0 or (s == 0 and end) for side, s, end in found):
        where = f" ({system.valid_where})" if system.valid_where else ""
        raise ValueError(f"initial_state must lie where the model holds{where}, but was {start}")
    if result == Result.INCONSISTENT_START:
        gap = float(system.gap(t, q)) if system.unilateral else 0.0
        if gap < 0:
            raise ValueError(f"initial_state must have a gap >= 0, but the gap was {gap:g}")
        raise ValueError(
            "initial_state must allow a finite contact force, but at this state of rest none "
            "exists (Painleve: friction and hinge_mass jam the tip); start it sliding or lifted"
        )
