"""Shares along one axis of a map, a step for each cell."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from ..style.axes import edges
from ..style.palette import CLASSES, HATCHES, REGIMES, readable
from .categories import class_swatch, row_runs
from .numbers import told

SHARES = {"stick": "stick", "slip": "slip_pos", "flight": "flight"}


def regime_shares(line: xr.Dataset, ax: Axes, across: np.ndarray, names: np.ndarray) -> list:
    """Shares of the regimes; cells that ended early have none and are hatched."""
    parts = {name: told(line, f"{name}_fraction").values for name in SHARES}
    seen = {name: part for name, part in parts.items() if (np.nan_to_num(part) > 0).any()}
    handles = stacked(
        ax, across, list(seen.values()), [REGIMES[SHARES[name]] for name in seen],
        [f"share of {name}" for name in seen], linewidth=0,
    )  # fmt: skip
    borders = edges(across)
    for name in [name for name in HATCHES if name in names]:
        hatch, edge = HATCHES[name]
        _, first, stop = row_runs((names == name)[None])
        for a, b in zip(borders[first], borders[stop], strict=True):
            ax.axvspan(a, b, facecolor=CLASSES[name], edgecolor=edge, hatch=hatch, linewidth=0)
        handles.append(class_swatch(name, readable(name), CLASSES[name]))
    ax.set_ylabel("share of time")
    return handles


def stacked(
    ax: Axes, across: np.ndarray, parts: list[np.ndarray], colours: list[str], labels: list[str],
    **look: Any,
) -> list:  # fmt: skip
    """Shares on top of each other, as wide as their cells: a cell is seen beside any other."""
    tops = np.cumsum([np.zeros(across.size), *parts], axis=0)
    ax.set_ylim(0, 1)
    return [
        ax.stairs(top, edges(across), baseline=low, fill=True, facecolor=colour, label=text, **look)
        for low, top, colour, text in zip(tops, tops[1:], colours, labels, strict=False)
    ]
