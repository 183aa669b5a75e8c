"""`simulate`: one trajectory for a person, as a labelled dataset, with no limit on its events.

The loop is that of `solve`; here it pauses whenever its event log is full, the log is emptied on
the host, and it goes on. Values of parameters are arguments of the compiled program, not constants
in it: a second call for a system of the same type does not compile again.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import fields
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from . import dataset, provenance
from .belts import AbstractBelt
from .ladder import Bar, Block
from .observers import Nothing
from .parameters import PARAMETERS
from .regimes import forces
from .results import ADVICE, RESULTS, RUNNING, Event, Regime, Result
from .solve import active, begin, final_velocity, make_problem
from .state import Problem, State
from .step import advance
from .system import AbstractSystem, contact
from .wiper import ENGINE_FIELDS, Wiper

EVENTS_AT_ONCE = 1024  # capacity of the log on the device
STEPS_AT_ONCE = 16384  # about a second: Ctrl-C is heard between
SAMPLES = 2000  # intervals of the default sampling
FEWEST_SLOTS = 65536  # of the sample buffer: 4 MB
MOST_SAMPLES = 5 * 10**7
_UNLIMITED = 2**31 - 1  # steps; the counter is 32 bits wide

REGIMES = {regime.name.lower(): int(regime) for regime in Regime}
EVENTS = {event.name.lower(): int(event) for event in Event}


class _Events(NamedTuple):
    """All events of a trajectory: the columns of `state.EventLog`, without a limit."""

    time: np.ndarray
    kind: np.ndarray
    before: np.ndarray
    after: np.ndarray
    impulse: np.ndarray


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
    zeno_time: float = 1e-8,
) -> xr.Dataset:
    """Return one trajectory of ``system`` from t = 0 to ``duration`` [s], with all its events.

    **Main arguments:** ``system``, a `Wiper` or any other; ``duration`` [s]; ``initial_state`` =
    (position, velocity), n values each (for the wiper ((x, y), (x', y')); default: the system's
    own start).

    **Other arguments:** ``solver``, an explicit diffrax Runge-Kutta solver with error estimate
    and dense output (default `diffrax.Tsit5`); ``rtol``; ``atol``, one number or (positions,
    velocities) (default: rtol times the system's scales); ``sample_interval`` [s] (default:
    1/2000 of the duration); ``max_steps``, trial steps (default: no limit); ``zeno_time`` [s],
    flights shorter than this are completed by the limit of their sequence.

    **Returns** a dataset with the dimensions ``time`` (samples up to the end reached), ``axis``
    (coordinates of the system) and ``event``: ``position``, ``velocity``, ``regime``,
    ``normal_force``, ``friction_force`` and, of a wiper, ``belt_velocity``; ``event_time``,
    ``event_kind``, ``regime_before``,
    ``regime_after``, ``event_impulse``; ``final_time``, ``final_position``, ``final_velocity``,
    ``final_regime``; ``result``. A sample at the very instant of an event shows the motion before
    it. Attributes hold the parameters of the system (SI units, radians), the tolerances, the
    solver's statistics, and ``result_message``, what the result means. A numerical failure is no
    exception: the trajectory ends there, and ``result`` says why.

    **Raises** `ValueError` for arguments that cannot be meant, or an initial state that is
    impossible (the contact point inside its partner; no finite force that could hold it).
    """
    if not isinstance(system, AbstractSystem):
        raise ValueError(f"system must be a system such as Wiper(), but was {system!r}")
    duration = _number("duration", duration)
    rtol = _number("rtol", rtol, high=1.0)
    zeno_time = _number("zeno_time", zeno_time)
    if sample_interval is None:
        sample_interval = duration / SAMPLES
    sample_interval = _number("sample_interval", sample_interval, high=duration)
    times = _sample_times(duration, sample_interval)
    if max_steps is None:
        max_steps = _UNLIMITED
    elif not isinstance(max_steps, int | np.integer) or not 1 <= max_steps <= _UNLIMITED:
        raise ValueError(f"max_steps must be a whole number in 1..2^31-1, but was {max_steps!r}")

    given = system
    system = _traced(system)
    start = _coordinates(system.default_state() if initial_state is None else initial_state)
    if isinstance(system, Wiper) and len(start[0]) != 2:
        raise ValueError(
            f"initial_state must have the 2 coordinates of Wiper, but had {len(start[0])}"
        )
    # the length of the buffer is part of the compiled program: few lengths, few compilations. At
    # least one time is never reached, so that a full buffer does not pause the loop.
    slots = max(FEWEST_SLOTS, 1 << len(times).bit_length())
    padded = np.full(slots, np.inf)
    padded[: len(times)] = times
    problem, position, velocity, zero = make_problem(
        system,
        duration,
        initial_state=start,
        solver=solver,
        rtol=rtol,
        atol=_tolerances(atol, len(start[0])),
        sample_times=padded,
        max_events=EVENTS_AT_ONCE,
        max_steps=max_steps,
        zeno_time=zeno_time,
        observer=Nothing(),
        pause_when_full=True,
    )
    try:
        state = _begin(problem, position, velocity, zero)
    except (IndexError, ValueError) as error:  # a tuple of another length than the system's
        raise ValueError(
            f"initial_state must have the coordinates of {type(given).__name__}, but had "
            f"{len(start[0])}: {error}"
        ) from error
    _check_start(system, start, int(state.result))

    pieces = []
    while int(state.result) == RUNNING:
        state = _advance(problem, state)
        count = int(state.log.count)
        pieces.append([np.asarray(column)[:count] for column in state.log[:-1]])
    log = _Events(*(np.concatenate(column) for column in zip(*pieces, strict=True)))
    attributes = {
        "duration": duration,
        "sample_interval": sample_interval,
        "initial_position": np.asarray(start[0]),
        "initial_velocity": np.asarray(start[1]),
        "solver": type(problem.solver).__name__,
        "rtol": rtol,
        "atol_position": np.asarray(problem.atol[0]),
        "atol_velocity": np.asarray(problem.atol[1]),
        "zeno_time": zeno_time,
        "max_steps": int(max_steps),
        "steps": int(state.attempts),
        "rejected_steps": int(state.rejected),
        "unproved_steps": int(state.unproved),
        "result_message": ADVICE[Result(int(state.result))],
        "source": f"wiperjax {provenance.version('wiperjax')}",
        "versions": json.dumps(provenance.versions(), sort_keys=True),
    }
    return _labelled(given, problem, state, log, attributes)


# --- on the device ----------------------------------------------------------------------------


@eqx.filter_jit
def _begin(problem: Problem, position, velocity, start) -> State:
    """Return the loop state at the start, with the first sample taken: no run is without any."""
    state = begin(problem, position, velocity, start)
    system = problem.system.on_piece(state.piece)
    f = forces(system, contact(system, state.time, state.position, state.velocity), state.regime)
    first = problem.record(system, state.time, state.position, state.velocity, state.regime, f)
    samples = jax.tree.map(lambda buffer, x: buffer.at[0].set(x), state.samples, first)
    return state._replace(samples=samples, sample_index=state.sample_index + 1)


@eqx.filter_jit
def _advance(problem: Problem, state: State) -> State:
    """Go on with an empty event log until it is full, enough steps are done, or all is over."""
    state = state._replace(log=state.log._replace(count=jnp.zeros_like(state.log.count)))
    pause = state.attempts + STEPS_AT_ONCE
    return jax.lax.while_loop(
        lambda s: active(problem, s) & (s.attempts < pause), partial(advance, problem), state
    )


def _traced(system):
    """Return ``system`` with its numbers as arrays, which are arguments of a compiled program.

    A Python zero stays one: its terms (of a hinge mass, say) are then not computed at all.
    """

    def traced(leaf):
        if isinstance(leaf, np.ndarray) or (isinstance(leaf, float | np.floating) and leaf != 0):
            return jnp.asarray(leaf, float)
        return leaf

    return jax.tree.map(traced, system)


# --- what a person gave -----------------------------------------------------------------------


def _number(name: str, value, high: float | None = None) -> float:
    """Return a positive finite number, at most ``high``. Raises ValueError that names it."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not (0 < number < math.inf and (high is None or number <= high)):
        limit = "" if high is None else f" and <= {high:g}"
        raise ValueError(f"{name} must be a finite number > 0{limit}, but was {value!r}")
    return number


