"""The failure chart and the stability limits of `wiperjax bench`."""

import dataclasses

import diffrax
import numpy as np
import pytest
from reference.blade import Mechanics, Steady, Trapezoid, simulate

from wiperjax import TrapezoidBelt
from wiperjax_bench.harness.interface import Answer, NotForThisScene
from wiperjax_bench.measurements import failures
from wiperjax_bench.measurements import stability_limits as limits
from wiperjax_bench.measurements import stability_theory as theory_of
from wiperjax_bench.measurements.failures import Outcome
from wiperjax_bench.reports import failures_plot, failures_text
from wiperjax_bench.rivals import compiled, moreau_jean
from wiperjax_bench.scenes import hard
from wiperjax_bench.scenes.hard_sliding import GROWTH_PLACE

(MOREAU,) = moreau_jean.RIVALS


# ---- the scenes and their reference --------------------------------------------------------------


def by_the_tests(scene, cell):
    """Return the positions (samples, 2) of one cell by the independent code of the tests."""
    values = {k: float(v[cell]) for k, v in scene.parameters().items()}
    rest = {k[5:]: values.pop(k) for k in list(values) if k.startswith("belt_")}
    belt = (Trapezoid if isinstance(scene.wiper.belt, TrapezoidBelt) else Steady)(**rest)
    times = scene.sample_times
    found = simulate(values, belt, scene.duration, scene.start[cell], sample_times=times).samples
    return np.stack([found["x"], found["y"]], axis=-1)


# what rounding makes of it: growth by 1e10 begins 7000 units of the last digit from balance
CLOSE = {"growth": 1e-3}
UNLIKE = ("near_painleve", "growth")  # a hinge mass; no tolerance of the loop sees what grows


@pytest.mark.long
@pytest.mark.parametrize("name", hard.SCENES)
def test_two_independent_codes_confirm_the_reference(name):
    scene = hard.SCENES[name]()
    true = failures.reference(scene)
    extent = np.ptp(true, axis=1, keepdims=True)
    extent = np.maximum(extent, failures.STILL * extent.max(axis=2, keepdims=True))
    limit = CLOSE.get(name, 1e-5) * extent
    for cell in (0, 3):
        assert np.all(np.abs(by_the_tests(scene, cell) - true[cell]) < limit[cell])
    if name not in UNLIKE:
        loop = compiled.Compiled("numba scalar loop", 1).prepare(scene, 1e-12).answer()
        assert np.all(np.abs(loop.position - true) < limit)


def test_growth_out_of_nothing_is_that_of_the_linear_motion():
    """x = a exp(r t) (cos w t - r / w sin w t) about balance, both rates from its forces."""
    scene = dataclasses.replace(hard.growth(), sample_times=np.linspace(0.004, 0.018, 60))
    found, body = by_the_tests(scene, 0)[:, 0], Mechanics({})
    place, speed = GROWTH_PLACE, float(scene.wiper.belt.speed)

    def pull(x, along):  # tip's acceleration in slip
        _, mass, force, _ = body.slip_terms(x, along - speed, speed, -1.0, 1)
        return force / mass

    stiffness = -(pull(place + 1e-8, 0.0) - pull(place - 1e-8, 0.0)) / 2e-8
    rate = 0.5 * (pull(place, 1e-5) - pull(place, -1e-5)) / 2e-5
    pace, t = np.sqrt(stiffness - rate**2), scene.sample_times
    size = (scene.start[0, 0] - place) * np.exp(rate * t)
    linear = size * (np.cos(pace * t) - rate / pace * np.sin(pace * t))
    assert size[-1] > 1e5 * size[0] / np.exp(rate * t[0])
    np.testing.assert_array_less(np.abs(found - place - linear), 0.01 * size)


@pytest.mark.long
def test_growth_out_of_nothing_needs_steps_that_see_it():
    """At a loose tolerance it is right with ten steps a period, and early without."""
    scene = hard.growth()
    true = failures.reference(scene)
    error = lambda rtol, steps: failures.error(
        answer(failures.reference(scene, rtol, steps), np.zeros(scene.cells, bool)), true
    )
    assert np.all(error(1e-3, 320) < failures.TOLERANCE)  # 0.1 ms; its period is 1.07 ms
    assert np.all(error(1e-3, 1) > 0.1)


# ---- judging -------------------------------------------------------------------------------------


def answer(position, stopped):
    return Answer(np.arange(3.0), position, position, None, None, np.array(stopped), np.ones(2))


def test_outcomes():
    true = np.zeros((2, 3, 2))
    true[:, :, 0] = [0, 1, 2]
    off = true.copy()
    off[1, 2, 0] += 0.05
    lost = np.where(off == 2.05, np.nan, off)
    sunk = true - [0.0, 0.0009]  # y: a twentieth of the range of x counts
    assert failures.judge(answer(true, [False, False]), true) == Outcome.RIGHT
    assert failures.judge(answer(sunk, [False, False]), true) == Outcome.RIGHT
    assert failures.judge(answer(2 * sunk - true, [False, False]), true) == Outcome.WRONG
    assert failures.judge(answer(off, [False, False]), true) == Outcome.WRONG
    assert failures.judge(answer(off, [False, True]), true) == Outcome.STOPPED
    assert failures.judge(answer(off, [True, False]), true) == Outcome.WRONG
    assert failures.judge(answer(lost, [False, False]), true) == Outcome.WRONG
    assert failures.judge(answer(lost, [False, True]), true) == Outcome.STOPPED


