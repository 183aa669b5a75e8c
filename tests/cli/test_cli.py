"""Command line: what it hands on, what it refuses before any work, and what it says.

The pieces (`jax_settings`, `driver`, `scene`, `plots`) are stubs that write down their
calls.
"""

import importlib.metadata
import inspect
import re
import subprocess
import sys
import threading
import types
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from wiperjax.cli import main, tables
from wiperjax.machine import files as storage
from wiperjax.maps import around_scene
from wiperjax.noise import run_class
from wiperjax.runs.scene import run_scene
from wiperjax.store import whole
from wiperjax.vocabulary import codes, schema
from wiperjax.vocabulary.cf import flags

NAN = float("nan")

SWEEP = """
title = "two cells"
[axes]
attack_angle = { values = [-30, 5] }
[run]
transient = 0.1
window = 0.1
"""
SCENE = "[blade]\nattack_angle = 5\n[run]\nduration = 0.1\n"


def small_map():
    label = xr.DataArray(
        np.array([2, 1], dtype=np.int8),
        dims="attack_angle",
        attrs={
            "flag_values": np.array([0, 1, 2], dtype=np.int8),
            "flag_meanings": "quiet squeal chattering",
        },
    )
    coords = {"attack_angle": [-30.0, 5.0]}
    attrs = {"title": "two cells", "specification_text": "[axes]\n[run]"}
    return xr.Dataset({"label": label}, coords=coords, attrs=attrs)


class Stubs:
    """Stand-ins for the pieces behind the commands; `calls` is what they were asked, in order."""

    def __init__(self, monkeypatch):
        self.calls = []
        self.error = None
        self.map = small_map()
        self.run = xr.Dataset({"position": (("time", "axis"), np.zeros((3, 2)))})
        self.report = types.SimpleNamespace(
            cells=2,
            points=0,
            columns=3,
            tolerance=1e-9,
            passed=True,
            identical=True,
            same_versions=True,
            largest={},
            differing=(),
        )
        pieces = {
            "machine.jax_settings": {"configure": self.configure},
            "maps.driver": {"sweep": self.sweep},
            "maps.verify": {"verify": self.verify},
            "runs.scene": {"run_scene": self.simulate},
            "plots": {"plot_file": self.plot_file, "plot_all": self.plot_all},
            "plots.files": {
                "usual_of_file": lambda path: "overview",
                "is_usual_of": lambda spec, path: False,
            },
        }
        for name, contents in pieces.items():
            module = types.ModuleType(f"wiperjax.{name}")
            vars(module).update(contents)
            monkeypatch.setitem(sys.modules, f"wiperjax.{name}", module)

    @property
    def names(self):
        return [call[0] for call in self.calls]

    @property
    def work(self):
        """Calls but the settings, which precede the file: its system may be a module with jax."""
        return [name for name in self.names if name != "configure"]

    def configure(self, cores=None):
        self.calls.append(("configure", cores))

    def sweep(self, spec, output, **options):
        self.calls.append(("sweep", spec, output, options))
        if self.error:
            raise self.error
        whole.write_dataset(self.map, output, options["force"] or options["resume"])
        return self.map

    def verify(self, path, cells, seed):
        self.calls.append(("verify", path, cells, seed))
        return self.report

    def simulate(self, spec):
        self.calls.append(("simulate", spec))
        if self.error:
            raise self.error
        return self.run

    def plot_all(self, path, output, **options):
        self.calls.append(("plot_all", path, output, options))
        return [output]

    def plot_file(self, path, output, **options):
        self.calls.append(("plot_file", path, output, options))
        if self.error:
            raise self.error
        output.write_bytes(b"picture")


@pytest.fixture
def stubs(monkeypatch):
    return Stubs(monkeypatch)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("s.toml").write_text(SWEEP)
    Path("scene.toml").write_text(SCENE)
    return tmp_path


def files(folder):
    return sorted(path.name for path in folder.iterdir())


def failed(capsys, status, expected_status=1):
    """The one line that was said."""
    printed = capsys.readouterr()
    assert status == expected_status
    assert printed.err.count("\n") == 1 and "Traceback" not in printed.err
    return printed.err.strip()


# --- commands -------------------------------------------------------------------------------------


def test_sweep_makes_map_picture_and_table(folder, stubs, capsys):
    assert main(["sweep", "s.toml", "-o", "m.h5"]) == 0
    assert stubs.names == ["configure", "sweep", "plot_file"]
    _, spec, output, options = stubs.calls[1]
    assert spec.title == "two cells" and output == Path("m.h5")
    assert options == {
        "resume": False,
        "force": False,
        "command": "wiperjax sweep s.toml -o m.h5",
    }
    assert files(folder) == ["m.h5", "m.png", "s.toml", "scene.toml"]
    printed = capsys.readouterr()
    assert printed.err == ""
    assert "attack_angle      -30 ... 5 degrees (2 values)" in printed.out
    assert re.search(r"^cells {13}2 of 0\.2 s, 1\d\d kB, about 15 s on ", printed.out, re.M)
    assert "squeal              1    50.0%" in printed.out
    assert re.search(
        r"^map      m\.h5: [\d.]+ MB, 0:00:\d\d, \d\.\d\d GB of memory", printed.out, re.M
    )
    assert "m.png" in printed.out
    assert "borders" not in printed.out


