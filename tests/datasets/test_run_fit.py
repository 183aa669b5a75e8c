"""What another program has changed in a run, a map or a branch: refused where no more can be told,
noted where the rest can, and never silent.
"""

import numpy as np
import pytest
import xarray as xr

from wiperjax.cli import main
from wiperjax.datasets.run_fit import doubts, unfit
from wiperjax.datasets.stated import wrong_attribute
from wiperjax.sound import sound
from wiperjax.store.whole import open_map


def a_run(**changed):
    """800 samples of a tip that slips, struck twice; `changed` variables replace its own."""
    time = np.arange(800) / 8000
    flags = {"flag_values": [0, 1, 2, 3], "flag_meanings": "stick slip_pos slip_neg flight"}
    kinds = {"flag_values": [4, 5], "flag_meanings": "lift_off impact"}
    own = {
        "velocity": ("time", np.sin(5000 * time), {"units": "m/s"}),
        "position": ("time", -np.cos(5000 * time) / 5000, {"units": "m"}),
        "normal_force": ("time", 1 + 0 * time, {"units": "N/m"}),
        "regime": ("time", np.ones(800, np.int8), flags),
        "event_time": ("event", [0.02, 0.05], {"units": "s"}),
        "event_kind": ("event", np.array([4, 5], np.int8), kinds),
        "regime_before": ("event", np.array([1, 3], np.int8), flags),
        "regime_after": ("event", np.array([3, 1], np.int8), flags),
        "result": ((), np.int8(0)),
        "final_time": ((), 0.1),
    }
    own |= {name: (own[name][0], value, *own[name][2:]) for name, value in changed.items()}
    attrs = {
        "lip_length": 6e-3, "belt_speed": 0.3, "duration": 0.1, "result_message": "reached the end",
        "parameter_units": "lip_length: m; belt_speed: m/s; attack_angle: degrees",
        "specification": "{}",
    }  # fmt: skip
    return xr.Dataset(own, coords={"time": time}, attrs=attrs)


def with_one(name, number, place=400):
    values = np.array(a_run()[name], dtype=float)
    values[place] = number
    return a_run(**{name: values})


def at_times(**samples):
    time = np.array(a_run()["time"])
    for place, number in samples.items():
        time[int(place[1:])] = number
    return a_run().assign_coords(time=time)


WRONG = {
    r"its regime_before must be 0 \(stick\), .* but had 99": a_run(regime_before=[99, 3]),
    r"its regime_after must be 0 \(stick\), .* but had -1": a_run(regime_after=[3, -1]),
    r"its regime_after must be whole codes, but had 0.5": a_run(regime_after=[3, 0.5]),
    r"its event_kind must be .* 13 \(blow\), but had 99": a_run(event_kind=[4, 99]),
    "its event_time must be finite numbers, but had nan": a_run(event_time=[0.02, np.nan]),
    "its event_time must be finite numbers, but had -inf": a_run(event_time=[-np.inf, 0.05]),
    "its event_time must not fall, but had 0.05 after 1e[+]300 s": a_run(event_time=[1e300, 0.05]),
    "its event_time must lie before its final_time, 0.1 s, but": a_run(event_time=[0.02, 1e300]),
    "its time must be in s and end at its final_time, 0.1 s, but ends at 1e[+]300": at_times(
        _799=1e300
    ),
    "its time must be in s and end at its final_time, nan s": a_run(final_time=np.nan),
    "its time must rise from sample to sample, but had 0 after 0.006125 s": at_times(_50=0),
}


@pytest.mark.parametrize("line", WRONG)
def test_a_run_whose_codes_or_times_cannot_be_is_none(line, tmp_path, capsys):
    """Bands and marks were drawn where nothing had happened; of a regime 99 `cannot be told as it
    is: 99` was all that was said, by those that had not told it."""
    assert unfit(a_run()) == ""
    with pytest.raises(ValueError, match=f"run must be a run .*, but {line}"):
        sound(WRONG[line])
    path = tmp_path / "r.h5"
    WRONG[line].to_netcdf(path, engine="h5netcdf")
    for command in (["plot"], ["listen"], ["export", "-o", str(tmp_path / "r.csv")]):
        assert main([*command, str(path)]) == 1
        said = capsys.readouterr().err
        assert said.startswith(f"wiperjax: {path}: holds something else, for its "), command
    assert main(["info", str(path)]) == 0
    assert "note: it is no run, for its " in capsys.readouterr().err


@pytest.mark.parametrize("lost", ["time", "position", "velocity", "regime"])
def test_info_says_what_a_run_lacks(lost, tmp_path, capsys):
    """`holds something else`, and no more."""
    path = tmp_path / "r.h5"
    a_run().drop_vars(lost).to_netcdf(path, engine="h5netcdf")
    assert main(["info", str(path)]) == 0
    said = capsys.readouterr()
    assert said.out.startswith("holds something else: ")
    assert f"note: it is no run, for it has no {lost}, which a run has\n" in said.err


