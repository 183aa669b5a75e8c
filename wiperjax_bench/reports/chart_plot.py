"""Work-precision pictures: a panel a scene, a curve a method."""

import textwrap
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ..harness.compare import against_us
from . import words

# Okabe and Ito's colours, told apart by the colour-blind; the engine's are the strong ones
STYLES = {
    "engine Tsit5": dict(color="#D55E00", marker="o", lw=2.4),
    "engine Tsit5 float32": dict(color="#D55E00", marker="o", lw=1.4, ls=":", mfc="white"),
    "engine Dopri8": dict(color="#E69F00", marker="s", lw=1.4),
    "engine Bosh3": dict(color="#CC79A7", marker="^", lw=1.4),
    "engine Tsit5, relative control": dict(color="#7A3300", marker="<", lw=1.0, ls="--"),
    "engine Tsit5, fixed steps": dict(color="#7A3300", marker="|", lw=1.2, ls=":"),
    "engine Dopri5": dict(color="#D55E00", marker="v", lw=1.0, ls="--"),
    "numba scalar loop": dict(color="#000000", marker="D", lw=2.0),
    "scipy solve_ivp RK45": dict(color="#009E73", marker="P", lw=1.2),
    "scipy solve_ivp DOP853": dict(color="#009E73", marker="X", lw=1.2, ls="--"),
    "diffrax Event per phase, lax.map": dict(color="#0072B2", marker="o", lw=1.2),
    "diffrax Event per phase, vmap": dict(color="#0072B2", marker="o", lw=1.2, ls="--"),
}
# what the short picture shows: a width of 900 pixels has no room for more
SHORT = (
    "engine Tsit5",
    "engine Tsit5 float32",
    "numba scalar loop",
    "diffrax Event per phase, lax.map",
    "scipy solve_ivp RK45",
    "Moreau-Jean",
    "tanh, penalty, Kvaerno5",
)
SHORT_SCENES = ("squeal", "chatter", "reversal", "batch")
LABELS = {
    "state_error": "state error (share of the length)",
    "event_time_error": "error of the event times [s]",
}
TITLE = 56  # letters in a line of a panel's title: more would run into the next
CROSSES = "most sequences of events wrong"
OTHERS = ("#56B4E9", "#999999", "#8C6D1F", "#5D3A9B", "#7F7F00", "#994455")


def style(name: str, methods: list[str]) -> dict:
    """Return the line of a method: known ones have theirs, others the next free colour."""
    if name in STYLES:
        return STYLES[name]
    if name.removesuffix(" float32") in STYLES:  # float32 of the other schemes: thin
        return STYLES[name.removesuffix(" float32")] | dict(lw=0.8, ls=":", mfc="white")
    rest = [m for m in methods if m not in STYLES and not m.startswith("engine")]
    i = rest.index(name)
    return dict(color=OTHERS[i % len(OTHERS)], marker="<>*hp8"[i % 6], lw=1.0, ls="-.")


def panel(ax, part: xr.Dataset, methods: list[str], clock: str, error: str) -> dict:
    """Draw one scene; return a line of each legend entry that it uses."""
    handles, wrong_events = {}, {}
    for name in (m for m in methods if m in part.solver.values):
        one = part.sel(solver=name)
        x, y = one[clock].values, one[error].values
        good = np.isfinite(x) & np.isfinite(y) & (y > 0)
        if not good.any():
            continue
        (line,) = ax.plot(x[good], y[good], ms=4.5, **style(name, methods))
        if clock == "wall":
            low = np.maximum(x - one.wall_low.values, 0)[good]
            high = np.maximum(one.wall_high.values - x, 0)[good]
            ax.errorbar(
                x[good], y[good], xerr=[low, high], fmt="none",
                ecolor=line.get_color(), elinewidth=0.7, alpha=0.6,
            )  # fmt: skip
        wrong = good & (one.wrong_events.values > 0.5)
        (crosses,) = ax.plot(x[wrong], y[wrong], "x", color="red", ms=9, mew=1.4)
        handles[name] = line
        if wrong.any():
            wrong_events = {CROSSES: crosses}
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.grid(alpha=0.25)
    return handles | wrong_events


