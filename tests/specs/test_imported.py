"""Modules of one's own: which one a file means, where Python has several of that name."""

import sys

import pytest

from wiperjax.specs.errors import SpecError
from wiperjax.specs.load import load_scene, load_sweep, parse_sweep

LAW = """
import wiperjax
from wiperjax import parameter

class Falling(wiperjax.AbstractFriction):
    static: float = parameter(1.0, low=0)

    def coefficient(self, speed):
        return self.static / (1 + {} * speed)
"""

SWEEP = """
blade.friction = "{}:Falling"
axes.static = {{ values = [0.5, 1.0] }}
run = {{ transient = 0, window = 0.1 }}
"""


@pytest.fixture
def folders(tmp_path, monkeypatch):
    """Two folders, each with a sweep and its law; the laws are of one name and of unlike physics.
    Python forgets them afterwards."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    for name, steepness in (("a", 3), ("b", 9)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "twin_law.py").write_text(LAW.format(steepness))
        (tmp_path / name / "sweep.toml").write_text(SWEEP.format("twin_law"))
    yield tmp_path
    for name, module in list(sys.modules.items()):
        if str(getattr(module, "__file__", None)).startswith(str(tmp_path)):
            sys.modules.pop(name)


def test_a_law_of_another_folder_is_not_taken_for_that_beside_the_file(folders):
    first = load_sweep(folders / "a/sweep.toml").canonical()
    must = f"must be that beside the file, {folders}/b/twin_law.py, was {folders}/a/twin_law.py: "
    with pytest.raises(SpecError, match=rf"^{folders}/b/.* blade.friction: module .* {must}"):
        load_sweep(folders / "b/sweep.toml")
    (folders / "b/scene.toml").write_text('blade.friction = "twin_law:Falling"\n')
    with pytest.raises(SpecError, match=must):
        load_scene(folders / "b/scene.toml")
    (folders / "b/twin_law.py").unlink()  # nothing of that name lies beside: any that Python finds
    assert load_sweep(folders / "b/sweep.toml").canonical() == first
    assert load_sweep(folders / "a/sweep.toml").canonical() == first


def test_the_file_comes_before_a_working_directory_that_is_on_the_path(folders, monkeypatch):
    monkeypatch.syspath_prepend(folders / "a")
    monkeypatch.chdir(folders / "a")
    with pytest.raises(SpecError, match=rf"{folders}/b/twin_law.py, was {folders}/a/twin_law.py"):
        load_sweep(folders / "b/sweep.toml")


@pytest.mark.parametrize(("name", "other"), [("wave", r"/\S+/wave.py"), ("time", "one built in")])
def test_a_module_of_the_library_is_not_taken_for_that_beside_the_file(folders, name, other):
    (folders / "a" / f"{name}.py").write_text(LAW.format(3))
    (folders / "a/sweep.toml").write_text(SWEEP.format(name))
    with pytest.raises(SpecError, match=rf"module '{name}' must be .*/a/{name}.py, was {other}"):
        load_sweep(folders / "a/sweep.toml")


def test_a_base_of_another_folder_is_not_taken(folders):
    """The class itself is the one beside the file; what it inherits is not."""
    load_sweep(folders / "a/sweep.toml")
    text = "import twin_law\nclass Falling(twin_law.Falling):\n    pass\n"
    (folders / "b/heir.py").write_text(text)
    (folders / "b/sweep.toml").write_text(SWEEP.format("heir"))
    with pytest.raises(SpecError, match="module 'twin_law' must be that beside the file"):
        load_sweep(folders / "b/sweep.toml")


def test_a_package_beside_the_file_is_found(folders):
    (folders / "a/laws").mkdir()
    for name in ("__init__", "dry"):
        (folders / "a/laws" / f"{name}.py").write_text(LAW.format(3))
    for name in ("laws", "laws.dry"):
        (folders / "a/sweep.toml").write_text(SWEEP.format(name))
        assert f'"{name}:Falling"' in load_sweep(folders / "a/sweep.toml").canonical()


MEASURED = """
import equinox as eqx
import jax.numpy as jnp
import numpy as np
import own_systems
import wiperjax
from pathlib import Path

