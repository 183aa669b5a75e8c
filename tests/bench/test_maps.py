"""`bench maps`: its picture and text say what was measured."""

import numpy as np
import pytest
import xarray as xr

from wiperjax_bench.measurements.maps import COMPARED
from wiperjax_bench.reports import maps_plot, maps_text


@pytest.fixture
def measured():
    """Two settings of the sweep's method and one of the loop, which names a cell otherwise."""
    rows = 3
    numbers = {f"{name}_p90": [1e-4, 1e-6, 1e-5] for name in COMPARED}
    numbers |= {"rtol": [1e-4, 1e-6, 1e-4], "cpu": [1e-3, 2e-3, 4e-3], "steps": [1e3] * rows}
    numbers |= {"wrong": [0.0] * rows, "wrong_settled": [0, 0, 0.01], "failed": [0.0] * rows}
    texts = {
        "code": ["engine", "engine", "scalar"],
        "solver": ["dopri8", "dopri8", "tsit5"],
        "precision": ["float64"] * rows,
    }
    attrs = {"cells": 100, "references": "two", "undecided": 0.0, "machine": "m", "load": 0.0}
    return xr.Dataset(
        {name: ("row", values) for name, values in (numbers | texts).items()},
        attrs=attrs | {"created": "now", "versions": "{}"},
    )


def curves(ax):
    return {line.get_label(): line.get_xydata() for line in ax.lines}


def test_error_over_cells_a_second(measured):
    (ax,) = maps_plot.draw(measured).axes
    found = curves(ax)
    np.testing.assert_allclose(found["engine, Dopri8"], [[1000, 1e-4], [500, 1e-6]])
    np.testing.assert_allclose(found["some class is another"], [[250, 1e-5]])
    assert "| engine | dopri8 | float64 | 1e-06 |" in maps_text.text(measured, "maps.png")
    assert "| 500 |" in maps_text.text(measured, "maps.png")


def test_a_plane_costs_its_simulations_at_the_setting_of_a_sweep(measured, tmp_path):
    borders = xr.Dataset(
        {
            "method": ("row", ["full grid", "refined map"]),
            "simulations": ("row", [10_000, 1000]),
            "wrong": ("row", [0.01, 0.0]),
        },
        attrs={"points": 500},
    )
    borders.to_netcdf(tmp_path / "borders.h5", engine="h5netcdf")
    _, right = maps_plot.draw(measured, tmp_path / "borders.h5").axes
    found = curves(right)
    np.testing.assert_allclose(found["full grid"], [[20.0, 10.0]])
    np.testing.assert_allclose(found["refined map"], [[2.0, 1.0]])  # half a point of 500
