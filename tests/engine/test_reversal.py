"""Statistics around V = 0: exact wherever steps end."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import wiperjax
from wiperjax import Result, TrapezoidBelt, Wiper, WipingBelt
from wiperjax.engine.observers.reversal import ReversalTotals, _integral
from wiperjax.engine.observers.told import told
from wiperjax.numerics import quartic

SHARES = ("stick_fraction", "flight_fraction")
DURATION, WINDOW, FREQUENCY = 0.4, 0.02, 4.0  # V = 0 at 0.125 s, 0.25 s, ...
BELTS = {
    "wiping": WipingBelt(0.8, FREQUENCY),
    "trapezoid": TrapezoidBelt(0.8, FREQUENCY, 0.02),
}


@eqx.filter_jit
def totals(belt, max_step):
    # quiet but for the turn itself, so that steps are long
    calm = dict(lip_length=6.5e-3, support_stiffness=2e4, mu_static=0.7, mu_minimum=0.5)
    wiper = Wiper(belt=belt, **calm)
    watching = ReversalTotals(0.0, WINDOW)
    return wiperjax.solve(wiper, DURATION, rtol=1e-8, observer=watching, max_step=max_step)


@pytest.fixture(scope="module", params=BELTS)
def both(request):
    """Long steps and short ones."""
    belt = BELTS[request.param]
    found = [totals(belt, max_step) for max_step in (np.inf, 1e-4)]
    assert all(run.result == Result.FINISHED for run in found)
    assert found[1].steps > 1.5 * found[0].steps  # else the test says nothing
    return [run.statistics for run in found]


@pytest.mark.long
def test_times_within_the_window_are_exact(both):
    # at the start, around three passages, and none at the end
    for record in both:
        assert float(record.stroke_time) == pytest.approx(DURATION - 7 * WINDOW, rel=1e-10)
        assert float(record.vibration_time) == pytest.approx(4 * WINDOW, rel=1e-10)


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "accuracy"),
    [
        ("force_max_reversal", 1e-5),
        ("force_integral_stroke", 1e-6),
        ("stick_time_stroke", 1e-5),
        ("vibration_integral", 1e-5),
    ],
)
def test_they_do_not_depend_on_the_steps(both, name, accuracy):
    long, short = (float(getattr(record, name)) for record in both)
    assert long == pytest.approx(short, rel=accuracy)


@pytest.mark.long
def test_the_largest_force_is_that_of_the_window_also_where_strokes_press_harder():
    """Against samples of the same motion: no node of a stroke counts, and no vertex is missed."""
    wiper = Wiper(
        belt=WipingBelt(0.4, 5.0, np.deg2rad(-70.0)),
        attack_angle=np.deg2rad(-35.0),
        support_stiffness=8000.0,
    )
    times, window = np.linspace(0.0, 0.2, 20_001)[1:], 0.025
    run = wiperjax.solve(
        wiper, 0.2, rtol=1e-8, observer=ReversalTotals(0.0, window), sample_times=times
    )
    force = np.asarray(run.samples.normal_force)
    near = np.abs(np.asarray(wiper.belt.since_reversal(times))) <= window
    assert force[~near].max() > 1.02 * force[near].max()  # else the test says nothing
    found = float(run.statistics.force_max_reversal)
    assert force[near].max() <= found < force[near].max() * (1 + 3e-4)  # it is at the window's edge


@pytest.mark.long
@pytest.mark.parametrize("which", [0, 1])
def test_what_lies_within_the_window_is_not_of_the_strokes_by_rounding(both, which):
    """A share of 1e-20 would name a mechanism: flight at the turn is none of the strokes."""
    r = both[which]
    for time in (r.stick_time_stroke, r.flight_time_stroke):
        assert float(time) == 0 or float(time) > 1e-9


@pytest.mark.long
def test_what_is_carried_by_a_turning_belt_moves_as_the_belt():
    """In stick there is no error to limit a step: one of half a period was 1 % off in the whole and
    14 % around V = 0."""
    amplitude, turn = 2e-3, 2 * np.pi * FREQUENCY
    record = totals(WipingBelt(amplitude, FREQUENCY), np.inf).statistics
    assert float(record.totals.stick_time) == pytest.approx(DURATION, rel=1e-12)

    def square(end):  # integral of the velocity's from V = 0 on
        return amplitude**2 * (end / 2 - np.sin(2 * turn * end) / (4 * turn))

    whole = float(record.totals.output_square_integral)
    assert whole == pytest.approx(square(DURATION), rel=1e-6)
    assert float(record.vibration_integral) == pytest.approx(4 * square(WINDOW), rel=1e-5)


@eqx.filter_jit
def seen(phase, window):
    wiper = Wiper(belt=WipingBelt(0.8, FREQUENCY, phase))
    return wiperjax.solve(wiper, 0.02, observer=ReversalTotals(0.0, window)).statistics


@pytest.mark.long
def test_what_no_time_lay_in_has_no_force():
    """The mean of strokes of no length was infinite, the largest force of no turn 0 N/m."""
    of_the_turn = {"normal_force_max_reversal", "velocity_rms_reversal"}
    of_strokes = {f"{name}_stroke" for name in ("normal_force_mean", *SHARES)}
    for degrees, window, lacking in ((0, 0.05, of_strokes), (90, 0.02, of_the_turn)):
        found = told(seen(jnp.deg2rad(jnp.array(float(degrees))), jnp.array(window)), 0.02, True)
        parts = {name: float(found[name]) for name in of_the_turn | of_strokes}
        assert {name for name, value in parts.items() if not np.isfinite(value)} == lacking
        assert all(np.isnan(parts[name]) for name in lacking)
        assert all(parts[name] > 0 for name in parts if "force" in name and name not in lacking)


def test_behind_a_step_of_no_length_nothing_is_blown_up():
    """Rounding of the nodes, to the fifth power of how many times as long the correction is, made
    1e5 m/s of 0.04."""
    nodes = 0.04 + 1e-17 * np.array([1.0, -1.0, 1.0, -1.0, 1.0])
    coefficients = quartic.powers(nodes)
    assert float(_integral(coefficients, 1e6)) == pytest.approx(0.04 * 1e6, rel=1e-9)
    assert float(_integral(coefficients, 0.3)) == pytest.approx(0.04 * 0.3, rel=1e-9)


@pytest.mark.parametrize("window", (-0.01, np.nan))
def test_a_window_that_cannot_be_meant_is_refused(window):
    """One of -10 ms made strokes longer than the run, and their share of stick 7 % larger."""
    with pytest.raises(ValueError, match="window must"):
        ReversalTotals(0.0, window)
