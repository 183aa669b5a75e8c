"""The picture of the stability limits: lines are theory, marks are measured."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKS = "osD^vP*"
TITLES = {
    "friction": "sticking, friction regularised\nover a width",
    "contact": "resting on a penalty glass",
    "spring": "swinging in flight\non a stiff neck",
}
AXES = {"friction": "width of the friction", "contact": "stiffness of the glass",
        "spring": "stiffness of the neck"}  # fmt: skip


def draw(dataset: xr.Dataset):
    """Return the figure: largest stable step over stiffness, one panel a problem.

    A method with no limit is drawn as open marks along the top, and the legend says so; the
    set-valued methods, which have no such stiffness, as a dashed line at the step they took.
    """
    problems = [str(p) for p in dataset.problem.values]
    figure = Figure(figsize=(4.1 * len(problems), 5.0), layout="constrained")
    panels = figure.subplots(1, len(problems), squeeze=False)
    names = [str(name) for name in dataset.solver.values]
    for panel, problem in zip(panels[0], problems, strict=True):
        part = dataset.sel(problem=problem)
        x = part.stiffness.values
        here = [n for n in names if np.any(~np.isnan(part.measured.sel(solver=n).values))]
        finite = part.measured.values[np.isfinite(part.measured.values)]
        highest = finite.max()
        for i, name in enumerate(here):
            theory, measured = (part[v].sel(solver=name).values for v in ("theory", "measured"))
            colour, mark = COLOURS[i], MARKS[i]
            free = np.isinf(measured)
            panel.plot(x, np.where(np.isfinite(theory), theory, np.nan), color=colour, lw=1.2)
            panel.plot(x, np.where(free, np.nan, measured), mark, color=colour, ms=6,
                       label=None if free.all() else name)  # fmt: skip
            if free.any():
                panel.plot(x[free], np.full(free.sum(), 0.95), mark, mfc="none", color=colour,
                           ms=7, transform=panel.get_xaxis_transform(),
                           label=f"{name}: unlimited")  # fmt: skip
        if problem != "spring":
            highest = max(highest, _set_valued(panel, dataset.attrs))
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_ylim(finite.min() / 4, highest * 30)
        panel.set_title(TITLES[problem], fontsize=10)
        panel.set_xlabel(f"{AXES[problem]} [{part.unit.values}]")
        panel.set_ylabel("largest stable step [s]")
        panel.grid(True, which="major", color="0.9")
        panel.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)
    return figure


def _set_valued(panel, attrs) -> float:
    """Draw, and return, the step [s] of engine and Moreau-Jean on the same blade, held at rest."""
    steps = [float(attrs[f"set_valued_step_{name}"]) for name in ("engine", "Moreau-Jean")]
    panel.axhline(min(steps), color="0.3", ls="--", lw=1.2)
    panel.annotate("engine, Moreau-Jean: stable at this step,\nthe longest tried",
                   (0.03, min(steps)), xycoords=("axes fraction", "data"), xytext=(0, 4),
                   textcoords="offset points", fontsize=7)  # fmt: skip
    return min(steps)
