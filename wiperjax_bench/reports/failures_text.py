"""The text under the failure chart, from its data."""

import numpy as np
import xarray as xr

from ..measurements.failures import STILL, TOLERANCE, Outcome, loosest
from .failures_plot import WORDS
from .words import duration, versions

LEVEL = 0.6  # an error that is still above this share of the one before has stopped falling
# what is known of a method that levels off on a scene: (part of its name, scene, reason)
REASONS = (
    ("Moreau-Jean", "near Painleve",
     "Newton's impact law: an impact without collision begins at zero normal speed and so gives "
     "back none, while Poisson's law (docs/model.md, section 6) gives back e times the impulse of "
     "compression; without a hinge mass the two agree"),
    ("penalty", "Zeno landing",
     "its friction follows the Stribeck curve during an impact, while the model holds mu at its "
     "value before; with constant mu it converges on the reference "
     "(`tests/bench/test_smoothing.py`)"),
    ("engine", "growth from 1e-12",
     "what is smaller than the tolerance steers no step; with a `max_step` of a tenth of the "
     "period `solve` is right at 1e-3 (`tests/bench/test_failures.py`), as methods are whose steps "
     "are bounded anyway"),
)  # fmt: skip


def failures_text(dataset: xr.Dataset, picture: str) -> str:
    """Return Markdown: the picture, what it shows, also against us, and how it was measured."""
    first = loosest(dataset)
    lines = ["# Where each method fails", "", f"![hard scenes by methods]({picture})", ""]
    lines += ["## What it shows", "", *_counts(dataset, first), ""]
    lines += ["Never right, at any setting that ran:", "", *_never_right(dataset, first), ""]
    lines += ["Right at a setting, and wrong again at a finer one:", "", *_relapses(dataset), ""]
    lines += ["## Against us", "", *_against_us(dataset, first), ""]
    lines += ["## What was asked, and what the engine promises there", ""]
    lines += ["| scene | what is hard | promise |", "|---|---|---|"]
    asked = (dataset[name].values for name in ("scene", "about", "promise"))
    lines += [f"| {' | '.join(map(str, row))} |" for row in zip(*asked, strict=True)]
    lines += [
        "",
        f"Right: in all cells of a scene (four blades) and at all 60 samples the tip is within "
        f"{100 * TOLERANCE:g} % of the reference, as a share of the range of each coordinate (at "
        f"least {100 * STILL:g} % of the other's). Reference: the engine at rtol 1e-12 in "
        "at least 3000 steps, which independent codes confirm (`tests/bench/test_failures.py`).",
        "",
        f"One core of {dataset.attrs['machine']}, {dataset.attrs['created']}, load average "
        f"{float(dataset.attrs['load_average']):.1f} at the end; wall time of a call over its "
        "cells, of the engine its single solve. Four cells are few: the times are for orders of "
        "magnitude, `wiperjax bench chart` is for ratios. " + versions(dataset),
        "",
    ]
    notes = _notes(dataset)
    return "\n".join(lines + (["## Not run", "", *notes, ""] if notes else []))


def _counts(dataset: xr.Dataset, first) -> list[str]:
    """One line a method: on how many scenes it can be right, and in how many runs it misled."""
    out = [
        "| method | scenes right at some setting | runs right | wrong without a word | stopped |",
        "|---|---|---|---|---|",
    ]
    for i, name in enumerate(dataset.solver.values):
        codes = dataset.outcome.values[i]
        ran = np.any(codes != Outcome.NOT_RUN, axis=1)
        if not ran.any():
            out.append(f"| {name} | not run | | | |")
            continue
        numbers = [int(np.sum(codes == o)) for o in (0, 1, 2)]
        out.append(
            f"| {name} | {int(np.sum(first[i] >= 0))} of {int(ran.sum())} | "
            + " | ".join(map(str, numbers))
            + " |"
        )
    return out