def _sample_times(duration: float, interval: float) -> np.ndarray:
    """Multiples of ``interval`` from 0 up to ``duration``, that itself if it is one to rounding."""
    ratio = duration / interval
    if ratio > MOST_SAMPLES:
        raise ValueError(
            f"sample_interval must be at least {duration / MOST_SAMPLES:g} s with this duration "
            f"({MOST_SAMPLES:g} samples), but was {interval:g}"
        )
    times = interval * np.arange(math.floor(ratio * (1 + 1e-12)) + 1)
    if abs(times[-1] - duration) <= 1e-12 * duration:
        times[-1] = duration
    return times


def _coordinates(initial_state) -> tuple[tuple, tuple]:
    """Return (position, velocity) as tuples of floats. Raises ValueError for other shapes."""
    must = "initial_state must be (position, velocity), each n >= 1 finite numbers"
    try:
        position, velocity = (
            tuple(float(x) for x in np.asarray(part, dtype=float)) for part in initial_state
        )
    except (TypeError, ValueError):
        raise ValueError(f"{must}, but was {initial_state!r}") from None
    if not position or len(position) != len(velocity):
        raise ValueError(f"{must}, but their lengths were {len(position)} and {len(velocity)}")
    if not np.all(np.isfinite(position + velocity)):
        raise ValueError(f"{must}, but was {(position, velocity)}")
    return position, velocity


