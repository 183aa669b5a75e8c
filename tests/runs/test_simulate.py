"""`simulate`: the dataset of its contract, known motions, and clear refusals."""

import json
import math
import re

import diffrax
import jax
import numpy as np
import pytest
import xarray as xr
from own_systems import Lifted, Unsaid
from reference import blade as reference

import wiperjax
from wiperjax.engine.observers.reversal import ReversalTotals
from wiperjax.runs import simulate
from wiperjax.store import whole
from wiperjax.systems.woodpecker import Woodpecker
from wiperjax.vocabulary.codes import ADVICE, RESULTS, Event, Regime, Result

BELT = 0.3


def blade(degrees, **parameters):
    """The reference blade at an attack angle, with other parameters as named."""
    return wiperjax.Wiper(attack_angle=np.radians(degrees), **parameters)


class Ball(wiperjax.AbstractSystem):
    """A ball dropped on the floor, without friction: one coordinate."""

    mass: float = 2.0
    weight: float = 9.81
    restitution: float = 0.5

    @property
    def bounce(self):
        return self.restitution

    def free_acceleration(self, t, q, v):
        return (-self.weight,)

    def directions(self, t, q):
        return (0.0,), (1 / self.mass,)

    def gap(self, t, q):
        return q[0]


@pytest.fixture(scope="module")
def squeal():
    """The blade of SCENES.md 1."""
    return wiperjax.simulate(blade(5.0), 0.2, sample_interval=2e-5)


@pytest.fixture(scope="module")
def flying():
    """The blade of SCENES.md 3."""
    return wiperjax.simulate(blade(-35.0, support_stiffness=8000.0), 0.5, sample_interval=2e-5)


def times_of(run, kind, after=0.0):
    chosen = (run.event_kind.values == kind) & (run.event_time.values > after)
    return run.event_time.values[chosen]


def whole_periods(run, after):
    """(time of the first release after `after`, of the last one, number of periods between)."""
    releases = times_of(run, Event.RELEASE, after)
    return releases[0], releases[-1], len(releases) - 1


# --- the contract ---------------------------------------------------------------------------------


@pytest.mark.slow
def test_dataset_has_what_the_contract_names(squeal):
    assert squeal.sizes == {"time": 10001, "axis": 2, "event": squeal.event_time.size}
    assert list(squeal.axis.values) == ["x", "y"]
    assert squeal.time.values[0] == 0 and squeal.time.values[-1] == 0.2
    units = {"position": "m", "velocity": "m/s", "normal_force": "N/m", "friction_force": "N/m"}
    for name, unit in (units | {"event_time": "s", "event_impulse": "N s/m"}).items():
        assert squeal[name].dtype == np.float64 and np.all(np.isfinite(squeal[name]))
        assert squeal[name].attrs["units"] == unit and squeal[name].attrs["long_name"]
    codes = {"regime": Regime, "regime_before": Regime, "regime_after": Regime}
    for name, enum in (codes | {"event_kind": Event, "result": Result}).items():
        meanings = squeal[name].attrs["flag_meanings"].split()
        assert squeal[name].dtype == np.int8
        assert dict(zip(meanings, squeal[name].attrs["flag_values"], strict=True)) == {
            member.name.lower(): int(member) for member in enum
        }
        assert np.isin(squeal[name], squeal[name].attrs["flag_values"]).all()
    assert squeal.position.dims == squeal.velocity.dims == ("time", "axis")
    assert squeal.result == RESULTS["finished"]


@pytest.mark.slow
def test_attributes_tell_all_parameters_tolerances_and_statistics(squeal):
    attrs = squeal.attrs
    assert (
        attrs["attack_angle"] == np.radians(5.0) and "attack_angle: rad" in attrs["parameter_units"]
    )
    assert (attrs["system"], attrs["belt"], attrs["belt_speed"]) == ("Wiper", "SteadyBelt", 0.3)
    assert attrs["hinge_mass"] == 0 and "piece" not in attrs
    assert (attrs["solver"], attrs["rtol"], attrs["zeno_time"]) == ("Tsit5", 1e-8, 1e-8)
    np.testing.assert_allclose(attrs["atol_position"], 1e-8 * 6e-3)
    assert attrs["steps"] > attrs["rejected_steps"] >= 0 and attrs["unproved_steps"] == 0
    assert attrs["result_message"] == ADVICE[Result.FINISHED]
    assert "diffrax" in json.loads(attrs["versions"])


