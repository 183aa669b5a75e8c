"""What a sweep says it will take: bytes that are those of its blocks, and refusals before any work.

The bytes of cells that the engine really computed are compared in `test_lanes` and
`test_sensitivity`, which compute them anyway.
"""

import collections
import math
import os

import numpy as np
import pytest
from stub_sweep import evaluate, make_spec

from wiperjax.machine.files import StoreError
from wiperjax.maps import driver, estimate
from wiperjax.store.blocks import BlockStore
from wiperjax.store.manifest import parts_of

BIG = {"angles": 1000, "loads": 1000, "speeds": 1000}


def free(monkeypatch, count):
    usage = collections.namedtuple("usage", "total used free")
    monkeypatch.setattr(estimate.shutil, "disk_usage", lambda path: usage(2 * count, count, count))


def a_cell(spec):
    """Bytes of a cell that are not packed: `test_lanes` holds them against those of a block."""
    return estimate.bytes_of_a_cell(spec)[0]


def test_a_sweep_that_no_disk_holds_is_refused_before_its_first_cell(tmp_path, monkeypatch):
    spec, path = make_spec(**BIG), tmp_path / "map.h5"
    free(monkeypatch, 5 * 10**10)
    with pytest.raises(StoreError) as refused:
        driver.sweep(spec, path, evaluate=pytest.fail, progress=False)
    assert str(refused.value) == (
        f"{path}: cannot be written: No space left on device: {a_cell(spec)} GB are needed at "
        "least until it is finished, but 50 GB are free"
    )
    assert list(tmp_path.iterdir()) == []


def test_what_is_done_needs_no_room_again(tmp_path, monkeypatch):
    spec, path = make_spec(), tmp_path / "map.h5"

    def stopping(spec, index):
        if index[0] >= 350:
            raise KeyboardInterrupt
        return evaluate(spec, index)

    with pytest.raises(driver.SweepInterrupted):
        driver.sweep(spec, path, evaluate=stopping, block=50, progress=False)
    free(monkeypatch, 35 * a_cell(spec))  # of 385 cells
    driver.sweep(spec, path, evaluate=evaluate, resume=True, progress=False).close()
    path.unlink()
    with pytest.raises(StoreError, match=f"device: {385 * a_cell(spec) / 1000:.3g} kB are"):
        driver.sweep(spec, path, evaluate=pytest.fail, progress=False)
    assert not parts_of(path).exists()


def test_a_map_that_no_memory_holds_is_refused(monkeypatch):
    monkeypatch.setattr(os, "sysconf", {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 2**20}.get)
    spec = make_spec(**BIG)
    refused = f"^output must name a file, but was None: the {a_cell(spec)} GB of"
    with pytest.raises(StoreError, match=refused):
        driver.sweep(spec, evaluate=pytest.fail, progress=False)


def test_time_grows_with_the_motion_and_falls_with_cores():
    short, long = make_spec(**BIG), make_spec(**BIG, window=1.8)
    one, two = (estimate.seconds(short, cores) for cores in (1, 2))
    assert one / two == pytest.approx(2, rel=1e-3)
    assert estimate.seconds(long, 1) / one == pytest.approx(5, rel=1e-3)
    by_three = short.with_sensitivities()
    assert estimate.seconds(by_three, 1) / one == pytest.approx(4, rel=1e-3)


@pytest.mark.parametrize(
    ("run", "packed"), [({}, 0), ({"raster": 100}, 100), ({"event_log": 10}, 190)]
)
def test_words(run, packed):
    spec = make_spec(**BIG, **run)
    plain = a_cell(spec)  # bytes, so GB of a thousand million cells
    size = f"{plain} GB to {plain + packed} GB" if packed else f"{plain} GB"
    words = f"1000000000 of 0.4 s, {size}, about 15 days on 2 cores (a guess from"
    assert estimate.words(spec, 2).startswith(words)


def full(spec, index, *_):
    """Every column, of numbers that do not pack."""
    noise = np.random.default_rng(5)
    lengths = {"": (), "raster_time": (spec.run.raster,), "event": (spec.run.event_log,)}
    return {
        column.name: np.frombuffer(noise.bytes(math.prod(shape) * item.itemsize), item).reshape(
            shape
        )
        for column in estimate.columns(spec)
        for item in [np.dtype(column.dtype)]
        for shape in [(len(index), *lengths[column.along])]
    }


@pytest.mark.filterwarnings("ignore:invalid value")  # noise has no class
def test_a_map_of_a_few_cells_is_as_large_as_foretold(tmp_path):
    """Its headers are most of it: numbers alone were a hundredth."""
    spec, path = make_spec(2, 2, 2), tmp_path / "map.h5"
    driver.sweep(spec, path, evaluate=full, progress=False).close()
    told = float(estimate.words(spec, 2).split(" s, ")[1].split(" kB")[0])
    assert path.stat().st_size / 1000 == pytest.approx(told, rel=0.15)


def test_the_block_on_the_disk_is_as_large_as_foretold(tmp_path):
    """What is foretold is what a file of numbers that do not pack holds, but for its headers."""
    spec, cells = make_spec(raster=100, event_log=10), 385

    identity = {"made by": "a test"}
    with BlockStore.open(tmp_path / "m.h5", spec, block=cells, identity=identity) as store:
        store.write(0, full(spec, np.arange(cells)))
        (block,) = store.parts.glob("block-*")
    size = cells * sum(estimate.bytes_of_a_cell(spec))
    assert size < block.stat().st_size < size + 40_000
