"""What a person gets of one trajectory: samples, events and parameters as a labelled dataset."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..contact.belts import AbstractBelt
from ..contact.friction import CLASSES, AbstractFriction
from ..contact.system import AbstractSystem, system_attributes
from ..engine.carry.problem import Problem
from ..engine.carry.state import EventLog, State, final_velocity, told_regime
from ..engine.observers.told import told
from ..machine import provenance
from ..vocabulary import cf
from ..vocabulary.cf import units_text
from ..vocabulary.codes import RESULTS, Event, Regime
from ..vocabulary.columns import SYSTEM, attributes_of
from ..vocabulary.declared import SET_BY_THE_ENGINE, marked
from ..vocabulary.kinds import FRICTIONS
from ..vocabulary.parameters import PARAMETERS
from ..vocabulary.schema import EVENT_COLUMNS

REGIMES = {regime.name.lower(): int(regime) for regime in Regime}
EVENTS = {event.name.lower(): int(event) for event in Event}
OF_A_RUN = frozenset(
    (
        *("Conventions", SYSTEM, "duration", "sample_interval", "initial_position"),
        *("initial_velocity", "max_steps", "solver", "rtol", "atol_position", "atol_velocity"),
        *("zeno_time", "steps", "rejected_steps", "unproved_steps", "result_message", "source"),
        *("versions", "statistics_start", "parameter_units", "max_step", "of_a_blade"),
    )
)
"""Attributes of every run: a parameter of such a name is an attribute by another (`beside`)."""


def labelled(given, problem: Problem, state: State, log: EventLog, attributes) -> xr.Dataset:
    """Return the dataset of a finished loop state."""
    whose = " of the tip" if given.of_a_blade else ""
    reached = int(state.sample_index)
    samples = jax.tree.map(lambda x: np.asarray(x)[:reached], state.samples)
    times = np.asarray(problem.sample_times)[:reached]
    own = getattr(given, "belt", None)
    belt = _belt_velocity(own, times) if isinstance(own, AbstractBelt) else None

    # units of other systems' coordinates are not declared; those of their contacts are SI
    place, rate = ("m", "m/s") if given.of_a_blade else (None, None)
    per = "/m" if given.per_metre else ""

    def about(long_name, units=None, flags=None):
        attrs: dict[str, Any] = {"long_name": long_name}
        if flags is not None:
            attrs |= cf.flags(flags)
        elif units:
            attrs["units"] = units
        return attrs

    position = about(f"position{whose}", place)
    velocity = about(f"velocity{whose}", rate)
    events = {
        "time": about("time of the event", "s"),
        "kind": about("kind of event", flags=EVENTS),
        "before": about("regime before", flags=REGIMES),
        "after": about("regime after", flags=REGIMES),
        "impulse": about("normal impulse of the event", f"N s{per}"),
    }
    along = ("time", "axis")
    code = np.int8
    ended = code(told_regime(problem, state))
    variables = {
        "position": (along, np.stack(samples.position, axis=-1), position),
        "velocity": (along, np.stack(samples.velocity, axis=-1), velocity),
        "regime": ("time", samples.regime, about("regime", flags=REGIMES)),
        "normal_force": ("time", samples.normal_force, about("normal force", f"N{per}")),
        "friction_force": ("time", samples.friction_force, about("friction force", f"N{per}")),
        **(
            {"belt_velocity": ("time", belt, about("velocity of the glass", "m/s"))}
            if belt is not None
            else {}
        ),
        **_worked_out(given, samples, times),
        **{
            EVENT_COLUMNS[field]: ("event", getattr(log, field), meaning)
            for field, meaning in events.items()
        },
        "final_time": ((), float(state.time), about("time reached", "s")),
        "final_position": ("axis", np.stack(state.position), position),
        "final_velocity": ("axis", np.stack(final_velocity(problem, state)), velocity),
        "final_regime": ((), ended, about("regime at the end", flags=REGIMES)),
        "result": ((), code(state.result), about("how the trajectory ended", flags=RESULTS)),
    }
    n = len(state.position)
    names = list(given.coordinates) or [f"q{i}" for i in range(n)]
    coords = {
        "time": ("time", times, about("time", "s")),
        "axis": ("axis", names, about("coordinate")),
    }
    parameters = _parameters(given)
    stated = {name: unit for name, (_, unit) in parameters.items() if unit is not None}
    attrs = {
        **provenance.maker(),
        **system_attributes(given),
        **beside({name: value for name, (value, _) in parameters.items()}),
        **({"parameter_units": units_text(beside(stated))} if stated else {}),
        **attributes,
    }
    return xr.Dataset(variables, coords=coords, attrs=cf.plain_attributes(attrs))


def beside(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is told of parameters by the names that these have among the attributes of a run:
    ``parameter_duration`` of one called duration, which is the run's own.
    """
    return {f"parameter_{k}" if k in OF_A_RUN else k: v for k, v in parameters.items()}


