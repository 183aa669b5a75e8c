"""Pictures of systems whose contact is not their first coordinate, and of such without a lip."""

import matplotlib
import numpy as np
import own_systems
import pytest

matplotlib.use("Agg")

import wiperjax
from wiperjax import plots
from wiperjax.datasets.run_dataset import contact_axis
from wiperjax.plots.runs import page
from wiperjax.plots.style import caption
from wiperjax.plots.style.palette import BELT, REGIMES

CLASSES = {"squeal_band": [500.0, 1000.0]}


@pytest.fixture(scope="module")
def head_and_tip():
    return wiperjax.run_scene(
        {
            "system": "head_and_tip",
            "parameters": {"attack_angle": -20.0},
            "run": {"duration": 0.3, "sample_interval": 2e-4},
            "classes": CLASSES,
        }
    )


def belts(ax):
    return [line for line in ax.lines if line.get_color() == BELT]


def points(ax, regime):
    found = [line for line in ax.lines if line.get_marker() == "."]
    return next(x.get_xydata() for x in found if x.get_color() == REGIMES[regime])


@pytest.mark.long
def test_what_sticks_has_no_slip_wherever_the_contact_is(head_and_tip):
    """The tip of a head and tip is its third coordinate."""
    ax = plots.friction_curve(head_and_tip)
    np.testing.assert_allclose(points(ax, "stick")[:, 0], 0.0, atol=1e-12)
    slip, ratio = points(ax, "slip_neg").T
    assert slip.min() < -0.5 and (slip < 1e-9).all()
    np.testing.assert_allclose(ratio, 0.8, rtol=1e-9)  # Coulomb


@pytest.mark.long
def test_the_belt_is_drawn_over_the_velocity_of_the_contact_only(head_and_tip):
    assert contact_axis(head_and_tip) == 2
    rows = page.history_page(head_and_tip)
    words = [ax.get_ylabel().replace("\n", " ") for ax in rows]
    assert words[:2] == ["velocity tip_x", "position tip_x"]
    assert belts(rows[0]) and not belts(rows[1])
    stick = np.asarray(head_and_tip["regime"]) == 0
    shown = next(line for line in rows[0].lines if line.get_color() == "black").get_ydata()
    np.testing.assert_allclose(shown[stick], 0.3, rtol=1e-12)  # on the line of the belt
    for component in (0, 1, 3):
        assert not belts(plots.time_history(head_and_tip, component=component))
        portrait = plots.phase_portrait(head_and_tip, component=component)
        assert not belts(portrait)
    assert portrait.get_xlabel() == "position tip_y"
    (line,) = belts(plots.phase_portrait(head_and_tip))
    assert line.get_ydata()[0] == 0.3


@pytest.mark.slow
def test_a_rim_has_a_slip_speed_and_no_line_of_the_belt_over_an_angle():
    run = wiperjax.simulate(own_systems.Pendulum(), 4.0)
    stick = np.asarray(run["regime"]) == 0
    np.testing.assert_allclose(run["slip_speed"][stick], 0.0, atol=1e-12)
    expected = 0.05 * run["velocity"].values[:, 0] - 0.1
    np.testing.assert_allclose(run["slip_speed"], expected, atol=1e-15)
    assert contact_axis(run) is None
    rows = page.history_page(run)
    assert rows[0].get_ylabel() == "velocity angle" and not any(map(belts, rows))
    assert not belts(plots.phase_portrait(run))
    assert not any(text.get_text() == "speed of the belt" for text in legend(rows[0].figure))


def legend(figure):
    return [text for one in figure.legends for text in one.get_texts()]


def scene(name, duration):
    return {
        "system": f"own_systems:{name}",
        "run": {"duration": duration},
        "classes": CLASSES | {"quiet_velocity": 1e-3},
    }


