"""From files to motion: wiper, belt and start, as a sweep or a scene file states them."""

import json
import time
from collections.abc import Mapping
from typing import Any

import diffrax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from . import dataset, provenance
from .belts import SteadyBelt, TrapezoidBelt, WipingBelt
from .ladder import as_lip, on_rung, start_on_rung
from .parameters import BELTS, PARAMETERS
from .run_dataset import units_text
from .spec import SceneSpec
from .spec_tables import Start
from .stability import map_shape, steady_slip
from .trajectory import simulate
from .wiper import Wiper

SOLVERS = {
    "tsit5": diffrax.Tsit5,
    "dopri5": diffrax.Dopri5,
    "dopri8": diffrax.Dopri8,
    "bosh3": diffrax.Bosh3,
}
_BELTS = {belt.kind: belt for belt in (SteadyBelt, WipingBelt, TrapezoidBelt)}


def run(spec: SceneSpec) -> xr.Dataset:
    """Return the trajectory of a scene file, labelled as `simulate` does.

    Its attributes are those of the file: title, text, and all parameters in the units of files
    (angles in degrees; ``parameter_units`` says so).

    Raises ValueError for a start that is impossible for these parameters.
    """
    begun = time.perf_counter()
    wiper = build_wiper(spec.parameters(), spec.belt.kind)
    start = start_state(wiper, spec.start)
    if spec.start.kind == "equilibrium" and not bool(jnp.isfinite(start[0][0])):
        raise ValueError(
            "start.equilibrium must be left out: with these parameters no steady slip exists"
        )
    asked = spec.run
    system = on_rung(wiper, spec.model)
    ds = simulate(
        system,
        asked.duration,
        initial_state=start_on_rung(system, start, spec.start.kind),
        solver=SOLVERS[asked.solver](),
        rtol=asked.rtol,
        atol=asked.atol,
        sample_interval=asked.sample_interval,
        max_steps=asked.max_steps,
        zeno_time=asked.zeno_time,
    )
    ds = as_lip(ds)
    stated = {
        name: float(PARAMETERS[name].to_edge(value)) for name, value in spec.parameters().items()
    }
    attrs = {
        "title": spec.title or "trajectory of a wiper lip",
        "model": spec.model,
        "belt_kind": spec.belt.kind,
        "start": json.dumps(spec.start.model_dump(mode="json", exclude_none=True), sort_keys=True)
        if spec.start.kind != "default"
        else dataset.DEFAULT_STARTS[spec.model],
        "parameter_units": units_text({name: PARAMETERS[name].edge_unit for name in stated}),
        **{f"class_{key}": value for key, value in spec.thresholds()},
        "specification_text": spec.text,
        "specification": json.dumps(spec.document()),
        **provenance.record(None, time.perf_counter() - begun),
    }
    return ds.assign_attrs(stated | dataset.plain_attributes(attrs))


def build_wiper(parameters: Mapping[str, Any], belt_kind: str) -> Wiper:
    """Return the wiper of ``parameters`` (SI units, radians) on a belt of ``belt_kind``.

    **Arguments:** ``parameters``, name -> value as `SweepSpec.cells` and `SceneSpec.parameters`
    give them: floats, or arrays with one entry a cell; left out: the reference value. They are
    kept as they are, so a float 0.0 (of ``hinge_mass``, say) stays one and its terms are skipped.

    Raises ValueError for an unknown kind or name, and for impossible values.
    """
    if belt_kind not in BELTS:
        raise ValueError(f"belt_kind must be one of {', '.join(BELTS)}, but was {belt_kind!r}")
    keys = BELTS[belt_kind]
    blade = {name for name, entry in PARAMETERS.items() if entry.table == "blade"}
    if strange := sorted(set(parameters) - blade - set(keys.values())):
        raise ValueError(f"parameters must suit belt_kind {belt_kind!r}, but had {strange[0]!r}")
    belt = {key: parameters[name] for key, name in keys.items() if name in parameters}
    return Wiper(
        belt=_BELTS[belt_kind](**belt),
        **{name: value for name, value in parameters.items() if name in blade},
    )


def start_state(wiper: Wiper, start: Start):
    """Return ((x, y), (x', y')) [m, m/s] of a `Start`, each shaped as the wiper's parameters.

    An ``equilibrium`` start rests at steady slip (the branch that leans farthest along the belt's
    motion, for V at t = 0) plus that fraction of the lip length; NaN where there is no steady slip.
    """
    length, shape = wiper.lip_length, map_shape(wiper)
    position, velocity = wiper.default_state()
    if start.kind == "angle" and start.angle is not None:
        position = (length * np.sin(np.radians(start.angle)), 0.0)
    elif start.kind == "equilibrium" and start.equilibrium is not None:
        position = (steady_slip(wiper).x + start.equilibrium * length, 0.0)
    elif start.kind == "state" and start.position is not None:
        position, velocity = start.position, start.velocity or (0.0, 0.0)

    def full(pair):
        return tuple(jnp.broadcast_to(jnp.asarray(x, float), shape) for x in pair)

    return full(position), full(velocity)
