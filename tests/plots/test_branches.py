"""Pictures of branches: in words of the blade, with nothing hidden, and nothing beyond the page."""

import matplotlib
import numpy as np
import odd_systems
import pytest
import xarray as xr
from matplotlib.colors import same_color
from own_systems import Ball, Nameless
from pictures import SIGHT, inside_the_page, lab

matplotlib.use("Agg")

import wiperjax  # noqa: E402
from wiperjax import plots  # noqa: E402
from wiperjax.cycles.branch.bifurcations import Special  # noqa: E402
from wiperjax.cycles.branch.dataset import branch_dataset, column_attributes  # noqa: E402
from wiperjax.cycles.branch.follow import Branch  # noqa: E402
from wiperjax.cycles.cycle import Cycle  # noqa: E402
from wiperjax.cycles.return_map import Found  # noqa: E402
from wiperjax.datasets.branch_dataset import TAKEN, with_rest, with_simulations  # noqa: E402
from wiperjax.plots import branches  # noqa: E402

SPEEDS = np.array([0.3, 0.6, 0.9, 1.2, 1.1, 0.8, 0.5])
CORNER = 3  # here the branch turns back, and its multipliers jump


@pytest.fixture(scope="module")
def branch() -> xr.Dataset:
    """Branch of a blade over its belt speed: stable up to a corner, unstable from there on."""
    blade = wiperjax.Wiper(belt=wiperjax.SteadyBelt(0.3), attack_angle=0.0873)
    cycles = [
        Cycle(
            system=blade, found=Found.FOUND, period=1e-3 * (1 + speed), state=np.zeros(4),
            multipliers=np.array([0.0 if k <= CORNER else 20 * speed, 0, 0], complex),
            maximum=4e-3 + 1e-4 * speed, minimum=3.8e-3, velocity_rms=0.7 * speed,
            stick_fraction=0.3, flight_fraction=0.0, normal_force_max=13.0,
        )
        for k, speed in enumerate(SPEEDS)
    ]  # fmt: skip
    corner = Special("grazing_sliding_fold", "-capture -release", 1.2, CORNER)
    hopf = Special("hopf", "", 0.45, 6)
    way = np.arange(7.0)
    ds = branch_dataset(
        Branch(cycles, SPEEDS, way, [corner, hopf], ("", ""), "belt_speed", (0.3, 1.2))
    )
    values = np.array([0.4, 1.4])
    brute = xr.Dataset(
        {"maximum": (("way", "belt_speed", "peak"), np.full((2, 2, 3), 3.9e-3), {"units": "m"})},
        coords={"way": ["up", "down"], "belt_speed": ("belt_speed", values, ds.belt_speed.attrs)},
        attrs={"over": "belt_speed", "settle": 0.1, "window": 0.01},
    )
    still = np.full((2, 1), 3.9e-3), values[:, None] > 1
    ds = with_rest(with_simulations(ds, brute), values, *still)
    return ds.assign_attrs(
        title="Squeal at 5 degrees", attack_angle=5.0, normal_load=15.0, support_stiffness=8e3,
        parameter_units="attack_angle: degrees; normal_load: N/m; support_stiffness: N/m/m",
    )  # fmt: skip


def test_cycles_that_turn_at_a_stop_are_told_apart(branch):
    """Their largest place was drawn, which is that of the stop: one flat line, in which the stable
    ones hid those that are not."""
    held = branch.assign(maximum=branch.maximum * 0 + 4e-3)
    for draw in (plots.branch_page, plots.branch_overview):
        assert draw(held).axes[0].get_ylabel() == "rms of the tip velocity about its mean (m/s)"
        assert draw(branch).axes[0].get_ylabel() == "largest tip position along the glass (mm)"


def test_axes_of_a_branch_are_in_words_of_the_blade(branch):
    every = [str(v.attrs.get("long_name", "")) for v in branch.variables.values()]
    assert not [words for words in every if "coordinate" in words or "output" in words]
    figure = plots.branch_overview(branch)
    top, middle, low = figure.axes
    assert top.get_ylabel() == "largest tip position along the glass (mm)"
    assert low.get_ylabel() == "frequency (Hz)" and low.get_xlabel() == "belt speed (m/s)"
    page = plots.branch_page(branch, "velocity_rms")
    assert page.axes[0].get_ylabel() == "rms of the tip velocity about its mean (m/s)"
    assert branch.rest_position.attrs["long_name"] == "tip position along the glass at rest"
    for drawn in (figure, page, plots.multipliers(branch).figure):
        heading = drawn.get_suptitle().splitlines()
        assert heading[0] == "Squeal at 5 degrees"
        assert heading[1] == "attack angle 5°, normal load 15 N/m, support stiffness 8000 N/m/m"
        assert inside_the_page(drawn) == []


@pytest.mark.parametrize(
    ("system", "words"),
    [(Ball, "largest coordinate height"), (Nameless, "largest first coordinate")],
)
def test_an_axis_of_a_branch_names_the_coordinate_of_a_system_of_ones_own(system, words):
    assert column_attributes(system(), "maximum")["long_name"] == words


def test_every_name_of_a_branch_is_taken(branch):
    """A branch over a parameter of such a name would lose it, or the variable."""
    names = {str(name).removeprefix("simulated_") for name in (*branch.variables, *branch.dims)}
    own = {"belt_speed", "rest_belt_speed"}
    assert own <= names and not (names - own) - TAKEN
    cycle = Cycle(system=odd_systems.Spelled(), found=Found.FOUND)
    over = Branch([cycle], SPEEDS[:1], np.zeros(1), [], ("", ""), "period", (0.3, 1.2))
    with pytest.raises(ValueError, match="is varied must have a name .*, was 'period': rename it"):
        branch_dataset(over)


def test_no_multiplier_hides_another(branch):
    ax = plots.multipliers(branch)
    lines = [line for line in ax.lines if line.get_label().startswith(("largest", "number"))]
    assert len(lines) == 3
    sizes = [line.get_markersize() for line in lines]
    assert sizes == sorted(sizes, reverse=True) and len(set(sizes)) == 3  # smaller ones on top
    assert all(same_color(line.get_markerfacecolor(), "none") for line in lines)
    drawn = np.stack([line.get_ydata() for line in lines])
    known = np.isfinite(drawn).all(axis=0)
    assert known.sum() == len(SPEEDS) and (np.diff(drawn[:, known], axis=0) <= 0).all()
    # no line over the corner, where they jump
    jump = np.flatnonzero(np.abs(np.diff(drawn[0, known])) > 10)[0]
    between = np.flatnonzero(known)[[jump, jump + 1]]
    assert np.diff(between) > 1
    assert ax.get_ylim()[1] > np.nanmax(drawn)


@pytest.mark.parametrize("sight", SIGHT)
def test_colours_of_branches_are_told_apart_by_everybody(sight):
    curves = (branches.BRANCH, branches.REST, *(colour for colour, _ in branches.DOTS.values()))
    for colours in (curves, tuple(colour for *_, colour in branches.MULTIPLIERS)):
        seen = [lab(colour, SIGHT[sight]) for colour in colours]
        near = [np.linalg.norm(a - b) for k, a in enumerate(seen) for b in seen[:k]]
        assert min(near) > 15
