"""What a refinement keeps beside its map, what of it counts, and what becomes of it."""

import json
import shutil
import time

import numpy as np
import pytest
from border_maps import border_spec, coarse_map, engine, refined, unit

from wiperjax.cli.refine import print_borders
from wiperjax.machine.files import StoreError
from wiperjax.machine.lock import acquire, release
from wiperjax.machine.provenance import PHASES
from wiperjax.maps.block import Block
from wiperjax.maps.refine import driver as refining
from wiperjax.maps.refine.grid import Grid
from wiperjax.maps.refine.points import Points
from wiperjax.maps.refine.replay import replay
from wiperjax.store.folder import LOCK
from wiperjax.store.levels import read_levels

DISC = engine(lambda x, y: np.where((x - 0.45) ** 2 + (y - 0.5) ** 2 < 0.3**2, 700.0, 300.0))


@pytest.fixture
def path(tmp_path):
    coarse_map(tmp_path / "map.h5", DISC)
    return tmp_path / "map.h5"


@pytest.fixture
def left(path, monkeypatch):
    """Refines up to its last step, and not that; returns the folder that is left."""

    def stop(*_):
        raise KeyboardInterrupt

    def refine(evaluate=DISC, **settings):
        with monkeypatch.context() as patched:
            patched.setattr(refining, "write_levels", stop)
            with pytest.raises(KeyboardInterrupt):
                refined(path, evaluate, **settings)
        return path.with_name("map.h5.refine")

    return refine


def counted(counts):
    def evaluate(spec, index, *look):
        counts.append(len(index))
        return DISC(spec, index, *look)

    return evaluate


@pytest.mark.slow
@pytest.mark.parametrize("how", ["damaged", "of another version"])
def test_what_is_of_no_use_there_is_named_with_what_to_do(path, left, how):
    folder = left(levels=2)
    manifest = sorted(folder.glob("points-*.parts/manifest.json"))[0]
    content = bytearray(manifest.read_bytes())
    if how == "damaged":
        content[40] ^= 1
        said = r"manifest.json: is damaged"
    else:
        place = content.index(b'"jax": "') + 8
        content[place : place + 1] = b"9"
        said = r"points-\w+.parts: was made otherwise.*jax was 9"
        content = _signed(content)
    manifest.write_bytes(content)
    advice = f"; delete {folder} and give the same command again$"
    with pytest.raises(StoreError, match=f"{said}.*{advice}"):
        refined(path, DISC, levels=2)
    shutil.rmtree(folder)
    refined(path, DISC, levels=2)
    assert not folder.exists()


def _signed(content):
    from wiperjax.store import manifest

    found = json.loads(content)
    return json.dumps(found | {"sha256": manifest._checksum(found)}).encode()


def test_what_a_kill_left_goes_when_its_borders_are_read_and_no_other_goes(path, left, caplog):
    """Killed once the borders are in the map the folder stayed for ever."""
    folder, kept = left(levels=2), path.with_name("kept")
    shutil.copytree(folder, kept)
    refined(path, DISC, levels=2)
    kept.rename(folder)
    lock = acquire(folder / LOCK)  # nobody may remove it: the borders are read all the same
    refined(path, None, levels=2)
    release(lock)
    assert "is being written by process" in caplog.text and folder.exists()
    refined(path, None, levels=2)
    assert not folder.exists()
    left(levels=2, on="mechanism")
    refined(path, None, levels=2)
    assert list(folder.glob("points-*"))  # hours of another refinement, to be gone on with


def test_a_strange_file_there_stays_and_the_borders_are_stored(path, caplog):
    folder = path.with_name("map.h5.refine")
    folder.mkdir()
    (folder / "note.txt").write_text("mine")
    assert refined(path, DISC, levels=2).sizes["border"] > 0
    assert "map.h5.refine: cannot be removed" in caplog.text
    assert "(the borders are complete)" in caplog.text
    assert (folder / "note.txt").read_text() == "mine"


