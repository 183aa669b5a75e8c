"""The picture and the text of `wiperjax bench smoothing`."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ..measurements.smoothing import CELLS, RTOL, SINKS, WIDTHS
from .words import duration, versions


def draw(dataset: xr.Dataset):
    """Return the figure: error as colour, with the processor time of a trajectory written on it."""
    rows, columns = dataset.sizes["scene"], dataset.sizes["solver"]
    figure = Figure(figsize=(4.6 * columns, 3.4 * rows + 0.4), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
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
    lines += [
        "",
        f"tanh friction, penalty contact, {CELLS} blades a scene, rtol {RTOL:.0e}, one core of "
        f"{dataset.attrs['machine']}, {dataset.attrs['created']}, load average "
        f"{dataset.attrs['load']:.1f}. {versions(dataset)}",
        "",
    ]
    return "\n".join(lines)
