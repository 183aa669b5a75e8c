"""Many starts of one system: the oscillator of docs/basins.md, whose shares are known exactly."""

import math
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import own_systems
import pytest
from pages import DOCS, blocks
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from systems import Rod

import wiperjax
from wiperjax.datasets.kinds import kind_of
from wiperjax.maps import basins
from wiperjax.systems.oscillator import Oscillator

SPEEDS = (1.25, 1.4, 1.55, 1.7)
EXACT = (0.0801969, 0.2122652, 0.3565963, 0.4941116)  # from the unstable cycle, by quadrature
HOPF, LAST_CYCLE = np.log(10) / 2, 1.8366009722


@pytest.fixture(scope="module")
def oscillator():
    """The class that the page defines."""
    names = {"wiperjax": wiperjax}
    exec(blocks(DOCS / "basins.md", "python")[0], names)
    return names["FrictionOscillator"]


def _return_speed(belt):
    """Largest slip speed, away from the belt, of the first swing back after a release (scipy)."""

    def slip(t, state):
        x, v = state
        return v, 0.5 + 0.5 * np.exp(-(belt - v) / 0.5) - x - 2 * 0.05 * v

    def fastest(t, state):
        return slip(t, state)[1] if t > 1.0 else -1.0  # at the release it is 0, too

    fastest.direction, fastest.terminal = -1, True
    fine = {"rtol": 1e-12, "atol": 1e-14, "method": "DOP853"}
    way = solve_ivp(slip, (0, 12), (1 - 2 * 0.05 * belt, belt), events=fastest, **fine)
    return way.y_events[0][0][1] - belt


def test_the_speed_at_which_the_cycle_dies_is_that_of_the_page():
    """Released on the belt, the block just comes back to its speed. It said 1.8367771041."""
    dies = brentq(_return_speed, 1.8, 1.9, xtol=1e-12)
    assert dies == pytest.approx(LAST_CYCLE, abs=1e-9)
    assert f"dies at {LAST_CYCLE};" in (DOCS / "basins.md").read_text()


def box(count, seed=1):
    rng = np.random.default_rng(seed)
    return (rng.uniform(-2, 2, count),), (rng.uniform(0, 2, count),)


@pytest.mark.long
def test_shares_of_the_friction_oscillator_are_the_exact_ones(oscillator):
    count, ends = 4000, (HOPF - 0.05, LAST_CYCLE + 0.02)
    speeds = np.repeat((*SPEEDS, *ends), count)
    starts = box(speeds.size)
    ds = wiperjax.basins(oscillator(belt=speeds), starts, settle=2000.0, window=50.0)
    assert (ds.result == wiperjax.Result.FINISHED).all()
    steady = (ds.velocity_rms < 1e-3).values.reshape(-1, count)
    rms = ds.velocity_rms.values
    assert not ((rms > 1e-4) & (rms < 0.3)).any()  # settled: the threshold does not matter
    assert (ds.stick_fraction.values.reshape(-1, count)[steady] == 0).all()
    share, error = steady.mean(axis=1), wiperjax.share_error(steady.sum(axis=1), count)
    assert (np.abs(share[:4] - EXACT) < 3 * error[:4]).all(), (share, error)
    assert share[4] == 0 and share[5] == 1