@pytest.mark.parametrize("lost", ["1 cell", "2 cells"])
def test_a_sweep_says_of_how_many_cells_the_answer_is_open(
    folder, stubs, capsys, monkeypatch, lost
):
    """As `info` does: a short transient was not seen until someone asked."""
    settled = xr.zeros_like(small_map()["label"]) + codes.SETTLED["yes"]
    settled[{dim: slice(int(lost[0])) for dim in settled.dims}] = codes.SETTLED["no"]
    monkeypatch.setattr(stubs, "map", small_map().assign(settled=settled))
    assert main(["sweep", "s.toml", "-o", "m.h5"]) == 0
    line = rf"^not settled  {lost}: growing, dying, irregular or of too few periods$"
    assert re.search(line, capsys.readouterr().out, re.M)
    assert main(["info", "m.h5"]) == 0
    assert re.search(line, capsys.readouterr().out, re.M)


@pytest.mark.parametrize(("differ", "noted"), [([1e-6, 4e-6, 0.05], 0), ([1e-6, 4e-3, 0.05], 1)])
def test_derivatives_that_disagree_with_differences_are_noted(differ, noted, capsys):
    """In the median: one cell may lie beside a grazing."""
    tables.print_sensitivities(judged(["fine"] * 3, differ))
    printed = capsys.readouterr()
    assert "checked by differences: 3 cells" in printed.out
    assert printed.err.count("note: derivatives disagree with differences: ") == noted


def judged(names, agreement):
    """What a map holds of its derivatives; an agreement of NaN: not checked."""
    numbers = np.array([codes.VALIDITY[name] for name in names], "int8")
    found = xr.DataArray(numbers, dims="attack_angle", attrs=flags(codes.VALIDITY, "int8"))
    agreement = ("attack_angle", np.array(agreement))
    return xr.Dataset({"sensitivity_code": found, "sensitivity_agreement": agreement})


@pytest.mark.parametrize(
    ("changed", "unchecked", "noted"),
    [
        (2, 56, "2 of 4 checked cells have other events a step away; so, most likely, as large a"
            " share of the 56 that are called fine unchecked: see all with check = 1"),
        (4, 56, "4 of 6 checked cells .* of the 56 "),
        (0, 56, None),
        (2, 0, None),  # all are checked
    ],
)  # fmt: skip
def test_where_checked_cells_have_changed_those_not_checked_are_not_called_fine_in_silence(
    changed, unchecked, noted, capsys
):
    """Of 60 cells 58 were called fine; of 4 that were looked at 2 had changed, and of all 49."""
    names = ["sequence_changes"] * changed + ["fine"] * (2 + unchecked)
    tables.print_sensitivities(judged(names, [NAN] * changed + [1e-6] * 2 + [NAN] * unchecked))
    said = capsys.readouterr().err
    assert re.fullmatch(f"note: {noted}.*\n", said) if noted else said == ""


@pytest.mark.parametrize(("turns", "cut"), [(False, 1), (True, 0)])
def test_derivatives_of_a_window_that_cuts_a_noise_are_noted(turns, cut, capsys):
    """Called fine, those of a squeal that does not come back to itself are not the noise's own."""
    found = judged(["fine", "fine", "fine", "unsettled", "fine"], [NAN] * 5)
    names = ["quiet", "squeal", "other", "squeal", "collapsed"]
    label = np.array([codes.LABELS[name] for name in names], "int8")
    found = found.assign(label=("attack_angle", label))
    if not turns:
        found = found.assign(noise_period=("attack_angle", [NAN, 1e-3, NAN, NAN, NAN]))
    tables.print_sensitivities(found)
    said = capsys.readouterr().err
    note = rf"note: derivatives of {cut} noisy cells, which did not come back to themselves, .*\n"
    assert re.fullmatch(note, said) if cut else said == ""


@pytest.mark.parametrize(
    ("trivial", "repeats", "notes"),
    [
        ([1e-9, 1e-9], [0.01, 0.02, 0.02, NAN], []),  # the last was not simulated to its end
        ([NAN, NAN], [0.01] * 4, []),  # of what something drives
        (
            [1e-9, 3e-2],
            [NAN, 0.01, NAN, NAN],
            [
                "note: multipliers of 1 cycles are known to 3e-02 only (trivial_error)",
                "note: 2 of them did not come back to themselves: their means are over the window"
                " (repeat_time)",
            ],
        ),
    ],
)
def test_what_is_not_known_well_of_a_branch_is_said(trivial, repeats, notes, capsys):
    plane, ended = ("way", "simulated_load"), [[0, 0], [0, codes.RESULTS["collapsed"]]]
    ds = xr.Dataset(
        {
            "stable": ("point", [1, 0]),
            "trivial_error": ("point", trivial),
            **{f"special_{key}": ("special", []) for key in ("kind", "parameter", "detail")},
            "simulated_result": (plane, ended),
            "simulated_repeat_time": (plane, np.reshape(repeats, (2, 2))),
        },
        coords={"load": ("point", [1.0, 2.0], {"units": "N"})},
        attrs={"over": "load", "ends": "both ends of the range"},
    )
    tables.print_special(ds)
    printed = capsys.readouterr()
    assert printed.out.splitlines()[-1] == "simulated 3 of 4 motions to their end"
    assert printed.err.splitlines() == notes


def test_what_a_sweep_will_take_names_its_borders(folder, stubs, capsys):
    stubs.error = KeyboardInterrupt()
    main(["sweep", "s.toml", "-o", "m.h5", "--refine", "2"])
    Path("s.toml").write_text(SWEEP + "[refine]\nlevels = 2\nmax_cells = 300\n")
    main(["sweep", "s.toml", "-o", "m.h5"])
    found = re.findall(r"^borders {11}at most (\d+) points more$", capsys.readouterr().out, re.M)
    assert found == ["1000000", "300"]


