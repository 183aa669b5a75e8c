"""Cells of a map computed again."""

import pytest
from stub_sweep import evaluate, make_spec, rewritten, run

from wiperjax.machine.files import StoreError
from wiperjax.maps.verify import verify


def test_verify_recomputes_and_finds_a_changed_number(tmp_path):
    spec, path = make_spec(), tmp_path / "map.h5"
    run(spec, path)
    report = verify(path, cells=40, seed=1, evaluate=evaluate)
    assert report.passed and report.same_versions and report.cells == 40 and report.columns == 14
    assert set(report.largest) <= {"dominant_frequency"}
    with rewritten(path) as file:
        file["normal_force_max"][...] = file["normal_force_max"][...] * (1 + 1e-6)
    report = verify(path, cells=385, evaluate=evaluate)
    assert not report.passed and len(report.differing) > 380
    assert report.largest["normal_force_max"] == pytest.approx(1e-6, rel=1e-3)
    with pytest.raises(StoreError, match=r"was made otherwise \(run.rtol was 1e-06, now 1e-07\)"):
        verify(path, spec=make_spec(rtol=1e-7), evaluate=evaluate)


@pytest.mark.parametrize("name", ["belt_speed", "run_window", "label"])
def test_verify_finds_what_is_said_of_right_numbers_changed(tmp_path, name):
    """Numbers computed again are the same whatever the file says they are of."""
    spec, path = make_spec(), tmp_path / "map.h5"
    run(spec, path)
    with rewritten(path) as file:
        if name == "belt_speed":
            file[name][3] *= 1.5
        elif name == "label":
            file[name].attrs["flag_meanings"] = file[name].attrs["flag_meanings"][::-1]
        else:
            file.attrs[name] = 2 * file.attrs[name]
    with pytest.raises(StoreError, match=f"what it says of {name} is not that of its sweep"):
        verify(path, evaluate=evaluate)


def test_verify_takes_a_map_whose_variables_another_version_explains_otherwise(tmp_path):
    """It was refused as changed for each comment that had been reworded since."""
    spec, path = make_spec(), tmp_path / "map.h5"
    run(spec, path)
    with rewritten(path) as file:
        for name in ("belt_speed", "label"):
            file[name].attrs["long_name"] = "as it was called before"
            file[name].attrs["comment"] = "as it was explained before"
    assert verify(path, evaluate=evaluate).passed
