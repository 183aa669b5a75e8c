"""Pictures of periodic motion: branches, stable and unstable, over brute-force diagrams."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..branch_file import rest, simulations
from .axes import label, long_name, page, shown_unit

BRANCH = "#0072B2"
REST = "#009E73"
MARKS = {  # special points: marker and words
    "fold": (">", "fold"),
    "period_doubling": ("D", "period doubling"),
    "neimark_sacker": ("h", "Neimark-Sacker"),
    "hopf": ("o", "Hopf"),
    "grazing": ("v", "grazing"),
    "grazing_sliding": ("s", "stick begins (grazing-sliding)"),
    "crossing_sliding": ("P", "stick begins (crossing-sliding)"),
    "switching_sliding": ("X", "switching-sliding"),
    "adding_sliding": ("p", "stick splits (adding-sliding)"),
    "shoulder": ("|", "shoulder reached"),
}
DOTS = {"up": ("#E69F00", 4.0), "down": ("#777777", 7.0)}


def bifurcation_diagram(
    branch: xr.Dataset | None = None,
    brute: xr.Dataset | None = None,
    *,
    quantity: str = "maximum",
    rest: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw cycles over a parameter: stable solid, unstable dashed, special points marked.

    Arguments:

    - `branch`: of `branch_dataset`; may be None.
    - `brute`: of `updown.up_and_down`, drawn below it as dots, up and down in two colours.
    - `quantity`: variable drawn, one that both datasets hold: `maximum`, `velocity_rms`,
      `stick_fraction`, ...
    - `rest`: (parameter, value, is stable) of an equilibrium, drawn as a line of its own.
    """
    if ax is None:
        ax = Figure(figsize=(8.0, 4.8), layout="constrained").subplots()
    shown = branch if branch is not None else brute
    if shown is None:
        raise ValueError("branch or brute must be given, but both were None")
    over = str(shown.attrs["over"])
    factor, unit = shown_unit(shown[quantity])
    if brute is not None:
        _dots(ax, brute, over, factor * brute[quantity])
    if rest is not None:
        stable = np.asarray(rest[2], bool)
        _line(ax, rest[0], factor * np.asarray(rest[1]), stable, REST, "steady slip")
    if branch is not None:
        x, y = branch[over].values, factor * branch[quantity].values
        _line(ax, x, y, branch["stable"].values.astype(bool), BRANCH, "cycle")
        _marks(ax, branch, x, y)
    ax.set_xlabel(_axis(shown[over]))
    ax.set_ylabel(label(long_name(shown[quantity]), unit))
    ax.ticklabel_format(axis="y", style="sci", scilimits=(-2, 4), useOffset=False)
    # below the axes: a branch fills them from corner to corner
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3, fontsize="small")
    return ax


def _dots(ax: Axes, brute: xr.Dataset, over: str, quantity: xr.DataArray) -> None:
    for way in ("down", "up"):
        colour, size = DOTS[way]
        values = quantity.sel(way=way)
        x = np.broadcast_to(
            brute[over].values.reshape((-1,) + (1,) * (values.ndim - 1)), values.shape
        )
        ax.plot(
            np.ravel(x),
            np.ravel(values.values),
            linestyle="",
            marker="o",
            markersize=size,
            color=colour,
            markeredgewidth=0,
            label=f"simulated, {way}wards",
        )


def _line(ax: Axes, x, y, stable, colour: str, words: str) -> None:
    """A curve, solid where stable and dashed elsewhere; each interval has the look of its ends."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    for look, holds, style in (("stable", stable, "-"), ("unstable", ~stable, "--")):
        if not holds.any():
            continue
        # an interval between a stable and an unstable point goes with the unstable one
        inner = holds[1:] & holds[:-1] if look == "stable" else holds[1:] | holds[:-1]
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


def _marks(ax: Axes, branch: xr.Dataset, x, y) -> None:
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
            [parameter],
            [y[int(index)]],
            marker,
            color="black",
            markersize=7,
            zorder=5,
            linestyle="",
            label=None if words in seen else words,
        )
        seen.add(words)


def branch_page(branch: xr.Dataset, quantity: str = "maximum") -> Figure:
    """Draw a branch with what its file holds below it: simulations, and steady slip.

    Raises ValueError for a quantity that is no number along the branch.
    """
    figure = page((8.0, 5.2))
    _diagram(branch, quantity, figure.subplots())
    return figure


def branch_overview(branch: xr.Dataset) -> Figure:
    """Draw a branch over the size of its multipliers and its frequency."""
    figure = page((8.0, 9.0))
    top, middle, low = figure.subplots(3, 1, height_ratios=(2.2, 1, 1), sharex=True)
    _diagram(branch, "maximum", top)
    top.set_xlabel("")
    multipliers(branch, middle)
    middle.set_xlabel("")
    over = branch[str(branch.attrs["over"])]
    stable = branch["stable"].values.astype(bool)
    _line(low, over.values, 1 / branch["period"].values, stable, BRANCH, "cycle")
    low.set_xlabel(_axis(over))
    low.set_ylabel("frequency (Hz)" if _unit(branch["period"]) else "1 / period")
    return figure


def _diagram(branch: xr.Dataset, quantity: str, ax: Axes) -> None:
    fair = [
        str(name)
        for name, variable in branch.data_vars.items()
        if variable.dims == ("point",) and variable.dtype.kind == "f"
    ]
    if quantity not in fair:
        raise ValueError(f"{quantity!r} is not in this branch; it holds {', '.join(fair)}")
    brute = simulations(branch)
    if brute is not None and quantity not in brute:
        brute = None
    still = rest(branch) if quantity == "maximum" else None
    bifurcation_diagram(branch, brute, quantity=quantity, rest=still, ax=ax)
    ax.set_title(str(branch.attrs.get("title", "")), fontweight="bold")


def multipliers(branch: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the size of the multipliers over the parameter; 1 is the border of stability."""
    if ax is None:
        ax = Figure(figsize=(8.0, 3.2), layout="constrained").subplots()
    over = str(branch.attrs["over"])
    size = np.hypot(branch["multiplier_real"].values, branch["multiplier_imag"].values)
    for k in range(size.shape[1]):
        ax.plot(branch[over], size[:, k], ".-", linewidth=1.0, label=f"multiplier {k + 1}")
    ax.axhline(1.0, color="black", linewidth=0.8)
    ax.set_yscale("symlog", linthresh=0.1)
    ax.set_ylim(bottom=-0.02)
    ax.set_xlabel(_axis(branch[over]))
    ax.set_ylabel("size of the multiplier")
    ax.legend(loc="best", fontsize="small")
    return ax


def remedy_bars(shares: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw what each parameter buys (`remedy.sensitivities`)."""
    if ax is None:
        ax = Figure(figsize=(6.5, 3.2), layout="constrained").subplots()
    order = np.argsort(np.abs(shares["buys"].values))
    names = [str(n).replace("_", " ") for n in shares["parameter"].values[order]]
    ax.barh(names, shares["buys"].values[order], color=BRANCH)
    ax.axvline(0.0, color="black", linewidth=0.8)
    unit = _unit(shares["buys"])
    ax.set_xlabel(f"{shares['buys'].attrs['long_name']}{f' ({unit})' if unit else ''}")
    return ax


def _unit(variable: xr.DataArray) -> str:
    unit = str(variable.attrs.get("units", "1"))
    return {"1": "", "degrees": "deg"}.get(unit, unit)


def _axis(variable: xr.DataArray) -> str:
    """Words of an axis; the values are drawn as they are stored."""
    return label(long_name(variable), _unit(variable))