def test_a_sweep_of_one_cell_says_that_it_draws_nothing(folder, stubs, capsys):
    Path("s.toml").write_text(SWEEP.replace("[-30, 5]", "[5]"))
    assert main(["sweep", "s.toml", "-o", "m.h5"]) == 0
    assert "plot_file" not in stubs.names
    assert "picture  none: a map of one cell" in capsys.readouterr().out
    assert main(["sweep", "s.toml", "-o", "n.h5", "--no-picture"]) == 0
    assert "picture  none" not in capsys.readouterr().out


def test_model_of_the_command_line_wins(folder, stubs, capsys):
    assert main("sweep s.toml -o m.h5 --no-picture --model block".split()) == 0
    _, spec, _, options = stubs.calls[1]
    assert spec.model == "block"
    assert options["command"] == "wiperjax sweep s.toml -o m.h5 --no-picture --model block"
    assert main("simulate scene.toml -o run.h5 --model bar".split()) == 0
    assert stubs.calls[-1][1].model == "bar"
    capsys.readouterr()
    said = failed(capsys, main("simulate scene.toml -o other.h5 --model beam".split()))
    assert said == ("wiperjax: scene.toml: model: must be 'block', 'bar' or 'lip', was 'beam'")


def test_ladder_is_refused_before_any_work(folder, stubs, capsys):
    Path("bad.toml").write_text("[run]\nduration = 0\n")
    said = failed(capsys, main("ladder scene.toml bad.toml".split()))
    assert said == "wiperjax: bad.toml: run.duration: must lie inside [1e-09, 100000] s, was 0"
    Path("fast.toml").write_text("[belt]\nspeed = 20\n[run]\nduration = 0.1\n")
    said = failed(capsys, main("ladder scene.toml fast.toml".split()))
    why = f"compared are blades within {around_scene.SPREAD:.0%} of its load and speed"
    assert said.startswith(f"wiperjax: fast.toml: {why}: axes.belt_speed: must lie inside")
    assert "must end in .md" in failed(capsys, main("ladder scene.toml -o table.txt".split()))
    Path("table.md").write_text("kept")
    assert "table.md" in failed(capsys, main("ladder scene.toml -o table.md".split()))
    assert stubs.work == [] and Path("table.md").read_text() == "kept"


def test_sweep_hands_on_its_options(folder, stubs):
    words = "sweep s.toml -o m.h5 --resume --no-picture --workers 3 --block 64"
    assert main(words.split()) == 0
    assert stubs.calls[0] == ("configure", 3)
    options = stubs.calls[1][3]
    assert options["resume"] and not options["force"] and options["block"] == 64
    assert options["command"] == "wiperjax sweep s.toml -o m.h5 --no-picture --workers 3"
    assert "plot_file" not in stubs.names and not Path("m.png").exists()


def test_settings_precede_the_modules_that_import_jax(folder, stubs, monkeypatch):
    seen = []
    monkeypatch.setattr(
        sys.modules["wiperjax.machine.jax_settings"],
        "configure",
        lambda cores=None, **_: seen.append("wiperjax.maps.cells" in sys.modules),
    )
    monkeypatch.delitem(sys.modules, "wiperjax.maps.cells", raising=False)
    assert main(["sweep", "s.toml", "-o", "m.h5"]) == 0
    assert seen == [False]


def test_small_angles_are_noted(folder, stubs, capsys):
    Path("s.toml").write_text(SWEEP.replace("[-30, 5]", "[-0.5, 0.5]"))
    assert main(["sweep", "s.toml", "-o", "m.h5"]) == 0
    note = "note: axes.attack_angle reaches 0.5 degrees only; it is not in radians"
    assert capsys.readouterr().err.strip() == note


def test_ctrl_c_says_how_to_resume(folder, stubs, capsys):
    stubs.error = KeyboardInterrupt("interrupted: 1 of 2 cells are kept")
    line = failed(capsys, main(["sweep", "s.toml", "-o", "m.h5"]), 130)
    assert line == "wiperjax: interrupted: 1 of 2 cells are kept"
    assert files(folder) == ["s.toml", "scene.toml"]


def test_ctrl_c_beside_the_blocks_says_how_to_go_on_where_anything_is_kept(folder, stubs, capsys):
    stubs.error = KeyboardInterrupt()
    assert failed(capsys, main(["sweep", "s.toml", "-o", "m.h5"]), 130) == "wiperjax: interrupted"
    Path("m.h5.parts").mkdir()
    assert main(["sweep", "s.toml", "-o", "m.h5", "--model", "bar"]) == 130
    first, again = capsys.readouterr().err.splitlines()
    assert first == "wiperjax: interrupted: what is finished is kept in m.h5.parts; go on with"
    assert again.split() == "wiperjax sweep s.toml -o m.h5 --model bar --resume".split()