def test_final_state_is_the_last_sample(squeal):
    assert float(squeal.final_time) == 0.2
    for name in ("position", "velocity"):
        np.testing.assert_allclose(squeal[f"final_{name}"], squeal[name][-1], rtol=1e-6, atol=1e-12)
    assert squeal.final_regime == squeal.regime[-1]


def test_run_survives_a_file(squeal, tmp_path):
    whole.write_dataset(squeal, tmp_path / "run.h5")
    with xr.open_dataset(tmp_path / "run.h5", engine="h5netcdf") as read:
        xr.testing.assert_equal(read.load(), squeal)
        assert read.attrs["tip_mass"] == 2.4e-3


# --- physics --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("degrees", "stiffness", "duration"), [(5.0, 2000.0, 0.03), (-35.0, 8000.0, 0.11)]
)
def test_events_are_those_of_the_independent_reference(degrees, stiffness, duration):
    parameters = {"attack_angle": math.radians(degrees), "support_stiffness": stiffness}
    exact = reference.simulate(
        reference.REFERENCE | parameters, reference.Steady(BELT), duration, rtol=1e-12
    )
    run = wiperjax.simulate(wiperjax.Wiper(**parameters), duration, rtol=1e-10)
    # the reference does not report kinks while flying
    kept = (run.event_kind != Event.KINK) | (run.regime_before != Regime.FLIGHT)
    run = run.sel(event=kept.values)
    expected = []
    for event in exact.events:
        if event.kind == "zeno":  # one event here, with the impact it completes there
            event = event._replace(impulse=event.impulse + expected.pop().impulse)
        expected.append(event)
    assert [Event(k).name.lower() for k in run.event_kind.values] == [e.kind for e in expected]
    times = np.array([event.time for event in expected])
    np.testing.assert_allclose(run.event_time, times, rtol=0, atol=1e-9 * duration)
    impulses = np.array([event.impulse for event in expected])
    np.testing.assert_allclose(run.event_impulse, impulses, rtol=1e-6, atol=1e-12)
    assert [int(code) for code in run.regime_after] == [e.after for e in expected]


def test_squeal(squeal):
    """SCENES.md 1: 780.8 Hz, rms 0.357 m/s, mean normal force 12.2 N/m."""
    first, last, periods = whole_periods(squeal, 0.1)
    assert periods / (last - first) == pytest.approx(780.79, abs=0.01)
    assert np.ptp(np.diff(times_of(squeal, Event.RELEASE, 0.1))) < 1e-6 / 780.8
    settled = squeal.sel(time=slice(first, last))
    # of whole periods; the share in SCENES.md (0.454) counts the 11 ms of stick after the start
    assert float((settled.regime == Regime.STICK).mean()) == pytest.approx(0.4385, abs=2e-3)
    assert float(settled.velocity.sel(axis="x").std()) == pytest.approx(0.357, abs=1e-3)
    assert float(settled.normal_force.mean()) == pytest.approx(12.2, abs=0.05)


def test_chattering_with_flight(flying):
    """SCENES.md 3: 28.2 Hz, stick/slip/flight 0.469/0.469/0.062, lift 0.48 mm, 4.5 mN s/m."""
    first, last, periods = whole_periods(flying, 0.1)
    assert periods / (last - first) == pytest.approx(28.2, abs=0.05)
    settled = flying.sel(time=slice(first, last))
    share = [float((settled.regime == r).mean()) for r in Regime]
    # whole periods here, 0.5 s there (14.1 periods)
    np.testing.assert_allclose(share, [0.469, 0.0, 0.469, 0.062], atol=4e-3)
    assert float(flying.position.sel(axis="y").max()) == pytest.approx(0.48e-3, abs=5e-6)
    late = flying.event_impulse.where(flying.event_time > 0.1)
    assert float(late.max()) == pytest.approx(4.5e-3, abs=5e-5)
    hits = np.isin(flying.event_kind, [Event.IMPACT, Event.ZENO])
    assert np.all(flying.event_impulse.values[hits] > 0)
    assert np.all(flying.event_impulse.values[~hits] == 0)


