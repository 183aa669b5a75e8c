"""`bench sweep`: the sweep it asks for, and what its text says of made-up measurements."""

import math
import tomllib

import numpy as np
import pytest
import xarray as xr

from wiperjax.maps.cells import batch
from wiperjax.specs.load import parse_sweep
from wiperjax_bench.measurements import maps, sweep
from wiperjax_bench.reports import sweep_text


def test_the_file_says_the_sweep_of_so_many_cells():
    for cells, shape in sweep.GRIDS.items():
        asked = sweep.given(cells)
        assert tomllib.loads(sweep.file_of(asked)) == asked
        spec = parse_sweep(asked)
        assert spec.size == cells == math.prod(shape)
        assert spec.run.transient + spec.run.window == 0.1


def test_the_bare_engine_and_the_scalar_loop_have_the_cells_of_the_sweep():
    spec, some = parse_sweep(sweep.given(1000)), np.array([0, 17, 500, 999])
    scene = maps.scene_of(spec, some)
    built, position, velocity = batch.prepare(spec, some)
    for name in ("attack_angle", "normal_load"):
        np.testing.assert_array_equal(getattr(scene.wiper, name), getattr(built.wiper, name)[:4])
    np.testing.assert_allclose(scene.start[:, 0], np.asarray(position[0])[:4], rtol=1e-15)
    np.testing.assert_array_equal(scene.start[:, 2], np.asarray(velocity[0])[:4])
    assert scene.duration == 0.1


def test_the_text_gives_rates_and_shares():
    took = {"wall": 20.0, "cpu": 36.0, "start": 2.0, "compiling": 4.0, "engine": 12.0}
    took |= {"naming": 1.0, "storing": 1.0, "idle": 2.0, "bytes": 1e6}
    took |= {"bare_wall": 10.0, "bare_cpu": 18.0, "scalar_wall": 60.0, "scalar_cpu": 110.0}
    dataset = xr.Dataset(
        {name: (("cells", "repeat"), [[x, x, 1.1 * x]]) for name, x in took.items()},
        coords={"cells": [1000]},
        attrs={"motion": 0.1, "cores": 2, "machine": "m", "created": "c", "load": 0.0,
               "versions": "{}"},
    )  # fmt: skip
    row = next(line for line in sweep_text.text(dataset).splitlines() if line.startswith("| 1000"))
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    assert cells[1:7] == ["20.0", "2.00", "4.00", "12.00", "1.00", "1.00"]
    assert cells[7].startswith("14%")  # naming and storing, of all but start and compiling
    assert cells[8:11] == ["50", "100", "17"]
    assert [cell.split()[0] for cell in cells[11:]] == ["0.50", "3.00", "2.00"]


@pytest.mark.long
def test_the_command_is_measured_as_users_run_it():
    found = sweep.command(1000)
    told = ("start", "compiling", "engine", "naming", "storing")
    assert all(found[name] > 0 for name in told)
    assert found["start"] + found["compiling"] + found["engine"] < found["wall"]
    # Nothing is untold; blocks overlap, so all together may be more than has passed
    assert sum(found[name] for name in told) > (1 - 1e-9) * found["wall"]