@pytest.mark.parametrize("told", ["", "interrupted: points are kept; go on with the same command"])
def test_ctrl_c_in_a_refinement_says_how_to_go_on(told, folder, monkeypatch, capsys):
    """By the very words: those of a sweep that was forced would begin anew."""

    def stopped(path, **options):
        Path("m.h5.refine").mkdir()
        raise KeyboardInterrupt(told)

    words = ["refine", "m.h5", "--levels", "2"]
    module = types.ModuleType("wiperjax.maps.refine.driver")
    module.refine = stopped
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(sys, "argv", ["wiperjax", *words])
    whole.write_dataset(small_map(), "m.h5")
    assert main(words) == 130
    first, again = capsys.readouterr().err.splitlines()
    assert first == "wiperjax: interrupted: what is finished is kept in m.h5.refine; go on with"
    assert again.split() == ["wiperjax", *words]


def test_simulate(folder, stubs, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["wiperjax", "simulate", "scene.toml", "-o", "r.h5"])
    assert main(["simulate", "scene.toml", "-o", "r.h5"]) == 0
    assert stubs.calls[0] == ("configure", 1)
    assert stubs.calls[1][1].run.duration == 0.1
    assert "r.h5: 3 time, 2 axis" in capsys.readouterr().out
    with whole.open_map("r.h5") as run:
        assert run.position.shape == (3, 2)
        assert run.attrs["command"] == "wiperjax simulate scene.toml -o r.h5"


def test_a_window_too_short_for_the_flip_is_noted(folder, stubs, capsys):
    belt = '[belt]\nkind = "wiping"\namplitude = 0.8\nfrequency = 5\n'
    Path("s.toml").write_text(f"{SCENE}{belt}[classes]\nreversal_window = 0.02\n")
    assert main(["simulate", "s.toml", "-o", "r.h5"]) == 0
    note = "note: classes.reversal_window is 0.02 s, but the glass needs up to 0.028 s after V = 0"
    assert capsys.readouterr().err.startswith(note)


def test_what_did_not_reach_its_end_is_said_by_all_that_write_it(folder, stubs, capsys):
    time = np.arange(800) / 8000
    speed = ("time", np.sin(5000 * time), {"units": "m/s"})
    regime = ("time", np.ones(800, np.int8), {"flag_values": [1], "flag_meanings": "slip_pos"})
    stubs.run = xr.Dataset(
        {"velocity": speed, "position": speed, "regime": regime, "result": 5, "final_time": 0.1},
        coords={"time": time},
        attrs={"duration": 0.2, "result_message": "impacts accumulate"},
    )
    expected = "note: the run ended at 0.1 of 0.2 s, zeno_unresolved: impacts accumulate\n"
    for command in ("simulate scene.toml -o r.h5", "listen r.h5", "export r.h5 -o r.csv"):
        assert main(command.split()) == 0
        said = capsys.readouterr().err
        assert said.endswith(expected) and said.count("the run ended") == 1, command
    stubs.run["result"] = 0
    assert main("simulate scene.toml -o s.h5".split()) == 0 and not capsys.readouterr().err


def test_what_is_wrong_with_a_scene_names_its_file(folder, stubs, capsys):
    stubs.error = ValueError("start.equilibrium must be left out: no steady slip exists")
    said = failed(capsys, main(["simulate", "scene.toml", "-o", "r.h5"]))
    assert said == f"wiperjax: scene.toml: {stubs.error}"


def test_ctrl_c_in_simulate(folder, stubs, capsys):
    stubs.error = KeyboardInterrupt()
    line = failed(capsys, main(["simulate", "scene.toml", "-o", "r.h5"]), 130)
    assert line == "wiperjax: interrupted, nothing was written"


def test_plot_needs_neither_jax_nor_its_settings(folder, stubs):
    whole.write_dataset(small_map(), "m.h5")
    assert main(["plot", "m.h5", "-o", "p.png"]) == 0
    options = {"picture": None, "force": False, "dpi": None}
    assert stubs.calls == [("plot_file", Path("m.h5"), Path("p.png"), options)]
    assert Path("p.png").read_bytes() == b"picture"
    assert main(["plot", "m.h5", "-o", "P.PNG"]) == 0  # as Windows writes it


def test_plot_hands_on_its_options(folder, stubs):
    whole.write_dataset(small_map(), "m.h5")
    words = (
        "plot m.h5 -o p.svg --picture line --x belt_speed --at normal_load=15 --at restitution=0"
    )
    assert main([*words.split(), "--dpi", "90", "--from", "0.1", "--to", "0.2"]) == 0
    assert stubs.calls[0][3] == {
        "picture": "line",
        "force": False,
        "dpi": 90,
        "x": "belt_speed",
        "at": {"normal_load": 15.0, "restitution": 0.0},
        "start": 0.1,
        "stop": 0.2,
    }
    assert main("plot m.h5 -o p.png --all --seconds 2".split()) == 0
    assert stubs.calls[1] == (
        "plot_all", Path("m.h5"), Path("p.png"), {"force": False, "dpi": None, "seconds": 2.0},
    )  # fmt: skip


