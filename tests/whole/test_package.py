"""What is published: a wheel and an sdist that work without the checkout, types for those who use
it, and the example files that come with it."""

import os
import subprocess
import sys
import tarfile
import tomllib
import venv
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

from wiperjax.cli import main
from wiperjax.cli.example import examples

CHECKOUT = Path(__file__).parents[2]
USER = """
import numpy as np
import wiperjax
from wiperjax import plots
from wiperjax.cycles import find_cycle

blade = wiperjax.Wiper(belt=wiperjax.SteadyBelt(0.3), attack_angle=np.deg2rad(5.0))
run = wiperjax.simulate(blade, 0.03, sample_interval=1e-5)
late = run.sel(time=slice(0.02, 0.03))
plots.time_history(late)
noise = wiperjax.open_map("map.h5")
share = float(noise.flight_fraction.mean())
cycle = find_cycle(blade, settle=0.02)
print(share, cycle.period, wiperjax.solve(blade, 0.01).final_time)
wiperjax.WipingBelt(0.3, 2.0)
turning = wiperjax.Wiper(belt=wiperjax.TrapezoidBelt(0.3, 2.0, 0.01))
find_cycle(turning, settle=1.0, period=lambda wiper: 1 / wiper.belt.frequency)
"""
WRONG = """
import wiperjax

wiperjax.simulate(duration=0.1)
wiperjax.Wiper(attack_angel=0.1)
wiperjax.smulate
"""


def test_every_shipped_file_is_listed_with_its_title(capsys):
    assert main(["example"]) == 0
    lines = capsys.readouterr().out.splitlines()
    files = sorted((CHECKOUT / "sweeps").rglob("*.toml"))
    assert len(files) == len([line for line in lines if line.startswith("  ")]) > 0
    for file in files:
        title = tomllib.loads(file.read_text())["title"]
        name = str(file.relative_to(CHECKOUT / "sweeps").with_suffix("")).removeprefix("scenes/")
        assert [line.split(maxsplit=1) for line in lines].count([name, title]) == 1


def test_every_example_is_printed_as_it_is(capsys):
    scenes, sweeps = examples()
    for name, file in (scenes | sweeps).items():
        assert main(["example", name]) == 0
        assert capsys.readouterr().out == file.read_text()
    for name, key in (("squeal", "duration"), ("remedies/squeal", "window")):
        main(["example", name])
        assert key in tomllib.loads(capsys.readouterr().out)["run"]


@pytest.mark.parametrize(
    ("name", "hint"), [("squeel", "did you mean squeal or "), ("zzzz", "'wiperjax example' lists")]
)
def test_an_unknown_example_is_one_line(name, hint, capsys):
    assert main(["example", name]) == 1
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1
    assert f"there is no example {name}: {hint}" in said.err


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Folder with the sdist, and the wheel that is built from it."""
    pytest.importorskip("hatchling")
    folder = tmp_path_factory.mktemp("built")
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", folder, CHECKOUT]
    subprocess.run(command, check=True, capture_output=True)
    return folder


@pytest.fixture(scope="module")
def installed(built, tmp_path_factory):
    """A virtual environment with the wheel, and the dependencies of this one, but no checkout."""
    folder = tmp_path_factory.mktemp("installed") / "venv"
    venv.create(folder, with_pip=False, symlinks=True)
    (site,) = folder.glob("lib/python*/site-packages")
    (wheel,) = built.glob("*.whl")
    command = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    command += ["--python", folder, "install", "--no-deps", "--no-index", wheel]
    subprocess.run(command, check=True, capture_output=True)
    # behind it, so that what is installed comes first; a plain folder's .pth files are not read,
    # so the checkout of an editable install stays out
    dependencies = Path(find_spec("jax").origin).parents[1]  # type: ignore[union-attr, arg-type]
    (site / "dependencies.pth").write_text(f"{dependencies}\n")
    return folder


def outside(installed, *words, cwd):
    """Run a program of the environment where nothing leads to the checkout."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    command = [str(installed / "bin" / words[0]), *words[1:]]
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True)


@pytest.mark.slow
def test_the_wheel_has_what_it_needs_and_no_more(built):
    (wheel,) = built.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    folders = {name.split("/")[0] for name in names}
    assert {f for f in folders if not f.endswith(".dist-info")} == {"wiperjax", "wiperjax_bench"}
    for wanted in ("wiperjax/py.typed", "wiperjax/examples/scenes/squeal.toml"):
        assert names.count(wanted) == 1
    shipped = {n.removeprefix("wiperjax/examples/") for n in names if "/examples/" in n}
    sweeps = CHECKOUT / "sweeps"
    assert shipped == {str(f.relative_to(sweeps)) for f in sweeps.rglob("*.toml")}
    modules = {str(f.relative_to(CHECKOUT)) for f in (CHECKOUT / "wiperjax").rglob("*.py")}
    assert modules <= set(names)
    assert any(name.endswith("licenses/LICENSE") for name in names)


@pytest.mark.slow
def test_the_sdist_has_the_tests_and_what_they_read(built):
    (sdist,) = built.glob("*.tar.gz")
    names = {name.partition("/")[2] for name in tarfile.open(sdist).getnames()}
    wanted = ("LICENSE", "CITATION.cff", "README.md", "CHANGELOG.md", "constraints.txt")
    wanted += ("mkdocs.yml", "docs/model.md", "sweeps/quick.toml", "tests/whole/test_package.py")
    assert set(wanted) <= names


@pytest.mark.long
def test_the_wheel_runs_without_the_checkout(installed, tmp_path):
    where = outside(
        installed, "python", "-c", "import wiperjax; print(wiperjax.__file__)", cwd=tmp_path
    )
    assert Path(where.stdout.strip()).is_relative_to(installed), where.stderr
    listed = outside(installed, "wiperjax", "example", cwd=tmp_path)
    assert "remedies/squeal" in listed.stdout and "Squeal at 5 degrees" in listed.stdout
    printed = outside(installed, "wiperjax", "example", "squeal", cwd=tmp_path)
    assert printed.stdout == (CHECKOUT / "sweeps" / "scenes" / "squeal.toml").read_text()
    (tmp_path / "squeal.toml").write_text(printed.stdout)
    done = outside(installed, "wiperjax", "simulate", "squeal.toml", "-o", "run.h5", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "squeal" in outside(installed, "wiperjax", "info", "run.h5", cwd=tmp_path).stdout


@pytest.mark.long
def test_a_type_checker_sees_the_public_names_from_outside(installed, tmp_path):
    """Without `py.typed`, pyright would guess from the source; with it, names must be public."""

    def errors(text):
        (tmp_path / "user.py").write_text(text)
        command = [sys.executable, "-m", "pyright", "--pythonpath", installed / "bin" / "python"]
        found = subprocess.run([*command, "user.py"], cwd=tmp_path, capture_output=True, text=True)
        return [line for line in found.stdout.splitlines() if " - error: " in line]

    (tmp_path / "pyrightconfig.json").write_text('{"typeCheckingMode": "standard"}')
    assert errors(USER) == []
    assert len(errors(WRONG)) >= 3
