"""Friction force of a run on the Stribeck curve."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ...vocabulary import checks
from ...vocabulary.kinds import FRICTION_KINDS
from ..style.axes import axes_or_page, label, legend_below, page, shown
from ..style.caption import is_own, set_caption
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

    Raises: `ValueError` for a run without the friction law.
    """
    kind, (_, unit) = law_of(ds), shown(ds["friction_force"])
    stribeck = kind == "stribeck"
    ax, whole = axes_or_page(ax, (6.4, 5.0))
    slip = np.asarray(ds["slip_speed"], dtype=float)
    normal = np.asarray(ds["normal_force"], dtype=float)
    friction = np.asarray(ds["friction_force"], dtype=float)
    touching = normal > 1e-6 * normal.max(initial=0.0)  # at lift-off 0/0
    scale = 1.0 if normalised else float(normal[touching].mean()) if touching.any() else 0.0
    least = float(ds.attrs["stribeck_speed"]) if stribeck else 1e-6
    reach = 1.08 * max(np.abs(slip[touching]).max(initial=0.0), least)
    least = 1e-3 * reach  # rounding at the end of a stick is no slip
    low, high = (
        reach if (sign * slip[touching] > least).any() else 0.15 * reach for sign in (-1, 1)
    )
    speed = np.linspace(-low, high, 1001)
    speed = np.insert(speed, np.searchsorted(speed, 0.0), [-1e-12, 1e-12])
    law = -np.sign(speed) * coefficient(ds, np.abs(speed)) * scale
    curve = "Stribeck curve" if stribeck else "friction law"
    words = curve if normalised else "the same times mean normal force"
    ax.plot(speed, law, color="black", linewidth=1.0, zorder=2)
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
    handles = [Line2D([], [], color="black", linewidth=1.0, label=words), *_regime_dots(ds)]
    if whole:
        if legend:
            legend_below(ax.figure, handles)
        set_caption(ax.figure, ds)
    elif legend:
        ax.legend(handles=handles, loc="best", fontsize="small", framealpha=0.9)
    return ax


def _regime_dots(ds: xr.Dataset) -> list[Line2D]:
    """Legend entries of the regimes in contact that occur."""
    return [
        Line2D(
            [], [], marker="o", linestyle="", color=REGIMES.get(name, UNKNOWN), markersize=5,
            label=readable(name),
        )
        for name, _ in regime_masks(ds)
        if name != "flight"
    ]  # fmt: skip


def law_of(ds: xr.Dataset) -> str:
    """Kind of friction law (`kinds.FRICTIONS`) of a run.

    Raises: `ValueError` unless its attributes tell it, and its numbers.
    """
    law = ds.attrs.get("friction", "stribeck")
    if ":" in (kind := str(law).lower()):  # a class of one's own, of which a run has no curve
        laws = " and ".join(FRICTION_KINDS)
        raise ValueError(f"the run has no curve of its law, {law}: only {laws} can be drawn")
    needed = FRICTION_KINDS[checks.choice("friction", kind, FRICTION_KINDS)].keys.values()
    if missing := [name for name in needed if name not in ds.attrs]:
        only = "the friction law is known of laws of the package only"
        raise ValueError(f"the run has no {missing[0]}: {only}")
    return kind


def has_law(ds: xr.Dataset) -> bool:
    """Whether a run tells its friction law and its slip speed."""
    try:
        return bool(law_of(ds)) and "slip_speed" in ds
    except ValueError:
        return False


def coefficient(ds: xr.Dataset, speed: np.ndarray) -> np.ndarray:
    """mu at slip speeds >= 0 (m/s) by the law of a run (docs/model.md, section 4)."""
    return FRICTION_KINDS[law_of(ds)].of(ds.attrs, speed)


def friction_page(ds: xr.Dataset) -> np.ndarray:
    """Both forms of `friction_curve` beside each other. Returns: axes, shape (2,)."""
    figure = page((10.5, 4.8))
    axes = np.asarray(figure.subplots(1, 2))
    friction_curve(ds, axes[0], legend=False)
    friction_curve(ds, axes[1], normalised=False, legend=False)
    law = Line2D(
        [],
        [],
        color="black",
        linewidth=1.0,
        label="Stribeck curve (right: times mean normal force)",
    )
    legend_below(figure, [law, *_regime_dots(ds)])
    set_caption(figure, ds)
    return axes