def test_help_of_plot_names_every_picture(capsys):
    from wiperjax.plots import PICTURES
    from wiperjax.vocabulary.products import PRODUCTS

    assert main(["plot", "--help"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    for kind, pictures in PICTURES.items():
        told = printed.split(f"Pictures of {PRODUCTS[kind].words}: ")[1].split(".")[0]
        assert all(name in told for name in pictures)
        for name, picture in pictures.items():
            if "quantity" in picture.options:
                assert name in re.split("Variable for ", printed)[1].split(".")[0]
    usual = inspect.signature(PICTURES["map"]["value"].draw).parameters["quantity"].default
    assert f"value (of --quantity, else {usual}," in printed


def test_plot_that_fails(folder, stubs, capsys):
    whole.write_dataset(small_map(), "m.h5")
    stubs.error = ValueError("no label in m.h5")
    status = main(["plot", "m.h5", "-o", "p.png"])
    assert failed(capsys, status) == "wiperjax: no label in m.h5"


def test_info(folder, capsys):
    whole.write_dataset(small_map(), "m.h5")
    assert main(["info", "m.h5"]) == 0
    printed = capsys.readouterr().out
    assert "attack_angle 2" in printed and "title: two cells" in printed
    assert "specification_text:\n    [axes]\n    [run]\n" in printed
    assert "chattering          1    50.0%" in printed


def test_info_says_that_a_file_is_none_of_ours(folder):
    """As a process: a warning of xarray's came first, and then not a word."""
    with h5py.File("strange.h5", "w") as file:
        file["a"] = np.arange(3)
    words = [sys.executable, "-m", "wiperjax", "info", "strange.h5"]
    ran = subprocess.run(words, capture_output=True, text=True, check=True)
    assert ran.stderr == "note: strange.h5 does not say that wiperjax made it\n"
    assert "phony_dim_0 3" in ran.stdout


def test_verify(folder, stubs, capsys):
    whole.write_dataset(small_map(), "m.h5")
    assert main(["verify", "m.h5", "--cells", "5", "--seed", "7"]) == 0
    assert stubs.calls[1] == ("verify", Path("m.h5"), 5, 7)
    assert "2 cells computed again, 3 columns compared: identical" in capsys.readouterr().out
    stubs.report.passed, stubs.report.identical = False, False
    stubs.report.differing, stubs.report.largest = (1,), {"steps": 0.25}
    assert main(["verify", "m.h5"]) == 1
    printed = capsys.readouterr().out
    assert "1 of 2 cells differ, the first: 1" in printed
    assert "steps: largest relative difference 0.25" in printed


def test_version_and_help(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("wiperjax ")
    assert main(["--help"]) == 0
    printed = capsys.readouterr().out
    for command in ("sweep", "simulate", "plot", "listen", "info", "verify"):
        assert command in printed
    for words in ([], ["-h"]):
        assert main(words) == 0
        assert capsys.readouterr().out == printed
    assert main(["sweep", "-h"]) == 0
    assert "SWEEP.toml" in capsys.readouterr().out


def test_python_m_wiperjax(tmp_path):
    ran = subprocess.run(
        [sys.executable, "-m", "wiperjax", "sweep", "missing.toml", "-o", str(tmp_path / "m.h5")],
        capture_output=True,
        text=True,
    )
    assert ran.returncode == 1
    assert ran.stderr == "wiperjax: missing.toml: cannot be read: No such file or directory\n"


def test_with_standard_error_closed_nothing_of_it_goes_to_standard_output(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["wiperjax", "sweep", "missing.toml", "-o", "m.h5"])
    monkeypatch.setattr(sys, "stderr", None)
    monkeypatch.setattr("wiperjax.cli.seek_garbage_less", lambda: None)
    assert main() == 1 and capsys.readouterr().out == ""
    sys.stderr.close()


def test_a_timer_that_ctrl_c_left_behind_does_not_hold_the_process(monkeypatch, folder, stubs):
    """JAX has one while it looks for a TPU: four of 75 processes stayed for a minute."""
    timer = threading.Timer(60, print)

    def looked(spec):
        timer.start()
        raise KeyboardInterrupt

    monkeypatch.setattr(sys.modules["wiperjax.runs.scene"], "run_scene", looked)
    monkeypatch.setattr(sys, "argv", ["wiperjax", "simulate", "scene.toml", "-o", "r.h5"])
    monkeypatch.setattr("wiperjax.cli.seek_garbage_less", lambda: None)
    try:
        assert main() == 130
        timer.join(5)
        assert not timer.is_alive()
    finally:
        timer.cancel()


def test_the_command_line_alone_imports_nothing_heavy():
    code = """if True:
        import sys, types
        package = types.ModuleType("wiperjax")  # in place of __init__, which may import anything
        package.__path__ = [sys.argv[1]]
        sys.modules["wiperjax"] = package
        import wiperjax.cli
        heavy = {"jax", "matplotlib", "xarray", "numpy", "h5py"} & set(sys.modules)
        sys.exit(", ".join(heavy) or 0)
    """
    package = Path(__file__).parents[2] / "wiperjax"
    subprocess.run([sys.executable, "-c", code, str(package)], check=True)


# --- refused before any work ----------------------------------------------------------------------


@pytest.mark.parametrize(
    "words, line",
    [
        ("sweep s.toml -o no/m.h5", "no/m.h5: cannot be written: no is not an existing folder"),
        ("sweep s.toml -o m.png", "m.png: must end in .h5 or .hdf5 or .nc"),
        ("sweep s.toml -o there.h5", "there.h5: exists already; use --force to replace it"),
        ("sweep s.toml -o drawn.h5", "drawn.png: exists already; use --force to replace it"),
        ("sweep s.toml -o folder.h5", "folder.h5: cannot be written: it is a folder"),
        ("sweep s.toml -o m.h5 --force --resume", "--force starts anew and --resume continues"),
        ("sweep none.toml -o m.h5", "none.toml: cannot be read: No such file or directory"),
        ("sweep typo.toml -o m.h5", "typo.toml: blade.mu_statik: unknown key; did you mean"),
        (
            "sweep slopes.toml -o m.h5 --target-error 1e-5",
            "slopes.toml: --target-error 1e-05 does not go with derivatives: run.rtol: must be",
        ),
        (
            "sweep s.toml -o m.h5 --target-error 1e-3 --sensitivities",
            "s.toml: --target-error 0.001 does not go with derivatives: run.precision: must be",
        ),
        (
            "sweep float32.toml -o m.h5 --sensitivities",
            "float32.toml: run.precision: must be 'float64' with sensitivities, was 'float32'",
        ),
        (
            "sweep own.toml -o m.h5 --target-error 1e-3",
            "own.toml: --target-error must be left out with system = 'oscillator'",
        ),
        ("simulate s.toml -o r.h5", "s.toml: has [axes], so it is a sweep"),
        ("sweep scene.toml -o r.h5", "scene.toml: has a run.duration and no [axes], so it is a sc"),
        ("simulate scene.toml -o there.h5", "there.h5: exists already; use --force"),
        ("simulate scene.toml -o r.txt", "r.txt: must end in .h5 or .hdf5 or .nc"),
        ("plot there.h5 -o p.h5", "p.h5: must end in .png or .pdf or .svg"),
        ("plot there.h5 -o p.gif --all", "p.gif: must end in .png or .pdf or .svg"),
        ("plot there.h5 -o p.png --all -p phase", "--all draws every picture and --picture one"),
        ("plot there.h5 -o p.png --at load", "--at must be AXIS=NUMBER, such as normal_load=15"),
        (
            "plot there.h5 -o p.png --at normal_load=15 --at normal_load=5",
            "--at must name each axis once, but named normal_load twice",
        ),
        (
            "refine there.h5 --levels 2 --box normal_load=5:6 --box normal_load=7:8",
            "--box must name each axis once, but named normal_load twice",
        ),
        ("plot .", "-o must be given: . has no name to call a file after"),
        (
            "plot half.h5 -o p.png",
            "half.h5: does not exist; an unfinished sweep is in half.h5.parts",
        ),
        ("listen there.h5 -o drawn.png", "drawn.png: must end in .wav"),
        ("listen there.h5 -o .", "the output must name a file that ends in .wav"),
        ("listen there.h5 -o .wav", "the output must name a file that ends in .wav"),
        (
            "explore there.h5 --static p.html --cell belt_speed=1;normal_load=3",
            "--cell must be AXIS=NUMBER, such as normal_load=15, was belt_speed=1;",
        ),
        ("plot none.h5 -o p.png", "none.h5: does not exist"),
        ("info none.h5", "none.h5: does not exist"),
        ("info s.toml", "s.toml: is not a readable map"),
        ("verify none.h5", "none.h5: does not exist"),
    ],
)
def test_refused_before_any_work(words, line, folder, stubs, capsys):
    Path("typo.toml").write_text("[blade]\nmu_statik = 1\n" + SWEEP)
    Path("float32.toml").write_text(SWEEP + "precision = 'float32'\n")
    Path("slopes.toml").write_text(SWEEP + "[sensitivities]\n")
    own = 'system = "oscillator"\n' + SWEEP.replace("attack_angle", "mass").replace("-30", "1")
    Path("own.toml").write_text(own)
    Path("there.h5").write_bytes(b"precious")
    Path("drawn.png").write_bytes(b"precious")
    Path("folder.h5").mkdir()
    Path("half.h5.parts").mkdir()
    before = files(folder)
    assert failed(capsys, main(words.split())).startswith(f"wiperjax: {line}")
    assert stubs.work == [] and files(folder) == before
    assert Path("there.h5").read_bytes() == b"precious"


def test_the_input_is_never_the_output(folder, stubs, capsys):
    Path("s.h5").write_text(SWEEP)
    line = failed(capsys, main(["sweep", "s.h5", "-o", "./s.h5", "--force"]))
    assert line == "wiperjax: s.h5: must be another file than the input"
    assert Path("s.h5").read_text() == SWEEP and stubs.work == []


@pytest.mark.parametrize(
    ("words", "helps"),
    [
        ("sweep s.toml", "wiperjax sweep --help"),
        ("sweep s.toml -o m.h5 --nope", "wiperjax sweep --help"),
        ("sweep s.toml -o m.h5 --block 0", "wiperjax sweep --help"),
        ("bogus", "wiperjax --help"),
        ("--nope", "wiperjax --help"),
    ],
)
def test_wrong_command_lines_name_the_help_that_helps(words, helps, folder, stubs, capsys):
    assert failed(capsys, main(words.split()), 2).endswith(f"; try '{helps}'")
    assert stubs.calls == []


@pytest.mark.parametrize("command", ["plot r.h5", "listen r.h5"])
@pytest.mark.parametrize("option", ["--from", "--to"])
def test_a_time_that_is_none_is_named_by_its_option(command, option, folder, stubs, capsys):
    said = failed(capsys, main([*command.split(), option, "nan"]), 2)
    assert f"'{option}': must be a finite number, was nan" in said and stubs.calls == []


def test_force_replaces(folder, stubs):
    Path("m.h5").write_bytes(b"old")
    Path("m.png").write_bytes(b"old")
    assert main(["sweep", "s.toml", "-o", "m.h5", "--force"]) == 0
    assert stubs.calls[1][3]["force"] and stubs.calls[2][3]["force"]
    assert Path("m.png").read_bytes() == b"picture"


# --- failures during the work ---------------------------------------------------------------------


@pytest.mark.parametrize(
    "error, line",
    [
        (storage.StoreError("m.h5.parts: is in use"), "wiperjax: m.h5.parts: is in use"),
        (ValueError("first line\nsecond line"), "wiperjax: first line"),
        (OSError(28, "No space left on device", "m.h5"), "wiperjax: m.h5: No space left on device"),
    ],
)
def test_errors_of_the_work_are_one_line(error, line, folder, stubs, capsys):
    stubs.error = error
    assert failed(capsys, main(["sweep", "s.toml", "-o", "m.h5"])) == line


def test_bugs_keep_their_traceback(folder, stubs, monkeypatch, capsys):
    stubs.error = KeyError("bug")
    with pytest.raises(KeyError):
        main(["sweep", "s.toml", "-o", "m.h5"])
    stubs.error = ValueError("odd")
    monkeypatch.setenv("WIPERJAX_TRACEBACK", "1")
    assert main(["sweep", "s.toml", "-o", "m.h5"]) == 1
    assert "Traceback" in capsys.readouterr().err


def test_version_is_that_of_the_package():
    try:
        version = importlib.metadata.version("wiperjax")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("wiperjax is not installed here")
    import wiperjax

    assert wiperjax.__version__ == version


@pytest.mark.long
def test_memory_is_that_of_this_process_alone():
    """The peak that the system hands out begins with that of the process that started this one."""
    held = np.ones(2**27)  # 1 GiB
    code = "from wiperjax.machine.memory import peak_memory; print(peak_memory())"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert 5e6 < int(ran.stdout) < 0.8 * held.nbytes


@pytest.mark.parametrize(
    ("words", "values"),
    [
        ([], (None, 0, None)),
        (["--simulate", "5"], (None, 5, None)),
        (
            "--step 0.1 --second normal_load --second-from 10 --second-to 20".split(),
            (0.1, 0, ("normal_load", 10.0, 20.0)),
        ),
    ],
)
def test_follow_computes_what_it_is_asked_to(words, values, folder, stubs, monkeypatch):
    asked = []

    def follow_scene(spec, over, low, high, *others, keep):
        asked.append(others)
        raise ValueError("far enough")

    followed_by(monkeypatch, follow_scene)
    assert main([*FOLLOW, *words]) == 1
    assert asked == [values]


FOLLOW = "follow scene.toml --over belt_speed --from 0.2 --to 0.4 -o b.h5".split()


def followed_by(monkeypatch, follow_scene):
    piece = types.ModuleType("wiperjax.cycles.branch.from_scene")
    piece.follow_scene = follow_scene  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "wiperjax.cycles.branch.from_scene", piece)


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [(KeyboardInterrupt(), 130, "interrupted"), (RuntimeError("of a curve"), 1, "of a curve")],
)
def test_a_branch_is_kept_whatever_ends_what_comes_after_it(
    error, status, said, folder, stubs, monkeypatch, capsys
):
    """Nothing was written before curves and simulations were done."""

    def follow_scene(*_, keep):
        for done, lacks in enumerate(("curves and simulations", "simulations")):
            keep(xr.Dataset(attrs={"done": done}), lacks)
        raise error

    followed_by(monkeypatch, follow_scene)
    assert main(FOLLOW) == status
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["note: b.h5 holds the branch, without its simulations", f"wiperjax: {said}"]
    with whole.open_map("b.h5", check=True) as ds:
        assert ds.attrs["done"] == 1
    assert files(folder) == ["b.h5", "s.toml", "scene.toml"]


def test_help_keeps_its_brackets(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    assert main(["sweep", "--help"]) == 0
    assert "[sensitivities]" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "output"),
    [
        ("plot m.h5", "m-overview.png"),
        ("plot m.h5 -p classes", "m-classes.png"),
        ("plot m.h5 -p animation", "m-animation.gif"),
        ("plot m.h5 --all", "m.png"),  # plot_all adds the names
        ("plot m.h5.parts -p classes", "m-classes.png"),
    ],
)
def test_plot_chooses_a_name(words, output, folder, stubs):
    whole.write_dataset(small_map(), Path("m.h5"))
    Path("m.h5.parts").mkdir()
    assert main(words.split()) == 0
    assert stubs.calls[-1][2] == Path(output)


