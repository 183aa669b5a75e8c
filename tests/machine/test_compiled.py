"""Compiled programs are kept between processes in the user's cache folder, unless told not to."""

import os
import subprocess
import sys

import pytest

from wiperjax.machine import compiled, jax_settings

CACHE = "JAX_COMPILATION_CACHE_DIR"
PROGRAM = """
import sys
import wiperjax
wiperjax.configure(int(sys.argv[1]))
import jax
from jax._src import monitoring
seen = []
monitoring.register_event_listener(lambda name, **_: seen.append(name.split("/")[-1]))
jax.jit(lambda x: x * 2 + 1)(1.0)
print(seen.count("cache_hits"), seen.count("cache_misses"))
"""


@pytest.fixture
def environment(tmp_path, monkeypatch):
    """An environment that says nothing of the cache but where the user's files are."""
    for name in list(os.environ):
        if name.startswith(("JAX_COMPILATION", "JAX_PERSISTENT")):
            monkeypatch.delenv(name)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(os, "environ", dict(os.environ))  # what is set goes with the test
    monkeypatch.delitem(sys.modules, "jax", raising=False)  # nor is this process's jax set
    return os.environ


@pytest.mark.skipif(sys.platform != "linux", reason="the folder's name is that of Linux")
def test_the_second_process_compiles_nothing(environment):
    """Nor does one that has more cores."""

    def run(cores):
        command = [sys.executable, "-c", PROGRAM, str(cores)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        return [int(word) for word in done.stdout.split()]

    first = run(1)
    assert first[0] == 0 and first[1] > 0
    assert run(1) == run(2) == [first[1], 0]


def test_threads_are_as_many_as_cores_unless_the_user_says_so(environment):
    for name in ("NPROC", jax_settings.OURS):
        environment.pop(name, None)
    for count in (3, 2):  # the second as if in a process that the first has started
        jax_settings._set_threads(count)
        assert environment["NPROC"] == str(count)
    environment["NPROC"] = "5"
    jax_settings._set_threads(2)
    assert environment["NPROC"] == "5"


def test_what_the_environment_says_wins(environment, tmp_path):
    environment[CACHE] = str(tmp_path / "own")
    compiled.keep_programs()
    assert environment[CACHE] == str(tmp_path / "own") and not compiled.folder().exists()


def test_a_folder_that_cannot_be_made_keeps_nothing(environment, tmp_path):
    (tmp_path / "wiperjax").write_text("a file where the folder would be")
    compiled.keep_programs()
    assert CACHE not in environment


def test_each_kind_of_processor_has_its_own_folder(environment, monkeypatch):
    here = compiled.folder()
    monkeypatch.setattr(compiled, "processor", lambda: "another one")
    assert compiled.folder() != here and compiled.folder().parent == here.parent


def test_a_program_that_was_cut_off_as_it_was_written_is_not_kept(environment):
    """It was kept for ever: every process warned that it cannot be read, and compiled it anew."""
    place = compiled.folder()
    place.mkdir(parents=True)
    for name in (".lockfile", "whole-cache", "whole-atime", "cut-cache"):
        (place / name).touch()
    compiled.keep_programs()
    assert sorted(os.listdir(place)) == [".lockfile", "whole-atime", "whole-cache"]
