"""Every command line of README and the pages runs, in small form and in a folder of its own.

Commands are those of `sh` blocks and of code spans. What they read is here under the names the
pages use, and small; `INSTEAD` says what else is not done as it stands there.
"""

import glob
import re
import shlex
import shutil
from pathlib import Path

import pytest
from pages import CHECKOUT, PAGES, as_params, blocks, write_files

import wiperjax
from wiperjax.cli import main
from wiperjax.plots.runs import animation

SWEEP = """
[axes]
attack_angle = { values = [-20, 5] }
belt_speed = { values = [0.2, 0.3] }
[run]
transient = 0.02
window = 0.05
"""
INSTEAD = {  # part of a command -> what stands for it; None: the command is left to other tests
    "--scheduler tcp://": None,  # test_cluster: a server
    "--local-cluster": None,  # test_cluster: processes
    "bench chart": None,  # test_bench
    "bench all": None,  # test_bench: each part of it, in small
    "bench sweep": None,  # tests/bench/test_sweep.py: a million cells
    "bench random": None,  # tests/bench/test_random.py: 4096 blades
    "bench speed --device": None,  # tests/bench/test_device.py
    "bench borders": None,  # tests/bench/test_borders.py
    "explore ": None,  # tests/explorer: it serves until Ctrl-C
    "MAP.h5.parts": None,  # test_storage: an unfinished sweep
    "FILE.toml": "sweeps/quick.toml",
    "map.toml": "sweeps/quick.toml",
    "big.toml": "sweeps/quick.toml",
    "FILE.h5": "MAP.h5",
    "docs/bench/chart.h5": f"{CHECKOUT}/docs/bench/chart.h5 -o table.json",
    "--from 0.25 --to 1.6": "--from 0.29 --to 0.31 --step 0.3",
    "--from 0.1 --to 1.9": "--from 0.29 --to 0.31 --step 0.3",
    "both.h5 --picture classes --curves curves.h5": None,  # tests/plots/test_curves.py
    "MAP.h5 --picture classes --curves BRANCH.h5": None,  # there, too
    "docs/ladder.md": "ladder.md",
}


def commands(page: Path) -> list[str]:
    """Lines of arguments of `wiperjax`, with what stands in for large parts of them."""
    text = "\n".join(blocks(page, "sh")).replace("\\\n", " ")
    lines = [part for line in text.splitlines() for part in re.split("&&", line.split("#")[0])]
    prose = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    lines += [" ".join(span.split()) for span in re.findall(r"`([^`]+)`", prose)]
    found = []
    for line in lines:
        words = re.match(r"\s*(?:\S*/)?wiperjax ([a-z]+ .*\S)", line)  # a bare name is no command
        if not words or words[1].startswith("sweep --") or words[1].startswith("plot --all,"):
            continue
        command = words[1]
        for part, other in INSTEAD.items():
            if command is not None and part in command:
                command = None if other is None else command.replace(part, other)
        if command is not None:
            found.append(command)
    return found


WITH_COMMANDS = [page for page in PAGES if commands(page)]


def test_pages_have_commands():
    assert len(WITH_COMMANDS) >= 7


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The names that pages use: sweeps, scenes, and a map, a run where a page names one."""
    place = tmp_path_factory.mktemp("made")
    for name in ("quick", "reference", "both_ways", "remedies/squeal"):
        file = (place / "sweeps" / name).with_suffix(".toml")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(SWEEP)
    shipped = "sweeps/systems/head_and_tip.toml"
    small = re.sub(r"num = \d+", "num = 2", (CHECKOUT / shipped).read_text())
    (place / shipped).parent.mkdir()
    (place / shipped).write_text(small)
    scene = "sweeps/scenes/squeal.toml"
    (place / scene).parent.mkdir()
    (place / scene).write_bytes((CHECKOUT / scene).read_bytes())
    wiperjax.sweep(wiperjax.load_sweep(place / "sweeps/quick.toml"), place / "MAP.h5")
    assert main(["simulate", str(place / scene), "-o", str(place / "RUN.h5")]) == 0
    shutil.copyfile(place / "RUN.h5", place / "run.h5")
    return place


@pytest.fixture
def folder(made, tmp_path, monkeypatch):
    """A copy of what is made for all, to work in; animations of a frame for every half second."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(animation, "FRAMES_PER_SECOND", 2)
    return tmp_path


@pytest.mark.long
@pytest.mark.parametrize("page", as_params(WITH_COMMANDS))
def test_commands_run(page, folder, capsys):
    write_files(page, folder)
    for command in commands(page):
        command, _, target = command.partition(" > ")
        words = [w for word in shlex.split(command) for w in sorted(glob.glob(word)) or [word]]
        writes = {"sweep", "simulate", "follow", "plot", "listen"} & {words[0]}
        if writes and "--force" not in words:  # what another command of the page has made
            words.append("--force")
        capsys.readouterr()
        status = main(words)
        printed = capsys.readouterr()
        assert status == 0, f"{' '.join(words)}: {printed.err}"
        if target:
            Path(target.strip()).write_text(printed.out)
