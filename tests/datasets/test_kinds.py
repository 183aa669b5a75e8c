"""What kind of dataset one is: each of the package, what was one, and what is none."""

import numpy as np
import pytest
import xarray as xr

from wiperjax.datasets.kinds import check_kind, kind_of
from wiperjax.machine.files import StoreError
from wiperjax.vocabulary.products import PRODUCTS


def a_run(**more):
    names = PRODUCTS["run"].told_by
    return xr.Dataset({name: ("time", np.zeros(3)) for name in (*names, *more)})


def test_a_dataset_is_of_the_first_kind_whose_variables_it_has():
    """A file of curves alone was taken for a branch, and ended in a traceback."""
    curves = {name: ("k", [0]) for name in (*PRODUCTS["curves"].told_by, "special_kind")}
    assert kind_of(xr.Dataset(curves)) == "curves"
    del curves["row_size"]
    assert kind_of(xr.Dataset(curves)) == "branch"
    assert kind_of(a_run()) == "run"
    assert kind_of(xr.Dataset(attrs={"cells_done": 0})) == "begun"


def test_a_run_with_its_class_beside_is_still_a_run():
    """`run.merge(assess(run))` has a label: it could be heard and exported no more, and its preview
    was that of a map of one cell."""
    assert kind_of(a_run(label=0)) == "run"
    assert kind_of(a_run().merge(xr.Dataset({"label": 0, "result": 0}))) == "run"
    assert kind_of(a_run(label=0)[["label", "time"]]) == "map"


def test_what_was_of_a_kind_is_of_none():
    run, shape = a_run(), xr.DataArray(np.zeros((2, 2)), dims=("mode", "axis"))
    modes = xr.Dataset({"shape_amplitude": shape})
    assert kind_of(modes) == "modes" and kind_of(modes.isel(mode=0)) == ""
    joined = xr.concat([run, run], "case")
    part = xr.Dataset({"velocity_rms": 0.1}, attrs={"cells_done": 5})  # of an unfinished map
    cut = run[["time", "velocity", "regime"]]  # was heard, and ended in a traceback
    for none in (run.isel(time=0), cut, joined, part, xr.Dataset()):
        assert kind_of(none) == ""


def test_a_run_that_is_none_any_more_says_why():
    joined = xr.concat([a_run(), a_run()], "case")
    with pytest.raises(StoreError, match="else, for its regime lies along case and time: .*; only"):
        check_kind(joined, ["run"], "heard")


@pytest.mark.parametrize(
    ("ds", "wanted", "line"),
    [
        (a_run(), ["map"], "m.h5: holds a run; only a map can be drawn"),
        (xr.Dataset(), ["run", "modes"], "m.h5: holds something else; only a run or modes of one"),
        (
            xr.Dataset(attrs={"cells_done": 0}),
            ["map", "run", "branch"],
            "m.h5: holds a sweep without a computed cell; only a map, a run or a branch can be",
        ),
    ],
)
def test_another_kind_is_refused_in_one_line(ds, wanted, line):
    with pytest.raises(StoreError, match=line):
        check_kind(ds, wanted, "drawn", "m.h5")
