"""From files to motion: wiper, belt and start, as a sweep or a scene file states them."""

import json
import time

import jax.numpy as jnp
import xarray as xr

from ..blade.build import build_wiper, start_state
from ..blade.rungs import on_rung, start_on_rung
from ..machine import provenance
from ..numerics.runge_kutta import SOLVERS
from ..specs.scene import SceneSpec
from ..vocabulary import cf
from ..vocabulary.cf import units_text
from ..vocabulary.kinds import MODELS
from ..vocabulary.parameters import PARAMETERS
from .dataset import as_lip
from .simulate import simulate


def run_scene(spec: SceneSpec) -> xr.Dataset:
    """Return the trajectory of a scene file, labelled as `simulate` does.

    Its attributes are those of the file: title, text, and all parameters in the units of files
    (angles in degrees; ``parameter_units`` says so).

    Raises ValueError for a start that is impossible for these parameters.
    """
    begun = time.perf_counter()
    wiper = build_wiper(spec.parameters(), spec.belt.kind, spec.blade.friction)
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
        "friction": spec.blade.friction,
        "start": json.dumps(spec.start.model_dump(mode="json", exclude_none=True), sort_keys=True)
        if spec.start.kind != "default"
        else MODELS[spec.model],
        "parameter_units": units_text({name: PARAMETERS[name].edge_unit for name in stated}),
        **{f"class_{key}": value for key, value in spec.thresholds()},
        "specification_text": spec.text,
        "specification": json.dumps(spec.document()),
        **provenance.record(None, time.perf_counter() - begun),
    }
    return ds.assign_attrs(stated | cf.plain_attributes(attrs))
