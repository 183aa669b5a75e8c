"""From files to motion: wiper, belt and start, as a sweep or a scene file states them."""

import json
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import xarray as xr

from ..blade.build import build_wiper, start_state
from ..blade.rungs import on_rung, start_on_rung
from ..machine import provenance
from ..numerics.runge_kutta import SOLVERS
from ..specs.load import load_scene, parse_scene
from ..specs.scene import SceneSpec
from ..vocabulary import cf, checks
from ..vocabulary.cf import units_text
from ..vocabulary.kinds import MODELS
from ..vocabulary.parameters import PARAMETERS
from .dataset import as_lip
from .simulate import simulate


def run_scene(spec: SceneSpec | Mapping[str, Any] | str | os.PathLike) -> xr.Dataset:
    """Return the trajectory of a scene file, labelled as `simulate` does.

    ``spec``: a scene of `load_scene`, the path of a scene file, or a mapping shaped like one. Its
    attributes are those of the file: title, text, and all parameters in the units of files
    (angles in degrees; ``parameter_units`` says so).

    Raises ValueError for anything else, and for a start that is impossible for these parameters.
    """
    begun, spec = time.perf_counter(), _scene(spec)
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


def _scene(spec: Any) -> SceneSpec:
    """Return the scene that ``spec`` is, names or describes."""
    if isinstance(spec, str | os.PathLike):
        return load_scene(Path(spec))
    if isinstance(spec, Mapping):
        return parse_scene(spec)
    such_as = "a scene, a mapping shaped like a scene file, or the path of one"
    checks.instance("spec", spec, SceneSpec, such_as)
    return spec
