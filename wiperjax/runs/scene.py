"""From files to motion: wiper, belt and start, as a sweep or a scene file states them."""

import json
import os
import time
from collections.abc import Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import xarray as xr

from ..engine.observers.reversal import totals_of
from ..machine import provenance
from ..numerics.runge_kutta import SOLVERS
from ..specs.load import spec_of
from ..specs.scene import SceneSpec
from ..systems.build import belt_of, build, start
from ..vocabulary import cf, checks
from ..vocabulary.cf import units_text
from ..vocabulary.columns import SYSTEM
from ..vocabulary.kinds import MODELS, WIPER
from ..vocabulary.wording import not_there
from .dataset import as_lip, beside
from .simulate import simulate


def run_scene(
    spec: SceneSpec | Mapping[str, Any] | str | os.PathLike,
    *,
    varied: Sequence[str] = (),
) -> xr.Dataset:
    """Return the trajectory of a scene file, labelled as `simulate` does.

    ``spec``: a scene of `load_scene`, the path of a scene file, or a mapping shaped like one (the
    notes of these two are logged as warnings). Its attributes are those of the file: title, text,
    and all parameters in the units of files (angles in degrees; ``parameter_units`` says so).
    ``varied``: parameters that other scenes have other values of; one that is 0 here is then
    computed with, not left out, so that all have one compiled program. After its transient
    (`SceneSpec.transient`) the engine gathers statistics, which are in the run as scalars.

    Raises ValueError for anything else, and for a start that is impossible for these parameters.
    """
    checks.names("varied", varied)
    begun, spec = time.perf_counter(), spec_of(SceneSpec, spec)
    such_as = "a scene, a mapping shaped like a scene file, or the path of one"
    checks.instance("spec", spec, SceneSpec, such_as)
    parameters, table = spec.parameters(), spec.parameter_table
    if strange := [name for name in varied if name not in parameters]:
        raise ValueError(not_there(str(strange[0]), "scene", parameters))
    built = build(spec, parameters | {name: jnp.asarray(parameters[name]) for name in varied})
    state = start(spec, built)
    if spec.start.kind == "equilibrium" and not bool(jnp.isfinite(state[0][0])):
        raise ValueError(
            "start.equilibrium must be left out: with these parameters no steady slip exists"
        )
    asked, limits, belt = spec.run, spec.thresholds(), belt_of(built.system)
    ds = simulate(
        built.system,
        asked.duration,
        initial_state=state,
        solver=SOLVERS[asked.solver](),
        rtol=asked.rtol,
        atol=asked.atol,
        sample_interval=asked.sample_interval,
        max_steps=asked.max_steps,
        max_step=asked.max_step,
        zeno_time=asked.zeno_time,
        observer=totals_of(built.system, belt, spec.transient, limits.reversal_window),
    )
    if built.wiper is not None:
        ds = as_lip(ds)
    stated = {name: float(table[name].to_edge(value)) for name, value in parameters.items()}
    attrs = {
        **_system(spec),
        "belt_kind": spec.belt_kind or "",
        "parameter_units": units_text(beside({name: table[name].edge_unit for name in stated})),
        **{f"class_{key}": value for key, value in limits if value is not None},
        "specification_text": spec.text,
        "specification": json.dumps(spec.document()),
        **provenance.record(None, time.perf_counter() - begun),
    }
    return ds.assign_attrs(beside(stated) | cf.plain_attributes(attrs))


def _system(spec: SceneSpec) -> dict[str, str]:
    """Attributes that tell the system, its law, its start and, unless stated, the title."""
    law, start = spec.family.law(spec), spec.start
    found = {"friction": law.name} if law is not None else {}
    begins = json.dumps(start.model_dump(mode="json", exclude_none=True), sort_keys=True)
    if spec.system != WIPER:
        name = spec.system.rpartition(":")[2]
        found |= {SYSTEM: spec.system, "title": spec.title or f"trajectory of {name}"}
        usual = "that of the system"
    else:
        found |= {"model": spec.model, "title": spec.title or "trajectory of a wiper lip"}
        usual = MODELS[spec.model]
    return found | {"start": usual if start.kind == "default" else begins}
