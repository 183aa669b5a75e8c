"""A cell of a map of several starts is simulated from where the sweep began it."""

import numpy as np
import pytest
from stub_sweep import evaluate, make_spec

from wiperjax.explorer.box import box_spec
from wiperjax.explorer.cells import scene_of, start_of
from wiperjax.explorer.explored import Explored, explored
from wiperjax.maps import driver
from wiperjax.specs.load import parse_sweep
from wiperjax.specs.starts import Starts
from wiperjax.vocabulary.codes import LABELS, Regime

PLACE = {"attack_angle": 1, "normal_load": 0, "belt_speed": 3}
X = 1e-3  # m, where every motion ends, as rounding leaves it: a hair above the glass


def ending_in_stick(spec, index, finer=1, room=None, ended=None):
    """Cells that all end in stick, on a glass that moves at their own belt speed."""
    speed = np.broadcast_to(spec.cells(index)["belt_speed"], index.shape)
    end = {"final_x": X, "final_y": 1e-35, "final_vx": speed, "final_vy": -1e-33}
    end["final_regime"] = int(Regime.STICK)
    found = evaluate(spec, index, finer, room)
    if ended is not None:  # random starts: all but the first make a sound of 600 Hz
        time = np.arange(finer * spec.samples) * spec.run.window / (finer * spec.samples)
        loud = ended["final_vx"] < 0.5
        found["velocity_rms"] = loud * 1.0
        found["signal"] = loud[:, None] * np.sqrt(2) * np.sin(1200 * np.pi * time)
        found["result"] = np.zeros(len(index), int)
    return found | {name: np.broadcast_to(x, index.shape) for name, x in end.items()}


def whole(starts):
    spec = parse_sweep(make_spec(angles=2, loads=2).document() | {"starts": starts})
    return explored(driver.sweep(spec, evaluate=ending_in_stick, progress=False))


@pytest.mark.parametrize("way", ["up", "down"])
def test_what_sticks_rides_on_the_glass_of_the_cell_that_goes_on(way):
    """The neighbour's glass had another speed, and a hair above it is in flight."""
    found = whole({"names": [way], "kick": 1e-3})
    speed = float(found.ds["belt_speed"][PLACE["belt_speed"]])
    begun = start_of(found, PLACE, way)
    assert begun["position"] == [pytest.approx(X + 1e-3 * 6e-3), 0.0]
    assert begun["velocity"] == [pytest.approx(speed), 0.0]
    first = PLACE | {"belt_speed": 0 if way == "up" else found.ds.sizes["belt_speed"] - 1}
    assert start_of(found, first, way) == {}


def test_the_usual_one_of_random_starts_is_the_one_the_map_shows():
    """Most squeal, and the first does not: the numbers beside its motion are not its own."""
    found = whole({"random": 9, "seed": 2, "x": [1e-3, 2e-3], "vx": [0.0, 1.0]})
    speeds = found.ds["start_vx"].values
    loud = np.flatnonzero(speeds < 0.5)
    assert loud[0] > 0 and len(loud) > 4
    assert found.cell(PLACE, ["label"])["label"] == LABELS["squeal"]
    begun = start_of(found, PLACE, None)
    assert begun["velocity"] == [speeds[loud[0]], 0.0]
    assert start_of(found, PLACE, 0)["velocity"] == [speeds[0], 0.0]


def test_a_system_of_ones_own_begins_where_it_was_drawn():
    spec = parse_sweep(
        {
            "system": "own_systems:Oscillator",
            "axes": {"stiffness": {"values": [1, 2]}, "belt_speed": {"values": [0.1, 0.2]}},
            "classes": {"quiet_velocity": 1e-3},
            "run": {"transient": 1, "window": 1},
            "starts": {"random": 3, "position": [[-1, 1]], "velocity": [[0, 1]]},
        }
    )
    found = Explored("", whole({"names": ["up"]}).ds, spec, "", tuple(spec.axes), (0, 1, 2))
    draws = Starts.model_validate(spec.starts).draws()
    expected = {name: draws[name][2].tolist() for name in ("position", "velocity")}
    assert start_of(found, {"stiffness": 1, "belt_speed": 0}, 2) == expected


def test_each_cell_of_a_box_begins_at_its_own_steady_slip():
    """And at rest where there is none, as in the map."""
    found = whole({"names": ["steady_slip"], "kick": 1e-3})
    spec = box_spec(found, {"attack_angle": (0, 1), "belt_speed": (2, 4)}, {"normal_load": 1}, None)
    assert spec.starts.names == ["steady_slip"] and spec.starts.kick == 1e-3


@pytest.mark.parametrize("way", ["up", "down"])
def test_a_start_that_was_taken_by_hand_is_the_one_that_is_simulated(way):
    """`ds.sel(start=...)` leaves the attributes of a map of several."""
    both = whole({"names": ["up", "down"], "kick": 1e-3})
    one = explored(both.ds.sel(start=way))
    assert one.starts == (way,) and one.spec is not None
    for start in (None, way):
        assert start_of(one, PLACE, start) == start_of(both, PLACE, way)
    assert one.cell(PLACE, ["final_x"]) == both.cell(PLACE, ["final_x"], way)


def test_random_starts_keep_their_numbers_in_a_part_of_them():
    found = whole({"random": 9, "seed": 2, "x": [1e-3, 2e-3], "vx": [0.0, 1.0]})
    speeds = found.ds["start_vx"].values
    part = explored(found.ds.isel(start=[7, 4, 5]))
    assert part.starts == (7, 4, 5)
    for start in part.starts:
        assert start_of(part, PLACE, start)["velocity"] == [speeds[start], 0.0]
        for name in ("label", "velocity_rms"):
            assert part.cell(PLACE, [name], start) == found.cell(PLACE, [name], start)
    usual = start_of(part, PLACE, None)["velocity"][0]
    label = found.cell(PLACE, ["label"], int(np.flatnonzero(speeds == usual)[0]))
    assert usual in speeds[[7, 4, 5]] and part.cell(PLACE, ["label"]) == label
    alone = explored(found.ds.isel(start=4))
    assert start_of(alone, PLACE, None)["velocity"] == [speeds[4], 0.0]


def test_a_map_that_does_not_say_which_start_it_is_of_is_shown_only():
    both = whole({"names": ["up", "down"]}).ds
    for ds in (both.isel(start=0, drop=True), both.assign_coords(start=["up", "sideways"])):
        assert "starts" in explored(ds).unable


def test_the_scene_of_a_cell_says_which_start_it_is_of():
    """Held beside each other two motions of one cell, a squeal and a quiet one, read alike."""
    both = whole({"names": ["up", "down"], "kick": 1e-3})
    for start, says in ((None, "up"), ("up", "up"), ("down", "down")):
        assert scene_of(both, PLACE, start)["title"].endswith(f"m/s, start: {says}")
    nine = whole({"random": 9, "seed": 2, "x": [1e-3, 2e-3], "vx": [0.0, 1.0]})
    assert scene_of(nine, PLACE, 4)["title"].endswith(", start: 4")