def _tolerances(atol, n: int):
    """Return ``atol`` as `make_problem` wants it. Raises ValueError for other shapes or values."""
    if atol is None:
        return None
    must = f"atol must be one number > 0, or (positions, velocities) with 1 or {n} numbers each"
    try:
        parts = [atol, atol] if np.ndim(atol) == 0 else list(atol)
        pair = tuple(
            tuple(float(x) for x in np.broadcast_to(np.asarray(part, float), (n,)))
            for part in parts
        )
    except (TypeError, ValueError):
        raise ValueError(f"{must}, but was {atol!r}") from None
    if len(pair) != 2 or not all(0 < x < math.inf for part in pair for x in part):
        raise ValueError(f"{must}, but was {atol!r}")
    return pair


def _check_start(system: AbstractSystem, start, result: int) -> None:
    """Raises ValueError, saying why, for a state in which no motion can begin."""
    t = jnp.asarray(0.0)
    q, v = (tuple(jnp.asarray(x) for x in part) for part in start)
    bound = system.limit(t, q, v)
    if bound is not None and float(bound) <= 0:
        limit = "|phi| < collapse_angle" if isinstance(system, Wiper) else "limit(t, q, v) > 0"
        raise ValueError(f"initial_state must lie where the model holds ({limit}), but was {start}")
    if result == Result.INCONSISTENT_START:
        gap = float(system.gap(t, q)) if system.unilateral else 0.0
        if gap < 0:
            raise ValueError(f"initial_state must have a gap >= 0, but the gap was {gap:g}")
        raise ValueError(
            "initial_state must allow a finite contact force, but at this state of rest none "
            "exists (Painleve: friction and hinge_mass jam the tip); start it sliding or lifted"
        )


# --- what a person gets -----------------------------------------------------------------------