def test_samples_obey_contact_and_friction(flying):
    y, slip = flying.position.sel(axis="y"), flying.velocity.sel(axis="x") - BELT
    stick, flight = flying.regime == Regime.STICK, flying.regime == Regime.FLIGHT
    assert float(abs(slip.where(stick)).max()) < 1e-9
    assert float(y.min()) > -1e-10 and float(y.where(flight).max()) > 1e-4
    assert float(abs(y.where(~flight)).max()) < 1e-10
    force, load = flying.friction_force, flying.normal_force
    assert np.all(load.where(flight, 0) == 0) and np.all(force.where(flight, 0) == 0)
    assert np.all(load.where(~flight, 1) > 0)
    assert np.all(abs(force) <= 1.0 * load * (1 + 1e-9))
    sliding = np.isin(flying.regime, [Regime.SLIP_POS, Regime.SLIP_NEG])
    assert np.all((force * slip).where(sliding, -1) <= 0)


def test_regimes_chain_and_agree_with_the_samples(flying):
    times = flying.event_time.values
    assert np.all(np.diff(times) >= 0)
    np.testing.assert_array_equal(flying.regime_before[1:], flying.regime_after[:-1])
    assert flying.final_regime == flying.regime_after[-1]
    codes = np.concatenate([flying.regime_before[:1], flying.regime_after])
    at = np.searchsorted(times, flying.time.values, side="left")
    clear = np.abs(times[:, None] - flying.time.values).min(axis=0) > 1e-9
    np.testing.assert_array_equal(flying.regime.values[clear], codes[at][clear])


def test_sampling_and_pauses_do_not_change_the_motion(squeal):
    other = wiperjax.simulate(blade(5.0), 0.2, sample_interval=0.03)
    assert list(other.time.values) == pytest.approx([0.03 * i for i in range(7)])
    xr.testing.assert_equal(
        other.drop_dims("time").drop_vars("axis"), squeal.drop_dims("time").drop_vars("axis")
    )
    assert squeal.attrs["steps"] == other.attrs["steps"]


def test_a_shorter_run_ends_on_the_longer_one(squeal):
    short = wiperjax.simulate(blade(5.0), 0.0137)
    assert short.sizes["time"] == 2001
    on = squeal.sel(time=0.0137, method="nearest")
    assert float(on.time) == pytest.approx(0.0137, rel=1e-12)
    np.testing.assert_allclose(short.final_position, on.position, atol=1e-7 * 6e-3)
    np.testing.assert_allclose(short.final_velocity, on.velocity, atol=1e-6)


# --- any system, any number of events -------------------------------------------------------------


def test_thousands_of_events_at_their_exact_times(monkeypatch, caplog):
    """An elastic ball: the k-th impact at (2 k - 1) sqrt(2 h/g). Who waits long is told how far it
    is, once."""
    monkeypatch.setattr(simulate, "PATIENCE", 0.0)
    height, weight = 1e-4, 9.81
    fall = np.sqrt(2 * height / weight)
    run = wiperjax.simulate(
        Ball(restitution=1.0), 5000 * fall, initial_state=((height,), (0.0,)), rtol=1e-10
    )
    impacts = np.arange(1, 2501)
    assert run.sizes["event"] == 2500 > 2 * simulate.EVENTS_AT_ONCE
    (told,) = caplog.messages
    assert re.fullmatch(r"note: at 18\.\d of 22\.6 s; the rest takes \d.* at this pace", told), told
    np.testing.assert_allclose(run.event_time, (2 * impacts - 1) * fall, rtol=1e-9)
    np.testing.assert_allclose(run.event_impulse, 4.0 * weight * fall, rtol=1e-9)
    assert list(run.axis.values) == ["q0"] and run.position.dims == ("time", "axis")
    assert "units" not in run.position.attrs and run.time.attrs["units"] == "s"
    # forces as in a map of it
    assert run.normal_force.attrs["units"] == run.friction_force.attrs["units"] == "N"
    assert run.event_impulse.attrs["units"] == "N s"
    assert run.attrs["weight"] == 9.81 and run.attrs["system"] == "Ball"


