"""A run as other programs read it."""

import csv
import errno
import os
import resource

import numpy as np
import own_systems
import pytest
import pyuff
import scipy.io
import xarray as xr

import wiperjax
from wiperjax import plots
from wiperjax.cli import main
from wiperjax.exports import columns, export
from wiperjax.noise.run_class import assess
from wiperjax.sound import sound
from wiperjax.store.whole import write_dataset


def test_a_table_holds_every_sample_with_its_unit(squeal, tmp_path):
    path = tmp_path / "run.csv"
    export(squeal, path)
    head, *lines = path.read_text().splitlines()
    assert head.startswith("time (s),position_x (m),position_y (m),velocity_x (m/s)")
    assert head.endswith(",regime (0 stick; 1 slip_pos; 2 slip_neg; 3 flight)")  # what a code means
    table = np.loadtxt(lines, delimiter=",")
    for column, (values, _) in zip(table.T, columns(squeal).values(), strict=True):
        np.testing.assert_array_equal(column, values)


def test_a_comma_in_the_name_of_a_coordinate_begins_no_column(squeal, tmp_path):
    path = tmp_path / "run.csv"
    export(squeal.assign_coords(axis=["a,b", "y"]), path)
    with open(path, encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    assert head[1] == "position_a,b (m)" and {len(row) for row in rows} == {len(head)}


def test_matlab_finds_samples_events_and_units(squeal, tmp_path):
    path = tmp_path / "run.mat"
    export(squeal, path)
    found = scipy.io.loadmat(path, squeeze_me=True)
    np.testing.assert_array_equal(found["velocity_x"], squeal["velocity"].sel(axis="x"))
    np.testing.assert_array_equal(found["event_time"], squeal["event_time"])
    assert found["units"]["normal_force"] == "N/m"
    assert "; 2 slip_neg; " in str(found["units"]["regime_before"])


def test_matlab_is_given_names_that_it_can_have(squeal, tmp_path):
    """A coordinate φ was "'latin-1' codec can't encode"."""
    path = tmp_path / "run.mat"
    export(squeal.assign_coords(axis=["φ", "a, b"]), path)
    found = scipy.io.loadmat(path, squeeze_me=True)
    np.testing.assert_array_equal(found["velocity_u03c6"], squeal["velocity"].sel(axis="x"))
    assert found["units"]["position_au002cu0020b"] == "m"


def test_test_software_finds_a_response_for_each_quantity(squeal, tmp_path):
    path = tmp_path / "run.uff"
    export(squeal, path)
    sets = {one["id1"]: one for one in pyuff.UFF(str(path)).read_sets()}
    expected = columns(squeal)
    assert set(sets) == set(expected) - {"time", "regime"}
    for name, one in sets.items():
        values, unit = expected[name]
        np.testing.assert_allclose(one["data"], values, rtol=1e-11, atol=1e-300)
        np.testing.assert_allclose(one["x"], expected["time"][0], rtol=1e-5, atol=1e-9)
        assert one["type"] == 58 and one["ordinate_axis_units_lab"] == unit
    assert sets["velocity_x"]["ordinate_spec_data_type"] == 11


def test_test_software_tells_coordinates_apart_whatever_their_letters(squeal, tmp_path):
    """Both were "position_?"."""
    path = tmp_path / "run.uff"
    export(squeal.assign_coords(axis=["φ", "ψ"]).assign_attrs(title="Zähler"), path)
    sets = {one["id1"]: one for one in pyuff.UFF(str(path)).read_sets()}
    assert sets[r"position_\u03c6"]["ordinate_axis_lab"] == r"position_\u03c6"
    psi = sets[r"velocity_\u03c8"]
    np.testing.assert_allclose(psi["data"], squeal["velocity"].sel(axis="y"), rtol=1e-11)
    assert psi["id2"] == r"Z\xe4hler"


def test_test_software_finds_the_coordinates_of_any_system(squeal, tmp_path):
    """Whatever they are called, and each a point of its own, as of modes."""
    path = tmp_path / "run.uff"
    renamed = squeal.assign_coords(axis=["x1", "crank"])
    export(renamed, path)
    sets = {one["id1"]: one for one in pyuff.UFF(str(path)).read_sets()}
    assert set(sets) == set(columns(renamed)) - {"time", "regime"}
    assert sets["velocity_x1"]["rsp_node"] == 1 and sets["velocity_crank"]["rsp_node"] == 2
    assert sets["position_crank"]["ordinate_spec_data_type"] == 8


@pytest.mark.long
@pytest.mark.parametrize(("system", "node"), [("Pulled", 2), ("Pendulum", 2), ("TwoBlocks", 1)])
def test_what_is_of_the_contact_stands_at_its_point(system, node, tmp_path):
    """The second coordinate, the rim of a shaft (no coordinate: one point more), the first one."""
    path = tmp_path / "run.uff"
    export(wiperjax.simulate(getattr(own_systems, system)(), 5.0), path)
    sets = {one["id1"]: one for one in pyuff.UFF(str(path)).read_sets()}
    for name in ("normal_force", "friction_force", "slip_speed"):
        assert sets[name]["rsp_node"] == sets[name]["ref_node"] == node, name


def test_modes_are_complex_eigenvalues_at_points(tmp_path):
    shape = np.array([[1.0, 0.3], [0.25, 1.0]])
    phase = np.array([[0.0, -2.0], [1.5, 0.0]])
    modes = xr.Dataset(
        {
            "real_part": ("mode", [12.5, -40.0]),
            "frequency": ("mode", [780.0, 2100.0]),
            "shape_amplitude": (("axis", "mode"), shape),
            "shape_phase": (("axis", "mode"), phase),
        },
        coords={"mode": [1, 2], "axis": ["x", "y"]},
    )
    for axis, points in ((["x", "y"], 1), (["q0", "q1"], 2)):
        path = tmp_path / f"{axis[0]}.uff"
        export(modes.assign_coords(axis=axis), path)
        sets = pyuff.UFF(str(path)).read_sets()
        for k, one in enumerate(sets):
            eigenvalue = modes["real_part"].values[k] + 2j * np.pi * modes["frequency"].values[k]
            assert one["eig"] == pytest.approx(eigenvalue, rel=1e-5)
            assert one["mode_n"] == k + 1 and len(one["node_nums"]) == points
            found = [one["r1"][0], one["r2"][0]] if points == 1 else one["r1"]
            np.testing.assert_allclose(found, (shape * np.exp(1j * phase))[:, k], atol=1e-5)
    with pytest.raises(ValueError, match="must end in .uff"):
        export(modes, tmp_path / "modes.csv")


def test_the_command_writes_runs_only_and_nothing_over_a_file(squeal, tmp_path, capsys):
    run, table = tmp_path / "run.h5", tmp_path / "run.csv"
    write_dataset(squeal, run)
    assert main(["export", str(run), "-o", str(table)]) == 0
    assert table.exists()
    assert main(["export", str(run), "-o", str(table)]) == 1
    assert "exists" in capsys.readouterr().err
    assert main(["export", str(run), "-o", str(tmp_path / "run.xls")]) == 1
    assert ".csv or .mat" in capsys.readouterr().err
    write_dataset(squeal.drop_vars("regime"), tmp_path / "other.h5")
    assert main(["export", str(tmp_path / "other.h5"), "-o", str(tmp_path / "o.mat")]) == 1
    assert "only a run" in capsys.readouterr().err


@pytest.mark.parametrize("ending", ["csv", "mat", "uff"])
def test_a_full_disk_is_one_line(ending, squeal, tmp_path, capsys):
    """As a limit on the size of files is."""
    run, made = tmp_path / "run.h5", tmp_path / f"made.{ending}"
    write_dataset(squeal, run)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, before[1]))
    try:
        assert main(["export", str(run), "-o", str(made)]) == 1
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    said = capsys.readouterr().err
    assert said == f"wiperjax: {made}: cannot be written: {os.strerror(errno.EFBIG)}\n"
    assert list(tmp_path.iterdir()) == [run]


