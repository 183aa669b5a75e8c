"""The lip in slow motion: rod, glass and contact force, with a time history that runs along."""

import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.ticker import FuncFormatter

from ...datasets.run_dataset import between, event_times, is_steady, last_periods
from ...noise.classes import stored
from ...noise.samples import sample_interval
from ...vocabulary.cf import flag_names
from ..style.axes import page
from ..style.caption import set_caption
from ..style.palette import BELT, REGIMES, readable
from .bands import regime_bands

FRAMES_PER_SECOND = 25
ARROW = 0.6  # length of the largest force, in lengths of the lip


def animate(ds: xr.Dataset, *, seconds: float = 6.0) -> FuncAnimation:
    """The lip of a wiper's run in slow motion.

    Arguments:

    - `ds`: a run of a `Wiper`, or the part of it to be shown.
    - `seconds`: how long it plays; the title says how much slower than life.

    The rod goes from the hinge to the tip and has the colour of the regime; the marks on the glass
    move with it; the arrow is the contact force on the tip; lengths are to scale. Frames are the
    nearest samples, so impacts between two samples may fall between two frames.

    Returns: an animation that is not started: save it with `save`, or show it in a notebook.

    Raises: `ValueError` for a run that is not of a wiper, or of one sample.
    """
    if not has_lip(ds):
        raise ValueError("the run must be of a Wiper: only its lip can be drawn")
    if ds.sizes["time"] < 2:
        raise ValueError("the run must have two samples or more to be animated, but has 1")
    scene = lip_scene(ds)
    length, time, tip, hinge, belt, travel, force, regimes = scene
    frames = int(min(max(2, round(seconds * FRAMES_PER_SECOND)), time.size))
    chosen = np.linspace(0, time.size - 1, frames).round().astype(int)
    arrows = scene.push

    figure = page((5.6, 5.6))
    ax, below = figure.subplots(2, 1, height_ratios=[3.6, 1.2])
    slower = frames / FRAMES_PER_SECOND / (time[-1] - time[0])
    set_caption(figure, ds, f"{slower:,.0f} times slower" if slower >= 2 else "")
    _stage(ax, scene)
    marks = np.arange(-4, 5) * 0.5 * length
    (glass,) = ax.plot([], [], "|", color=BELT, markersize=9, markeredgewidth=1.6)
    (rod,) = ax.plot([], [], "-", linewidth=5, solid_capstyle="round", zorder=3)
    (joint,) = ax.plot([], [], "o", color="black", markersize=7, zorder=4)
    arrow = ax.annotate(
        "", xy=(0, 0), xytext=(0, 0), zorder=5,
        arrowprops={"arrowstyle": "-|>", "color": "black", "linewidth": 1.6, "shrinkA": 0,
                    "shrinkB": 0, "mutation_scale": 13},
    )  # fmt: skip
    words = ax.text(0.02, 0.97, "", transform=ax.transAxes, va="top")
    numbers = ax.text(0.98, 0.97, "", transform=ax.transAxes, va="top", ha="right")

    cursor = _velocities(below, ds, time, belt)

    def draw(frame: int):
        k = chosen[frame]
        x, y = tip[k]
        rod.set_data([0.0, x], [hinge[k], y])
        rod.set_color(REGIMES[regimes[k]])
        joint.set_data([0.0], [hinge[k]])
        glass.set_data(
            (marks + travel[k] + 2 * length) % (4 * length) - 2 * length,
            np.full(9, -0.045 * length),
        )
        push = arrows[k]
        arrow.xy = (x + push[0], y + push[1])
        arrow.set_position((x, y))
        arrow.set_visible(bool(np.linalg.norm(push) > 0.02 * length))
        words.set_text(f"{1e3 * time[k]:.2f} ms\n{readable(regimes[k])}")
        numbers.set_text(
            f"normal {force[k, 1]:.1f} N/m\nfriction {force[k, 0]:.1f} N/m\n"
            f"lip {np.degrees(np.arcsin(np.clip(x / length, -1, 1))):.0f}°"
        )
        cursor.set_xdata([time[k]] * 2)
        return rod, joint, glass, arrow, words, numbers, cursor

    draw(0)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # laid out once: the page must not tremble, nor cost again
    return FuncAnimation(figure, draw, frames=frames, interval=1000 / FRAMES_PER_SECOND)


def has_lip(ds: xr.Dataset) -> bool:
    """Whether a run is of a wiper, whose lip can be drawn."""
    return ds.attrs.get("system") in ("Wiper", "Bar") and "lip_length" in ds.attrs