@pytest.mark.long
def test_a_start_is_what_it_would_be_alone(oscillator, monkeypatch):
    (x,), (v,) = box(5)
    speeds = np.array([1.2, 1.3, 1.4, 1.5, 1.6])
    ds = wiperjax.basins(oscillator(belt=speeds), ((x,), (v,)), settle=20.0, window=20.0, rtol=1e-9)
    np.testing.assert_array_equal(ds.initial_velocity[:, 0], v)
    for k, speed in enumerate(speeds):
        run = wiperjax.simulate(
            oscillator(belt=speed), 40.0, initial_state=((x[k],), (v[k],)), rtol=1e-10
        )
        assert float(ds.final_position[k, 0]) == pytest.approx(
            float(run.final_position[0]), abs=1e-6
        )
        late = run.isel(time=slice(run.sizes["time"] // 2, None))
        assert float(ds.velocity_rms[k]) == pytest.approx(float(late.velocity.std()), rel=0.02)
    monkeypatch.delattr(basins, "run_pool")  # other times and tolerances trace nothing
    wiperjax.basins(oscillator(belt=speeds), ((x,), (v,)), settle=3.0, window=2.0, rtol=1e-6)


class _Tabulated(wiperjax.AbstractFriction):
    """A law read from a table of four speeds."""

    static: float = 1.0
    speeds: Any = eqx.field(default_factory=lambda: np.array([0.0, 0.5, 1.0, 3.0]))
    values: Any = eqx.field(default_factory=lambda: np.array([1.0, 0.6, 0.5, 0.5]))

    def coefficient(self, speed):
        return jnp.interp(speed, self.speeds, self.values)


class _Named(Oscillator):
    coordinates = ("place",)


@pytest.mark.long
def test_what_reached_its_end_has_numbers_where_several_motions_were_possible():
    """They were NaN, and a start of no motion counted as one of the other."""
    (x, y, lean), rates = Rod().start(math.radians(60), 1.0, spin=5.0)
    ds = wiperjax.basins(Rod(), (([x], y, lean), rates), settle=0.0, window=0.01)
    assert ds.result.item() == wiperjax.Result.PAINLEVE_INDETERMINATE
    assert ds.flight_fraction.item() == pytest.approx(1.0)
    assert ds.attrs["source"].startswith("wiperjax") and ds.attrs["system"] == "Rod"


@pytest.mark.long
def test_a_table_is_no_number_of_each_start():
    """With as many starts as the table has speeds, each start would get one speed of it."""
    system = _Named(friction=_Tabulated())
    (x,), (v,) = box(5)
    ds = wiperjax.basins(system, ((x,), (v,)), settle=1.0, window=1.0)
    assert kind_of(ds) == "basins"
    with pytest.raises(ValueError, match=r"system: friction.speeds must be made by wiperjax.param"):
        wiperjax.basins(system, ((x[:4],), (v[:4],)), settle=1.0, window=1.0)
    assert (ds.result == wiperjax.Result.FINISHED).all()
    assert list(ds.axis.values) == ["place"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"starts": 3}, "starts must be (position, velocity), each n >= 1 arrays"),
        ({"starts": (([1.0],), ())}, "starts must be (position, velocity), each n >= 1 arrays"),
        ({"starts": (([1.0, 2.0],), ([1.0, 2.0, 3.0],))}, "starts must be (position, velocity)"),
        ({"starts": (([1.0, np.nan],), (0.0,))}, "one a start, but had nan"),
        ({"settle": -1.0}, "settle must be a finite number >= 0, but was -1"),
        ({"window": 0.0}, "window must be a finite number > 0, but was 0"),
        ({"rtol": 1.0}, "rtol must lie inside"),
        (
            {"system": Oscillator(damping=np.array([0.1, 0.2]))},
            "system: damping must be a number or have one entry a start (3), but had 2",
        ),
        ({"system": 1}, "system must be a system such as Wiper()"),
    ],
)
def test_what_cannot_be_meant_is_one_line(oscillator, given, said):
    usual = {"system": oscillator(), "starts": box(3), "settle": 1.0, "window": 1.0}
    with pytest.raises(ValueError) as refused:
        wiperjax.basins(**usual | given)
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_a_law_that_rises_at_rest_is_refused():
    block = own_systems.Oscillator(friction=own_systems.Rising())
    with pytest.raises(ValueError, match="^Rising: .* must not be larger in slip than at rest"):
        wiperjax.basins(block, box(3), settle=1.0, window=1.0)


def test_the_error_of_a_share_is_that_of_many_repetitions():
    rng, count = np.random.default_rng(2), 400
    for share in (0.02, 0.3, 0.5):
        seen = rng.binomial(count, share, 20_000)
        assert wiperjax.share_error(share * count, count) == pytest.approx(
            seen.std() / count, rel=0.1
        )
    with pytest.raises(ValueError, match=r"count must be at most of \(400\), but was 401"):
        wiperjax.share_error(401, count)
    assert wiperjax.share_error(0, count) > 0 and wiperjax.share_error(count, count) > 0
