"""Pictures of periodic motion: branches, stable and unstable, over brute-force diagrams."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..datasets.branch_dataset import rest, simulations
from ..vocabulary.wording import not_there
from .style.axes import axes_or_page, label, legend_below, long_name, page, shown, shown_unit
from .style.caption import set_caption

BRANCH = "#0072B2"
REST = "#882255"
MARKS = {  # special points: marker and words
    "fold": (">", "fold"),
    "period_doubling": ("D", "period doubling"),
    "neimark_sacker": ("h", "Neimark-Sacker"),
    "hopf": ("o", "Hopf"),
    "boundary_equilibrium": ("*", "steady slip at a stop"),
    "grazing": ("v", "grazing"),
    "grazing_sliding": ("s", "stick begins (grazing-sliding)"),
    "crossing_sliding": ("P", "stick begins (crossing-sliding)"),
    "switching_sliding": ("X", "switching-sliding"),
    "adding_sliding": ("p", "stick splits (adding-sliding)"),
    "shoulder": ("|", "shoulder reached"),
}
SMOOTH = (  # no multiplier jumps
    *("fold", "period_doubling", "neimark_sacker", "shoulder"),
    *("hopf", "boundary_equilibrium"),
)
HELD = 1e-3  # of the change of the amplitude: a maximum that changes by less is that of a stop
MULTIPLIERS = (  # marker, size, colour: the larger ones are hollow, so that none hides another
    ("o", 9.0, "#0072B2"),
    ("s", 6.5, "#D55E00"),
    ("D", 4.0, "#009E73"),
    (".", 3.0, "#000000"),
)
DOTS = {"up": ("#E69F00", 4.0), "down": ("#AAAAAA", 7.0)}


def bifurcation_diagram(
    branch: xr.Dataset | None = None,
    brute: xr.Dataset | None = None,
    *,
    quantity: str = "maximum",
    rest: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None,
    ax: Axes | None = None,
    legend: bool = True,
) -> Axes:
    """Draw cycles over a parameter: stable solid, unstable dashed, special points marked.

    Arguments:

    - `branch`: of `branch_dataset`; may be None.
    - `brute`: of `cycles.up_and_down`, drawn below it as dots, up and down in two colours.
    - `quantity`: variable drawn, one that both datasets hold: `maximum`, `velocity_rms`,
      `stick_fraction`, ...
    - `rest`: (parameter, value, is stable) of equilibria, drawn as curves of their own, with a NaN
      between two of them.
    - `legend`: whether to name what is drawn below the axes.
    """
    ax, _ = axes_or_page(ax, (8.0, 4.8))
    held = branch if branch is not None else brute
    if held is None:
        raise ValueError("branch or brute must be given, but both were None")
    over = str(held.attrs["over"])
    factor, unit = shown_unit(held[quantity])
    across, _ = shown_unit(held[over])
    if brute is not None:
        _dots(ax, shown(brute[over])[0], factor * brute[quantity])
    if rest is not None:
        stable = np.asarray(rest[2], bool)
        x, y = across * np.asarray(rest[0]), factor * np.asarray(rest[1])
        _line(ax, x, y, stable, REST, "steady slip")
    if branch is not None:
        x, y = shown(branch[over])[0], factor * branch[quantity].values
        _line(ax, x, y, branch["stable"].values.astype(bool), BRANCH, "cycle")
        _marks(ax, branch, across, y)
    ax.set_xlabel(_axis(held[over]))
    ax.set_ylabel(label(long_name(held[quantity]), unit))
    ax.ticklabel_format(axis="y", style="sci", scilimits=(-2, 4), useOffset=False)
    if legend:  # below the axes: a branch fills them from corner to corner
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3, fontsize="small")
    return ax


def _dots(ax: Axes, parameter: np.ndarray, quantity: xr.DataArray) -> None:
    """Simulated motions, up and down; each of the maxima of a motion is a dot."""
    each = ": each maximum" if "peak" in quantity.dims else ""
    for way in ("down", "up"):
        colour, size = DOTS[way]
        values = quantity.sel(way=way)
        x = np.broadcast_to(parameter.reshape((-1,) + (1,) * (values.ndim - 1)), values.shape)
        ax.plot(
            np.ravel(x),
            np.ravel(values.values),
            linestyle="",
            marker="o",
            markersize=size,
            color=colour,
            markeredgewidth=0,
            label=f"simulated {way}wards{each}",
        )


def _line(ax: Axes, x, y, stable, colour: str, words: str) -> None:
    """A curve, solid where stable and dashed elsewhere; each interval has the look of its ends."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    for look, holds, style in (("stable", stable, "-"), ("unstable", ~stable, "--")):
        if not holds.any():
            continue
        # an interval between a stable and an unstable point goes with the unstable one
        inner = holds[1:] & holds[:-1] if look == "stable" else holds[1:] | holds[:-1]
        inner &= np.isfinite(y[1:]) & np.isfinite(y[:-1])  # none between curves
        gaps = np.zeros((len(inner), 3, 2))
        gaps[:, 0] = np.stack([x[:-1], y[:-1]], axis=1)
        gaps[:, 1] = np.stack([x[1:], y[1:]], axis=1)
        gaps[:, 2] = np.nan
        runs, last = [], False
        for part, on in zip(gaps, inner, strict=True):
            if on:
                runs += [part[1]] if last else [part[2], part[0], part[1]]
            last = on
        if runs:
            path = np.array(runs)
            ax.plot(path[:, 0], path[:, 1], style, color=colour, label=f"{words}, {look}")