def _never_right(dataset: xr.Dataset, first) -> list[str]:
    """One line a method and scene: whether its error still falls or has stopped falling.

    Judged by the last two settings that ran to their end; one that stops has no error.
    """
    out = []
    for i, j in np.argwhere(first < 0):
        codes = dataset.outcome.values[i, j]
        ran = np.flatnonzero(codes != Outcome.NOT_RUN)
        if not len(ran) or np.any(codes == Outcome.RIGHT):
            continue
        name, scene = str(dataset.solver.values[i]), str(dataset.scene.values[j])
        error, setting = dataset.error.values[i, j], dataset.setting.values[i, j]
        known = ran[np.isfinite(error[ran])]
        if not len(known):
            text = "no setting gets to the end"
        else:
            last = known[-1]
            text = f"error {error[last]:.1e} at {setting[last]:.0e}"
            if len(known) > 1:
                flat = error[last] > LEVEL * error[known[-2]]
                text += f" (before: {error[known[-2]]:.1e}), "
                text += "it has stopped falling" if flat else "still falling"
                for part, where, why in REASONS if flat else ():
                    if part in name and where == scene:
                        text += f": {why}"
        out.append(f"- {scene}, {name}: {text}")
    return sorted(out) or ["None."]


def _relapses(dataset: xr.Dataset) -> list[str]:
    """One line a method and scene where refining made a right answer wrong."""
    out = []
    for i, j in np.ndindex(dataset.outcome.shape[:2]):
        codes, setting = dataset.outcome.values[i, j], dataset.setting.values[i, j]
        right = np.flatnonzero(codes == Outcome.RIGHT)
        if not len(right):
            continue
        again = [k for k in np.flatnonzero((codes == Outcome.WRONG) | (codes == Outcome.STOPPED))
                 if k > right[0]]  # fmt: skip
        if again:
            at = ", ".join(f"{setting[k]:.0e} ({WORDS[Outcome(int(codes[k]))]})" for k in again)
            name, scene = dataset.solver.values[i], dataset.scene.values[j]
            out.append(f"- {scene}, {name}: right at {setting[right[0]]:.0e}, not at {at}")
    return sorted(out) or ["None."]


def _against_us(dataset: xr.Dataset, first) -> list[str]:
    """Every run of the engine that is not right, and every scene where another is faster."""
    out, names = [], [str(name) for name in dataset.solver.values]
    ours = [i for i, name in enumerate(names) if name.startswith("engine")]
    for i in ours:
        for j, scene in enumerate(dataset.scene.values):
            for outcome in (Outcome.WRONG, Outcome.STOPPED):
                levels = np.flatnonzero(dataset.outcome.values[i, j] == outcome)
                if len(levels):
                    at = ", ".join(f"{x:.0e}" for x in dataset.setting.values[i, j, levels])
                    out.append(f"- {names[i]}, {scene}: {WORDS[outcome]} at {at}")
    spent = np.full(first.shape, np.inf)
    for i, j in np.argwhere(first >= 0):
        spent[i, j] = dataset.seconds.values[i, j, first[i, j]]
    for j, scene in enumerate(dataset.scene.values):
        if not ours or not np.isfinite(spent[ours, j].min()):
            continue
        mine, best = spent[ours, j].min(), int(np.argmin(spent[:, j]))
        if best not in ours:
            out.append(
                f"- {scene}: {names[best]} is right in {duration(spent[best, j])}, the engine in "
                f"{duration(mine)}"
            )
    return out or ["Nothing in this run."]


def _notes(dataset: xr.Dataset) -> list[str]:
    out = []
    for name in dataset.solver.values:
        reasons = dataset.reason.sel(solver=name)
        for text in dict.fromkeys(str(x) for x in reasons.values if str(x)):
            where = [
                str(s) for s in dataset.scene.values if str(reasons.sel(scene=s).values) == text
            ]
            scenes = "all scenes" if len(where) == dataset.sizes["scene"] else ", ".join(where)
            out.append(f"- {name}, {scenes}: {text}")
    return out