def test_points_of_steady_slip_are_none_that_are_simulated(
    tmp_path, left, path, monkeypatch, capsys
):
    """Of one map, at the same places: with the columns of the one the other cannot be answered."""

    def both(spec, index, *look):
        x, y = unit(spec, index)
        slip = {"growth_rate": 0.09 - (x - 0.45) ** 2 - (y - 0.5) ** 2}
        return DISC(spec, index) | slip | {"linear_frequency": np.full(len(index), 600.0)}

    def linear(spec, spans):
        for number, span in spans.items():
            columns = both(spec, np.arange(*span))
            names = ("growth_rate", "linear_frequency")
            yield Block(number, {name: columns[name] for name in names}, None, 0.0)

    coarse_map(tmp_path / "new.h5", both)
    (tmp_path / "new.h5").replace(path)
    monkeypatch.setattr(refining, "linear_blocks", linear)
    left(both, levels=3, on="growth_rate=0")
    found = refined(path, both, levels=3)
    assert found.sizes["border"] > 0 and "linear_points" not in found.attrs
    found = refined(path, both, levels=3, on="growth_rate=0")
    counts = ("simulations", "fresh_simulations", "linear_points")
    assert [found.attrs[name] > 0 for name in counts] == [False, False, True]
    print_borders(found)  # which told of simulations, and of a grid's saving, that never were
    said = capsys.readouterr().out
    assert f"{found.attrs['linear_points']} points of steady slip, no simulation\n" in said
    assert "simulations beside" not in said and "for a grid" not in said
    spec = border_spec()
    grid, index = Grid(spec.axes, 3), np.arange(5)
    digests = {Points(spec, grid, index, linear=linear).digest() for linear in (False, True)}
    assert len(digests) == 2


def test_steps_of_a_longer_window_are_no_more_than_the_engine_counts():
    spec = border_spec(run={"transient": 0.2, "window": 0.2, "max_steps": 10**9})
    grid = Grid(spec.axes, 2)
    steps = [Points(spec, grid, np.arange(3), factor).run.max_steps for factor in (1, 2, 4)]
    assert steps == [10**9, 2 * 10**9, 2**31 - 1]


@pytest.mark.slow
def test_a_budget_is_of_what_is_computed_whatever_is_stored(path, left):
    refined(path, DISC, levels=3)
    stored = sum(len(level.index) for level in read_levels(path))
    other = path.with_name("other.h5")
    shutil.copy(path, other)
    counts = []
    found = refined(other, counted(counts), levels=5, max_cells=300)
    assert sum(counts) == found.attrs["fresh_simulations"] == 300 and found.attrs["budget_spent"]
    assert found.attrs["simulations"] > 300  # the borders rest on stored ones too
    assert sum(len(level.index) for level in read_levels(other)) == stored + 300
    left(levels=5, max_cells=300)
    counts.clear()
    again = refined(path, counted(counts), levels=5, max_cells=300)  # killed, and gone on with
    assert not counts and again.attrs["fresh_simulations"] == 300
    for name in found.variables:
        np.testing.assert_array_equal(again[name], found[name])
    search, _ = replay(path)
    assert search.spent and search.used == found.attrs["simulations"]
    np.testing.assert_array_equal(search.outcome().high, replay(other)[0].outcome().high)
    assert len(search.outcome().high) == found.sizes["border"]


def test_borders_say_what_their_time_went_into(path):
    calls = []

    def slow(spec, index, *look):
        time.sleep(0.02)
        calls.append(len(index))
        return DISC(spec, index, *look)

    begun = time.perf_counter()
    found = refined(path, slow, levels=3)
    passed = time.perf_counter() - begun
    took = {name: found.attrs[f"{name}_time"] for name in PHASES if name != "idle"}
    assert took["naming"] >= len(calls) * 0.02 and took["storing"] > 0
    assert sum(took.values()) < passed
    assert len(calls) * 0.02 <= found.attrs["wall_time"] < passed