def test_accumulating_bounces_end_at_rest():
    height, weight, e = 0.1, 9.81, 0.5
    fall = np.sqrt(2 * height / weight)
    run = wiperjax.simulate(Ball(restitution=e), 1.0, initial_state=((height,), (0.0,)))
    rest = fall * (1 + e) / (1 - e)
    assert run.event_kind[-1] == Event.ZENO
    assert float(run.event_time[-1]) == pytest.approx(rest, rel=1e-9)
    assert run.final_position == 0 and run.final_velocity == 0
    lying = run.sel(time=slice(rest + 1e-9, None))
    np.testing.assert_allclose(lying.normal_force, 2.0 * weight, rtol=1e-12)


@pytest.mark.long
def test_one_compilation_serves_all_values(squeal, flying, monkeypatch):
    traces = []

    def counted(problem, state):
        traces.append(type(problem.system).__name__)
        return step(problem, state)

    step = simulate.advance
    monkeypatch.setattr(simulate, "advance", counted)
    faster = wiperjax.SteadyBelt(0.35)
    run = wiperjax.simulate(
        blade(12.0, belt=faster, normal_load=12.0, mu_static=0.9), 0.01, rtol=1e-6, atol=1e-9
    )
    assert run.attrs["belt_speed"] == 0.35 and run.attrs["steps"] > 0
    assert traces == []
    # the counter counts: another solver is another program
    wiperjax.simulate(Ball(), 0.01, initial_state=((0.1,), (0.0,)), solver=diffrax.Bosh3())
    assert set(traces) == {"Ball"}
    # nor does a time from which is gathered, which was in the program
    start = ((0.1,), (0.0,))
    wiperjax.simulate(Ball(), 0.01, initial_state=start, observer=wiperjax.RegimeTotals(0.002))
    traces.clear()
    wiperjax.simulate(Ball(), 0.01, initial_state=start, observer=wiperjax.RegimeTotals(0.003))
    assert traces == []


def test_no_program_is_kept_for_each_number_of_samples(caplog):
    """Of 1000 runs of unlike lengths jax kept four programs each, some 5 MB, and compiled them."""

    def samples(count):
        return wiperjax.simulate(blade(12.0), 0.004, sample_interval=0.004 / count)

    samples(100)
    with jax.log_compiles():
        found = [samples(count) for count in (97, 113)]
    assert [run.sizes["time"] for run in found] == [98, 114]
    assert [r.message for r in caplog.records if r.message.startswith("Compiling")] == []
    for run in found:
        np.testing.assert_array_equal(run.belt_velocity, BELT)
        slip = run.velocity.sel(axis="x") - BELT
        np.testing.assert_allclose(run.slip_speed, slip, rtol=0, atol=1e-12)


# --- ends that are results, not errors ------------------------------------------------------------


def test_collapse_is_a_result():
    run = wiperjax.simulate(blade(60.0), 0.1)
    assert run.result == RESULTS["collapsed"]
    end = float(run.final_time)
    assert 0 < end < 0.1 and end - 5e-5 < run.time.values[-1] <= end
    lean = np.arcsin(float(run.final_position.sel(axis="x")) / 6e-3)
    assert np.degrees(lean) == pytest.approx(89.0, abs=1e-4)
    assert run.event_kind[-1] == Event.COLLAPSE and "collapse_angle" in run.attrs["result_message"]


@pytest.mark.slow
def test_a_load_that_pulls_is_a_result():
    """Friction on a load below zero drove what it should brake, and the run finished."""
    run = wiperjax.simulate(Lifted(), 20.0)
    assert Result(int(run.result)) == Result.NO_CONSISTENT_REGIME
    assert np.pi + np.arcsin(0.3) < float(run.final_time) < 4.0


