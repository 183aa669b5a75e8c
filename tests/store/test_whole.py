"""Finished maps opened."""

import tomllib
from pathlib import Path

import h5py
import pytest
import stub_sweep as stub
import xarray as xr

from wiperjax.machine.files import StoreError
from wiperjax.store import checksums
from wiperjax.store.manifest import parts_of
from wiperjax.store.whole import open_map, write_dataset


def test_files_that_are_no_maps(tmp_path):
    with pytest.raises(StoreError, match="does not exist"):
        open_map(tmp_path / "none.h5")
    for content in (b"", b"\x89HDF\r\n\x1a\n", b"text"):
        (tmp_path / "bad.h5").write_bytes(content)
        with pytest.raises(StoreError, match="bad.h5: is not a readable map"):
            open_map(tmp_path / "bad.h5")


def test_a_map_opens_with_the_variables_that_are_asked_for(tmp_path):
    path, axes = tmp_path / "map.h5", {"attack_angle", "normal_load", "belt_speed"}
    stub.run(stub.make_spec(), path)
    with open_map(path, ["label", "steps"]) as ds:
        assert set(ds.data_vars) == {"label", "steps"} and set(ds.coords) == axes
    with h5py.File(path, "r+"):  # which is refused while it is open for reading
        path.unlink()
    stub.half_done(path, stub.make_spec(), 3)
    stub.run(stub.make_spec(), tmp_path / "other.h5")
    for held in (parts_of(path), tmp_path / "other.h5"):
        with pytest.raises(StoreError, match=r"'labl' is not in this file; did you mean label\?$"):
            open_map(held, ["labl"])


def test_cells_that_a_joined_map_does_not_have_are_saved_without_a_class(tmp_path):
    """Saved in the type of the file, int8, NaN would be 0: quiet."""
    path, joined = tmp_path / "map.h5", tmp_path / "joined.h5"
    stub.run(stub.make_spec(), path)
    with open_map(path) as ds:
        parts = ds.isel(belt_speed=[0]), ds.isel(belt_speed=slice(1, None))
        over = xr.DataArray([0.1, 0.2], dims="stiffness", name="stiffness")
        xr.concat(parts, over, join="outer").to_netcdf(joined, engine="h5netcdf")
    with open_map(joined) as found:
        lacks, codes = found["velocity_rms"].isnull(), found["label"]
        assert lacks.sum() == ds["label"].size
        assert codes.isnull().equals(lacks)
    with open_map(path) as ds:  # what is whole stays as it was
        ds.to_netcdf(joined, engine="h5netcdf")
        with open_map(joined) as found:
            assert {n: x.dtype for n, x in found.items()} == {n: x.dtype for n, x in ds.items()}


def test_of_two_programs_that_write_one_new_file_the_later_is_told(tmp_path, monkeypatch):
    path, run = tmp_path / "run.h5", xr.Dataset({"position": ("time", [1.0])})
    monkeypatch.setattr(checksums, "add", lambda buffer: path.write_bytes(b"precious"))
    with pytest.raises(StoreError, match="was made by another program meanwhile"):
        write_dataset(run, path)
    assert path.read_bytes() == b"precious"
    write_dataset(run, path, force=True)


def test_no_xarray_is_allowed_that_cannot_write_a_file_in_memory():
    """Before 2025.8 it refuses h5netcdf there, and writes by scipy, which knows no HDF5."""
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())
    (bound,) = (line for line in project["project"]["dependencies"] if line.startswith("xarray"))
    lowest = tuple(map(int, bound.removeprefix("xarray>=").split(".")))
    assert lowest >= (2025, 8)
