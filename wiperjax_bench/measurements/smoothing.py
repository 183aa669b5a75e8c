"""`wiperjax bench smoothing`: friction smoothed over a width, contact by a stiffness, as a grid.

In the chart one number refines both. Here each goes by itself, at a tolerance that adds nothing, so
that it shows which of the two is to blame for an error, and what each costs, explicit and implicit.
"""

import time
from functools import partial

import diffrax
import numpy as np
import xarray as xr

from ..harness import measure
from ..harness.keep import Parts
from ..rivals.regularised import Regularised
from ..scenes import families
from . import errors

WIDTHS = (1e-1, 3e-2, 1e-2, 3e-3)  # of friction, over the scene's speed
SINKS = (1e-3, 1e-4, 1e-5, 1e-6)  # depth under the load, over the length: load / stiffness
RTOL = 1e-7
SCENES = ("squeal", "zeno")
SOLVERS = {"Tsit5": diffrax.Tsit5, "Kvaerno5": diffrax.Kvaerno5}
CELLS = 8
PATIENCE = 3.0  # s of processor time: after a call that takes longer, stiffer glass is left out


def row(scene_name: str, solver: str, quick: bool, say) -> dict:
    """Return error, seconds and steps per trajectory, nested lists over widths and sinks."""
    scene = getattr(families, scene_name)(CELLS)
    true = errors.truth(scene)
    method = Regularised(f"tanh, penalty, {solver}", "tanh", SOLVERS[solver](), ())
    shape = (len(WIDTHS), len(SINKS))
    found = {name: np.full(shape, np.nan) for name in ("error", "seconds", "steps", "stopped")}
    for i, width in enumerate(WIDTHS[:2] if quick else WIDTHS):
        for j, sink in enumerate(SINKS[:2] if quick else SINKS):
            call = method.build(scene, width, sink, RTOL)
            started = time.process_time()
            answer = call()
            spent = time.process_time() - started
            judged = errors.judge(scene, true, answer)
            values = judged.state, spent / CELLS, float(np.mean(answer.steps)), judged.stopped
            for array, value in zip(found.values(), values, strict=True):
                array[i, j] = value
            say(f"{scene_name} {solver} width {width:g} sink {sink:g}: error {judged.state:.1e}, "
                f"{spent / CELLS:.2e} s")  # fmt: skip
            if spent > PATIENCE:
                break
    return {name: array.tolist() for name, array in found.items()}


def run(output, *, quick: bool = False, say=print) -> xr.Dataset:
    """Return the dataset over (scene, solver, width, sink), written to ``output``."""
    names = SCENES[:1] if quick else SCENES
    solvers = list(SOLVERS)[:1] if quick else list(SOLVERS)
    parts = Parts(output, {"quick": quick, "grid": (WIDTHS, SINKS, RTOL)})
    cells = [[parts.once(f"{s}-{m}", partial(row, s, m, quick, say), say) for m in solvers]
             for s in names]  # fmt: skip
    units = {"error": "1", "seconds": "s", "steps": "1", "stopped": "1"}
    axes = ("scene", "solver", "width", "sink")
    dataset = xr.Dataset(
        {k: (axes, np.array([[c[k] for c in line] for line in cells]), {"units": u})
         for k, u in units.items()},
        coords={"scene": list(names), "solver": solvers, "width": list(WIDTHS),
                "sink": list(SINKS)},
        attrs=measure.attributes("smoothed friction and contact, each by itself")
        | {"rtol": RTOL, "load": measure.load()},
    )  # fmt: skip
    dataset.to_netcdf(output, engine="h5netcdf")
    parts.clear()
    return dataset
