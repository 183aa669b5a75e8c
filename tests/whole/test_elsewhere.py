"""Commands on Windows and macOS, as far as Linux can play them (`helpers/elsewhere.py`)."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import xarray as xr

import wiperjax

SWEEP = """
title = "Überlandfahrt"
[axes]
attack_angle = {start = -10, stop = 10, num = 6}
belt_speed = {start = 0.1, stop = 0.5, num = 4}
[run]
transient = 0.05
window = 0.05
"""
SCENE = """
[blade]
attack_angle = 5
[run]
duration = 0.02
"""
COMMANDS = (
    "sweep sweep.toml -o map.h5 --block 8",
    "sweep sweep.toml -o map.h5 --force",
    "refine map.h5 --levels 1",
    "sweep sweep.toml -o map.h5 --resume",
    "verify map.h5",
    "plot map.h5 --all",
    "simulate squeal.toml -o run.h5",
    "plot run.h5",
    "listen run.h5 -o run.wav",
    "export run.h5 -o run.csv",
    "info map.h5",
)


@pytest.mark.long
@pytest.mark.parametrize("system", ["win32", "darwin"])
def test_commands_run_on_other_systems(tmp_path, system):
    """On macOS every sweep was a traceback of os.sched_getaffinity; Windows has no fcntl."""
    (tmp_path / "sweep.toml").write_text(SWEEP, encoding="utf-8")
    (tmp_path / "squeal.toml").write_text(SCENE, encoding="utf-8")
    player = Path(__file__).parents[1] / "helpers" / "elsewhere.py"
    done = subprocess.run(
        [sys.executable, "-X", "warn_default_encoding", player, system, *COMMANDS],
        cwd=tmp_path, capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": str(Path(wiperjax.__file__).parents[1])},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-300:] + done.stderr[-3000:]
    assert "identical" in done.stdout and not list(tmp_path.glob(".*"))
    assert not list(tmp_path.glob("*.parts"))
    with wiperjax.open_map(tmp_path / "map.h5") as found:
        here = wiperjax.sweep(tmp_path / "sweep.toml")
        for name, column in here.data_vars.items():
            xr.testing.assert_equal(found[name], column)
