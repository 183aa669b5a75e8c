"""The text under the chart, from the data: what it shows, first of all what it shows against us."""

import numpy as np
import xarray as xr

from ..harness.compare import OURS, TARGETS, against_us, statements, table
from .words import versions


def chart_text(dataset: xr.Dataset, picture: str, clock: str = "wall", events: str = "") -> str:
    """Return Markdown: the picture, what is against us, the ratios, and how it was measured.

    ``events``: name of the picture of event times, if there is one.
    """
    lines = against_us(dataset, clock)
    notes = []
    for method in dataset.solver.values:
        for scene in dataset.scene.values:
            note = str(dataset.note.sel(solver=method, scene=scene).values)
            if note:
                notes.append(f"{method}, {scene}: {note}")
    errors = ", ".join(f"{e:.0e}" for e in TARGETS)
    low, middle, high = spread(dataset)
    return "\n".join(
        [
            "# Speed against accuracy",
            "",
            f"![error over cost]({picture})",
            "",
            "## What it shows against us",
            "",
            *([f"- {line}" for line in lines] or ["Nothing in this run."]),
            "",
            "## Who leads whom",
            "",
            f"Of `{OURS}` against each rival, at equal state error, {clock} time per trajectory:",
            "",
            *(f"- {line}" for line in statements(dataset, clock)),
            "",
            f"## Cost over that of `{OURS}` at equal error",
            "",
            f"State errors {errors}; above 1 ours is faster; `-`: the method does not reach it; "
            "0: ours does not.",
            "",
            table(dataset, clock),
            "",
            "## Events",
            "",
            *([f"![error of the event times over cost]({events})", ""] if events else []),
            "The loosest setting from which on every judged cell has the right events in the right "
            "order; else the share of cells that have not, at the finest setting that ran. Methods "
            "without events are not in this table.",
            "",
            event_table(dataset),
            "",
            "## Compilation",
            "",
            "Seconds of the first call with a method on each scene, less those of the second; a "
            "scene whose program is that of the one before compiles nothing.",
            "",
            compile_table(dataset),
            "",
            "## How it was measured",
            "",
            f"One core of {dataset.attrs['machine']}, {dataset.attrs['created']}, load average "
            f"{float(dataset.load_average.max()):.1f} at most; {clock} time, median of "
            f"{dataset.attrs['repeats']} interleaved repeats, the first of which is the call that "
            "tried the setting; compilation apart. Spread of the "
            f"wall time (10th to 90th percentile over the median): {middle:.1%} in the median of "
            f"all points, {low:.1%} to {high:.1%} in 80 % of them. {versions(dataset)}",
            "",
            "A cell is judged up to its horizon (the time at which 1e-10 has grown to 1e-6); the "
            f"reference is {dataset.attrs['reference']}. What confirms it: "
            f"{dataset.attrs['second']}.",
            "",
            *confirmed(dataset),
            "",
            *(["## Not run, or stopped", "", *(f"- {n}" for n in notes), ""] if notes else []),
        ]
    )


def spread(dataset: xr.Dataset) -> np.ndarray:
    """Return 10th, 50th and 90th percentile of (high - low) / median wall time over all points."""
    wide = ((dataset.wall_high - dataset.wall_low) / dataset.wall).values
    wide = wide[np.isfinite(wide)]
    return np.quantile(wide, (0.1, 0.5, 0.9)) if wide.size else np.full(3, np.nan)


def confirmed(dataset: xr.Dataset) -> list[str]:
    """Return a table: how far the second method agrees with the reference."""
    rows = [
        "| scene | state error, 90 % of cells | event times [s] | cells with other events |",
        "|---|---|---|---|",
    ]
    for scene in dataset.scene.values:
        one = dataset.sel(scene=scene)
        rows.append(
            f"| {scene} | {float(one.confirmed):.0e} | {float(one.confirmed_time):.0e} | "
            f"{float(one.confirmed_wrong):.1%} |"
        )
    return rows


def _rows(dataset: xr.Dataset, cell) -> str:
    """Return a Markdown table of ``cell(part)`` over methods and scenes; empty rows left out."""
    scenes = [str(s) for s in dataset.scene.values]
    rows = ["| method | " + " | ".join(scenes) + " |", "|---" * (len(scenes) + 1) + "|"]
    for method in dataset.solver.values:
        cells = [cell(dataset.sel(solver=method, scene=scene)) for scene in scenes]
        if any(cells):
            rows.append(f"| {method} | " + " | ".join(cells) + " |")
    return "\n".join(rows)


def event_table(dataset: xr.Dataset) -> str:
    """Return the loosest setting with all events right, per method and scene."""

    def cell(part) -> str:
        wrong, setting = part.wrong_events.values, part.setting.values
        ran = np.isfinite(wrong)
        if not ran.any():
            return ""
        wrong, setting = wrong[ran], setting[ran]
        bad = np.flatnonzero(wrong > 0)
        if not len(bad):
            return f"{setting[0]:.0e}"
        return f"{setting[bad[-1] + 1]:.0e}" if bad[-1] + 1 < len(wrong) else f"{wrong[-1]:.1%}"

    return _rows(dataset, cell)


def compile_table(dataset: xr.Dataset) -> str:
    """Return the seconds of compilation, per method and scene."""

    def cell(part) -> str:
        known = part.compile.values[np.isfinite(part.compile.values)]
        return f"{known[0]:.1f}" if len(known) else ""

    return _rows(dataset, cell)