def _belt_velocity(belt: AbstractBelt, times: np.ndarray) -> np.ndarray:
    """Return V [m/s] at each of ``times``; it is continuous, so a corner may count to any piece."""
    one = jax.vmap(lambda t: belt.velocity(t, belt.first_piece(t)) + 0.0 * t)  # as the engine asks
    return np.asarray(one(_few_lengths(times)))[: len(times)]


def _few_lengths(samples: np.ndarray) -> jax.Array:
    """Return samples, the last one again and again behind them: jax keeps a program of each length
    that it meets, for as long as the process lives.
    """
    more = (1 << len(samples).bit_length()) - len(samples)
    return jnp.asarray(np.pad(samples, (0, more), mode="edge"))


def _worked_out(system: AbstractSystem, samples: Any, times: np.ndarray) -> dict[str, Any]:
    """Return the variables that only the system can tell of its samples: how fast its contact
    slides and, of one that is no blade, how far it is open and what the motion is judged by.
    """
    known = {"output": ("output velocity", "m/s"), "gap": ("gap", "m")}
    known |= {"slip_speed": ("slip speed", "m/s")}
    names = [] if system.of_a_blade else ["output"] + ["gap"] * system.unilateral
    names += [] if system.law is None else ["slip_speed"]

    def at(t, q, rates):
        now = system.on_piece(system.first_piece(t))
        v = now.from_rates(t, q, rates)
        values = {"output": now.output, "slip_speed": now.slip_speed}
        return {name: now.gap(t, q) if name == "gap" else values[name](t, q, v) for name in names}

    found = jax.vmap(at)(*jax.tree.map(_few_lengths, (times, samples.position, samples.velocity)))
    found = {name: np.asarray(values, float)[: len(times)] for name, values in found.items()}
    attrs = {name: dict(zip(("long_name", "units"), known[name], strict=True)) for name in names}
    return {name: ("time", found[name], attrs[name]) for name in names}


def _class(value: eqx.Module) -> str:
    """Name of the class of a law or belt; with its module where a law of one's own is called as one
    of the package, whose curve would be taken for its."""
    own, name = type(value) not in CLASSES.values(), type(value).__name__
    clash = own and isinstance(value, AbstractFriction) and name.lower() in CLASSES
    return f"{type(value).__module__}:{name}" if clash else name


def _parameters(module: eqx.Module, prefix: str = "") -> dict[str, tuple[Any, str | None]]:
    """Name -> (value, unit if it is known) of each numeric field, those of modules inside prefixed;
    and their classes. The numbers of a system of one's own are pure ones unless it says more.
    """
    found: dict[str, tuple[Any, str | None]] = {}
    declared, pure = marked(module), None if getattr(module, "of_a_blade", True) else "1"
    for field in fields(module):  # type: ignore[arg-type]
        name, value = prefix + field.name, getattr(module, field.name)
        if field.name in SET_BY_THE_ENGINE or field.name in getattr(module, "idle", ()):
            continue
        if isinstance(value, eqx.Module):
            found[name] = _class(value), None
            if isinstance(value, AbstractFriction):
                the_law = value is getattr(module, "law", None)
                keys = FRICTIONS.get(value.kind, {}) if the_law else {}  # as in files
                for key, (x, unit) in _parameters(value).items():
                    known = PARAMETERS[keys[key]].unit if key in keys else unit
                    found[prefix + keys.get(key, f"{name}_{key}")] = x, known
                continue
            found |= _parameters(value, f"{name}_")
            continue
        if isinstance(module, AbstractBelt) and field.name == "amplitude":
            name = f"{prefix}speed"  # as it is called in files
        if isinstance(value, bool | str):
            found[name] = value, None
        elif isinstance(value, int | float | np.generic | np.ndarray | jax.Array):
            entry = declared.get(field.name) or (PARAMETERS.get(name) if pure is None else None)
            unit = (pure if entry is None else entry.unit) if np.ndim(value) == 0 else None
            found[name] = np.asarray(value)[()], unit
    return found


def with_statistics(given: AbstractSystem, run: xr.Dataset, record: Any, start: float):
    """Return a run with what an observer has gathered from ``start`` [s] on, scalars named as the
    columns of a map; NaN where the run did not reach its end.
    """
    units = {} if given.per_metre else {SYSTEM: ""}
    window = float(run.attrs["duration"]) - start
    finished = int(run["result"]) == RESULTS["finished"]
    found = told(record, window, finished)
    columns = {name: ((), x[()], attributes_of(name, units)) for name, x in found.items()}
    return run.assign(columns).assign_attrs(statistics_start=start)


def as_lip(run: xr.Dataset) -> xr.Dataset:
    """Return a run of a block or bar with the lip's two coordinates, y = 0 and y' = 0 added."""
    if run.sizes.get("axis") != 1:
        return run
    both = run.reindex(axis=[*run.axis.values, "y"], fill_value=0.0)
    return both.assign_coords(axis=("axis", ["x", "y"], run.axis.attrs))
