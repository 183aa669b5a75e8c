"""Maps whose borders are known: their engine is a formula, of the class at any point."""

import numpy as np

from wiperjax.maps import driver
from wiperjax.maps.refine.driver import refine
from wiperjax.specs.load import parse_sweep

AXES = {
    "attack_angle": {"start": -40, "stop": 40, "num": 9},
    "normal_load": {"start": 5, "stop": 30, "num": 6},
    "belt_speed": {"start": 0.1, "stop": 0.9, "num": 9},
}


def border_spec(axes=("attack_angle", "belt_speed"), **tables):
    """Sweep of some of the axes above."""
    return parse_sweep(
        {"axes": {n: AXES[n] for n in axes}, "run": {"transient": 0.2, "window": 0.2}} | tables
    )


def unit(spec, index):
    """Axes of cells from 0 to 1, (axes, cells)."""
    cells = spec.cells(np.asarray(index))
    found = []
    for name in [name for name in AXES if name in spec.axes]:
        low, high = spec.axes[name].values()[[0, -1]]
        if name == "attack_angle":
            low, high = np.deg2rad(low), np.deg2rad(high)
        found.append((cells[name] - low) / (high - low))
    return np.array(found)


def engine(frequency, settled=None):
    """`evaluate` of cells whose frequency [Hz] and mechanism are told by `frequency(*unit)`: a
    frequency, or (frequency, share of stick). `settled` likewise, with the cell's window.
    """

    def evaluate(spec, index, finer=1, room=None):
        axes = unit(spec, index)
        told = frequency(*axes)
        pitch, stick = told if isinstance(told, tuple) else (told, 0.0)
        count = len(index)
        sure = 1 if settled is None else settled(spec.run.window, *axes)
        return {
            "result": np.zeros(count, int),
            "velocity_rms": np.full(count, 0.2),
            "belt_speed_rms": np.full(count, 0.5),
            "stick_fraction": np.broadcast_to(stick, count),
            "flight_fraction": np.zeros(count),
            "dominant_frequency": np.broadcast_to(pitch, count).astype(float),
            "settled": np.broadcast_to(sure, count).astype(int),
            "final_time": np.full(count, spec.run.transient + spec.run.window),
        }

    return evaluate


def coarse_map(path, evaluate, **options):
    """A finished map at `path`; returns its specification."""
    spec = border_spec(**options)
    driver.sweep(spec, path, evaluate=evaluate, progress=False).close()
    return spec


def refined(path, evaluate, **settings):
    """Borders of the map at `path`."""
    return refine(path, evaluate=evaluate, progress=False, **settings)


def places_of(grid, values):
    """Places (points, dim) in steps of a grid of values of its axes, edge units."""
    found = []
    for name in grid.names:
        along, rank = grid.along[name], np.arange(grid.shape[grid.names.index(name)], dtype=float)
        if along[0] > along[-1]:
            along, rank = along[::-1], rank[::-1]
        found.append(np.interp(np.asarray(values[name], dtype=float), along, rank))
    return np.stack(found, axis=-1)
