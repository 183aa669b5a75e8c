"""When a poorer model says the same of a motion as a better one."""

import numpy as np

from wiperjax.noise.agreement import differences, said
from wiperjax.vocabulary.codes import BANDS, LABELS, MECHANISMS


def columns(**changed):
    """Six motions: two squeals, a quiet one, a failed one, a reversal, one that is carried."""
    names = ("squeal", "squeal", "quiet", "failed", "reversal", "other")
    ways = ("stick_slip", "self_excited_slip", "none", "none", "reversal_pulse", "carried")
    bands = ("squeal", "squeal", "none", "none", "none", "none")
    return {
        "label": np.array([LABELS[name] for name in names]),
        "mechanism": np.array([MECHANISMS[name] for name in ways]),
        "band": np.array([BANDS[name] for name in bands]),
        "dominant_frequency": np.array([700.0, 800, np.nan, np.nan, 300, np.nan]),
        "velocity_rms_stroke": np.array([0.3, 0.2, 1e-9, np.nan, 0.01, 0.0]),
        "vibration_reversal": np.array([9.0, 9, 9, np.nan, 0.2, 9]),
        "normal_force_max_reversal": np.array([20.0, 20, 20, np.nan, 60, 20]),
        "normal_force_mean_stroke": np.full(6, 15.0),
    } | {name: np.asarray(values, float) for name, values in changed.items()}


def unlike(**changed):
    found = differences(said(columns(**changed)), said(columns()))
    return np.flatnonzero(found.told & ~found.tolerated).tolist()


def test_a_model_agrees_with_itself_also_where_there_are_no_numbers():
    found = differences(said(columns()), said(columns()))
    assert np.flatnonzero(~found.tolerated).tolist() == [3] and not found.name.any()
    compared = np.isfinite([found.frequency, found.amplitude, found.forces]).astype(int)
    assert compared.tolist() == [[1, 1, 0, 0, 0, 0], [1, 1, 0, 0, 1, 1], [0, 0, 0, 0, 1, 0]]
    assert not np.nansum([found.frequency, found.amplitude, found.forces])


def test_nothing_agrees_with_a_failure():
    lip = columns()
    other = differences(said(lip | {"label": np.full(6, LABELS["squeal"])}), said(lip))
    assert other.told.tolist() == [True, True, True, False, True, True]
    assert other.tolerated.tolist() == [True, True] + 4 * [False]


def test_each_number_counts_where_it_tells_something():
    slower = [690, 780, 1, 1, 200, np.nan]  # 1.4 and 2.5 %; of a reversal it says nothing
    assert unlike(dominant_frequency=slower) == [1]
    assert unlike(dominant_frequency=[700, np.nan, np.nan, np.nan, 300, np.nan]) == [1]
    assert unlike(dominant_frequency=[700, 800, np.nan, np.nan, 300, 50]) == [5]
    louder = [0.32, 0.23, 1e-7, 1, 1, 0]  # 7 and 15 %; a reversal's is that just after it
    assert unlike(velocity_rms_stroke=louder) == [1]
    assert unlike(vibration_reversal=[1, 1, 1, 1, 0.23, 1]) == [4]
    assert unlike(normal_force_max_reversal=[99, 99, 99, 99, 67, 99]) == [4]
    assert unlike(normal_force_max_reversal=[99, 99, 99, 99, 65, 99]) == []


def test_a_steady_belt_has_no_strokes():
    steady = {name: values for name, values in columns().items() if "stroke" not in name} | {
        "velocity_rms": columns()["velocity_rms_stroke"]
    }
    del steady["normal_force_max_reversal"]
    found = differences(said(steady | {"velocity_rms": 1.2 * steady["velocity_rms"]}), said(steady))
    assert np.flatnonzero(found.told & ~found.tolerated).tolist() == [0, 1, 4]