class Still(moreau_jean.MoreauJean):
    """A method that stands still and says nothing; it knows no hinge mass."""

    name = "still"
    settings = (1.0,)

    def prepare(self, scene, setting):
        if np.any(scene.wiper.hinge_mass):
            raise NotForThisScene("no hinge mass")
        start = np.repeat(scene.start[:, None], len(scene.sample_times), axis=1)
        still = np.zeros(scene.cells, bool)
        return lambda: Answer(
            scene.sample_times, start[..., :2], start[..., 2:], None, None, still, still + 1
        )


class Absent(Still):
    name = "absent"

    def available(self):
        return "not installed"


@pytest.fixture(scope="module")
def chart():
    few = {name: hard.SCENES[name] for name in ("grazing", "near_painleve", "large_step")}
    coarse = dataclasses.make_dataclass("Coarse", [], bases=(moreau_jean.MoreauJean,))()
    coarse.settings = (1e-2, 1e-3, 3e-4)
    loop = compiled.Compiled("numba scalar loop", 1)
    loop.settings = (1e-4, 1e-6, 1e-8)
    return failures.measure([coarse, loop, Still(), Absent()], few)


@pytest.mark.long
def test_a_chart_tells_right_from_wrong_and_from_not_run(chart):
    code = lambda method, scene: list(chart.outcome.sel(solver=method, scene=scene).values)
    assert code("Moreau-Jean", "grazing") == [Outcome.WRONG, Outcome.RIGHT, Outcome.RIGHT]
    assert code("Moreau-Jean", "large step") == [Outcome.WRONG, Outcome.RIGHT, Outcome.RIGHT]
    # it converges on Newton's impact law: no rebound from an impact without collision
    assert code("Moreau-Jean", "near Painleve") == [Outcome.WRONG] * 3
    # the parabola through the glass: gravity is in the scalar loop too
    assert code("numba scalar loop", "large step") == [Outcome.RIGHT] * 3
    assert float(chart.error.sel(solver="numba scalar loop", scene="large step", level=2)) < 1e-6
    none = Outcome.NOT_RUN
    assert code("still", "grazing") == [Outcome.WRONG, none, none]
    assert code("still", "near Painleve") == [none] * 3
    assert code("absent", "grazing") == [none] * 3
    assert chart.reason.sel(solver="absent", scene="grazing").item() == "not installed"
    assert chart.reason.sel(solver="still", scene="near Painleve").item() == "no hinge mass"
    first = failures.loosest(chart)
    assert first[0].tolist() == [1, -1, 1] and first[2].tolist() == [-1, -1, -1]


@pytest.mark.long
def test_a_chart_is_drawn_written_and_read(chart, tmp_path):
    chart.to_netcdf(tmp_path / "f.h5", engine="h5netcdf")
    figure = failures_plot.draw(chart)
    words = [text.get_text() for text in figure.axes[0].texts]
    assert words.count("not run") == 5 and words.count("never right") == 3
    text = failures_text.failures_text(chart, "f.png")
    assert "near Painleve, Moreau-Jean: error" in text and "Newton's impact law" in text
    assert "- large step, still: error" in text
    assert "| absent | not run |" in text and "| Moreau-Jean | 2 of 3 | 4 | 5 | 0 |" in text


# ---- stability -----------------------------------------------------------------------------------


def test_stability_regions():
    radius = lambda r, angle=np.pi: theory_of.largest_radius(r, angle)
    assert radius(theory_of.stability_function(diffrax.Heun())) == pytest.approx(2.0)
    # Hairer and Wanner, figure IV.2.2
    assert radius(theory_of.stability_function(diffrax.Dopri5())) == pytest.approx(3.3066, abs=1e-4)
    assert radius(theory_of.stability_function(diffrax.Kvaerno5())) == np.inf
    assert radius(theory_of.theta_function(0.5)) == np.inf
    assert radius(theory_of.theta_function(0.0), 2.0) == pytest.approx(-2 * np.cos(2.0))


@pytest.mark.long
@pytest.mark.parametrize("problem", ["friction", "contact"])
def test_measured_limit_of_smooth_contact_is_that_of_theory(problem):
    theory, measured = limits.methods(problem)["smooth contact, Tsit5"](limits.POINTS[problem][2])
    assert measured == pytest.approx(theory, rel=0.01)


@pytest.mark.long
def test_the_engine_has_the_limit_of_its_solver():
    theory, measured = limits.methods("spring")["engine, Tsit5"](5.0)
    assert measured == pytest.approx(theory, rel=0.01)


@pytest.mark.slow
def test_moreau_jean_has_the_limit_of_its_theta():
    ways = limits.methods("spring")
    theory, measured = ways["Moreau-Jean, theta = 0"](5.0)
    assert measured == pytest.approx(theory, rel=0.02)
    assert ways["Moreau-Jean, theta = 0.5"](5.0) == (np.inf, np.inf)
