"""Cells that go on from where their neighbour ended, by the engine: one long motion in pieces, and
both answers of a blade that has two.
"""

import numpy as np
import pytest

import wiperjax
from wiperjax.datasets.map_starts import hangs_on_start
from wiperjax.maps import driver
from wiperjax.maps.cells.batch import prepare
from wiperjax.maps.starts import drawn, kicked
from wiperjax.maps.verify import verify
from wiperjax.specs.load import parse_sweep
from wiperjax.vocabulary.codes import LABELS

HOPF, LAST_CYCLE = 0.4511, 1.4302  # m/s, of the reference blade at 0 degrees and 15 N/m
RUN = {"transient": 0.05, "window": 0.05}
FINE = RUN | {"rtol": 1e-9}


@pytest.mark.long
@pytest.mark.parametrize(
    ("belt", "angle"),
    [
        (wiperjax.SteadyBelt(0.3), 5.0),
        (wiperjax.WipingBelt(0.3, 20.0, 0.7), -30.0),
    ],
)
def test_a_walk_over_what_changes_nothing_is_one_long_run(belt, angle):
    wiping = isinstance(belt, wiperjax.WipingBelt)
    file = {"kind": "steady", "speed": 0.3}
    if wiping:
        phase = float(np.degrees(belt.phase))
        file = {"kind": "wiping", "amplitude": 0.3, "frequency": 20.0, "phase": phase}
    spec = parse_sweep(
        {
            "axes": {"collapse_angle": {"values": [86, 87, 88, 89]}},
            "blade": {"attack_angle": angle},
            "belt": file,
            "run": FINE,
            "classes": {"reversal_window": 0.005},
            "starts": {"names": ["up", "down"], "kick": 0.0},
        }
    )
    ds = driver.sweep(spec, progress=False)
    blade = wiperjax.Wiper(belt=belt, attack_angle=np.radians(angle))
    long = wiperjax.simulate(blade, 0.4, rtol=1e-10, sample_interval=0.1)
    for way, order in (("up", slice(None)), ("down", slice(None, None, -1))):
        for k, cell in enumerate(ds.sel(start=way).isel(collapse_angle=order).final_x):
            at = long.isel(time=k + 1)
            state = ds.sel(start=way, collapse_angle=cell.collapse_angle)
            assert state.final_regime == at.regime
            for axis, name in enumerate("xy"):
                there = float(at.position[axis]), float(at.velocity[axis])
                assert float(state[f"final_{name}"]) == pytest.approx(there[0], abs=6e-9)
                assert float(state[f"final_v{name}"]) == pytest.approx(there[1], abs=3e-5)


@pytest.mark.long
def test_both_answers_of_a_blade_that_has_two(tmp_path):
    speeds = [0.3, 0.35, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.5, 1.6]
    spec = parse_sweep(
        {
            "axes": {"belt_speed": {"values": speeds}},
            "blade": {"attack_angle": 0.0, "normal_load": 15.0},
            "run": RUN,
            "starts": {"names": ["steady_slip", "up", "down"]},
        }
    )
    path = tmp_path / "map.h5"
    with driver.sweep(spec, path, progress=False) as ds:
        squeal = (ds.label == LABELS["squeal"]).transpose("start", ...).values
        low, high = np.array(speeds) < HOPF, np.array(speeds) < LAST_CYCLE
        np.testing.assert_array_equal(squeal, [low, high, low])
        assert (ds.label.values[~squeal.T] == LABELS["quiet"]).all()
        np.testing.assert_array_equal(hangs_on_start(ds), high & ~low)
    assert verify(path, cells=6).identical


def test_only_what_goes_on_begins_at_rest_where_the_lip_would_collapse():
    """A random start there is where it was drawn: collapsed, and no motion that began elsewhere."""
    axes = {"belt_speed": {"values": [0.3, 0.6]}}
    more = {"blade": {"collapse_angle": 40}, "run": {"transient": 0.1, "window": 0.1}}
    far = {"random": 2, "x": [5e-3, 5.5e-3]}  # 56 degrees and more
    spec = parse_sweep({"axes": axes, "starts": far, **more})
    cells, begun = np.array([0, 0]), drawn(spec.starts, 1)
    _, (x, _), _ = prepare(spec, cells, ended=begun)
    np.testing.assert_array_equal(x[:2], begun["final_x"])
    up = parse_sweep({"axes": axes, "starts": {"names": ["up"]}, **more})
    _, (x, _), _ = prepare(up, cells, ended=kicked(up, cells, begun))
    np.testing.assert_array_equal(x[:2], 0.0)
