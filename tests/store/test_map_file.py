"""Finished files: chunks, netCDF, memory, and writes that are lost."""

import tracemalloc

import h5py
import numpy as np
import pytest
from stub_sweep import assert_same_map, block_files, make_spec, run, with_events

from wiperjax.machine.files import StoreError
from wiperjax.maps import driver
from wiperjax.store import map_file


@pytest.mark.parametrize(
    "shape",
    [
        (41, 11, 21),
        (100, 100, 100),
        (5,),
        (10**6,),
        (1000, 1000),
        (3, 4, 5, 6, 70),
        (2, 3000, 3000),
    ],
)
def test_slabs_cover_the_map_once_in_order_and_chunks_fit_in_them(shape):
    chunk = map_file.chunk_shape(shape)
    assert (
        all(1 <= c <= n for c, n in zip(chunk, shape, strict=True))
        and np.prod(chunk) <= map_file.CHUNK_CELLS
    )
    position = 0
    for start, stop, index in map_file.slabs(shape, chunk):
        assert start == position and stop - start <= map_file.SLAB_CELLS
        extents = [part.stop - part.start for part in index]
        assert stop - start == np.prod(extents)
        assert start == np.ravel_multi_index([part.start for part in index], shape)
        for part, c, n in zip(index, chunk, shape, strict=True):
            assert part.start % c == 0 and (part.stop % c == 0 or part.stop == n)
        position = stop
    assert position == np.prod(shape)


def test_a_map_larger_than_a_slab_is_put_together_right(tmp_path, monkeypatch):
    monkeypatch.setattr(map_file, "SLAB_CELLS", 40)
    monkeypatch.setattr(map_file, "CHUNK_CELLS", 16)
    assert_same_map_of = make_spec()
    run(assert_same_map_of, tmp_path / "map.h5", block=33)
    assert_same_map(tmp_path / "map.h5", assert_same_map_of)


def test_the_netcdf_library_itself_reads_a_map(tmp_path):
    """Types, dimensions and attributes as netCDF has them, not as HDF5 would also allow."""
    netcdf = pytest.importorskip("netCDF4")
    spec, path = make_spec(event_log=5), tmp_path / "map.h5"
    ds = run(spec, path, evaluate=with_events)
    with netcdf.Dataset(path) as file:
        file.set_auto_mask(False)
        assert file.data_model == "NETCDF4" and file.Conventions == "CF-1.11"
        sizes = {name: len(dim) for name, dim in file.dimensions.items()}
        assert sizes == {"attack_angle": 7, "normal_load": 5, "belt_speed": 11, "event": 5}
        assert not any(dim.isunlimited() for dim in file.dimensions.values())
        for name, variable in file.variables.items():
            np.testing.assert_array_equal(variable[...], ds[name].values)
            assert variable.long_name and isinstance(variable.dtype, np.dtype)
            if "flag_values" in variable.ncattrs():
                values = np.atleast_1d(variable.flag_values)
                assert values.dtype == variable.dtype
                assert len(values) == len(variable.flag_meanings.split())
            else:
                assert variable.units
        assert file["event_time"].filters()["zlib"] and file["event_time"].chunking()[-1] == 5
        for name in ("specification_text", "versions", "host", "date_created", "seed", "command"):
            assert isinstance(getattr(file, name), str), name
        assert file.wall_time > 0


def test_a_write_that_is_lost_is_noticed(tmp_path, monkeypatch):
    """Of h5netcdf (it drops what lies past the end of a dimension) or of the disk."""
    import h5netcdf

    spec, path = make_spec(), tmp_path / "map.h5"
    true_write = h5netcdf.Variable.__setitem__

    def losing(self, key, value):
        if self.name != "/steps":
            true_write(self, key, value)

    with monkeypatch.context() as patch:
        patch.setattr(h5netcdf.Variable, "__setitem__", losing)
        with pytest.raises(StoreError, match="steps reads back otherwise than it was written"):
            run(spec, path)
    assert not path.exists() and len(block_files(path)) == 8

    class Lossy(map_file.SpillFile):
        def write(self, data):
            if len(memoryview(data).cast("B")) < 1000:
                return super().write(data)
            self._place += len(data)
            self._size = max(self._size, self._place)
            return len(data)

    with monkeypatch.context() as patch:
        patch.setattr(map_file, "SpillFile", Lossy)
        with pytest.raises(StoreError, match="^[^\n]*map.h5[^\n]*$"):
            run(spec, path, resume=True)
    assert not path.exists() and len(block_files(path)) == 8
    run(spec, path, resume=True)
    assert_same_map(path, spec)


@pytest.mark.long
def test_memory_is_that_of_a_block(tmp_path, monkeypatch):
    """The same peak for 2 500 cells and for 25 000, event log included, but for the record of
    checksums: 2 kB for each of its chunks, which here have 500 numbers and ordinarily 32 768.
    """
    monkeypatch.setattr(map_file, "SLAB_CELLS", 2000)
    monkeypatch.setattr(map_file, "CHUNK_CELLS", 500)

    def peak(angles):
        spec = make_spec(angles, 50, 10, event_log=20, samples=16)
        tracemalloc.start()
        with driver.sweep(
            spec, tmp_path / f"{angles}.h5", evaluate=with_events, block=500, progress=False
        ):
            found = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return found

    peak(2)  # imports
    small, large = peak(5), peak(50)
    with h5py.File(tmp_path / "50.h5") as file:
        chunks = sum(file[name].id.get_num_chunks() for name in file if file[name].chunks)
    assert large < 1.25 * small + 2000 * chunks, (small, large, chunks)
