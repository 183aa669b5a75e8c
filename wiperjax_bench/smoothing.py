"""`wiperjax bench smoothing`: friction smoothed over a width, contact by a stiffness, as a grid.

In the chart one number refines both. Here each goes by itself, at a tolerance that adds nothing, so
that it shows which of the two is to blame for an error, and what each costs, explicit and implicit.
"""

import json
import time
from functools import partial
from typing import Any

import diffrax
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

from . import errors, measure, scenes
from .failures_plot import duration
from .keep import Parts
from .rivals.regularised import Regularised

WIDTHS = (1e-1, 3e-2, 1e-2, 3e-3)  # of friction, over the scene's speed
SINKS = (1e-3, 1e-4, 1e-5, 1e-6)  # depth under the load, over the length: load / stiffness
RTOL = 1e-7
SCENES = ("squeal", "zeno")
SOLVERS = {"Tsit5": diffrax.Tsit5, "Kvaerno5": diffrax.Kvaerno5}
CELLS = 8
PATIENCE = 3.0  # s of processor time: after a call that takes longer, stiffer glass is left out


def row(scene_name: str, solver: str, quick: bool, say) -> dict:
    """Return error, seconds and steps per trajectory, nested lists over widths and sinks."""
    scene = getattr(scenes, scene_name)(CELLS)
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
        attrs={
            "title": "smoothed friction and contact, each by itself",
            "rtol": RTOL,
            "machine": measure.machine(),
            "versions": json.dumps(measure.versions(), sort_keys=True),
            "created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            "load": measure.load(),
        },
    )  # fmt: skip
    dataset.to_netcdf(output, engine="h5netcdf")
    parts.clear()
    return dataset


def draw(dataset: xr.Dataset):
    """Return the figure: error as colour, with the processor time of a trajectory written on it."""
    rows, columns = dataset.sizes["scene"], dataset.sizes["solver"]
    figure, axes = plt.subplots(
        rows, columns, figsize=(4.6 * columns, 3.4 * rows + 0.4), squeeze=False,
        layout="constrained",
    )  # fmt: skip
    size = np.log10(dataset.error.where(np.isfinite(dataset.error)))
    low = float(size.min())
    high = max(float(size.max()), low + 1)
    image = None
    for i, j in np.ndindex(rows, columns):
        ax: Any = axes[i, j]
        part = dataset.isel(scene=i, solver=j)
        shown = np.ma.masked_invalid(size.isel(scene=i, solver=j).values)
        image = ax.imshow(shown, cmap="cividis", vmin=low, vmax=high, aspect="auto")
        for a, b in np.ndindex(part.error.shape):
            error, seconds = float(part.error[a, b]), float(part.seconds[a, b])
            text = f"{error:.0e}\n{duration(seconds)}" if np.isfinite(seconds) else "not run"
            dark = np.isfinite(error) and np.log10(error) < 0.5 * (low + high)
            ax.text(b, a, text, ha="center", va="center", fontsize=8,
                    color="white" if dark else "black")  # fmt: skip
        ax.set_xticks(range(part.sizes["sink"]), [f"{s:.0e}" for s in part.sink.values])
        ax.set_yticks(range(part.sizes["width"]), [f"{w:.0e}" for w in part.width.values])
        ax.set_xlabel("depth under the load / length (right: stiffer)")
        ax.set_ylabel("width of friction / speed")
        ax.set_title(f"{part.scene.item()}, {part.solver.item()}", fontsize=10)
    assert image is not None
    figure.colorbar(image, ax=axes, label="log10 of the state error (share of the length)")
    return figure


def text(dataset: xr.Dataset, picture: str) -> str:
    """Return Markdown: the picture, the best of each panel, how it was measured."""
    lines = [
        "# Smoothed friction and contact, each by itself", "", f"![error and cost]({picture})", "",
        "Colour: median state error; below it the processor time of a trajectory. Not run: a call "
        "before it on the same row took too long.", "",
        "| scene | solver | least error | at width | at depth | time | error falls by, narrower "
        "| error falls by, stiffer |",
        "|---|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    for scene in dataset.scene.values:
        for solver in dataset.solver.values:
            part = dataset.sel(scene=scene, solver=solver)
            error = np.where(np.isfinite(part.error.values), part.error.values, np.inf)
            i, j = np.unravel_index(np.argmin(error), error.shape)
            narrower = error[0, j] / error[i, j]
            stiffer = error[i, 0] / error[i, j]
            lines.append(
                f"| {scene} | {solver} | {error[i, j]:.1e} | {WIDTHS[i]:.0e} | {SINKS[j]:.0e} | "
                f"{duration(float(part.seconds[i, j]))} | {narrower:.2g} x from {WIDTHS[0]:.0e} | "
                f"{stiffer:.2g} x from {SINKS[0]:.0e} |"
            )
    versions = json.loads(dataset.attrs["versions"])
    lines += [
        "",
        f"tanh friction, penalty contact, {CELLS} blades a scene, rtol {RTOL:.0e}, one core of "
        f"{dataset.attrs['machine']}, {dataset.attrs['created']}, load average "
        f"{dataset.attrs['load']:.1f}. Versions: "
        + ", ".join(f"{k} {v}" for k, v in versions.items())
        + ".",
        "",
    ]
    return "\n".join(lines)