def test_classes_of_the_map_of_one_start_are_counted(capsys):
    """`ds.sel(start="up")`, with or without what it was: the classes ended in a traceback."""
    label = {"flag_values": np.array([0, 1]), "flag_meanings": "quiet squeal"}
    ds = xr.Dataset(
        {"label": (("speed", "start"), [[0, 1], [1, 1]], label), "class_set": ("speed", [3, 2])},
        coords={"start": ["up", "down"]},
    )
    for one in (ds.sel(start="up"), ds.sel(start="up", drop=True)):
        tables.print_classes(one)
        lines = capsys.readouterr().out.splitlines()
        assert lines[-1] == "the class depends on the start in 1 of 2 cells"
        assert not any(line.startswith("start ") for line in lines)
    tables.print_classes(ds)
    assert "start down: squeal 100.0%" in capsys.readouterr().out


@pytest.mark.slow
def test_info_of_a_run_begins_with_its_class(squeal, folder, capsys):
    whole.write_dataset(squeal, Path("r.h5"))
    assert main(["info", "r.h5"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(re.match(r"label +squeal$", line) for line in lines[:4])
    assert any(line.startswith("tip_mass") for line in lines)


@pytest.mark.parametrize(
    ("result", "line"),
    [
        ("zeno_unresolved", "failed       1 cell: zeno_unresolved, impacts accumulate"),
        ("finished", "failed       1 cell: finished, but without numbers that its class rests on"),
    ],
)
def test_why_cells_of_a_map_failed_is_told(result, line, capsys):
    """Neither a sweep nor `info` of its map said it: only the variable `result` did."""
    ds = xr.Dataset(
        {
            name: ("speed", values, schema.SCHEMA[name].attributes())
            for name, values in {"label": [0, 6], "result": [0, codes.RESULTS[result]]}.items()
        }
    )
    tables.print_open(ds)
    assert capsys.readouterr().out.startswith(line)
    tables.print_open(ds.isel(speed=[0]))
    assert not capsys.readouterr().out


@pytest.mark.parametrize(("model", "told"), [("bar", True), ("lip", False)])
def test_where_a_bar_is_held_on_the_glass_is_told(model, told, capsys):
    ds = xr.Dataset(
        {"label": ("speed", [1, 1, 0]), "flight_fraction": ("speed", [1e-3, 0.5, 0.0])},
        attrs={"model": model},
    )
    tables.print_open(ds)
    line = "lifted       2 cells: held on the glass where the lip would leave it; "
    assert capsys.readouterr().out.startswith(line) == told


@pytest.mark.parametrize(
    ("label", "frequency", "told", "sticks", "word"),
    [
        ("other", 1.9e6, "yes", 0, "none: no tone"),  # of what is carried, rounding has a line, too
        ("quiet", np.nan, "no", 0, "none: no tone"),  # nobody hears what coarse samples miss
        ("other", np.nan, "no", 1, "not known: window too short (run.duration)"),
        ("other", np.nan, "no", 2, "not known: not told by these samples (run.sample_interval)"),
        ("failed", np.nan, "unknown", 0, "not known: no line"),
        ("failed", 756.0, "yes", 9, "not known: no turn in the settled part (run.duration"),
        ("squeal", 780.8, "yes", 9, "780.8 Hz"),
        ("squeal", 0.17404, "yes", 9, "0.174 Hz"),
    ],
)
def test_the_frequency_of_a_run_is_told_where_it_has_one(
    label, frequency, told, sticks, word, monkeypatch, capsys
):
    known = {"dominant_frequency": frequency, "frequency_told": codes.TOLD[told]}
    known |= {"stick_count": sticks, "impact_count": 0, "stick_fraction": 0.5}
    known |= {"flight_fraction": 0.0, "label": codes.LABELS[label], "result": 0}
    known |= {"vibration_reversal": np.nan if label == "failed" and told == "yes" else 0.1}
    band = codes.BANDS["squeal" if label == "squeal" else "none"]
    found = xr.Dataset({name: ((), x) for name, x in known.items()} | {"band": band})
    monkeypatch.setattr(run_class, "assess", lambda run: found)
    tables.print_class(None)
    assert f"frequency   {word}" in capsys.readouterr().out


def test_modes_of_a_sweep_name_its_file(folder, capsys):
    """Of a sweep whose model a probe would choose it said what was wrong, not in which file."""
    axes = 'model = "auto"\n[axes]\nattack_angle = { values = [0, 5] }\n'
    Path("s.toml").write_text(axes + "[run]\ntransient = 0.1\nwindow = 0.1\n")
    assert main(["modes", "s.toml"]) == 1
    said = "wiperjax: s.toml: model must be one of block, bar, lip, but was 'auto'"
    assert said in capsys.readouterr().err


def test_info_and_export_of_modes_over_a_sweep(folder, capsys):
    """They were taken for a run: "run must be a run of a scene file"."""
    rates = np.array([[-1.0, 2.0], [3.0, np.nan]])
    modes = xr.Dataset(
        {
            "growth_rate": (("load", "speed"), rates),
            "exists": (("load", "speed"), np.isfinite(rates).astype(np.int8)),
            "real_part": (("load", "speed", "mode"), rates[..., None]),
            "frequency": (("load", "speed", "mode"), np.full((2, 2, 1), 5.0)),
        },
        attrs={"belt_kind": "steady"},
    )
    whole.write_dataset(modes, Path("modes.h5"))
    assert main(["info", "modes.h5"]) == 0
    said = capsys.readouterr().out
    assert "steady sliding in 3 of 4 cells, unstable in 2\nof these 2 oscillate" in said
    assert main(["export", "modes.h5", "-o", "modes.uff"]) == 1
    said = capsys.readouterr().err
    assert "only a run or modes of one system can be exported (a map as a table: docs/" in said


@pytest.mark.slow
def test_a_window_with_one_slip_in_it_is_too_short(capsys):
    """Chattering at 8.1 Hz, looked at for 0.1 s, was called too fast for its samples."""
    blade, belt = {"attack_angle": -30}, {"kind": "steady", "speed": 0.05}
    times = {"duration": 0.3, "transient": 0.2, "sample_interval": 5e-5}
    tables.print_class(run_scene({"blade": blade, "belt": belt, "run": times}))
    assert "frequency   not known: window too short (run.duration)" in capsys.readouterr().out


def test_ctrl_c_outside_of_a_long_command_is_said(monkeypatch, capsys, tmp_path):
    """The typer of today makes a status of it, and nothing was said."""

    def stopped(path):
        raise KeyboardInterrupt

    monkeypatch.setattr("wiperjax.cli.compute.check_source", stopped)
    words = ["verify", str(tmp_path / "map.h5")]
    assert failed(capsys, main(words), 130) == "wiperjax: interrupted"