def read():
    return np.loadtxt(Path(__file__).with_name("measured.csv"))

class Given(wiperjax.AbstractFriction):
    static: float = 2.0
    table: tuple = ()

    def coefficient(self, speed):
        return jnp.interp(speed, jnp.arange(3.0), jnp.asarray(self.table))

class OfModule(Given):
    def coefficient(self, speed):
        return jnp.interp(speed, jnp.arange(3.0), {held})

class OfField(Given):
    table: tuple = {field}

class Block(own_systems.Oscillator):
    friction: wiperjax.AbstractFriction = {default}
"""
UNUSED = {"held": "TABLE", "field": "()", "default": "wiperjax.Coulomb(0.5)"}
TABLES = {
    "a field": UNUSED | {"field": "tuple(read().tolist())"},
    "a factory": UNUSED | {"field": "eqx.field(default_factory=lambda: (*read(),))"},
    "an array": UNUSED | {"more": "TABLE = read()"},
    "a list of pairs": UNUSED | {"more": "TABLE = list(enumerate(read().tolist()))"},
    "a mapping": UNUSED | {"more": "TABLE = {'mu': jnp.asarray(read())}"},
    "a law by default": UNUSED | {"default": "Given(table=(*read().tolist(),))"},
}


@pytest.mark.parametrize("where", TABLES)
def test_a_table_that_was_read_from_another_file_tells_maps_apart(folders, monkeypatch, where):
    """One that was changed between a stop and `--resume` made one map of two laws of friction."""
    parts = dict(TABLES[where])
    text = MEASURED.format(**{name: parts[name] for name in UNUSED}) + parts.get("more", "")
    (folders / "a/measured_law.py").write_text(text)
    monkeypatch.syspath_prepend(folders / "a")
    of_law = {"blade": {"friction": "measured_law:OfField"}, "axes": {"static": {"values": [1, 2]}}}
    if parts.get("more"):
        of_law["blade"]["friction"] = "measured_law:OfModule"
    if where == "a law by default":
        of_law = {"system": "measured_law:Block", "axes": {"mass": {"values": [1, 2]}}}
    digests = []
    for third in (0.4, 0.5, 0.4):
        (folders / "a/measured.csv").write_text(f"0.9\n0.5\n{third}\n")
        sys.modules.pop("measured_law", None)  # as the next process finds it
        spec = parse_sweep(of_law | {"run": {"transient": 0, "window": 20.0}})
        digests.append(spec.digest())
    assert digests[0] == digests[2] != digests[1]


def test_a_module_without_the_class_is_named_with_its_file(folders):
    (folders / "a/sweep.toml").write_text(SWEEP.format("twin_law").replace("Falling", "Rising"))
    named = rf"module 'twin_law' has no class 'Rising' \(in {folders}/a/twin_law.py\)$"
    with pytest.raises(SpecError, match=named):
        load_sweep(folders / "a/sweep.toml")


def test_a_module_that_ends_the_process_is_named(folders):
    (folders / "a/ending_law.py").write_text("import sys\n\nsys.exit(3)\n")
    (folders / "a/sweep.toml").write_text(SWEEP.format("ending_law"))
    with pytest.raises(SpecError, match="module 'ending_law' cannot be imported: SystemExit: 3$"):
        load_sweep(folders / "a/sweep.toml")


def test_an_axis_that_keeps_a_map_from_being_refined_is_noted(folders):
    """It was refused only when the map was there, to be computed again under another name."""
    (folders / "a/level_law.py").write_text(LAW.format(3) + "\n    level: float = 1.0\n")
    text = SWEEP.format("level_law")
    (folders / "a/sweep.toml").write_text(text.replace("static", "level"))
    (note,) = load_sweep(folders / "a/sweep.toml").notes()
    assert note == (
        "axes.level is called as a variable of borders or levels: the map cannot be refined"
    )
    (folders / "a/sweep.toml").write_text(text)
    assert load_sweep(folders / "a/sweep.toml").notes() == []
