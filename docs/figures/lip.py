"""Draws `lip.svg`, the figure of docs/model.md: `python docs/figures/lip.py`."""

from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Arc, Rectangle

INK, GREY, FORCE, BELT = "#222222", "#777777", "#b5322b", "#cfe3ee"
LENGTH, PHI, ALPHA, GAP = 3.4, np.radians(38), np.radians(13), 0.62
TIP = np.array([LENGTH * np.sin(PHI), GAP])
HINGE = np.array([0.0, GAP + LENGTH * np.cos(PHI)])


def arrow(ax, start, end, color=INK, style="-|>", width=1.3):
    """An arrow from ``start`` to ``end``; style ``<->`` for a dimension."""
    shape = {"arrowstyle": style, "color": color, "lw": width, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", end, start, arrowprops={**shape, "mutation_scale": 13})


def spring(ax, x, low, high):
    """A helical spring between two heights."""
    heights = np.linspace(low, high, 41)
    ends = (heights < low + 0.15 * (high - low)) | (heights > high - 0.15 * (high - low))
    wave = 0.16 * np.where(ends, 0, [0, 1, 0, -1] * 10 + [0])
    ax.plot(x + wave, heights, color=INK, lw=1.2)


def dashpot(ax, x, low, high):
    """A piston in an open cylinder between two heights."""
    middle = 0.5 * (low + high)
    ax.plot([x, x], [low, middle - 0.2], color=INK, lw=1.2)
    low_end, high_end = middle - 0.2, middle + 0.22
    cup = ([x - 0.16, x - 0.16, x + 0.16, x + 0.16], [high_end, low_end, low_end, high_end])
    ax.plot(*cup, color=INK, lw=1.2)
    ax.plot([x - 0.11, x + 0.11], [middle, middle], color=INK, lw=2)
    ax.plot([x, x], [middle, high], color=INK, lw=1.2)


def holder(ax):
    """The arm, held still, its preload, and what carries the hinge along the normal."""
    base, arm = HINGE[1] + 0.42, HINGE[1] + 1.75
    ax.add_patch(
        Rectangle((-1.0, arm), 2.0, 0.22, facecolor="#dddddd", edgecolor=INK, hatch="////")
    )
    ax.plot([-0.7, 0.7], [base, base], color=INK, lw=2)
    ax.plot([0, 0], [HINGE[1], base], color=INK, lw=2)
    spring(ax, -0.6, base, arm)
    dashpot(ax, 0.6, base, arm)
    ax.text(-0.88, 0.5 * (base + arm), "$k$", ha="right", va="center")
    ax.text(0.88, 0.5 * (base + arm), "$c$", ha="left", va="center")
    ax.text(1.15, arm + 0.09, "arm, held still", ha="left", va="center", color=GREY, size=10)
    arrow(ax, (0, arm - 0.05), (0, base + 0.03), FORCE)
    ax.text(0.08, 0.5 * (base + arm), "$F$", color=FORCE, ha="left", va="center")


def lip(ax):
    """The rod between hinge and tip, the masses at its ends, and the spring that bends it."""
    ax.plot(*np.transpose([HINGE, TIP]), color=INK, lw=4, solid_capstyle="round")
    turn = np.linspace(0, 2.6 * np.pi, 120)
    spiral = (0.1 + 0.028 * turn) * np.array([np.sin(turn + ALPHA), -np.cos(turn + ALPHA)])
    ax.plot(*(HINGE[:, None] + spiral), color=INK, lw=1)
    ax.plot(*HINGE, "o", color="white", mec=INK, ms=9, mew=1.6)
    ax.plot(*TIP, "o", color=INK, ms=9)
    ax.text(HINGE[0] - 0.5, HINGE[1] - 0.02, "$M_h$", ha="right", va="center")
    ax.text(TIP[0] + 0.2, TIP[1] + 0.18, "$m$", ha="left", va="center")
    middle = 0.62 * HINGE + 0.38 * TIP
    ax.text(middle[0] + 0.14, middle[1] + 0.12, "$L$", ha="left", va="bottom")
    ax.text(-0.42, HINGE[1] - 0.42, "$M(\\theta)$", ha="right", va="center")


def angles(ax):
    """phi of the lip and alpha of the undeformed blade, from the glass normal."""
    ax.plot([0, 0], [HINGE[1], 0], color=GREY, lw=1, ls=(0, (6, 3)))
    rest = HINGE + 3.0 * np.array([np.sin(ALPHA), -np.cos(ALPHA)])
    ax.plot(*np.transpose([HINGE, rest]), color=GREY, lw=1, ls=(0, (2, 2)))
    for radius, angle, text in ((2.55, ALPHA, "$\\alpha$"), (1.55, PHI, "$\\varphi$")):
        size = 2 * radius
        ax.add_patch(Arc(HINGE, size, size, angle=-90, theta2=np.degrees(angle), color=INK, lw=1))
        place = HINGE + (radius + 0.2) * np.array([np.sin(0.5 * angle), -np.cos(0.5 * angle)])
        ax.text(*place, text, ha="center", va="center")


def glass(ax):
    """The belt, the frame of reference and the forces of contact."""
    ax.add_patch(Rectangle((-2.0, -0.45), 6.2, 0.45, facecolor=BELT, edgecolor="none"))
    ax.plot([-2.0, 4.2], [0, 0], color=INK, lw=1.6)
    arrow(ax, (-1.7, -0.22), (-0.5, -0.22), width=2)
    ax.text(-0.35, -0.24, "$V(t)$", ha="left", va="center")
    ax.text(4.1, -0.24, "glass", ha="right", va="center", color=GREY, size=10)
    arrow(ax, (0, 0.2), (TIP[0], 0.2), GREY, "<|-|>", 1)
    ax.text(0.62 * TIP[0], 0.27, "$x$", ha="center", va="bottom")
    arrow(ax, (TIP[0], 0), (TIP[0], TIP[1] - 0.06), GREY, "<|-|>", 1)
    ax.text(TIP[0] + 0.1, 0.3, "$y$", ha="left", va="center")
    arrow(ax, (-1.45, 0), (-1.45, HINGE[1]), GREY, "<|-|>", 1)
    ax.plot([-1.6, -0.9], [HINGE[1]] * 2, color=GREY, lw=0.8)
    ax.text(-1.55, 0.5 * HINGE[1], "$\\eta$", ha="right", va="center")
    arrow(ax, TIP + (1.15, -0.55), TIP + (1.15, 0.55), FORCE)
    ax.text(*(TIP + (1.25, 0.45)), "$\\lambda_n$", color=FORCE, ha="left", va="center")
    arrow(ax, TIP + (1.15, -0.55), TIP + (2.0, -0.55), FORCE)
    ax.text(*(TIP + (2.0, -0.4)), "$\\lambda_t$", color=FORCE, ha="center", va="bottom")


def main():
    plt.rcParams.update({"font.size": 13, "svg.hashsalt": "lip", "mathtext.fontset": "stix"})
    figure, ax = plt.subplots(figsize=(6.4, 6.0))
    for part in (glass, angles, holder, lip):
        part(ax)
    ax.set(xlim=(-2.1, 4.4), ylim=(-0.55, HINGE[1] + 2.1), aspect="equal")
    ax.axis("off")
    target = Path(__file__).with_suffix(".svg")
    figure.savefig(target, bbox_inches="tight", facecolor="white", metadata={"Date": None})


if __name__ == "__main__":
    matplotlib.use("Agg")
    main()
