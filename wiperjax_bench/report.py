"""The text under the chart, from the data: what it shows, first of all what it shows against us."""

import json

import xarray as xr

from .compare import OURS, TARGETS, against_us, table


def chart_text(dataset: xr.Dataset, picture: str, clock: str = "wall") -> str:
    """Return Markdown: the picture, what is against us, the ratios, and how it was measured."""
    lines = against_us(dataset, clock)
    notes = []
    for method in dataset.solver.values:
        for scene in dataset.scene.values:
            note = str(dataset.note.sel(solver=method, scene=scene).values)
            if note:
                notes.append(f"{method}, {scene}: {note}")
    errors = ", ".join(f"{e:.0e}" for e in TARGETS)
    versions = json.loads(dataset.attrs["versions"])
    confirmed = ", ".join(
        f"{s} {float(dataset.confirmed.sel(scene=s)):.0e}" for s in dataset.scene.values
    )
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
            f"## Cost over that of `{OURS}` at equal error",
            "",
            f"State errors {errors}; above 1 ours is faster; `-`: the method does not reach it; "
            "0: ours does not.",
            "",
            table(dataset, clock),
            "",
            "## How it was measured",
            "",
            f"One core of {dataset.attrs['machine']}, {dataset.attrs['created']}, load average "
            f"{float(dataset.load_average.max()):.1f} at most; {clock} time, median of "
            f"{dataset.attrs['repeats']} interleaved repeats, compilation apart. Versions: "
            + ", ".join(f"{k} {v}" for k, v in versions.items())
            + ".",
            "",
            "A cell is judged up to its horizon (the time at which 1e-10 has grown to 1e-6); the "
            f"reference is {dataset.attrs['reference']}. A second method agrees with it to "
            f"(state error, 90 % of the cells): {confirmed}.",
            "",
            *(["## Not run, or stopped", "", *(f"- {n}" for n in notes), ""] if notes else []),
        ]
    )
