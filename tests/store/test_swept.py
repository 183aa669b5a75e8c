"""Maps of a law of one's own whose source was changed since: nothing more is computed from them."""

import linecache
import re
import sys

import pytest
from stub_sweep import evaluate

from wiperjax.cli import main
from wiperjax.explorer.explored import explored, open_explored
from wiperjax.machine.files import StoreError
from wiperjax.maps.driver import sweep
from wiperjax.maps.refine.driver import refine
from wiperjax.maps.refine.replay import replay
from wiperjax.maps.verify import verify
from wiperjax.specs.load import load_sweep
from wiperjax.store.swept import sweep_of
from wiperjax.store.whole import open_map

LAW = """
import wiperjax
from wiperjax import parameter

class Falling(wiperjax.AbstractFriction):
    static: float = parameter(1.0, low=0)

    def coefficient(self, speed):
        return self.static / (1 + 3 * speed)
"""

SWEEP = """
blade.friction = "edited_law:Falling"
axes.attack_angle = { start = -40, stop = 40, num = 5 }
axes.belt_speed = { start = 0.1, stop = 0.9, num = 5 }
run = { transient = 0.2, window = 0.2 }
"""


def changed(path, old, new):
    """A source in which something is another, as the next process finds it."""
    path.write_text(path.read_text().replace(old, new))
    sys.modules.pop("edited_law", None)
    linecache.clearcache()


@pytest.fixture
def law(tmp_path, monkeypatch):
    """The law of a refined map `map.h5`, which lies beside it in the working directory."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "edited_law.py").write_text(LAW)
    (tmp_path / "sweep.toml").write_text(SWEEP)
    spec = load_sweep("sweep.toml")
    sweep(spec, "map.h5", evaluate=evaluate, progress=False).close()
    refine("map.h5", evaluate=evaluate, levels=2, progress=False)
    yield tmp_path / "edited_law.py"
    sys.modules.pop("edited_law", None)


@pytest.mark.slow
def test_a_law_beside_its_map_is_found_from_any_folder(law, monkeypatch):
    """It was looked for in the working directory alone, though the error said otherwise."""
    path, elsewhere = law.parent / "map.h5", law.parent / "elsewhere"
    elsewhere.mkdir()

    def as_the_next_process():
        monkeypatch.chdir(elsewhere)
        sys.modules.pop("edited_law", None)
        sys.path[:] = [place for place in sys.path if place != str(law.parent)]

    for ask in (
        lambda: verify(path, evaluate=evaluate),
        lambda: refine(path, evaluate=evaluate, levels=3, progress=False),
        lambda: replay(path),
    ):
        as_the_next_process()
        ask()
    as_the_next_process()
    found, file = open_explored(path, trusted=True)
    file.close()
    assert found.spec is not None, found.unable
    as_the_next_process()
    found, file = open_explored(path)
    file.close()
    assert found.spec is None and "edited_law" not in sys.modules


UNLIKE = "has another source, or other tables in it, than it had"
OTHERWISE = rf"made otherwise \(edited_law:Falling {UNLIKE}\)"


def test_no_command_computes_from_a_map_whose_law_was_changed(law, capsys):
    with open_map("map.h5") as ds:
        assert sweep_of(ds, "map.h5").digest() == ds.attrs["specification_digest"]
    changed(law, "3 * speed", "3 * speed**2")
    for ask in (
        lambda: verify("map.h5", evaluate=evaluate),
        lambda: refine("map.h5", evaluate=evaluate, levels=3, progress=False),
        lambda: replay("map.h5"),
    ):
        with pytest.raises(StoreError, match=f"^map.h5: was {OTHERWISE}; sweep it anew$"):
            ask()
    assert main(["modes", "map.h5"]) == 1
    assert UNLIKE in capsys.readouterr().err
    changed(law, "speed**2", "speed")
    replay("map.h5")


def test_no_motion_of_a_changed_law_is_shown_beside_a_map(law):
    changed(law, "3 *", "3.0 *")
    found, file = open_explored("map.h5", trusted=True)
    file.close()
    assert found.spec is None and re.search(OTHERWISE, found.unable)
    changed(law, "3.0 *", "3 *")
    found, file = open_explored("map.h5", trusted=True)
    file.close()
    assert found.spec is not None and not found.unable
    for told in ("no JSON", "[" * 5000, "{}"):
        assert explored(found.ds.assign_attrs(specification_canonical=told), trusted=True).unable
