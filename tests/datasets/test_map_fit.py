"""Numbers of a map that no sweep has are noted; borders with sides of another name are refused."""

import re

import numpy as np
import pytest
import xarray as xr

from wiperjax.cli.options import print_doubts
from wiperjax.datasets.borders import unfit
from wiperjax.datasets.map_fit import doubts
from wiperjax.vocabulary.cf import flags
from wiperjax.vocabulary.codes import CROSSINGS, LABELS, MECHANISMS
from wiperjax.vocabulary.columns import attributes_of


def a_map(**changed):
    """Three speeds, of which the last failed; `changed` columns replace its own."""
    columns = {
        "label": [1, 0, 6],
        "mechanism": [2, 0, 0],
        "stick_fraction": [0.4, 1 + 1e-12, np.nan],
        "velocity_rms": [0.2, 0.0, np.nan],
        "dominant_frequency": [780.0, np.nan, np.nan],
        "growth_rate": [-5.0, 5.0, np.nan],
        "final_y": [-1e-20, 0.0, 0.0],
    } | changed
    found = {
        name: ("belt_speed", values, attributes_of(name, {})) for name, values in columns.items()
    }
    return xr.Dataset(found, coords={"belt_speed": [0.1, 0.2, 0.3]}, attrs={"lip_length": 6e-3})


def test_what_a_sweep_makes_is_not_doubted():
    assert list(doubts(a_map())) == []
    masked = a_map().where(a_map().belt_speed > 0.15)
    assert list(doubts(masked)) == []
    unfinished = a_map(label=[-1, 0, 6], stick_fraction=[np.nan, 1.0, np.nan])
    assert list(doubts(unfinished)) == []
    own = a_map().assign_coords(belt_speed=[1e3, 1e4, 1e5]).assign_attrs(system="my:Own")
    assert list(doubts(own)) == []


@pytest.mark.parametrize(
    ("ds", "line"),
    [
        (a_map(mechanism=[99, 0, 0]), r"its mechanism must be 0 \(none\), .*, but had 99"),
        (a_map(label=[1.5, 0, 6]), r"its label must be 0 \(quiet\), .*, but had 1.5"),
        (
            a_map(stick_fraction=[5, 0, 0]),
            r"its stick_fraction must lie inside \[0, 1\], but had 5",
        ),
        (
            a_map(stick_fraction=[0.1, np.nan, 0]),
            "its stick_fraction must be a number where a cell",
        ),
        (
            a_map(velocity_rms=[-1.0, 0, 0]),
            "its velocity_rms must be a finite number >= 0, but had -1",
        ),
        (
            a_map(growth_rate=[np.inf, 0, 0]),
            r"its growth_rate must be finite .* 1e\+150 .* had inf",
        ),
        (
            a_map(dominant_frequency=[1e300, 0, 0]),
            "its dominant_frequency must be finite numbers up",
        ),
        (a_map().assign_coords(belt_speed=[0.1, 0.2, 1e30]), "its axis belt_speed must lie inside"),
        (
            a_map().assign_coords(belt_speed=[0.1, np.nan, 0.3]),
            "its axis belt_speed must lie inside",
        ),
    ],
)
def test_what_no_sweep_makes_is_noted(ds, line, capsys):
    """`info` told it as it was."""
    print_doubts(ds)
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert re.match(f"note: {line}", said)


def test_names_of_other_codes_are_noted():
    """31 squealing cells were 31 quiet ones."""
    ds = a_map()
    words = ds["label"].attrs["flag_meanings"].split()
    ds["label"].attrs["flag_meanings"] = " ".join([words[1], words[0], *words[2:]])
    said = "its label must have the names of its codes, but had 0 (squeal) for 0 (quiet)"
    assert list(doubts(ds)) == [said]
    ds["label"].attrs |= flags(LABELS | {"whistle": 7})  # of a later version
    assert list(doubts(ds)) == []


def borders(on, names):
    place = ("border", [0.15])
    found = {
        "belt_speed": place, "bracket_low": place, "bracket_high": place,
        "axis": ("border", [0], flags({"belt_speed": 0})),
        "kind": ("border", [0], flags(CROSSINGS)),
        "side_low": ("border", [0], flags(names)), "side_high": ("border", [1], flags(names)),
    }  # fmt: skip
    return xr.Dataset(found, attrs={"on": on})


def test_borders_have_the_sides_of_what_they_are_between():
    """Borders of labels were drawn over mechanisms, and between classes with each other's names."""
    assert unfit(borders("label", LABELS)) == unfit(borders("mechanism", MECHANISMS)) == ""
    assert unfit(borders("growth_rate", {"below": 0, "above": 1})) == ""
    said = "side_low of mechanism with 0 (quiet) for 0 (none)"
    assert unfit(borders("mechanism", LABELS)) == said
    swapped = LABELS | {"quiet": 1, "squeal": 0}
    assert unfit(borders("label", swapped)) == "side_low of label with 1 (quiet) for 0 (quiet)"