def test_uneven_samples_are_no_universal_file(squeal, tmp_path):
    uneven = squeal.isel(time=[0, 1, 2, 4, 8, 16, 32, 64, 128])
    with pytest.raises(ValueError, match="evenly spaced"):
        export(uneven, tmp_path / "run.uff")
    assert not list(tmp_path.iterdir())


def damaged(run):
    """Datasets that were a run, and what each is said to be."""
    return {
        "its event_time lies along": run.where(run.time > 0.05),
        "its event_time lies along time and event": xr.concat([run, run], "time", data_vars="all"),
        "its regime lies along case and time": xr.concat([run, run], "case"),
        "holds no samples over time": run.isel(time=slice(0, 0)),
        "holds no samples": run.isel(time=0),
        "its time must be in s, but is in ms": run.assign_coords(
            time=(1e3 * run.time).assign_attrs(units="ms")
        ),
        "its regime must be whole codes, but had 0.5": run.assign(regime=0 * run.regime + 0.5),
        r"its regime must be 0 \(stick\), 1 .*, but had 99": run.assign(regime=0 * run.regime + 99),
        "its velocity must be numbers, but is of complex128": run.assign(
            velocity=1j * run.velocity
        ),
        "its event_time must be numbers, but is of": run.assign(
            event_time=run.event_time.astype("S")
        ),
        "its time must be finite numbers, but had nan": run.assign_coords(
            time=run.time.where(run.time > run.time[3])
        ),
    }


def test_what_was_a_run_is_no_run_for_any(squeal, tmp_path):
    """Of events along time, too, a sound asked for 26 GiB; the table of an empty run was empty,
    that of a run in ms said `time (s)` over its thousands.
    """
    short = squeal.isel(time=slice(0, 100), event=slice(0, 5)).load()
    for said, ds in damaged(short).items():
        for ask in (sound, plots.time_history, lambda ds: export(ds, tmp_path / "run.csv")):
            with pytest.raises(ValueError, match=rf"must be a run .*, but {said}"):
                ask(ds)
    assert not list(tmp_path.iterdir())


def test_a_run_may_have_words_of_a_person(squeal):
    words = ("time", np.full(squeal.sizes["time"], "loud"))
    assert assess(squeal.assign(said=words)).label == assess(squeal).label


def test_a_run_that_ended_as_nobody_knows_is_written_with_a_note(squeal, tmp_path, capsys):
    """The table was written, and then `99 is not a valid Result` told as an error."""
    write_dataset(squeal.assign(result=squeal.result + 99), tmp_path / "run.h5")
    made = tmp_path / "run.csv"
    assert main(["export", str(tmp_path / "run.h5"), "-o", str(made)]) == 0
    said = capsys.readouterr().err
    assert said.startswith("note: the run ended at ") and "with code 99, of another" in said
    assert made.exists()


@pytest.mark.parametrize("number", [np.nan, np.inf])
@pytest.mark.parametrize("name", ["position", "velocity", "event_time"])
def test_numbers_that_are_none_have_no_class(name, number, squeal):
    """The class was `other`, for want of a finer sample interval, or `failed`."""
    values = squeal[name].values.copy()
    values[len(values) // 2] = number
    broken = squeal.assign({name: squeal[name].copy(data=values)})
    with pytest.raises(ValueError, match=f"the {name} of the run must be finite numbers"):
        assess(broken)
