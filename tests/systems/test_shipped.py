"""The systems that come with the package, against codes and formulas that are not theirs."""

import tomllib
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import wiperjax
from wiperjax import Coulomb, TrapezoidBelt
from wiperjax.datasets.map_dataset import describe
from wiperjax.systems.chain import Chain, Chain2, Chain3, Chain8
from wiperjax.systems.head_and_tip import HeadAndTip
from wiperjax.systems.oscillator import Oscillator
from wiperjax.vocabulary.codes import LABELS
from wiperjax.vocabulary.columns import attributes_of

SPEED, LAW = 0.2, (1.0, 0.4, 0.3)


def chain_events(n: int, damping: float, stop: float) -> list[tuple[float, str]]:
    """Captures and releases of the first block of a chain from rest, by scipy alone."""
    static, least, scale = LAW
    stiff = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)  # masses, springs and load are 1

    def free(z):
        return -stiff @ (z[:n] + damping * z[n:])

    def slip(sign):
        def rates(t, z):
            force = free(z)
            relative = abs(z[n] - SPEED)
            force[0] -= sign * (least + (static - least) * np.exp(-relative / scale))
            return [*z[n:], *force]

        return rates

    def stick(t, z):
        return [*z[n:], 0.0, *free(z)[1:]]

    def caught(t, z):
        return z[n] - SPEED

    def released(t, z):
        return abs(free(z)[0]) - static

    caught.terminal = released.terminal = True
    now, z, events = 0.0, np.zeros(2 * n), []
    sticks, sign = False, -1
    while now < stop:
        rates, guard = (stick, released) if sticks else (slip(sign), caught)
        guard.direction = 1 if sticks else -sign
        begun = now
        if not sticks and events:  # off the guard, which it leaves
            first = solve_ivp(rates, (now, now + 1e-4), z, rtol=1e-12, atol=1e-14)
            now, z = first.t[-1], first.y[:, -1]
        done = solve_ivp(rates, (now, stop), z, "DOP853", events=guard, rtol=1e-12, atol=1e-14)
        now, z = done.t[-1], done.y[:, -1].copy()
        assert now > begun
        if done.status != 1:
            break
        if not sticks:
            z[n] = SPEED
            sticks = abs(free(z)[0]) <= static
            if not sticks:  # it passes through
                sign = -sign
            events.append((now, "stick" if sticks else "pass"))
        else:
            sticks, sign = False, int(np.sign(free(z)[0]))
            events.append((now, "slip"))
    return events


def test_a_chain_keeps_the_names_that_it_gives_its_blocks():
    """They were overwritten by x1, x2, .., and later so were those of a class made from it."""

    class Train(Chain):
        blocks = 2
        coordinates = ("engine", "waggon")

    class Slow(Train):
        pass

    class Long(Train):
        blocks = 3

    assert Train().coordinates == Slow().coordinates == ("engine", "waggon")
    assert Long().coordinates == ("x1", "x2", "x3")
    assert Chain3().coordinates == ("x1", "x2", "x3")


@pytest.mark.long
@pytest.mark.parametrize("chain", [Chain2, Chain3, Chain8])
def test_a_chain_sticks_and_slips_when_scipy_says(chain):
    system = chain(damping=0.05)
    run = wiperjax.simulate(system, 60.0, rtol=1e-10, sample_interval=0.5)
    meanings = run.event_kind.attrs["flag_meanings"].split()
    names = [meanings[int(kind)] for kind in run.event_kind]
    told = chain_events(chain.blocks, 0.05, 60.0)
    assert len(told) >= 6
    assert len(names) == len(told), (names, told)
    np.testing.assert_allclose(run.event_time, [time for time, _ in told], atol=2e-8)


