"""heyoka sees the motions that the scalar loop sees, where it is installed."""

import dataclasses

import pytest

import wiperjax
from wiperjax_bench.measurements import errors
from wiperjax_bench.rivals import heyoka_phases
from wiperjax_bench.scenes import families

METHOD = heyoka_phases.Taylor()


def test_without_it_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setattr(heyoka_phases.importlib.util, "find_spec", lambda name: None)
    assert METHOD.available() == "heyoka is not installed (pip install heyoka)"


@pytest.mark.long
@pytest.mark.skipif(METHOD.available() is not None, reason=f"{METHOD.available()}")
@pytest.mark.parametrize("name", ["squeal", "chatter", "reversal", "zeno", "grazing", "block"])
def test_events_and_states_are_those_of_the_loop(name):
    scene = getattr(families, name)(8).head(8)
    found = METHOD.prepare(scene, 1e-10)
    error = errors.judge(scene, errors.truth(scene), found.answer())
    assert error.wrong == 0 and error.stopped == 0
    assert error.state < 1e-7 and error.event_time < 1e-9
    assert len(found().position[0]) == 0  # what is timed keeps no history


def test_a_curve_without_a_taylor_series_at_rest_is_not_for_it():
    pytest.importorskip("heyoka", reason=f"{METHOD.available()}")
    scene = families.squeal(2)
    bent = wiperjax.Wiper(belt=scene.wiper.belt, stribeck_shape=1.5)
    scene = dataclasses.replace(scene, wiper=bent)
    with pytest.raises(heyoka_phases.NotForThisScene):
        METHOD.prepare(scene, 1e-6)