@pytest.mark.slow
def test_a_gap_is_that_of_the_contact():
    """Over a table that moves it is no coordinate."""
    run = wiperjax.run_scene(
        scene("BallOnATable", 2.0) | {"start": {"position": [1.5], "velocity": [0.0]}}
    )
    table = 1.0 + 0.1 * np.sin(3.0 * run["time"])
    np.testing.assert_allclose(run["gap"], run["position"][:, 0] - table, atol=1e-14)
    assert float(run["gap"].min()) > -1e-7 and run["gap"].attrs["units"] == "m"
    rows = {ax.get_ylabel(): ax for ax in page.history_page(run)}
    assert {"velocity height", "position height", "gap (mm)"} <= rows.keys()
    drawn = next(line for line in rows["gap (mm)"].lines if line.get_color() == "black")
    np.testing.assert_allclose(drawn.get_ydata(), 1e3 * run["gap"])


@pytest.mark.long
def test_a_heading_has_every_parameter_whoever_computed_it(head_and_tip):
    """A run of a file, of Python, and a branch, whose dataset names the class alone."""
    of_file = wiperjax.run_scene(scene("Pendulum", 1.0))
    of_python = wiperjax.simulate(own_systems.Pendulum(), 1.0)
    words = set(caption.parameters_text(of_file).split(", "))
    assert {"inertia 0.02 kg m^2", "lean 11.46°", "mu static 0.7", "belt speed 0.1 m/s"} <= words
    assert set(caption.parameters_text(of_python).split(", ")) == words
    branch = of_file.assign_attrs(system="Pendulum")
    assert set(caption.parameters_text(branch).split(", ")) == words
    shipped = caption.parameters_text(head_and_tip)
    assert "head mass 0.05 kg/m" in shipped and ", load 15 N/m" in shipped


@pytest.mark.long
def test_a_blade_by_any_model_is_headed_as_a_blade():
    """Of a soft lip with what the wiper does not have."""
    run = {"run": {"duration": 0.01}}
    soft = wiperjax.run_scene({"system": "soft_lip", "parameters": {"normal_load": 12.0}} | run)
    text = caption.parameters_text(soft)
    assert text.startswith("attack angle 0°, normal load 12 N/m, belt speed 0.3 m/s")
    assert "contact stiffness 2000 N/m/m" in text
    for model, said in {"block": "block model", "bar": "bar model", "lip": "0.3 m/s"}.items():
        found = wiperjax.run_scene({"model": model} | run)
        assert not caption.is_own(found)
        assert caption.parameters_text(found).endswith(said)
        del found.attrs["model"]  # as in a run of Python, and in a branch
        assert caption.parameters_text(found).endswith(said)


class Block(own_systems.Oscillator):
    """Called as a model of a wiper is, with three coordinates and a lip length."""

    coordinates = ("x", "y", "z")
    lip_length: float = wiperjax.parameter(0.1, "m", above=0)
    normal_load: float = 3.0  # no load of a blade
    seal: wiperjax.AbstractFriction = wiperjax.Coulomb(0.9)

    def free_acceleration(self, t, q, v):
        return (-q[0], -q[1], -q[2])

    def directions(self, t, q):
        return (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)

    def default_state(self):
        return (0.0, 0.01, 0.02), (0.0, 0.0, 0.0)


@pytest.mark.long
def test_a_system_of_ones_own_is_what_it_is_whatever_its_names():
    run = wiperjax.simulate(Block(friction=wiperjax.Coulomb(0.5)), 1.0, sample_interval=0.01)
    assert caption.is_own(run)
    assert [ax.get_ylabel() for ax in plots.time_history(run).figure.axes]  # draws
    assert run.attrs["mu_static"] == 0.5 and run.attrs["seal_static"] == 0.9
    assert "normal load 3," in (said := caption.parameters_text(run) + ",")
    assert "block model" not in said
    with pytest.raises(ValueError, match="component must be 0 ... 2, was 7"):
        plots.phase_portrait(run, component=7)


@pytest.mark.slow
def test_a_hardly_moving_contact_is_still_the_contacts_coordinate(head_and_tip):
    """Slip and belt add up to a velocity but for the rounding of each."""
    quiet, belt = head_and_tip.copy(deep=True), head_and_tip["belt_velocity"]
    quiet["velocity"] = 1e-9 * quiet["velocity"]
    quiet["slip_speed"] = quiet["velocity"].isel(axis=2) - belt
    assert contact_axis(quiet) == 2
