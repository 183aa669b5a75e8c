"""Friction force of a run over its slip speed, on its law."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ...datasets.stated import is_own
from ...vocabulary.kinds import FRICTION_KINDS
from ..style.axes import axes_or_page, label, legend_below, page, shown
from ..style.caption import set_caption
from ..style.palette import REGIMES, UNKNOWN, readable
from .portrait import regime_masks


def friction_curve(
    ds: xr.Dataset, ax: Axes | None = None, *, normalised: bool = True, legend: bool = True
) -> Axes:
    """Friction force over slip speed, coloured by regime, on the law of a run.

    Arguments:

    - `ds`: a run of a scene, or of a `Wiper`.
    - `normalised`: friction over normal force, on the law itself: every sample lies on it, or in
        stick on the upright bar at zero slip. Otherwise the forces (N/m), on the law times the mean
        normal force: the loop is what a changing normal force makes of it.
    - `legend`: whether to name regimes and law in the axes.

    Slip speed is that of the contact over its partner, of a tip x' - V; friction opposes it. In
    flight there is no force, and no point.

    Of a law that the run does not tell (one's own, say) the samples are drawn alone.
    """
    _, unit = shown(ds["friction_force"])
    ax, whole = axes_or_page(ax, (6.4, 5.0))
    slip = np.asarray(ds["slip_speed"], dtype=float)
    normal = np.asarray(ds["normal_force"], dtype=float)
    friction = np.asarray(ds["friction_force"], dtype=float)
    touching = normal > 1e-6 * normal.max(initial=0.0)  # at lift-off 0/0
    scale = 1.0 if normalised else float(normal[touching].mean()) if touching.any() else 0.0
    speed, law = law_over(ds, slip[touching])
    ax.plot(speed, scale * law, color="black", linewidth=1.0, zorder=2)
    shown_force = friction / np.where(touching, normal, np.nan) if normalised else friction
    for name, mask in regime_masks(ds):
        chosen = mask & touching
        if chosen.any():
            ax.plot(
                slip[chosen],
                shown_force[chosen],
                ".",
                color=REGIMES.get(name, UNKNOWN),
                markersize=4,
                markeredgewidth=0,
                zorder=3,
                rasterized=chosen.sum() > 20_000,
            )
    ax.axhline(0, color="#999999", linewidth=0.6, zorder=1)
    ax.set_xlim(speed[0], speed[-1])
    ax.set_xlabel("slip speed (m/s)" if is_own(ds) else "slip speed, tip over glass (m/s)")
    ax.set_ylabel("friction force / normal force" if normalised else label("friction force", unit))
    handles = _handles(ds, "" if normalised else " times mean normal force")
    if whole:
        if legend:
            legend_below(ax.figure, handles)
        set_caption(ax.figure, ds)
    elif legend:
        ax.legend(handles=handles, loc="best", fontsize="small", framealpha=0.9)
    return ax


def _handles(ds: xr.Dataset, scaled: str) -> list[Line2D]:
    """Legend entries: the law, if it is known, and what it is `scaled` by; the regimes in contact
    that occur."""
    kind = law_of(ds)
    words = ("Stribeck curve" if kind == "stribeck" else "friction law") + scaled
    line = Line2D([], [], color="black", linewidth=1.0, label=words)
    return [line] * bool(kind) + [
        Line2D(
            [], [], marker="o", linestyle="", color=REGIMES.get(name, UNKNOWN), markersize=5,
            label=readable(name),
        )
        for name, _ in regime_masks(ds)
        if name != "flight"
    ]  # fmt: skip


def law_of(ds: xr.Dataset) -> str:
    """Kind of friction law (`kinds.FRICTION_KINDS`) of a run; empty of one of one's own, and where
    its numbers are not told.
    """
    law = str(ds.attrs.get("friction", "stribeck")).lower()
    known = law in FRICTION_KINDS and ds.attrs.keys() >= {*FRICTION_KINDS[law].keys.values()}
    return law if known else ""


def law_over(ds: xr.Dataset, slip: np.ndarray, count: int = 1001) -> tuple[np.ndarray, np.ndarray]:
    """The law under samples that touch, as a curve.

    Arguments:

    - `slip`: slip speeds (m/s) of the samples.
    - `count`: points of the curve, about.

    Returns: slip speeds (m/s) that reach a little beyond those, and friction over normal force
        there; NaN of a law that the run does not tell.
    """
    least = float(ds.attrs["stribeck_speed"]) if law_of(ds) == "stribeck" else 1e-6
    reach = 1.08 * max(np.abs(slip).max(initial=0.0), least)
    sliding = 1e-3 * reach  # rounding at the end of a stick is no slip
    low, high = (reach if (sign * slip > sliding).any() else 0.15 * reach for sign in (-1, 1))
    speed = np.linspace(-low, high, count)
    speed = np.insert(speed, np.searchsorted(speed, 0.0), [-1e-12, 1e-12])
    return speed, -np.sign(speed) * coefficient(ds, np.abs(speed))


def coefficient(ds: xr.Dataset, speed: np.ndarray) -> np.ndarray:
    """mu at slip speeds >= 0 (m/s) by the law of a run (docs/model.md, section 4); NaN of one that
    it does not tell.
    """
    kind = law_of(ds)
    return FRICTION_KINDS[kind].of(ds.attrs, speed) if kind else np.full_like(speed, np.nan)


def friction_page(ds: xr.Dataset) -> np.ndarray:
    """Both forms of `friction_curve` beside each other. Returns: axes, shape (2,)."""
    figure = page((10.5, 4.8))
    axes = np.asarray(figure.subplots(1, 2))
    friction_curve(ds, axes[0], legend=False)
    friction_curve(ds, axes[1], normalised=False, legend=False)
    legend_below(figure, _handles(ds, " (right: times mean normal force)"))
    set_caption(figure, ds)
    return axes
