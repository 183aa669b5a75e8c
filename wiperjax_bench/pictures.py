"""Work-precision pictures: a panel a scene, a curve a method."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

from .compare import against_us

# Okabe and Ito's colours, told apart by the colour-blind; the engine's are the strong ones
STYLES = {
    "engine Tsit5": dict(color="#D55E00", marker="o", lw=2.4),
    "engine Tsit5 float32": dict(color="#D55E00", marker="o", lw=1.4, ls=":", mfc="white"),
    "engine Dopri8": dict(color="#E69F00", marker="s", lw=1.4),
    "engine Bosh3": dict(color="#CC79A7", marker="^", lw=1.4),
    "engine Dopri5": dict(color="#D55E00", marker="v", lw=1.0, ls="--"),
    "numba scalar loop": dict(color="#000000", marker="D", lw=2.0),
    "scipy solve_ivp RK45": dict(color="#009E73", marker="P", lw=1.2),
    "scipy solve_ivp DOP853": dict(color="#009E73", marker="X", lw=1.2, ls="--"),
    "diffrax Event per phase, lax.map": dict(color="#0072B2", marker="o", lw=1.2),
    "diffrax Event per phase, vmap": dict(color="#0072B2", marker="o", lw=1.2, ls="--"),
}
OTHERS = ("#56B4E9", "#999999", "#8C6D1F", "#5D3A9B", "#7F7F00", "#994455")


def style(name: str, methods: list[str]) -> dict:
    """Return the line of a method: known ones have theirs, others the next free colour."""
    if name in STYLES:
        return STYLES[name]
    if name.startswith("engine"):  # float32 of the other schemes: thin
        return STYLES[name.removesuffix(" float32")] | dict(lw=0.8, ls=":", mfc="white")
    rest = [m for m in methods if m not in STYLES and not m.startswith("engine")]
    i = rest.index(name)
    return dict(color=OTHERS[i % len(OTHERS)], marker="<>*hp8"[i % 6], lw=1.0, ls="-.")


def work_precision(dataset: xr.Dataset, clock: str = "wall", error: str = "state_error"):
    """Return a figure: error over cost per trajectory, one panel a scene."""
    methods = [str(m) for m in dataset.solver.values]
    scenes = dataset.scene.values
    columns = min(4, len(scenes) + 1)
    rows = -(-(len(scenes) + 1) // columns)
    figure, axes = plt.subplots(
        rows, columns, figsize=(4.3 * columns, 3.7 * rows), squeeze=False, layout="constrained"
    )
    handles = {}
    for scene, ax in zip(scenes, axes.flat, strict=False):
        part = dataset.sel(scene=scene)
        for name in methods:
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
            ax.plot(x[wrong], y[wrong], "x", color="red", ms=9, mew=1.4)
            handles[name] = line
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.grid(alpha=0.25)
        ax.set_title(f"{scene}: {str(part.about.values)}", fontsize=9)
        ax.set_xlabel(f"{'wall' if clock == 'wall' else 'processor'} time per trajectory [s]")
        ax.set_ylabel("median state error / length scale" if error == "state_error" else error)
    for ax in axes.flat[len(scenes) :]:
        ax.axis("off")
    (cross,) = axes.flat[len(scenes)].plot([], [], "x", color="red", ms=9, mew=1.4)
    handles["most sequences of events wrong"] = cross
    axes.flat[len(scenes)].legend(
        handles.values(), handles.keys(), loc="center", fontsize=8, frameon=False
    )
    figure.suptitle("Speed against accuracy, one core (left and low is better)")
    return figure


def save(dataset: xr.Dataset, stem: Path, clock: str = "wall") -> list[Path]:
    """Draw the chart as ``stem``.png and .svg; return the files."""
    figure = work_precision(dataset, clock)
    lines = against_us(dataset, clock)
    text = "Against us: " + ("; ".join(lines[:4]) if lines else "nothing in this run") + "."
    figure.supxlabel(text, fontsize=8, wrap=True)
    files = []
    for suffix in (".png", ".svg"):
        file = stem.with_suffix(suffix)
        figure.savefig(file, dpi=130, metadata={"Date": None} if suffix == ".svg" else None)
        files.append(file)
    plt.close(figure)
    return files
