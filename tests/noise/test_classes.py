"""Noise classes: each rule, the borders, and that nothing that failed is called anything else."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from wiperjax.noise import class_counts, classes
from wiperjax.specs.load import parse_sweep
from wiperjax.vocabulary import codes, schema, thresholds
from wiperjax.vocabulary.codes import RESULTS

FLAGS = {
    name: {code: word for word, code in (schema.SCHEMA[name].flags or {}).items()}
    for name in ("label", "mechanism", "band", "settled")
}
NAN = float("nan")
HIT = {"impact_impulse_reversal": 1e-3, "impact_impulse_max": 1e-3}
CUT = {"stick_fraction": 0.9991, "velocity_rms": 4e-4, "velocity_mean": 0.29999}
SQUEAL_IN_STROKE = {
    "velocity_rms_stroke": 0.1,
    "dominant_frequency": 700.0,
    "stick_fraction_stroke": 0.4,
}
NUMBERS = (
    *("velocity_rms", "belt_speed_rms", "dominant_frequency", "stick_fraction", "flight_fraction"),
)


def classify(thresholds=None, **values):
    """Name of the class of one cell; see `named_codes`."""
    return named_codes(thresholds, **values)["label"]


def named_codes(thresholds=None, **values):
    """Names of class, mechanism and band of one cell; what is not given is a loud finished slip
    oscillation at 300 Hz.
    """
    cell = {
        "result": RESULTS["finished"],
        "velocity_rms": 0.1,
        "belt_speed_rms": 0.3,
        "dominant_frequency": 300.0,
        "stick_fraction": 0.0,
        "flight_fraction": 0.0,
    } | values
    columns = {name: np.array([value]) for name, value in cell.items()}
    found = classes.classify(columns, thresholds)
    assert all(code.dtype == np.int8 and code.shape == (1,) for code in found.values())
    return {name: FLAGS[name][int(code[0])] for name, code in found.items()}


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


FLIP = {  # a belt that reverses: silent strokes, a pulse of twice the mean, a vibration after it
    "reversal_count": 2,
    "normal_force_max_reversal": 30.0,
    "normal_force_mean_stroke": 15.0,
    "vibration_reversal": 0.1,
    "vibration_stroke": 0.001,
    "velocity_rms_stroke": 0.002,
    "stick_fraction_stroke": 0.0,
    "flight_fraction_stroke": 0.0,
    "stick_fraction": 0.05,
    "impact_impulse_reversal": 0.0,
    "impact_impulse_max": 0.0,
}


@pytest.mark.parametrize(
    ("expected", "values"),
    [
        ("reversal", {}),
        ("quiet", {"normal_force_max_reversal": 29.9}),
        ("other", {"normal_force_max_reversal": 29.9, "velocity_rms_stroke": 0.1}),
        # a pulse that starts nothing is none; nor is a vibration that is there anyway
        ("quiet", {"vibration_reversal": 0.0029}),
        ("quiet", {"vibration_stroke": 0.051}),
        ("other", {"vibration_stroke": 0.051, "velocity_rms_stroke": 0.1}),
        ("failed", {"normal_force_mean_stroke": NAN}),
        ("failed", {"vibration_reversal": NAN}),
        ("failed", {"velocity_rms_stroke": NAN}),
        # the strokes decide about squeal and chattering, not the flip and its stick
        ("squeal", {"velocity_rms_stroke": 0.1, "dominant_frequency": 700.0}),
        ("reversal", {"dominant_frequency": 700.0}),
        ("reversal", {"dominant_frequency": 20.0, "velocity_rms_stroke": 0.1}),
        (
            "chattering",
            {
                "dominant_frequency": 20.0,
                "velocity_rms_stroke": 0.1,
                "stick_fraction_stroke": 0.5,
            },
        ),
        # a window that shows no turn, or nothing else
        ("failed", {"normal_force_max_reversal": NAN, "vibration_reversal": NAN}),
        (
            "failed",
            {"normal_force_mean_stroke": NAN, "vibration_stroke": NAN, "velocity_rms_stroke": NAN},
        ),
    ],
)
def test_reversal_needs_a_pulse_and_the_vibration_it_starts(expected, values):
    assert classify(**FLIP | values) == expected


TURN = {  # silent strokes without a pulse; 18 ms of 700 Hz after each of two turns
    **FLIP,
    "normal_force_max_reversal": 16.0,
    "dominant_frequency": 700.0,
    "tone_time_before": 0.0,
    "tone_time_after": 0.018,
    "stick_count": 20,
}


@pytest.mark.parametrize(
    ("label", "mechanism", "band", "values"),
    [
        ("squeal", "stick_slip", "squeal", {}),
        ("squeal", "stick_slip", "squeal", {"tone_time_before": 0.018, "tone_time_after": 0.0}),
        ("squeal", "self_excited_slip", "squeal", {"stick_count": 4}),  # the turns themselves
        ("other", "stick_slip", "low", {"dominant_frequency": 430.0}),
        ("quiet", "none", "none", {"tone_time_after": 0.0149}),
        # a tone of another pitch that a pulse starts is its noise; squeal comes first
        ("reversal", "reversal_pulse", "none", FLIP | {"dominant_frequency": 430.0}),
        ("squeal", "stick_slip", "squeal", FLIP | {"dominant_frequency": 700.0}),
        # strokes that sound are named by their own pitch
        ("other", "stick_slip", "low", {"dominant_frequency": 300.0, "velocity_rms_stroke": 0.1}),
    ],
)
def test_a_tone_at_the_turn(label, mechanism, band, values):
    found = named_codes(**TURN | values)
    assert (found["label"], found["mechanism"], found["band"]) == (label, mechanism, band)
    if label == "squeal":
        assert classify(thresholds.Thresholds(tone_time=0.03), **TURN | values) != "squeal"


def test_a_frequency_that_samples_do_not_tell_is_no_failure():
    """Its shares and its standard deviation are exact: it moves, and nobody knows how fast."""
    seen = {"dominant_frequency": NAN, "stick_fraction": 0.99, "velocity_rms": 0.02}
    settled, untold = codes.SETTLED["yes"], codes.TOLD["no"]
    found = named_codes(**seen, settled=settled, frequency_told=untold)
    assert found == {"label": "other", "mechanism": "stick_slip", "band": "none"} | {
        "settled": "unknown"
    }
    quiet = seen | {"velocity_rms": 0.002}
    assert classify(**quiet, settled=settled, frequency_told=untold) == "quiet"
    # told, and yet none: it has no line
    assert classify(**seen, settled=settled, frequency_told=codes.TOLD["yes"]) == "other"
    # nobody has looked
    unknown = {"frequency_told": codes.TOLD["unknown"]}
    assert classify(**seen, **unknown, settled=settled) == "failed"
    assert classify(**seen, settled=settled) == "failed"


def test_whether_a_tip_that_is_carried_has_settled_is_unknown():
    """Constant as it is: the spring pulls it back sooner or later."""
    seen = {"velocity_rms": 0.0, "dominant_frequency": NAN, "stick_fraction": 1.0}
    found = named_codes(**seen, settled=codes.SETTLED["yes"], frequency_told=codes.TOLD["no"])
    assert found["mechanism"] == "carried" and found["settled"] == "unknown"


def test_a_slip_cut_by_the_end_of_the_window_is_not_the_motion():
    """Of 2001 blades that chatter at 0.3 m/s 8 were quiet and settled: they had slipped for 90 us.
    What is called quiet by a speed of the person's own may stick and slip, and what stands as its
    belt does may stick meanwhile."""
    found = named_codes(**CUT, settled=codes.SETTLED["yes"])
    assert (found["label"], found["settled"]) == ("other", "unknown")
    whole = {"stick_fraction": 0.6, "velocity_rms": 0.4, "velocity_mean": 1e-3}
    assert classify(thresholds.Thresholds(quiet_velocity=0.5), **whole) == "quiet"
    assert classify(**CUT | {"velocity_mean": 1e-5, "stick_fraction": 0.6}) == "quiet"


@pytest.mark.parametrize("squeal", [(500, 1000), (60, 500), (20, 80), (0, 200), (300, 301)])
def test_a_band_is_drawn_where_its_class_is_told(squeal):
    """Where two overlap the first rule holds; there they were drawn over each other, grey."""
    limits = thresholds.Thresholds(squeal_band=squeal)
    bands = classes.class_bands(limits)
    for frequency in np.arange(0.5, 1100, 3.3):
        names = [name for name, low, high in bands if low <= frequency < high]
        told = classify(limits, dominant_frequency=frequency, stick_fraction=0.5)
        assert names == [told] * (told != "other"), frequency


@pytest.mark.parametrize(
    ("squeal", "chatter", "frequency", "band"),
    [
        ((60, 500), (0, 100), 80.0, "squeal"),  # it was "chatter", and the class squeal
        ((60, 500), (0, 100), 59.0, "chatter"),
        ((60, 500), (0, 1500), 1400.0, "chatter"),
        ((20, 80), (0, 100), 10.0, "chatter"),
        ((20, 80), (0, 100), 90.0, "chatter"),
    ],
)
def test_what_two_bands_hold_has_the_band_of_its_class(squeal, chatter, frequency, band):
    limits = thresholds.Thresholds(squeal_band=squeal, chatter_band=chatter)
    found = named_codes(limits, dominant_frequency=frequency, stick_fraction=0.5)
    told = {"squeal": "squeal", "chatter": "chattering"}
    assert (found["band"], found["label"]) == (band, told[band])


def test_stored_thresholds():
    given = thresholds.Thresholds(squeal_band=(400.0, 2500.0), quiet_velocity_ratio=0.02)
    attrs = {
        f"class_{name}": np.array(value) for name, value in vars(given).items() if value is not None
    }
    assert classes.stored(attrs) == given
    assert classes.stored({"title": "none"}) == thresholds.Thresholds()
    assert classes.stored({"class_stick_share": np.array([0.5])}).stick_share == 0.5


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("quiet_velocity_ratio", np.nan, r"must lie inside \[.*\], but was nan"),
        ("quiet_velocity_ratio", -1.0, r"must lie inside \[.*\], but was -1"),
        ("quiet_velocity_ratio", [0.01, 0.02], r"must be one number, but was \[0.01, 0.02\]"),
        ("squeal_band", [1000.0, 500.0], r"must be \[low, high\] in Hz with low < high, but was "),
        ("squeal_band", 500.0, r"must be \[low, high\] in Hz with low < high, but was \[500.0\]"),
        ("chatter_band", [np.nan, 100.0], r"must lie inside .* Hz, but was nan"),
        ("squeal_band", "high", r"must lie inside .* Hz, but was 'high'"),
    ],
)
def test_borders_of_classes_that_cannot_be_are_named(name, value, said):
    """All cells were of other classes, without a word."""
    with pytest.raises(ValueError, match=f"^class_{name} {said}"):
        classes.stored({f"class_{name}": value})
    with pytest.raises(ValueError, match=f"^{name} {said}"):
        thresholds.Thresholds(**{name: value})


@pytest.mark.parametrize(
    ("mechanism", "band", "values"),
    [
        ("none", "none", {"velocity_rms": 0.001, "stick_fraction": 0.5}),
        ("none", "none", {"result": RESULTS["collapsed"]}),
        ("none", "none", {"velocity_rms": NAN}),
        ("self_excited_slip", "squeal", {"dominant_frequency": 700.0}),
        ("self_excited_slip", "low", {"dominant_frequency": 100.0, "stick_fraction": 0.0099}),
        ("stick_slip", "low", {"dominant_frequency": 499.9, "stick_fraction": 0.01}),
        ("stick_slip", "high", {"dominant_frequency": 1000.1, "stick_fraction": 0.3}),
        ("stick_slip", "chatter", {"dominant_frequency": 99.9, "stick_fraction": 0.3}),
        ("self_excited_slip", "chatter", {"dominant_frequency": 99.9}),
        ("flight", "low", {"flight_fraction": 1e-3, "stick_fraction": 0.4}),
        ("vibro_impact", "chatter", {"dominant_frequency": 3.0, "blow_count": 18}),
        ("stick_slip", "low", {"blow_count": 18, "stick_fraction": 0.4}),
        ("carried", "none", {"stick_fraction": 1.0, "dominant_frequency": NAN}),
        ("carried", "none", CUT),
        ("reversal_pulse", "none", FLIP),
        ("reversal_impulse", "none", FLIP | HIT),
        # the hardest hit is elsewhere
        ("reversal_pulse", "none", FLIP | HIT | {"impact_impulse_max": 2e-3}),
        ("stick_slip", "squeal", FLIP | HIT | SQUEAL_IN_STROKE),
    ],
)
def test_mechanism_and_band(mechanism, band, values):
    found = named_codes(**values)
    assert (found["mechanism"], found["band"]) == (mechanism, band)


def test_anatomy_of_a_class():
    cells = {
        "result": np.zeros(5, int),
        "velocity_rms": np.full(5, 0.1),
        "belt_speed_rms": np.full(5, 0.3),
        "dominant_frequency": np.array([300.0, 1500.0, 1600.0, 700.0, 400.0]),
        "stick_fraction": np.array([0.2, 0.3, 0.3, 0.3, 0.0]),
        "flight_fraction": np.zeros(5),
    }
    names = ("label", "mechanism", "band")
    found = classes.classify(cells)
    ds = xr.Dataset(
        {name: ("case", found[name], schema.SCHEMA[name].attributes()) for name in names}
    )
    assert class_counts.anatomy(ds) == [
        ("stick_slip", "high", 2),
        ("self_excited_slip", "low", 1),
        ("stick_slip", "low", 1),
    ]
    assert class_counts.anatomy(ds, "squeal") == [("stick_slip", "squeal", 1)]
    settled = ("case", np.array([0, 1, 0, 2, 1]))
    assert class_counts.unsettled_count(ds.assign(settled=settled)) == 2


def test_failures_are_counted_by_their_result():
    cells = {
        "label": [[6, 6, 0], [4, 6, 6]],  # a failure that finished has no numbers for its class
        "result": [[5, 3, 0], [0, 5, 0]],
    }
    ds = xr.Dataset(
        {
            name: (("angle", "speed"), values, schema.SCHEMA[name].attributes())
            for name, values in cells.items()
        }
    )
    found = [("zeno_unresolved", 2), ("finished", 1), ("step_budget_spent", 1)]
    assert class_counts.failures(ds) == found
    assert class_counts.failures(ds.assign(result=ds["result"].transpose())) == found
    assert class_counts.failures(ds.isel(speed=[2], angle=[0])) == []
    assert class_counts.failures(ds[["label"]]) == []


def test_cells_are_counted_whatever_the_order_of_the_axes_of_one_variable():
    """`xr.where` orders them as its mask does; the label of one cell met the band of another."""
    cells = {
        "label": [[0, 1, 6], [4, 4, 0]],
        "mechanism": [[0, 2, 2], [2, 1, 0]],
        "band": [[0, 3, 1], [2, 4, 0]],
        "frequency_told": [[0, 1, 1], [0, 0, 1]],
    }
    ds = xr.Dataset(
        {
            name: (("angle", "speed"), values, schema.SCHEMA[name].attributes())
            for name, values in cells.items()
        }
    )
    turned = ds.assign(label=ds["label"].transpose())
    for name in codes.LABELS:
        assert class_counts.anatomy(turned, name) == class_counts.anatomy(ds, name)
    assert class_counts.untold_count(turned) == class_counts.untold_count(ds) == 2


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
        st.one_of(st.floats(0, 2e3), st.sampled_from([NAN, 0.0, 1.0])), min_size=5, max_size=5
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
    assert classify(thresholds.Thresholds(squeal_band=(250.0, 350.0))) == "squeal"
    data = {"axes": {"belt_speed": {"values": [0.1]}}, "run": {"transient": 0.1, "window": 0.1}}
    assert classify(parse_sweep(data).classes) == "other"
    data["classes"] = {"quiet_velocity_ratio": 0.5}
    assert classify(parse_sweep(data).classes) == "quiet"
    default = parse_sweep(data | {"classes": {}}).classes
    assert all(
        getattr(default, name) == value for name, value in vars(thresholds.Thresholds()).items()
    )


def test_a_class_table_of_a_run_is_refused_for_what_it_is():
    with pytest.raises(ValueError, match="^ds must be a map .wiperjax.sweep., but has no label"):
        class_counts.class_table(xr.Dataset({"regime": ("time", [0], {"flag_values": [0]})}))


def test_classes_that_lost_their_codes_or_the_names_of_these_are_refused_for_that():
    column = schema.SCHEMA["label"]
    ds = xr.Dataset({"label": ("a", np.array([0, 1], np.int8), column.attributes())})
    with pytest.raises(ValueError, match="^label must have names of its codes, but has no flag"):
        class_counts.class_table(ds.drop_attrs())
    with pytest.raises(ValueError, match="^label must be whole codes, but is of <U"):
        class_counts.class_table(ds.assign(label=ds["label"].astype(str)))


def test_class_table_counts_what_is_there():
    cells = np.array([[0, 0, 1], [6, 2, -1]], dtype=np.int8)  # -1: not computed
    column = schema.SCHEMA["label"]
    ds = xr.Dataset({"label": (("a", "b"), cells, column.attributes())})
    table = class_counts.class_table(ds)
    assert [name for name, *_ in table] == list(codes.LABELS)
    assert {name: count for name, count, _ in table if count} == {
        "quiet": 2,
        "squeal": 1,
        "chattering": 1,
        "failed": 1,
    }
    assert sum(share for *_, share in table) == pytest.approx(1)


@pytest.mark.parametrize(
    ("count", "of", "error"),
    [
        (np.array([254, 255], np.uint8), 300, [0.02091, 0.02074]),
        (np.int8(126), np.int16(200), 0.03385),
        ([0, 3], 10, [0.09352, 0.12806]),
    ],
)
def test_counts_of_few_bits_do_not_overflow(count, of, error):
    """254 + 2 was 0 as uint8, 200 + 4 times itself beyond int16; a list was refused."""
    np.testing.assert_allclose(class_counts.share_error(count, of), error, rtol=1e-3)


def test_a_count_that_cannot_be_is_one_line():
    for wrong in ("a", [[1], [1, 2]], [1, "b"], -1):
        with pytest.raises(ValueError, match="^count must be a finite number >= 0, but was"):
            class_counts.share_error(wrong, 10)
