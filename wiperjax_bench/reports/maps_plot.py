"""The picture of `wiperjax bench maps`: what a map stores, and how right, over what it costs."""

from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ..measurements.maps import COMPARED
from .borders_page import MARKS

STYLES = {
    ("engine", "tsit5", "float64"): ("engine, Tsit5", "#D55E00", "o-"),
    ("engine", "tsit5", "float32"): ("engine, Tsit5 in float32", "#D55E00", "o:"),
    ("engine", "dopri8", "float64"): ("engine, Dopri8", "#E69F00", "s-"),
    ("engine", "bosh3", "float64"): ("engine, Bosh3", "#CC79A7", "^-"),
    ("scalar", "tsit5", "float64"): ("scalar loop, Tsit5", "#000000", "D-"),
}
DEFAULT = ("engine", "dopri8", "float64", 1e-6)  # of a sweep
STORED = tuple(name for name in COMPARED if name != "dominant_frequency")  # that is its samples'


def draw(dataset: xr.Dataset, beside: Path | None = None):
    """Return the figure: error of the worst variable over cells a second; and, of ``beside`` (the
    dataset of `bench borders`), wrong classes of a plane over the seconds that its map takes.
    """
    if beside is None or not beside.is_file():
        figure = Figure(figsize=(5.6, 4.4), layout="constrained")
        _settings(figure.subplots(), dataset)
        return figure
    figure = Figure(figsize=(9.6, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    _settings(left, dataset)
    with xr.open_dataset(beside, engine="h5netcdf") as borders:
        _planes(right, borders, _cost(dataset))
    return figure


def _settings(ax, dataset: xr.Dataset) -> None:
    worst = np.max([dataset[f"{name}_p90"].values for name in STORED], axis=0)
    rates = 1 / dataset.cpu.values
    keys = list(zip(*(dataset[n].values for n in ("code", "solver", "precision")), strict=True))
    for key, (label, colour, mark) in STYLES.items():
        here = [i for i, other in enumerate(keys) if tuple(map(str, other)) == key]
        if not here:
            continue
        ax.loglog(rates[here], worst[here], mark, color=colour, label=label, markersize=4)
        for i in here:
            tolerance = f"{dataset.rtol.values[i]:.0e}".replace("e-0", "e-")
            ax.annotate(tolerance, (rates[i], worst[i]), xytext=(4, 3),
                        textcoords="offset points", fontsize=6, color=colour)  # fmt: skip
    wrong = dataset.wrong_settled.values > 0
    ax.loglog(rates[wrong], worst[wrong], "o", mfc="none", color="#999999", markersize=11,
              label="some class is another")  # fmt: skip
    ax.set_xlabel("cells a second of one core (0.8 s of motion each)")
    ax.set_ylabel("error of the worst variable (90 % of cells)")
    ax.legend(frameon=False, fontsize=7)
    ax.grid(alpha=0.3)


def _cost(dataset: xr.Dataset) -> float:
    """Seconds of a core of a cell at the setting nearest to that of a sweep."""
    code, solver, precision, rtol = DEFAULT
    alike = (dataset.code == code) & (dataset.solver == solver) & (dataset.precision == precision)
    here = np.flatnonzero(alike.values)
    if not len(here):
        return float(dataset.cpu[0])
    off = np.abs(np.log(dataset.rtol.values[here] / rtol))
    return float(dataset.cpu.values[here[np.argmin(off)]])


def _planes(ax, borders: xr.Dataset, cost: float) -> None:
    floor = 500 / int(borders.attrs["points"])
    for method, mark in MARKS.items():
        some = borders.isel(row=np.flatnonzero(borders.method.values == method))
        if some.sizes["row"]:
            wrong = np.maximum(1000 * some.wrong.values, floor)
            ax.loglog(cost * some.simulations, wrong, mark, label=method, markersize=4)
    ax.axhline(floor, color="#999999", linewidth=0.8, linestyle=":")
    ax.set_xlabel("seconds of one core for a map of a plane")
    ax.set_ylabel("wrong classes in 1000 random points of the plane")
    ax.legend(frameon=False, fontsize=7)
    ax.grid(alpha=0.3)