@pytest.mark.parametrize(
    ("name", "number"),
    [("velocity", np.nan), ("velocity", -np.inf), ("position", 1e300), ("normal_force", 1e300)],
)
def test_numbers_of_a_run_that_are_none_are_noted_wherever_it_is_told(
    name, number, tmp_path, capsys
):
    """A table, a sound of inf dB and a page without a word; of others `Axis limits cannot be NaN or
    Inf`. What can be told of the rest still is, for a motion may grow without bound."""
    path, run = tmp_path / "r.h5", with_one(name, number)
    line = f"{name} must be finite numbers up to 1e+150 in size, but had 1 of 800 not"
    assert doubts(a_run()) == [] and doubts(run) == [f"{line}, the first {number:g} at 0.05 s"]
    run.to_netcdf(path, engine="h5netcdf")
    heard = 1 if name in ("velocity", "position") else 0  # by which the tone is told
    for words, status in (
        (["export", "-o", str(path.with_suffix(".csv"))], 0),
        (["info"], 0),
        (["listen"], heard),
        (["listen", "--quantity", "normal_force", "-o", str(path.with_name("n.wav"))], 1),
    ):
        assert main([*words, str(path)]) == status, words
        said = capsys.readouterr()
        assert f"note: {line}" in said.err and "inf dB" not in said.out
    page = path.with_name("o.svg")
    assert main(["plot", str(path), "-o", str(page)]) == 0
    assert f"{name} must be finite numbers up to 1e+150" in page.read_text()


def test_a_run_that_ended_as_nobody_knows_is_drawn_and_says_so(tmp_path, capsys):
    """`99 is not a valid Result`; and the note of others went on that it `reached the end`."""
    path, page = tmp_path / "r.h5", tmp_path / "p.svg"
    a_run(result=99).to_netcdf(path, engine="h5netcdf")
    assert main(["plot", str(path), "-o", str(page)]) == 0
    assert "ended at 0.1 s: code 99, of another version or program" in page.read_text()
    assert main(["listen", str(path)]) == 0
    note = "note: the run ended at 0.1 of 0.1 s, with code 99, of another version or program\n"
    assert capsys.readouterr().err.endswith(note)


@pytest.mark.parametrize(
    ("attrs", "line"),
    [
        ({"belt_speed": 1e300}, "belt_speed must lie inside [-20, 20] m/s, was 1e+300"),
        ({"belt_speed": "fast"}, "belt_speed must be a finite number, but was 'fast'"),
        ({"lip_length": np.nan}, "lip_length must be a finite number, but was nan"),
        ({"lip_length": [1.0, 2.0]}, "lip_length must be a finite number, but was array([1., 2.])"),
        ({"attack_angle": 200.0}, "attack_angle must lie inside (-90, 90) degrees, was 200"),
        ({"duration": "long"}, "duration must be a finite number > 0, but was 'long'"),
        (
            {"statistics_start": np.nan},
            "statistics_start must be a finite number >= 0, but was nan",
        ),
    ],
)
def test_what_a_run_states_of_itself_and_cannot_be_is_named(attrs, line, tmp_path, capsys):
    """`quiet`, on a belt of 1e300 m/s; `could not convert string to float: 'fast'`, of what?"""
    path = tmp_path / "r.h5"
    a_run().assign_attrs(attrs).to_netcdf(path, engine="h5netcdf")
    assert main(["plot", str(path)]) == 1
    assert capsys.readouterr().err == f"wiperjax: {path}: its attribute {line}\n"
    for command in (["info"], ["export", "-o", str(path.with_suffix(".csv"))]):
        assert main([*command, str(path)]) == 0
        said = capsys.readouterr().err
        assert f"note: its attribute {line}: another program changed it\n" in said
    with open_map(path) as run:
        assert wrong_attribute(run) == line


def test_what_a_system_or_a_blade_of_python_may_state():
    """Ranges of files are for what is from one; a system of one's own may have any number."""
    python = a_run().assign_attrs(belt_speed=100.0)
    del python.attrs["specification"]
    assert wrong_attribute(python) == ""
    assert "belt_speed must lie" in wrong_attribute(python.assign_attrs(specification="{}"))
    own = a_run().assign_attrs(belt_speed=-np.inf, of_a_blade=0)
    assert wrong_attribute(own) == ""
    assert wrong_attribute(own.assign_attrs(belt_speed="x")) == (
        "belt_speed must be a number, but was 'x'"
    )
    taken = {"duration": -1.0, "parameter_units": "duration: s"}  # a parameter of that name
    assert wrong_attribute(xr.Dataset(attrs=own.attrs | taken)) == ""


def test_what_a_spectrum_cannot_be_made_of_names_its_file(tmp_path, capsys):
    path = tmp_path / "r.h5"
    with_one("velocity", np.nan).to_netcdf(path, engine="h5netcdf")
    assert main(["plot", str(path), "-p", "spectrum"]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"wiperjax: {path}: the velocity of the run must be finite numbers up")
