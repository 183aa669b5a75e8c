"""Shared by all tests: 64-bit numbers, which importing wiperjax switches on before any array."""

import ctypes
import gc
import os
import tempfile
from pathlib import Path

import pytest

# Most of the suite's time is compilation: the two processes, and those that tests start, share what
# they compile in one folder, which goes with the run. A folder named by the environment stays.
if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
    _compiled = tempfile.TemporaryDirectory(prefix="wiperjax-tests-", ignore_cleanup_errors=True)
    os.environ["JAX_COMPILATION_CACHE_DIR"] = _compiled.name

import hypothesis  # noqa: E402
import psutil  # noqa: E402

import wiperjax  # noqa: E402

wiperjax.configure(1)  # as the command line does: one core for each of the processes
import jax  # noqa: E402

from wiperjax.machine import jax_settings  # noqa: E402
from wiperjax.machine.memory import seek_garbage_less  # noqa: E402

seek_garbage_less()

MOST_MEMORY = 6 * 2**30  # bytes of one process, from which on it forgets its compiled programs

# `pytest --hypothesis-profile many tests/whole/test_properties.py`: for a night
hypothesis.settings.register_profile("many", max_examples=1000)

# Kills first: a process that has run other tests is so large that forking it takes most of their
# time. Then the longest: begun last, one would keep one process busy and leave the other idle.
FIRST = """kills commands sensitivity cycle notebooks cluster measures failures noises lanes
hard_scenes against_reference reverse known_answers saltation_wiper""".split()


@pytest.hookimpl(tryfirst=True)  # before -m chooses
def pytest_collection_modifyitems(items):
    for item in items:
        if item.get_closest_marker("long"):
            item.add_marker(pytest.mark.slow)
    names = [f"test_{name}" for name in FIRST]
    items.sort(key=lambda i: names.index(i.path.stem) if i.path.stem in names else len(names))


@pytest.fixture(autouse=True)
def one_core(monkeypatch):
    """One core for each process, also after a test of a command that takes all there are."""
    monkeypatch.setattr(jax_settings, "_configured", 1)


@pytest.fixture(scope="module", autouse=True)
def bounded_memory():
    """Behind a file of tests that leaves much memory in use, programs are forgotten: all together
    they are some 10 GB in each of the two processes. What is wanted again is in the folder."""
    yield
    if psutil.Process().memory_info().rss > MOST_MEMORY:
        jax.clear_caches()
        gc.collect()
        if trim := getattr(ctypes.CDLL(None), "malloc_trim", None):  # GNU's keeps what is freed
            trim(0)


@pytest.fixture(scope="session")
def squeal():
    """Run of the scene that squeals: 0.2 s, stick-slip at 780.8 Hz."""
    from wiperjax.runs import scene
    from wiperjax.specs.load import load_scene

    return scene.run_scene(
        load_scene(Path(__file__).parents[1] / "sweeps" / "scenes" / "squeal.toml")
    )


@pytest.fixture(scope="session")
def steady_scenes():
    """Columns of the scenes on a steady belt, their remedies and neighbours (`scenes`)."""
    from scenes import STEADY, evaluated

    return evaluated(STEADY, "squeal")