@pytest.mark.long
def test_a_block_is_carried_through_the_reversal_and_thrown_where_friction_gives_way():
    """On a ramp of slope -a through rest the block sticks from V = 0 at mu N/k until
    k (mu N/k - a s^2/2) - m a - c a s = -mu N, and leaves at the belt's speed there.
    """
    mass, stiffness, damping, load, mu = 1.3, 2.0, 0.15, 0.8, 0.9
    belt = TrapezoidBelt(3.0, 0.01, 20.0)
    own = {"mass": mass, "stiffness": stiffness, "damping": damping, "load": load}
    system = Oscillator(**own, friction=Coulomb(mu), belt=belt)
    start = ((mu * load / stiffness,), (0.0,))
    run = wiperjax.simulate(system, 60.0, initial_state=start, rtol=1e-10, sample_interval=0.01)
    meanings = run.event_kind.attrs["flag_meanings"].split()
    times = {
        meanings[int(k)]: float(t) for k, t in zip(run.event_kind, run.event_time, strict=True)
    }
    time, slope = times["capture"], 3.0 / 10.0
    assert time == pytest.approx(50.0, abs=1e-9)  # half a period of the belt
    roots = np.roots([-0.5 * stiffness * slope, -damping * slope, 2 * mu * load - mass * slope])
    span = float(roots[roots > 0][0])
    assert times["release"] == pytest.approx(time + span, abs=1e-8)
    late = run.sel(time=slice(time + span, None))
    omega = np.sqrt(stiffness / mass - (damping / mass / 2) ** 2)
    place = mu * load / stiffness - 0.5 * slope * span**2 + mu * load / stiffness  # off its rest
    decay, s = damping / mass / 2, late.time.values - time - span
    amplitude = (-slope * span + decay * place) / omega
    exact = np.exp(-decay * s) * (place * np.cos(omega * s) + amplitude * np.sin(omega * s))
    np.testing.assert_allclose(late.position[:, 0] + mu * load / stiffness, exact, atol=1e-7)


SWEEPS = Path(__file__).parents[2] / "sweeps/systems"
CELLS = {  # of each shipped sweep, and what is heard there
    "chain": ({"belt_speed": [0.2, 0.6], "damping": [0.2]}, ["squeal", "quiet"]),
    "flutter": ({"mu_minimum": [0.4, 0.725, 0.775, 1.1]}, [*["quiet"] * 2, *["squeal"] * 2]),
    "head_and_tip": ({"attack_angle": [-12, 10], "load": [20]}, ["chattering", "quiet"]),
    "oscillator": (  # on the way up, on the way down
        {"belt_speed": [0.2, 1.1, 1.35, 1.6, 2.0]},
        [*["squeal", "squeal"] * 2, *["squeal", "quiet"] * 2, *["quiet", "quiet"]],
    ),
    "reversal": ({"damping": [0.1, 0.38], "belt_frequency": [0.004]}, ["squeal", "reversal"]),
    "soft_lip": ({"attack_angle": [-8, 25], "contact_stiffness": [3000]}, ["squeal", "quiet"]),
    "woodpecker": ({"beak_restitution": [0.5]}, ["chattering"]),
}


def test_every_sweep_of_a_system_is_run_below():
    assert set(CELLS) == {path.stem for path in SWEEPS.glob("*.toml")}


@cache
def swept(name):
    spec = tomllib.loads((SWEEPS / f"{name}.toml").read_text())
    return wiperjax.sweep(
        spec | {"axes": {key: {"values": x} for key, x in CELLS[name][0].items()}}
    )


@pytest.mark.long
@pytest.mark.parametrize("name", CELLS)
def test_a_shipped_sweep_shows_what_it_says(name):
    heard, ds = CELLS[name][1], swept(name)
    names = {code: label for label, code in LABELS.items()}
    assert np.all(ds.result == 0)
    assert [names[int(code)] for code in ds.label.values.ravel()] == heard


@pytest.mark.long
def test_a_map_of_the_woodpecker_hears_its_pecking():
    """At 0.1452 s a peck, as is published; down the pole by 4.0 s of it."""
    cell = swept("woodpecker").isel(beak_restitution=0)
    assert float(cell.dominant_frequency) == pytest.approx(1 / 0.1452, rel=0.01)
    assert float(cell.final_position[0]) == pytest.approx(-0.0195 * 4.0 / 0.146, rel=0.02)


@pytest.mark.parametrize(
    ("name", "unit"), [("soft_lip", "N/m"), ("head_and_tip", "N/m"), ("flutter", "N")]
)
def test_maps_say_whose_forces_are_per_metre_of_blade(name, unit):
    axes = {"belt_speed": {"values": [0.1, 0.2]}}
    run = {"transient": 0.1, "window": 0.5}
    attrs = describe(wiperjax.parse_sweep({"system": name, "axes": axes, "run": run}))["attrs"]
    assert attributes_of("normal_force_mean", attrs)["units"] == unit
    for end in ("final_position", "final_velocity"):  # as in a run
        assert "units" not in attributes_of(end, attrs), end
    slope = attributes_of("d_normal_force_mean_d_belt_speed", attrs)["units"]
    assert slope == f"({unit})/(m/s)"


@pytest.mark.slow
def test_runs_say_the_same():
    run = wiperjax.simulate(HeadAndTip(), 1e-3, observer=wiperjax.RegimeTotals(0.0))
    for name in ("normal_force", "friction_force", "normal_force_mean"):
        assert run[name].attrs["units"] == "N/m", name
    assert run.event_impulse.attrs["units"] == "N s/m" and "units" not in run.position.attrs