def slow_part(ds: xr.Dataset, periods: float) -> xr.Dataset:
    """The part of a run that a few seconds of frames can follow: its last `periods`, on a belt that
    turns the last V = 0 to the end of its `reversal_window`, in which the lip flips over, and a
    fifth of that before it. All of it where there is none of these.
    """
    if is_steady(ds):
        return last_periods(ds, periods, always=True)
    turns = event_times(ds).get("belt_reversal", np.zeros(0))
    if not turns.size:
        return ds
    after = max(stored(ds.attrs).reversal_window, 8 * sample_interval(ds))
    end = min(turns[-1] + after, float(ds["time"][-1]))
    return between(ds, max(end - 1.2 * after, float(ds["time"][0])), end)


class LipScene(NamedTuple):
    """What is drawn of a run, over its samples; lengths in mm."""

    length: float
    time: np.ndarray
    tip: np.ndarray
    hinge: np.ndarray  # height
    belt: np.ndarray  # m/s
    travel: np.ndarray  # of the glass
    force: np.ndarray
    regimes: list[str]

    @property
    def push(self) -> np.ndarray:
        """The force as arrows (samples, 2): of the largest, `ARROW` lengths of the lip."""
        largest = float(np.linalg.norm(self.force, axis=1).max(initial=0.0)) or 1.0
        return ARROW * self.length / largest * self.force

    @property
    def reach(self) -> float:
        """How far to either side the lip and its tip are seen."""
        return max(1.35 * self.length, 1.1 * float(np.abs(self.tip[:, 0]).max()))


def lip_scene(ds: xr.Dataset) -> LipScene:
    """What is drawn of a run."""
    length = 1e3 * float(ds.attrs["lip_length"])
    time = np.asarray(ds["time"], dtype=float)
    tip = 1e3 * np.asarray(ds["position"])
    tip = np.column_stack([tip, 0 * tip]) if tip.shape[1] == 1 else tip  # a bar stays on the glass
    hinge = tip[:, 1] + np.sqrt(np.maximum(length**2 - tip[:, 0] ** 2, 0.0))
    belt = np.asarray(ds["belt_velocity"], dtype=float)
    travel = 1e3 * np.concatenate([[0.0], np.cumsum(0.5 * (belt[1:] + belt[:-1]) * np.diff(time))])
    force = np.column_stack([ds["friction_force"], ds["normal_force"]])
    names = flag_names(ds["regime"])
    regimes = [names[int(code)] for code in np.asarray(ds["regime"])]
    return LipScene(length, time, tip, hinge, belt, travel, force, regimes)


def _velocities(ax, ds: xr.Dataset, time: np.ndarray, belt: np.ndarray):
    """Velocities of tip and glass over time, with the bands of regime; the line that runs along."""
    regime_bands(ds, ax)
    ax.plot(time, np.asarray(ds["velocity"])[:, 0], color="black", linewidth=0.9)
    ax.plot(time, belt, color=BELT, linewidth=1.2)
    ax.set_xlim(time[0], time[-1])
    ax.xaxis.set_major_formatter(FuncFormatter(lambda seconds, _: f"{1e3 * seconds:g}"))
    ax.set_xlabel("time (ms)")
    ax.set_ylabel("tip, glass (m/s)")
    return ax.axvline(time[0], color="black", linewidth=1.0)


def _stage(ax, scene: LipScene) -> None:
    """Glass and hinge line, to scale."""
    length = scene.length
    ax.axhspan(-0.25 * length, 0, color="#D8EDE6", zorder=0)
    ax.axhline(0, color=BELT, linewidth=1.2, zorder=1)
    ax.set_xlim(-scene.reach, scene.reach)
    ax.set_ylim(-0.12 * length, max(1.3 * length, 1.1 * float(scene.hinge.max())))
    ax.set_aspect("equal")
    ax.set_xlabel("along the glass (mm)")
    ax.set_ylabel("height (mm)")
    ax.axvline(0, color="#BBBBBB", linewidth=0.8, linestyle=":", zorder=0)


def save(animation: FuncAnimation, path: Path, dpi: int) -> None:
    """Writes an animation as .gif or .mp4 (see `check_writer`)."""
    if path.suffix.lower() == ".mp4":
        writer = FFMpegWriter(fps=FRAMES_PER_SECOND)
    else:
        writer = PillowWriter(fps=FRAMES_PER_SECOND)
    animation.save(path, writer=writer, dpi=dpi)


def check_writer(output: Path) -> None:
    """Raises: `ValueError` if a file of this ending cannot be written here."""
    if output.suffix.lower() == ".mp4" and shutil.which("ffmpeg") is None:
        raise ValueError(f"{output}: .mp4 needs the program ffmpeg, which is not here; take .gif")
