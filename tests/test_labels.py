"""Noise classes: each rule, the borders, and that nothing that failed is called anything else."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wiperjax import dataset, labels
from wiperjax.results import RESULTS
from wiperjax.spec import parse_sweep

NAMES = {code: name for name, code in dataset.LABELS.items()}
NAN = float("nan")
NUMBERS = (
    *("velocity_rms", "belt_speed_rms", "dominant_frequency", "stick_fraction", "flight_fraction"),
    *("normal_force_max_reversal", "normal_force_mean_stroke"),
)


def classify(thresholds=None, **values):
    """Name of the class of one cell; what is not given is a loud finished slip oscillation at 300
    Hz.
    """
    cell = {
        "result": RESULTS["finished"],
        "velocity_rms": 0.1,
        "belt_speed_rms": 0.3,
        "dominant_frequency": 300.0,
        "stick_fraction": 0.0,
        "flight_fraction": 0.0,
    } | values
    codes = labels.label({name: np.array([value]) for name, value in cell.items()}, thresholds)
    assert codes.dtype == np.int8 and codes.shape == (1,)
    return NAMES[int(codes[0])]


@pytest.mark.parametrize(
    ("expected", "values"),
    [
        ("other", {}),
        ("quiet", {"velocity_rms": 0.002}),
        ("quiet", {"velocity_rms": 0.002, "dominant_frequency": 700.0}),
        ("quiet", {"velocity_rms": 0.0, "dominant_frequency": NAN}),
        ("squeal", {"dominant_frequency": 500.0}),
        ("squeal", {"dominant_frequency": 1000.0, "stick_fraction": 0.4}),
        ("other", {"dominant_frequency": 499.9}),
        ("other", {"dominant_frequency": 1000.1}),
        ("chattering", {"dominant_frequency": 39.7, "stick_fraction": 0.785}),
        ("chattering", {"dominant_frequency": 39.7, "flight_fraction": 0.06}),
        ("other", {"dominant_frequency": 39.7}),
        ("other", {"dominant_frequency": 100.0, "stick_fraction": 0.5}),
        ("collapsed", {"result": RESULTS["collapsed"], "velocity_rms": NAN}),
        # a tip that rides on the belt for the whole window has not settled, however constant its
        # velocity
        ("other", {"velocity_rms": 0.0, "dominant_frequency": NAN, "stick_fraction": 1.0}),
        ("other", {"dominant_frequency": 5.0, "stick_fraction": 1.0}),
    ],
)
def test_rules(expected, values):
    assert classify(**values) == expected


@pytest.mark.parametrize(
    ("expected", "values"),
    [
        ("reversal", {"normal_force_max_reversal": 30.0, "normal_force_mean_stroke": 15.0}),
        ("other", {"normal_force_max_reversal": 29.9, "normal_force_mean_stroke": 15.0}),
        ("other", {"normal_force_max_reversal": NAN, "normal_force_mean_stroke": 15.0}),
        ("failed", {"normal_force_max_reversal": 30.0, "normal_force_mean_stroke": NAN}),
        (
            "squeal",
            {
                "normal_force_max_reversal": 40.0,
                "normal_force_mean_stroke": 15.0,
                "dominant_frequency": 700.0,
            },
        ),
        (
            "reversal",
            {
                "normal_force_max_reversal": 40.0,
                "normal_force_mean_stroke": 15.0,
                "velocity_rms": 0.001,
            },
        ),
    ],
)
def test_reversal_needs_a_belt_that_reverses(expected, values):
    assert classify(**values) == expected


@pytest.mark.parametrize("result", sorted(set(RESULTS) - {"finished", "collapsed"}))
def test_any_other_result_is_failed(result):
    assert classify(result=RESULTS[result], dominant_frequency=700.0) == "failed"
    assert classify(result=RESULTS[result], velocity_rms=0.0) == "failed"


@pytest.mark.parametrize(
    "column", ["velocity_rms", "belt_speed_rms", "dominant_frequency", "stick_fraction"]
)
def test_not_a_number_is_failed(column):
    assert classify(**{column: NAN}) == "failed"


@given(
    result=st.integers(-128, 127),
    numbers=st.lists(
        st.one_of(st.floats(0, 2e3), st.sampled_from([NAN, 0.0, 1.0])), min_size=7, max_size=7
    ),
)
def test_exactly_one_class_and_never_a_sound_one_for_a_failure(result, numbers):
    columns = dict(zip(NUMBERS, numbers, strict=True))
    name = classify(result=result, **columns)
    if result not in (RESULTS["finished"], RESULTS["collapsed"]):
        assert name == "failed"
    if any(
        np.isnan(columns[key])
        for key in ("velocity_rms", "belt_speed_rms", "stick_fraction", "flight_fraction")
    ):
        assert name in ("failed", "collapsed")


def test_thresholds_are_arguments_and_those_of_a_sweep_fit():
    assert classify(labels.Thresholds(squeal_band=(250.0, 350.0))) == "squeal"
    data = {"axes": {"belt_speed": {"values": [0.1]}}, "run": {"transient": 0.1, "window": 0.1}}
    assert classify(parse_sweep(data).classes) == "other"
    data["classes"] = {"quiet_velocity_ratio": 0.5}
    assert classify(parse_sweep(data).classes) == "quiet"
    default = parse_sweep(data | {"classes": {}}).classes
    assert all(getattr(default, name) == value for name, value in vars(labels.Thresholds()).items())


def test_class_table_counts_what_is_there():
    codes = np.array([[0, 0, 1], [6, 2, -1]], dtype=np.int8)  # -1: not computed
    column = dataset.SCHEMA["label"]
    ds = dataset.xr.Dataset({"label": (("a", "b"), codes, column.attributes())})
    table = labels.class_table(ds)
    assert [name for name, *_ in table] == list(dataset.LABELS)
    assert {name: count for name, count, _ in table if count} == {
        "quiet": 2,
        "squeal": 1,
        "chattering": 1,
        "failed": 1,
    }
    assert sum(share for *_, share in table) == pytest.approx(1)
