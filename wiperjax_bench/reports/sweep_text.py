"""The text of `wiperjax bench sweep`: what a map costs from the command line."""

import numpy as np
import xarray as xr

from .words import versions

SHOWN = ("start", "compiling", "engine", "naming", "storing")


def text(dataset: xr.Dataset) -> str:
    """Return the table as Markdown: medians over the repeats, and the spread of the ratios."""
    attrs = dataset.attrs
    lines = [
        "# A sweep from the command line",
        "",
        f"Cells of {attrs['motion']:g} s. `wiperjax sweep` in a process of its own without a "
        "compilation cache, all of it: start, compiling, blocks, naming, storing. The bare engine "
        "has the same cells without samples and statistics, compiled before; the scalar loop is "
        f"compiled numba code, given the sweep's own naming. All on {attrs['cores']} cores, in "
        f"turns, {dataset.sizes['repeat']} of them. In brackets the lowest and the highest.",
        "",
        "| cells | wall [s] | " + " | ".join(f"{name} [s]" for name in SHOWN) + " | outside the "
        "engine, but for start and compiling | cells/s | bare engine, cells/s | scalar loop, "
        "cells/s | rate over the bare engine's | times the scalar loop | processor time over the "
        "bare engine's |",
        "|---" * (8 + len(SHOWN)) + "|",
    ]
    for cells in dataset["cells"].values:
        r = dataset.sel(cells=cells)
        middle = {name: float(r[name].median()) for name in r.data_vars}
        steady = r["engine"] + r["naming"] + r["storing"]
        lines.append(
            f"| {cells} | {middle['wall']:.1f} | "
            + " | ".join(f"{middle[name]:.2f}" for name in SHOWN)
            + f" | {_spread((r['naming'] + r['storing']) / steady, '.0%')} | "
            f"{cells / middle['wall']:.0f} | {cells / middle['bare_wall']:.0f} | "
            f"{cells / middle['scalar_wall']:.0f} | "
            f"{_spread(r['bare_wall'] / r['wall'], '.2f')} | "
            f"{_spread(r['scalar_wall'] / r['wall'], '.2f')} | "
            f"{_spread(r['cpu'] / r['bare_cpu'], '.2f')} |"
        )
    return "\n".join(
        [
            *lines,
            "",
            f"{attrs['machine']}, {attrs['created']}, load average {attrs['load']:.1f} at the end. "
            f"{versions(dataset)}",
            "",
        ]
    )


def _spread(values: xr.DataArray, form: str) -> str:
    low, middle, high = np.quantile(values, (0.0, 0.5, 1.0))
    return f"{middle:{form}} ({low:{form}} to {high:{form}})"
