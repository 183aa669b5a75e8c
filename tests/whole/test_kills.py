"""Sweeps that survive: kills at random times and before every call that counts, and Ctrl-C."""

import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import slow_sweep
import xarray as xr
from border_maps import coarse_map, engine, refined
from processes import environment, fork
from stub_sweep import assert_same_map, data_of, evaluate, half_done, make_spec, run, whole

from wiperjax.maps import driver
from wiperjax.store import checksums, partial
from wiperjax.store.levels import read_levels
from wiperjax.store.manifest import parts_of
from wiperjax.store.whole import borders, open_map


@pytest.mark.long
def test_kills_at_random_times(tmp_path):
    """SIGKILL at random times, from before the first block to while the map is put together."""
    spec, path = make_spec(), tmp_path / "map.h5"
    reference = data_of(whole(spec))
    kills, finished, kept, places = 0, 0, 0, set()
    rng = random.Random(0)
    # Processes are forked: a fresh interpreter for each kill would take most of the time. The time
    # of a whole sweep is measured, for the kills must hit all of it on a busy machine, too.
    begun = time.monotonic()
    os.waitpid(subprocess_fork(spec, path, delay=0.004), 0)
    length = time.monotonic() - begun
    path.unlink()
    deadline = begun + 180  # about ten seconds, unless the machine is very busy
    enough = False
    while not enough and time.monotonic() < deadline:
        child = subprocess_fork(spec, path, delay=0.004)
        time.sleep(rng.uniform(0.0, 0.8 * length))
        os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        kills += os.WIFSIGNALED(status)
        if path.exists():
            with open_map(path) as ds:  # whole, or not there
                xr.testing.assert_identical(data_of(ds), reference)
            finished += 1
            path.unlink()
            shutil.rmtree(parts_of(path), ignore_errors=True)
        elif parts_of(path).exists() and (parts_of(path) / "manifest.json").exists():
            done = partial.open_partial(parts_of(path))
            cells = done.done.values.astype(bool)
            kept += bool(cells.any())
            places.add(int(cells.sum()))
            if cells.any():
                same = done.steps.values[cells] == reference.steps.values[cells]
                assert same.all()
        enough = kills >= 20 and kept >= 8 and finished >= 2 and len(places) >= 4
    run(spec, path, resume=True)
    assert_same_map(path, spec)
    counts = f"{kills} kills, {kept} left finished blocks, {finished} maps were finished"
    print(f"{counts}; cells done after a kill: {sorted(places)}")
    assert enough, counts


CALLS = ("mkdir", "ftruncate", "fsync", "replace", "unlink", "rmdir")


@pytest.mark.slow
def test_a_kill_before_any_call_that_counts(tmp_path):
    """SIGKILL before the first, the second, ... of all the calls that make what was written
    durable, name it or delete it: each time what is left can be read, and goes on to the same map.
    """
    spec, path = make_spec(2, 2, 5), tmp_path / "map.h5"

    def go_on():
        options = {"block": 8, "evaluate": evaluate, "progress": False, "resume": True}
        return driver.sweep(spec, path, **options)

    reference = data_of(driver.sweep(spec, evaluate=evaluate, block=8, progress=False))
    places, kept = 0, set()
    while killed_at(places, go_on):
        if (parts_of(path) / "manifest.json").exists():
            part = open_map(parts_of(path))
            done = part.done.values == 1
            kept.add(int(done.sum()))
            if done.any():
                assert (part.steps.values[done] == reference.steps.values[done]).all()
        with go_on() as ds:
            xr.testing.assert_identical(data_of(ds), reference)
        assert [entry.name for entry in tmp_path.iterdir()] == ["map.h5"]
        path.unlink()
        places += 1
    print(f"{places} kills, one before each call")
    assert places > 25 and kept >= {0, 8, 16, 20}


@pytest.mark.long
def test_a_refinement_killed_before_any_call_leaves_nothing_in_the_end(tmp_path):
    path = tmp_path / "map.h5"
    coarse_map(path, HALVES, axes=("belt_speed",))
    coarse = path.read_bytes()
    wanted = refine(path)
    places, complete = 0, 0
    path.write_bytes(coarse)
    while killed_at(places, lambda: refine(path)):
        complete += path.read_bytes() != coarse  # killed when all was done but the clearing up
        assert refine(path).equals(wanted)
        assert [entry.name for entry in tmp_path.iterdir()] == ["map.h5"]
        path.write_bytes(coarse)
        places += 1
    print(f"{places} kills, {complete} with the borders in place")
    assert places > 25 and complete > 5