def _labelled(given, problem: Problem, state: State, log: _Events, attributes) -> xr.Dataset:
    """Return the dataset of a finished loop state."""
    blade = isinstance(given, Wiper | Bar | Block)
    whose = " of the tip" if blade else ""
    reached = int(state.sample_index)
    samples = jax.tree.map(lambda x: np.asarray(x)[:reached], state.samples)
    times = np.asarray(problem.sample_times)[:reached]
    belt = _belt_velocity(given.belt, times) if blade else None

    def about(long_name, units=None, flags=None):
        attrs: dict[str, Any] = {"long_name": long_name}
        if flags is not None:
            attrs["flag_values"] = np.array(list(flags.values()), dtype=np.int8)
            attrs["flag_meanings"] = " ".join(flags)
        elif units == "s" or (units is not None and blade):  # other units are known of a blade only
            attrs["units"] = units
        return attrs

    position = about(f"position{whose}", "m")
    velocity = about(f"velocity{whose}", "m/s")
    impulse = about("normal impulse of the event", "N s/m")
    along = ("time", "axis")
    code = np.int8
    variables = {
        "position": (along, np.stack(samples.position, axis=-1), position),
        "velocity": (along, np.stack(samples.velocity, axis=-1), velocity),
        "regime": ("time", samples.regime, about("regime", flags=REGIMES)),
        "normal_force": ("time", samples.normal_force, about("normal force", "N/m")),
        "friction_force": ("time", samples.friction_force, about("friction force", "N/m")),
        **(
            {"belt_velocity": ("time", belt, about("velocity of the glass", "m/s"))}
            if blade
            else {}
        ),
        "event_time": ("event", log.time, about("time of the event", "s")),
        "event_kind": ("event", log.kind, about("kind of event", flags=EVENTS)),
        "regime_before": ("event", log.before, about("regime before", flags=REGIMES)),
        "regime_after": ("event", log.after, about("regime after", flags=REGIMES)),
        "event_impulse": ("event", log.impulse, impulse),
        "final_time": ((), float(state.time), about("time reached", "s")),
        "final_position": ("axis", np.stack(state.position), position),
        "final_velocity": ("axis", np.stack(final_velocity(problem, state)), velocity),
        "final_regime": ((), code(state.regime), about("regime at the end", flags=REGIMES)),
        "result": ((), code(state.result), about("how the trajectory ended", flags=RESULTS)),
    }
    n = len(state.position)
    names = ["x", "y"][:n] if blade else [f"q{i}" for i in range(n)]
    coords = {
        "time": ("time", times, about("time", "s")),
        "axis": ("axis", names, about("coordinate")),
    }
    parameters = _parameters(given)
    known = {name: PARAMETERS[name].unit for name in parameters if blade and name in PARAMETERS}
    attrs = {
        "Conventions": dataset.CONVENTIONS,
        "system": type(given).__name__,
        **{f"parameter_{k}" if k in attributes else k: v for k, v in parameters.items()},
        **({"parameter_units": units_text(known)} if known else {}),
        **attributes,
    }
    return xr.Dataset(variables, coords=coords, attrs=dataset.plain_attributes(attrs))


def _belt_velocity(belt: AbstractBelt, times: np.ndarray) -> np.ndarray:
    """Return V [m/s] at each of ``times``; it is continuous, so a corner may count to any piece."""
    velocity = belt.velocity(jnp.asarray(times), belt.first_piece(jnp.asarray(times)))
    return np.broadcast_to(np.asarray(velocity, float), times.shape).copy()


def units_text(units: Mapping[str, str]) -> str:
    """Units of parameters in one attribute: ``name: unit; name: unit``."""
    return "; ".join(f"{name}: {unit}" for name, unit in units.items())


def _parameters(module: eqx.Module, prefix: str = "") -> dict[str, Any]:
    """Name -> value of each numeric field, those of modules inside prefixed; and their classes."""
    found: dict[str, Any] = {}
    for field in fields(module):  # type: ignore[arg-type]
        name, value = prefix + field.name, getattr(module, field.name)
        if field.name in ENGINE_FIELDS:
            continue
        if isinstance(value, eqx.Module):
            found[name] = type(value).__name__
            found |= _parameters(value, f"{name}_")
            continue
        if isinstance(module, AbstractBelt) and field.name == "amplitude":
            name = f"{prefix}speed"  # as it is called in files
        if isinstance(value, bool | int | float | str):
            found[name] = value
        elif isinstance(value, np.generic | np.ndarray | jax.Array):
            found[name] = np.asarray(value)[()]
    return found
