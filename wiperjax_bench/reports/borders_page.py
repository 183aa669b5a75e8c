"""Picture and text of `wiperjax bench borders`, from its data."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from .words import versions

MARKS = {"refined map": "o-", "octree": "s-", "full grid": "^-", "adaptive": "d-"}


def draw(dataset: xr.Dataset) -> Figure:
    """Share of wrong classes over simulations, a curve for each method."""
    figure = Figure(figsize=(6.4, 4.8), layout="constrained")
    ax = figure.subplots()
    floor = 0.5 / int(dataset.attrs["points"])
    for method, mark in MARKS.items():
        some = dataset.isel(row=np.flatnonzero(dataset.method.values == method))
        if some.sizes["row"]:
            wrong = np.maximum(some.wrong.values, floor)
            ax.loglog(some.simulations, wrong, mark, label=method, markersize=4)
    ax.set_xlabel("simulations")
    ax.set_ylabel(f"wrong classes of {dataset.attrs['points']} random points")
    ax.axhline(floor, color="#999999", linewidth=0.8, linestyle=":")
    ax.legend(frameon=False)
    ax.grid(alpha=0.3)
    return figure


def text(dataset: xr.Dataset, picture: str) -> str:
    """Markdown: the picture and the table."""
    lines = [
        "# Borders and what they cost",
        "",
        f"![wrong classes over simulations]({picture})",
        "",
    ]
    lines += [
        f"Classes told at {dataset.attrs['points']} random points, beside simulating each. "
        "Dotted: half a point. `far`: the farthest wrong point from the border that is told, "
        "in steps; `beyond`: wrong ones beyond the stated bracket (a step, or the cube where the "
        "file says so); `unseen`: those in cubes where no border was seen. Full grid, octree and "
        "adaptive take their simulations from the finest refined map.",
        "",
        "| method | step of the axes | simulations | wrong | far | beyond | unseen |",
        "|---|---|---|---|---|---|---|",
    ]
    for k in range(dataset.sizes["row"]):
        row = {name: dataset[name].values[k] for name in dataset.data_vars}
        more = "| | |"
        if not np.isnan(row["far"]):
            more = f"{row['far']:.2g} | {row['beyond']:.0f} | {row['unseen']:.0f} |"
        lines.append(
            f"| {row['method']} | 1/{1 / row['step']:.0f} | {row['simulations']} | "
            f"{row['wrong']:.2%} | {more}"
        )
    return "\n".join([*lines, "", f"{dataset.attrs['machine']}. " + versions(dataset), ""])