def _marks(ax: Axes, branch: xr.Dataset, across: float, y: np.ndarray) -> None:
    """Special points; `across` is the factor from the stored parameter to that of the axis."""
    seen = set()
    for kind, parameter, index in zip(
        branch["special_kind"].values,
        branch["special_parameter"].values,
        branch["special_point"].values,
        strict=True,
    ):
        base = str(kind).removesuffix("_fold") if kind != "fold" else "fold"
        marker, words = MARKS.get(base, ("*", base.replace("_", " ")))
        if str(kind) != base:
            words = f"{words}, branch turns back"
        ax.plot(
            [across * float(parameter)],
            [y[int(index)]],
            marker,
            color="black",
            markersize=7,
            zorder=5,
            linestyle="",
            label=None if words in seen else words,
        )
        seen.add(words)


def branch_page(branch: xr.Dataset, quantity: str | None = None) -> Figure:
    """Draw a branch with what its file holds below it: simulations, and steady slip.

    `quantity`: a number along the branch; left out, its `maximum`, or where a stop holds that its
    `velocity_rms`.

    Raises ValueError for a quantity that is no number along the branch.
    """
    figure = page((8.0, 5.2))
    _headed(figure, branch, _diagram(branch, quantity, figure.subplots()))
    return figure


def branch_overview(branch: xr.Dataset) -> Figure:
    """Draw a branch over the size of its multipliers and its frequency."""
    figure = page((8.0, 9.4))
    top, middle, low = figure.subplots(3, 1, height_ratios=(2.2, 1, 1), sharex=True)
    _diagram(branch, None, top)
    multipliers(branch, middle)
    over = branch[str(branch.attrs["over"])]
    stable = branch["stable"].values.astype(bool)
    _line(low, shown(over)[0], 1 / branch["period"].values, stable, BRANCH, "cycle")
    low.set_ylabel("frequency (Hz)" if shown(branch["period"])[1] else "1 / period")
    low.set_xlabel(_axis(over))
    for ax in (top, middle):
        ax.label_outer()
    _headed(figure, branch, top)
    return figure


def _headed(figure: Figure, branch: xr.Dataset, ax: Axes) -> None:
    """Heading and legend of a page."""
    legend_below(figure, ax.get_legend_handles_labels()[0])
    set_caption(figure, branch)


def _diagram(branch: xr.Dataset, quantity: str | None, ax: Axes) -> Axes:
    quantity = quantity or _telling(branch)
    fair = [
        str(name)
        for name, variable in branch.data_vars.items()
        if variable.dims == ("point",) and variable.dtype.kind == "f"
    ]
    if quantity not in fair:
        raise ValueError(not_there(quantity, "branch", fair))
    brute = simulations(branch)
    if brute is not None and quantity not in brute:
        brute = None
    still = rest(branch) if quantity == "maximum" else None
    return bifurcation_diagram(branch, brute, quantity=quantity, rest=still, ax=ax, legend=False)


def _telling(branch: xr.Dataset) -> str:
    """What tells cycles apart: not the largest coordinate of those that turn at a stop."""
    rises = {name: np.ptp(branch[name].values) for name in ("maximum", "amplitude")}
    return "velocity_rms" if rises["maximum"] < HELD * rises["amplitude"] else "maximum"


def multipliers(branch: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the size of the multipliers over the parameter; 1 is the border of stability.

    They are sorted by size at each point. Lines end where multipliers jump: where events of the
    motion appear or vanish.
    """
    ax, whole = axes_or_page(ax, (8.0, 3.8))
    over = branch[str(branch.attrs["over"])]
    size = np.hypot(branch["multiplier_real"].values, branch["multiplier_imag"].values)
    size = -np.sort(-size, axis=1)
    x = shown(over)[0]
    smooth = np.isin(branch["special_kind"].values, SMOOTH)
    corners = branch["special_point"].values[~smooth]  # each lies between this point and the next
    jumps = np.unique(np.concatenate([corners, corners + 1]))
    x, size = np.insert(x, jumps, np.nan), np.insert(size, jumps, np.nan, axis=0)
    for k in range(size.shape[1]):
        marker, width, colour = MULTIPLIERS[min(k, len(MULTIPLIERS) - 1)]
        ax.plot(
            x, size[:, k], marker=marker, markersize=width, color=colour, linewidth=0.8,
            markerfacecolor="none" if k < len(MULTIPLIERS) - 1 else colour,
            label="largest" if k == 0 else f"number {k + 1} by size",
        )  # fmt: skip
    ax.axhline(1.0, color="black", linewidth=0.8)
    ax.set_yscale("symlog", linthresh=0.1)
    ax.set_ylim(-0.02, max(2.0, 1.5 * float(np.nanmax(size, initial=0.0))))
    ax.set_xlabel(_axis(over))
    ax.set_ylabel("size of multipliers")
    if whole:
        legend_below(ax.figure, ax.get_legend_handles_labels()[0], title="multipliers")
        set_caption(ax.figure, branch)
    else:
        ax.legend(loc="best", fontsize="small", title="multipliers", title_fontsize="small")
    return ax


def remedy_bars(shares: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw what each parameter buys (`remedy.sensitivities`)."""
    ax, _ = axes_or_page(ax, (6.5, 3.2))
    order = np.argsort(np.abs(shares["buys"].values))
    names = [str(n).replace("_", " ") for n in shares["parameter"].values[order]]
    ax.barh(names, shares["buys"].values[order], color=BRANCH)
    ax.axvline(0.0, color="black", linewidth=0.8)
    ax.set_xlabel(_axis(shares["buys"]))
    return ax


def _axis(variable: xr.DataArray) -> str:
    """Words of an axis, with the unit in which `axes.shown` gives its values."""
    return label(long_name(variable), shown_unit(variable)[1])