@pytest.mark.long
def test_a_mending_killed_before_any_call_keeps_the_borders(tmp_path):
    path = tmp_path / "map.h5"
    spec = coarse_map(path, HALVES, axes=("belt_speed",))
    wanted = refine(path)
    count = len(read_levels(path))
    with open(path, "rb") as file:
        pieces = checksums._read(file).pieces
    damaged = bytearray(path.read_bytes())
    damaged[next(piece.start for piece in pieces if piece.variable == "velocity_rms")] ^= 1

    def mend():
        driver.sweep(spec, path, evaluate=HALVES, progress=False, resume=True).close()

    places = 0
    path.write_bytes(damaged)
    while killed_at(places, mend):
        mend()
        assert borders(path).identical(wanted) and len(read_levels(path)) == count
        assert [entry.name for entry in tmp_path.iterdir()] == ["map.h5"]
        path.write_bytes(damaged)
        places += 1
    print(f"{places} kills, one before each call")
    assert places > 10


HALVES = engine(lambda speed: np.where(speed < 0.3, 600.0, 200.0))


def refine(path):
    return refined(path, HALVES, levels=1, probes=2)


def killed_at(call, work):
    """Whether a process that does `work` came to its call number `call` of `CALLS`, before which it
    is killed.
    """
    left = iter(range(call + 1))

    def deadly(function):
        def wrapped(*args, **kwargs):
            if next(left, None) == call:
                os.kill(os.getpid(), signal.SIGKILL)
            return function(*args, **kwargs)

        return wrapped

    def dying():
        for name in CALLS:
            setattr(os, name, deadly(getattr(os, name)))
        work()

    _, status = os.waitpid(fork(dying), 0)
    return os.WIFSIGNALED(status)


def subprocess_fork(spec, path, delay):
    """Process id of a child that resumes the sweep, each block taking `delay` seconds."""
    return fork(lambda: slow_sweep.slow_sweep(spec, path, delay, resume=True))


def test_ctrl_c_stops_cleanly_and_says_how_to_go_on(tmp_path):
    path = tmp_path / "map.h5"
    child = subprocess.Popen(
        [sys.executable, slow_sweep.__file__, path, "0.3"],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=environment(),
    )
    deadline = time.monotonic() + 60
    while (
        not list(tmp_path.glob("map.h5.parts/block-*"))
        and child.poll() is None
        and time.monotonic() < deadline
    ):
        time.sleep(0.02)
    child.send_signal(signal.SIGINT)
    _, said = child.communicate(timeout=60)
    assert child.returncode == 130, said
    assert (
        "cells are kept" in said
        and "wiperjax sweep a.toml -o map.h5 --resume" in said
        and "Traceback" not in said
    )
    assert not path.exists() and parts_of(path).is_dir()
    run(make_spec(), path, resume=True)
    assert_same_map(path, make_spec())


PRESSED = """
import os, signal, sys
from matplotlib.figure import Figure
from wiperjax.cli import main

drawn, number = Figure.savefig, int(sys.argv.pop())

def save(figure, path, **options):
    drawn(figure, path, **options)
    os.kill(os.getpid(), number)

Figure.savefig = save
for each in ("SIGTERM", "SIGHUP"):  # as at a terminal: whoever runs the tests may ignore them
    signal.signal(getattr(signal, each), signal.SIG_DFL)
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.exit(main())
"""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "status"), [("SIGTERM", 143), ("SIGHUP", 129), ("SIGINT", 130)])
def test_what_ends_a_process_leaves_no_half_picture(name, status, tmp_path):
    """SIGTERM left `.map.PID.png` beside the map, and said nothing."""
    run(make_spec(), tmp_path / "map.h5").close()
    number = getattr(signal, name)
    words = ["plot", "map.h5", "-o", "map.png", "-p", "line", "--x", "belt_speed"]
    ran = subprocess.run(
        [sys.executable, "-c", PRESSED, *words, str(int(number))],
        cwd=tmp_path, env=environment(), capture_output=True, text=True,
    )  # fmt: skip
    assert (ran.returncode, ran.stderr) == (status, "wiperjax: interrupted\n")
    assert [entry.name for entry in tmp_path.iterdir()] == ["map.h5"]


def test_kill_between_the_finished_map_and_the_removal_of_its_parts(tmp_path):
    spec, path = make_spec(), tmp_path / "map.h5"
    half_done(path, spec, 3)
    shutil.copytree(parts_of(path), tmp_path / "kept")
    run(spec, path, resume=True)
    before = hashlib.sha256(path.read_bytes()).hexdigest()
    (tmp_path / "kept").rename(parts_of(path))

    def never(spec, index):
        raise AssertionError("nothing is left to compute")

    run(spec, path, resume=True, evaluate=never)
    assert hashlib.sha256(path.read_bytes()).hexdigest() == before and not parts_of(path).exists()