def test_a_spent_budget_is_a_result():
    run = wiperjax.simulate(blade(5.0), 0.1, max_steps=50)
    assert run.result == RESULTS["step_budget_spent"] and run.attrs["steps"] == 50
    assert "max_steps" in run.attrs["result_message"]
    assert float(run.final_time) < 0.1 and np.all(np.isfinite(run.position))


# --- refusals -------------------------------------------------------------------------------------


def test_what_is_of_the_reversal_needs_a_belt_that_says_when_it_turns():
    """All of the window was the stroke, and its share of stick that of stroke and turns."""
    turning = wiperjax.Wiper(belt=Unsaid(0.3, 5.0, 0.04))
    words = "^Unsaid.since_reversal must be its own where a belt turns: .* that of AbstractBelt$"
    with pytest.raises(ValueError, match=words):
        wiperjax.simulate(turning, 0.01, observer=ReversalTotals(0.0, 0.02))
    with pytest.raises(ValueError, match="^system must be on a belt, .*, but was Woodpecker"):
        wiperjax.simulate(Woodpecker(), 0.01, observer=ReversalTotals(0.0, 0.02))


def test_a_window_around_a_turn_leaves_something_of_the_strokes():
    """From a quarter period on it was that quarter, whatever it said."""
    wiping = wiperjax.Wiper(belt=wiperjax.WipingBelt(0.5, 10.0))
    must = "^observer.window: must be at most a fifth of the belt's period .0.02 s., was 0.03$"
    with pytest.raises(ValueError, match=must):
        wiperjax.simulate(wiping, 0.2, observer=ReversalTotals(0.0, 0.03))


TOUCHING = ((1e-3, 0.0), (0.0, 0.0))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"system": "wiper"}, "system must be a system such as Wiper(), but was 'wiper'"),
        ({"duration": 0}, "duration must be a finite number > 0, but was 0"),
        ({"duration": np.inf}, "duration must be a finite number > 0, but was inf"),
        ({"duration": "long"}, "duration must be a finite number > 0, but was 'long'"),
        ({"rtol": -1e-8}, "rtol must lie inside [1e-13, 0.01], but was -1e-08"),
        ({"zeno_time": 0.0}, "zeno_time must be a finite number > 0, but was 0"),
        ({"sample_interval": 0.2}, "sample_interval must lie inside (0, 0.1], but was 0.2"),
        ({"sample_interval": 1e-12}, "sample_interval must be at least 1e-08 s"),
        ({"max_steps": 0}, "max_steps must be a whole number in [1, 2147483647], but was 0"),
        ({"max_steps": 1.5}, "max_steps must be a whole number in [1, 2147483647], but was 1.5"),
        ({"atol": 0.0}, "atol must be one number > 0, or (positions, velocities)"),
        ({"atol": (1e-9, (1e-6, 1e-6, 1e-6))}, "with 1 or 2 numbers each"),
        ({"solver": diffrax.Euler()}, "solver must be an explicit diffrax Runge-Kutta solver"),
        ({"initial_state": 3.0}, "initial_state must be (position, velocity), each n >= 1"),
        ({"initial_state": ((0.0, 0.0), (0.0,))}, "but their lengths were 2 and 1"),
        ({"initial_state": ((0.0,), (0.0,))}, "must have the 2 coordinates of Wiper, but had 1"),
        ({"initial_state": ((np.nan, 0.0), (0.0, 0.0))}, "each n >= 1 finite numbers, but was"),
        ({"initial_state": ((0.0, -1e-4), (0.0, 0.0))}, "a gap >= 0, but the gap was -0.0001"),
        ({"initial_state": ((6e-3, 0.0), (0.0, 0.0))}, "(|phi| < collapse_angle), but was"),
        ({"system": Ball()}, "no default start: pass initial_state"),
        ({"system": Ball(), "initial_state": TOUCHING}, "the coordinates of Ball, but had 2"),
    ],
)
def test_refusals_name_the_argument(changes, text):
    arguments = {"system": blade(5.0), "duration": 0.1} | changes
    with pytest.raises(ValueError) as refused:
        wiperjax.simulate(arguments.pop("system"), arguments.pop("duration"), **arguments)
    assert text in str(refused.value) and "\n" not in str(refused.value)
