"""The map as a dataset: schema, coordinates, attributes, and what plain tools make of it."""

import json
import subprocess
import sys

import numpy as np
import pytest

import wiperjax
from wiperjax.datasets import map_dataset
from wiperjax.machine import provenance
from wiperjax.specs.load import parse_sweep
from wiperjax.store.whole import open_map, write_dataset
from wiperjax.vocabulary import cf, codes, schema
from wiperjax.vocabulary.codes import RESULTS


def small_spec(**changes):
    """Sweep of 4 x 3 x 5 cells."""
    data = {
        "title": "small",
        "axes": {
            "attack_angle": {"start": -40, "stop": 40, "num": 4},
            "normal_load": {"start": 5, "stop": 30, "num": 3},
            "belt_speed": {"start": 0.02, "stop": 1.0, "num": 5, "spacing": "geometric"},
        },
        "blade": {"shoulder_angle": 30.0},
        "run": {"transient": 0.2, "window": 0.1},
    }
    return parse_sweep(data | changes)


def columns_of(spec):
    index = np.arange(spec.size)
    return {
        "result": np.zeros(spec.size, dtype=int),
        "label": index % 7,
        "stick_fraction": np.sin(index),
        "impact_count": index * 10,
        "dominant_frequency": np.where(index % 5, 674.4, np.nan),
    }


def test_dimensions_coordinates_and_values():
    spec = small_spec()
    ds = map_dataset.assemble(spec, columns_of(spec))
    assert ds["stick_fraction"].dims == ("attack_angle", "normal_load", "belt_speed")
    assert ds.attack_angle.attrs == {"units": "degrees", "long_name": "attack angle"}
    assert ds.belt_speed.attrs["units"] == "m/s" and ds.normal_load.attrs["units"] == "N/m"
    np.testing.assert_array_equal(ds.attack_angle, np.linspace(-40, 40, 4))
    np.testing.assert_array_equal(ds.stick_fraction.values.ravel(), np.sin(np.arange(60)))
    assert ds.impact_count.sel(attack_angle=40, normal_load=30).values[-1] == 590
    assert "velocity_rms" not in ds
    assert all(ds[name].dtype == schema.SCHEMA[name].dtype for name in ds.data_vars)
    assert all("long_name" in ds[name].attrs for name in ds.variables)


def test_a_column_that_the_schema_does_not_know_is_named_not_dropped():
    spec = small_spec()
    columns = columns_of(spec) | {"unheard_of": np.zeros(spec.size), "velocity_rmss": 0.0}
    with pytest.raises(ValueError, match=r"SCHEMA, but unheard_of, velocity_rmss are not"):
        map_dataset.assemble(spec, columns)


def test_attributes_say_how_it_was_made():
    spec = small_spec()
    ds = map_dataset.assemble(spec, columns_of(spec), attributes=provenance.record("typed", 1.5))
    assert ds.attrs["Conventions"] == "CF-1.11"
    assert (
        ds.attrs["shoulder_angle"] == pytest.approx(30.0)
        and "shoulder_angle: degrees" in ds.attrs["parameter_units"]
    )
    assert (
        ds.attrs["tip_mass"] == 2.4e-3
        and ds.attrs["run_rtol"] == 1e-6
        and ds.attrs["run_solver"] == "dopri8"
    )
    np.testing.assert_array_equal(ds.attrs["class_squeal_band"], [500.0, 1000.0])
    assert (
        ds.attrs["belt_kind"] == "steady"
        and ds.attrs["command"] == "typed"
        and ds.attrs["wall_time"] == 1.5
    )
    assert parse_sweep(json.loads(ds.attrs["specification"])).digest() == spec.digest()
    assert ds.attrs["specification_digest"] == spec.digest()
    assert (
        provenance.version("jax") != "none"
        and provenance.version("wiperjax") == wiperjax.__version__
    )
    assert {"command", "date_created", "host", "wall_time"} <= set(ds.attrs)


def test_plain_xarray_opens_it_where_wiperjax_is_not_installed(tmp_path):
    spec = small_spec()
    ds = map_dataset.assemble(spec, columns_of(spec))
    ds.attrs["command"] = "ü" + "x" * 100_000  # longer than an HDF5 object header
    write_dataset(ds, tmp_path / "map.h5")
    script = (
        "import sys, xarray as xr\n"
        "ds = xr.open_dataset(sys.argv[1], engine='h5netcdf')\n"
        "assert not any('wiperjax' in name for name in sys.modules)\n"
        "assert ds.label.dtype == 'int8', ds.label.dtype\n"
        "assert ds.label.attrs['flag_meanings'].split()[1] == 'squeal'\n"
        "assert ds.label.attrs['flag_values'].dtype == 'int8'\n"
        "assert ds.impact_count.dtype == 'int32', ds.impact_count.dtype\n"
        "assert len(ds.attrs['command']) == 100001\n"
        "print(ds.sizes['belt_speed'])\n"
    )
    done = subprocess.run(
        [sys.executable, "-I", "-c", script, tmp_path / "map.h5"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "5"
    with open_map(tmp_path / "map.h5") as back:
        map_dataset.xr.testing.assert_identical(back.load(), ds)


def test_flags_are_those_of_the_engine():
    ds = map_dataset.assemble(small_spec(), columns_of(small_spec()))
    assert {name: code for code, name in cf.flag_names(ds.result).items()} == RESULTS
    assert {name: code for code, name in cf.flag_names(ds.label).items()} == codes.LABELS


def test_wrong_columns_are_refused():
    spec = small_spec()
    with pytest.raises(ValueError, match="column result must have the shape"):
        map_dataset.assemble(spec, {"result": np.zeros(59)})
    with pytest.raises(ValueError, match="result must fit int8"):
        map_dataset.assemble(spec, {"result": np.full(60, 300)})
    with pytest.raises(ValueError, match="steps must fit int32"):
        map_dataset.assemble(spec, {"steps": np.full(60, np.nan)})


def test_attributes_are_types_that_netcdf_can_hold():
    plain = cf.plain_attributes(
        {"a": True, "b": None, "c": [1, 2.5], "d": {"x": 1}, "e": "t", "f": 3, "g": []}
    )
    assert (
        "b" not in plain
        and plain["a"].dtype == np.int8
        and plain["d"] == '{"x": 1}'
        and plain["g"] == "[]"
    )
    np.testing.assert_array_equal(plain["c"], [1, 2.5])


def test_host_kind_is_no_host_name():
    import socket

    assert "cores" in provenance.host_kind() and socket.gethostname() not in provenance.host_kind()