def _in_order(handles: dict) -> dict:
    """Return legend entries with that of the crosses last."""
    return {name: handles[name] for name in sorted(handles, key=lambda name: name == CROSSES)}


def work_precision(dataset: xr.Dataset, clock: str = "wall", error: str = "state_error"):
    """Return a figure: error over cost per trajectory, one panel a scene."""
    methods = [str(m) for m in dataset.solver.values]
    scenes = dataset.scene.values
    columns = min(4, len(scenes) + 1)
    rows = -(-(len(scenes) + 1) // columns)
    figure = Figure(figsize=(4.3 * columns, 3.9 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    handles = {}
    for scene, ax in zip(scenes, axes.flat, strict=False):
        part = dataset.sel(scene=scene)
        handles |= panel(ax, part, methods, clock, error)
        ax.set_title(textwrap.fill(f"{scene}: {part.about.values}", TITLE), fontsize=9)
        ax.set_xlabel(f"{_clock(clock)} time per trajectory [s]")
        ax.set_ylabel(f"median {LABELS[error]}")
    for ax in axes.flat[len(scenes) :]:
        ax.axis("off")
    legend = axes.flat[len(scenes)]
    handles = _in_order(handles)
    legend.legend(handles.values(), handles.keys(), loc="center", fontsize=8, frameon=False)
    figure.suptitle("Speed against accuracy, one core (left and low is better)")
    return figure


def short(dataset: xr.Dataset, clock: str = "wall"):
    """Return the figure for a narrow page: four scenes, one method of each kind."""
    scenes = [s for s in SHORT_SCENES if s in dataset.scene.values]
    if len(scenes) < 2:
        scenes = [str(s) for s in dataset.scene.values[:4]]
    methods = [m for m in SHORT if m in dataset.solver.values]
    columns = min(2, len(scenes))
    rows = -(-len(scenes) // columns)
    figure = Figure(figsize=(9, 3.1 * rows + 0.8), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, sharey=True)
    handles = {}
    for scene, ax in zip(scenes, axes.flat, strict=False):
        part = dataset.sel(scene=scene)
        handles |= panel(ax, part, methods, clock, "state_error")
        ax.set_title(str(part.about.values), fontsize=10)
    for ax in axes.flat[len(scenes) :]:
        ax.axis("off")
    for ax in axes[:, 0]:
        ax.set_ylabel("state error / length")
    for ax in axes[-1]:
        ax.set_xlabel(f"{_clock(clock)} time per trajectory, one core [s]")
    handles = _in_order(handles)
    figure.legend(
        handles.values(), handles.keys(), loc="outside lower center", ncols=3, fontsize=9,
        frameon=False,
    )  # fmt: skip
    return figure


def _clock(clock: str) -> str:
    return "wall" if clock == "wall" else "processor"


def save(dataset: xr.Dataset, stem: Path, clock: str = "wall") -> list[Path]:
    """Draw the chart as ``stem``.png and .svg, of event times as ``stem``_events.png, and the short
    one as ``stem``_short.png; return the files.
    """
    whole = work_precision(dataset, clock)
    lines = against_us(dataset, clock)
    text = "Against us: " + ("; ".join(_plain(x) for x in lines[:4]) or "nothing in this run") + "."
    whole.supxlabel(text, fontsize=8, wrap=True)
    events = work_precision(dataset, clock, "event_time_error")
    files = []
    for end, figure, suffixes in (
        ("", whole, (".png", ".svg")),
        ("_events", events, (".png",)),
        ("_short", short(dataset, clock), (".png", ".svg")),
    ):
        files += words.save(figure, stem.with_name(f"{stem.name}{end}.png"), suffixes)
    return files


def _plain(line: str) -> str:
    """Return a line of `against_us` without what its factor is made of."""
    return line.split(" (at ")[0]
