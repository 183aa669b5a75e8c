"""The picture of the failure chart."""

import textwrap

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from ..measurements.failures import Outcome, loosest
from .words import duration

# Okabe and Ito's colours, and a sign each: the chart reads without colour too
COLOURS = {
    Outcome.RIGHT: "#009E73",
    Outcome.WRONG: "#D55E00",
    Outcome.STOPPED: "#F0E442",
    Outcome.NOT_RUN: "#E6E6E6",
}
SIGNS = {Outcome.RIGHT: "", Outcome.WRONG: "\u00d7", Outcome.STOPPED: "!", Outcome.NOT_RUN: ""}
WORDS = {
    Outcome.RIGHT: "right",
    Outcome.WRONG: "wrong without a word",
    Outcome.STOPPED: "stopped with an error",
    Outcome.NOT_RUN: "not run",
}


# one method of each kind, for a narrow page
SHORT = (
    "engine Tsit5",
    "engine Tsit5 float32",
    "numba scalar loop",
    "diffrax Event per phase, lax.map",
    "heyoka, Taylor series",
    "scipy solve_ivp RK45",
    "scipy solve_ivp DOP853",
    "Moreau-Jean",
    "tanh, penalty, Tsit5",
    "tanh, penalty, Kvaerno5",
)


def short(dataset: xr.Dataset):
    """Return `draw` of one method of each kind, as far as they are there."""
    names = [n for n in SHORT if n in dataset.solver.values]
    return draw(dataset.sel(solver=names)) if names else draw(dataset)


def draw(dataset: xr.Dataset):
    """Return the figure: scenes by methods, each cell a strip of settings from coarse to fine.

    Grey at the right end of a strip: finer settings that would have taken too long. Under it: the
    loosest setting from which all are right, and its wall time per trajectory.
    """
    methods, scenes = dataset.sizes["solver"], dataset.sizes["scene"]
    first = loosest(dataset)
    size = (1.6 + 1.12 * methods, 1.9 + 0.52 * scenes)
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots()
    for i in range(methods):
        ran = np.isfinite(dataset.setting.values[i]).any(axis=0)
        levels = int(ran.sum())
        for j in range(scenes):
            codes = dataset.outcome.values[i, j, :levels]
            _strip(axes, j, i, codes)
            axes.text(i, j + 0.28, _caption(dataset, first, i, j), ha="center", va="center",
                      fontsize=7)  # fmt: skip
    axes.set_xlim(-0.5, methods - 0.5)
    axes.set_ylim(scenes - 0.5, -0.5)
    named = zip(dataset.solver.values, dataset.setting_name.values, strict=True)
    heads = [f"{textwrap.fill(str(name), 16)}\n({setting})" for name, setting in named]
    axes.set_xticks(range(methods), heads, fontsize=8)
    axes.set_yticks(range(scenes), [str(x) for x in dataset.scene.values], fontsize=9)
    axes.tick_params(length=0, top=True, labeltop=True, bottom=False, labelbottom=False)
    axes.set_xticks(np.arange(methods + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(scenes + 1) - 0.5, minor=True)
    axes.grid(which="minor", color="0.8", linewidth=0.6)
    axes.tick_params(which="minor", length=0)
    keys = [
        Rectangle((0, 0), 1, 1, facecolor=COLOURS[o], edgecolor="0.3", label=WORDS[o])
        for o in Outcome
        if np.any(dataset.outcome.values == o)
    ]
    figure.legend(handles=keys, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    figure.suptitle(
        "Where each method fails: settings from coarse (left) to fine (right); below, the loosest\n"
        "setting from which all are right, and its time per trajectory",
        fontsize=10,
    )
    return figure


def _strip(axes, row: int, column: int, codes) -> None:
    width = 0.9 / len(codes)
    for k, code in enumerate(codes):
        left = column - 0.45 + k * width
        outcome = Outcome(int(code))
        axes.add_patch(
            Rectangle((left, row - 0.34), width, 0.38, facecolor=COLOURS[outcome],
                      edgecolor="white", lw=0.8)
        )  # fmt: skip
        axes.text(left + width / 2, row - 0.15, SIGNS[outcome], ha="center", va="center",
                  fontsize=7)  # fmt: skip


def _caption(dataset: xr.Dataset, first: np.ndarray, i: int, j: int) -> str:
    level = int(first[i, j])
    if np.all(dataset.outcome.values[i, j] == Outcome.NOT_RUN):
        return "not run"
    if level < 0:
        right = np.sum(dataset.outcome.values[i, j] == Outcome.RIGHT)
        ran = np.sum(dataset.outcome.values[i, j] != Outcome.NOT_RUN)
        return f"right at {right} of {ran}" if right else "never right"
    setting, seconds = dataset.setting.values[i, j, level], dataset.seconds.values[i, j, level]
    return f"{setting:.0e}: {duration(seconds)}"
