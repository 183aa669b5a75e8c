"""The rungs: the bar is the lip while it is pressed on the glass, the block its linearisation."""

import tomllib
from dataclasses import replace

import jax
import jax.numpy as jnp
import noises
import numpy as np
import pytest
from own_systems import RunsBack
from scipy.optimize import brentq
from systems import events, trajectory

import wiperjax
from wiperjax import Coulomb, Event, Regime
from wiperjax.blade import block
from wiperjax.blade import rungs as ladder
from wiperjax.blade.steady_slip import steady_slip
from wiperjax.contact.friction import Stribeck
from wiperjax.contact.regimes import forces, vector_field
from wiperjax.contact.space import contact
from wiperjax.datasets.run_dataset import regime_spans
from wiperjax.maps import around_scene, compare_rungs
from wiperjax.noise.class_counts import lifted_count
from wiperjax.noise.run_class import assess, words
from wiperjax.runs.scene import run_scene
from wiperjax.specs.load import SpecError, load_scene, parse_scene, parse_sweep
from wiperjax.vocabulary.codes import BANDS, LABELS, MECHANISMS
from wiperjax.vocabulary.kinds import MODELS

# numbers as arrays are in one program, also where they are 0
ZERO = jnp.zeros(())
WIPER = wiperjax.Wiper(attack_angle=0.1, support_damping=3.0, hinge_damping=1e-5, gravity=9.81)
BELTS = {
    "steady": wiperjax.SteadyBelt(0.3),
    "wiping": wiperjax.WipingBelt(0.8, 0.7, 0.4),
    "trapezoid": wiperjax.TrapezoidBelt(0.8, 0.7, 0.5, 0.1),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", BELTS)
@pytest.mark.parametrize("regime", [Regime.STICK, Regime.SLIP_POS, Regime.SLIP_NEG])
def test_bar_has_the_forces_and_the_acceleration_of_the_lip(kind, regime):
    wiper = replace(WIPER, belt=BELTS[kind])
    t, draw = jnp.asarray(0.02), np.random.default_rng(3)
    piece = wiper.first_piece(t)
    lip = wiper.on_piece(piece)
    bar = ladder.on_rung(wiper, "bar").on_piece(piece)
    places, slips = draw.uniform(-0.8, 0.8, 5) * 6e-3, draw.uniform(0, 0.5, 5)
    sense = {Regime.STICK: 0.0, Regime.SLIP_NEG: -1.0, Regime.SLIP_POS: 1.0}[regime]

    def at_once(x, v):
        both = (lip, (x, 0 * x), (v, 0 * v)), (bar, (x,), (v,))
        found = [forces(s, contact(s, t, q, v), regime) for s, q, v in both]
        rates = [vector_field(t, (q, v), (s, regime)) for s, q, v in both]
        watched = [(s.switches(t, q, v)[0], s.ends(t, q, v)[0]) for s, q, v in both]
        return found, rates, watched

    found, rates, watched = jax.vmap(at_once)(jnp.asarray(places), jnp.asarray(sense * slips))
    np.testing.assert_allclose(found[1].normal, found[0].normal, rtol=1e-13)
    np.testing.assert_allclose(found[1].tangential, found[0].tangential, rtol=1e-12)
    for part in (0, 1):
        np.testing.assert_allclose(rates[1][part][0], rates[0][part][0], rtol=1e-11, atol=1e-9)
    for of_bar, of_lip in zip(*watched[::-1], strict=True):
        np.testing.assert_array_equal(of_bar, of_lip)


def test_a_bar_that_would_lift_off_slides_freely():
    bar = ladder.on_rung(wiperjax.Wiper(support_damping=50.0), "bar")
    q, fast = (jnp.asarray(5e-3),), (jnp.asarray(5.0),)  # the hinge is thrown up
    t = jnp.asarray(0.0)
    assert bar.constraint_force(t, q, fast) < 0
    assert bar.normal_force(t, q, fast) == pytest.approx(1e-6 * 15)
    assert bar.switches(t, q, fast)[-1] < 0 < bar.switches(t, q, (jnp.asarray(-0.3),))[-1]
    assert bar.on_sides((1.0, -1.0)).lifted and not bar.on_sides((-1.0, 1.0)).lifted


def test_a_bar_keeps_its_side_of_the_corner_where_it_begins_to_slide_freely():
    """As the lip does of its shoulders: a stage beyond it had the derivatives of the other side."""
    bar = ladder.on_rung(wiperjax.Wiper(support_damping=50.0), "bar").prepared()
    pressed, free = bar.on_sides((1.0, 1.0)), bar.on_sides((1.0, -1.0)).on_piece(0)
    t, q, least = jnp.asarray(0.0), (jnp.asarray(5e-3),), 1e-6 * 15
    for speed in (5.0, -0.3):
        at = t, q, (jnp.asarray(speed),)
        assert pressed.normal_force(*at) == bar.constraint_force(*at)
        assert free.normal_force(*at) == least

    def above(speed):
        return bar.constraint_force(t, q, (speed,)) - least

    edge = brentq(above, -0.3, 5.0, xtol=1e-15)
    assert bar.switches(t, q, (jnp.asarray(edge),))[-1] == pytest.approx(0, abs=1e-12)


# --- the block ------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("degrees", [-30, -10, 0, 10, 30])
@pytest.mark.parametrize("speed", [0.3, -0.6])
def test_block_has_the_linearisation_of_the_lip(degrees, speed):
    belt = wiperjax.SteadyBelt(speed)
    wiper = replace(WIPER, attack_angle=jnp.radians(float(degrees)), belt=belt)
    block, slip = ladder.on_rung(wiper, "block"), steady_slip(wiper)
    regime = Regime.SLIP_NEG if speed > 0 else Regime.SLIP_POS
    t = jnp.asarray(0.0)

    def acceleration(x, rate):
        v = block.from_rates(t, (x,), (rate,))
        return vector_field(t, ((x,), v), (block, regime))[1][0]

    still = jnp.asarray(0.0)
    size = abs(float(slip.k_eff)) * 6e-3 / 2.4e-3
    assert abs(float(acceleration(slip.x, still))) < 1e-9 * size
    stiff, damp = jax.grad(acceleration, (0, 1))(slip.x, still)
    np.testing.assert_allclose(-2.4e-3 * stiff, slip.k_eff, rtol=1e-10)
    np.testing.assert_allclose(-2.4e-3 * damp, slip.c_eff, rtol=1e-9, atol=1e-9)


def unstable_speeds(rung):
    """Belt speeds (low, high) [m/s] between which steady slip of a block is unstable.

    Lyapunov's first method: m xi'' + (c_b + mu'(V) N) xi' + k_b xi = 0 grows where mu'(V) is below
    -c_b/N. The Stribeck curve is steepest at v_s ((delta - 1)/delta)^(1/delta), so that the speeds
    form one interval, which begins at rest for delta = 1. NaN if no speed is unstable; high is inf
    if none is stable.
    """
    law = rung.friction
    scale, shape = float(law.stribeck_speed), float(law.shape)
    fall = float(law.static - law.minimum) / scale
    allowed = float(law.viscous_slope + rung.damping / rung.load)

    def excess(u):  # -mu' of the falling part, less what damping and viscosity allow; u = V/v_s
        return fall * shape * u ** (shape - 1) * np.exp(-(u**shape)) - allowed

    top = ((shape - 1) / shape) ** (1 / shape)
    if not excess(top) > 0:
        return np.nan, np.nan
    low = 0.0 if excess(0.0) > 0 else brentq(excess, 0.0, top, xtol=1e-15)
    if allowed <= 0:
        return scale * low, np.inf
    far = top + 1.0
    while excess(far) > 0:
        far *= 2
    return scale * low, scale * brentq(excess, top, far, xtol=1e-15)


@pytest.mark.long
@pytest.mark.parametrize(
    ("degrees", "hopf"), [(-30, 0.5766), (-10, 0.5017), (0, 0.4511), (10, 0.3937), (30, 0.2470)]
)
def test_block_loses_stability_where_the_lip_does(degrees, hopf):
    """docs/model.md, section 10: Hopf speeds of the reference blade, four digits."""
    belt = wiperjax.SteadyBelt(hopf)
    angle = jnp.radians(float(degrees))
    rung = block.block_of(
        wiperjax.Wiper(belt=belt, attack_angle=angle, hinge_damping=ZERO, gravity=ZERO)
    )
    low, high = unstable_speeds(rung)
    fall, load, damping = 0.7, float(rung.load), float(rung.damping)
    closed = 0.1 * np.log(fall * load / (0.1 * (damping + 0.02 * load)))
    assert low == 0 and high == pytest.approx(closed, rel=1e-12)
    assert high == pytest.approx(hopf, abs=2e-4)


@pytest.mark.slow
def test_a_block_on_a_belt_of_ones_own_that_runs_back():
    """It was made for a belt that runs as fast the other way."""
    own, known = (
        block.block_of(wiperjax.Wiper(belt=belt, attack_angle=0.35))
        for belt in (RunsBack(), wiperjax.SteadyBelt(-0.3))
    )
    assert own.centre == known.centre and own.load == known.load


def oscillator(shape, speed, damping):
    """The squeal oscillator: m = 2.4e-3, k = 3e4, N = 12, mu from 0.6 to 0.4 over 0.3 m/s."""
    law = Stribeck(0.6, 0.4, 0.3, shape, 0.02)
    centre = -law.coefficient(speed) * 12 / 3e4
    return block.Block(
        wiperjax.SteadyBelt(speed), law, 2.4e-3, damping, 3e4, centre, 12.0, reach=6e-3
    )


def test_range_of_unstable_speeds():
    round_law = oscillator(2.0, 0.2, 3.0)
    low, high = unstable_speeds(round_law)
    for speed in (low, high):  # the very slopes balance there
        slope = jax.grad(round_law.law.coefficient)(speed)
        assert 3.0 + 12 * slope == pytest.approx(0, abs=1e-9)
    assert 0 < low < 0.3 / np.sqrt(2) < high
    assert np.isnan(unstable_speeds(oscillator(2.0, 0.2, 9.0))).all()
    assert unstable_speeds(oscillator(1.0, 0.2, -1.0)) == (0.0, np.inf)


@pytest.mark.long
def test_squeal_oscillator_grows_inside_its_range_and_dies_outside():
    low, high = unstable_speeds(oscillator(2.0, 0.2, 3.0))
    span = 0.03  # s, 17 periods
    for speed in (0.9 * low, 1.1 * low, 0.97 * high, 1.03 * high):
        system = oscillator(2.0, speed, 3.0)
        kick = 1e-4 * speed  # far from stick: linear
        end = trajectory(system, span, ((0.0,), (kick,)))
        slope = float(jax.grad(system.law.coefficient)(speed))
        rate = -(3.0 + 12 * slope) / (2 * 2.4e-3)
        w = np.sqrt(3e4 / 2.4e-3 - rate**2)
        energy = (end.final_velocity[0] - rate * end.final_position[0]) ** 2
        size = np.sqrt(energy + (w * end.final_position[0]) ** 2)
        assert np.log(size / kick) / span == pytest.approx(rate, rel=2e-3)
        assert (rate > 0) == (low < speed < high)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("m", "k", "static", "dynamic", "v"), [(1, 1, 1, 0.5, 0.2), (1, 100, 0.4, 0.25, 0.05)]
)
def test_block_on_a_belt(m, k, static, dynamic, v):
    """Times of stick and slip in closed form."""
    friction = Coulomb(float(static), float(dynamic))
    belt = wiperjax.SteadyBelt(float(v))
    system = block.Block(belt, friction, float(m), 0.0, float(k), 0.0, 1.0, reach=100.0)
    way, w = (static - dynamic) / k, np.sqrt(k / m)
    slip, stick = (2 / w) * (np.pi - np.arctan(w * way / v)), 2 * way / v
    found = trajectory(system, 3 * (slip + stick), ((static / k - 0.1 * v,), (float(v),)))
    release, capture = events(found, Event.RELEASE), events(found, Event.CAPTURE)
    assert release[0] == pytest.approx(0.1, rel=1e-9)
    assert np.diff(release) == pytest.approx(slip + stick, rel=1e-9)
    assert np.array(capture[:2]) - release[:2] == pytest.approx(slip, rel=1e-9)


# --- files ----------------------------------------------------------------------------------------


def test_model_is_a_key_of_files():
    data = {"run": {"duration": 0.1}}
    assert parse_scene(data).model == "lip"
    with pytest.raises(SpecError, match=r"^scene: model: must be .*block.*bar.*lip.*was 'beam'$"):
        parse_scene(data | {"model": "beam"})
    with pytest.raises(SpecError, match=r"^scene: blade.hinge_mass: .* model = 'bar'.* was 0.001$"):
        parse_scene(data | {"model": "bar", "blade": {"hinge_mass": 1e-3}})
    with pytest.raises(SpecError, match=r"^scene: start.position: .*y = 0.* was 0.0001 m$"):
        parse_scene(data | {"model": "block", "start": {"position": [1e-3, 1e-4]}})
    sweep = {"axes": {"belt_speed": {"values": [0.1]}}, "run": {"transient": 0.1, "window": 0.1}}
    specs = [parse_sweep(sweep | {"model": model}) for model in MODELS]
    assert len({spec.digest() for spec in specs}) == 3
    assert specs[2].digest() == parse_sweep(sweep).digest()
    assert load_scene(noises.SWEEPS / "scenes" / "squeal.toml", "bar").model == "bar"


def test_wrong_rungs_are_refused():
    with pytest.raises(ValueError, match="model must be one of block, bar, lip, but was 'beam'"):
        ladder.on_rung(WIPER, "beam")
    with pytest.raises(ValueError, match="hinge_mass must be 0 with model 'bar', but was 0.001"):
        ladder.on_rung(replace(WIPER, hinge_mass=1e-3), "bar")


@pytest.mark.long
@pytest.mark.parametrize("model", ["bar", "block"])
def test_a_scene_file_runs_on_a_lower_rung(model):
    spec = load_scene(noises.SWEEPS / "scenes" / "squeal.toml", model)
    ds = run_scene(spec)
    assert ds.attrs["model"] == model and list(ds.axis.values) == ["x", "y"]
    assert not ds.position.sel(axis="y").any() and not ds.velocity.sel(axis="y").any()
    assert ds.velocity.attrs["units"] == "m/s"
    late = ds.event_time[(ds.event_kind == Event.RELEASE) & (ds.event_time > 0.1)]
    pitch = 1 / float(late.diff("event").mean())
    # the bar is the lip, the block near it though its load is constant
    assert pitch == pytest.approx({"bar": 780.8, "block": 783.7}[model], abs=0.1)


@pytest.mark.long
def test_a_sweep_on_the_bar_gives_the_map_of_the_lip(steady_scenes):
    like = noises.remedies("squeal")
    names = ("squeal", "squeal_slip", "chatter", "quiet", "quiet_wet")
    cases = noises.Cases(like, {name: noises.parameters(name) for name in names})
    cases.model = "bar"
    for name, bar in cases.evaluate().items():
        lip = steady_scenes[name]
        for column in ("label", "mechanism", "band", "settled", "stick_count"):
            assert bar[column] == lip[column]
        loud = lip["label"] != "quiet"
        for column in ("dominant_frequency", "velocity_rms")[: 2 * loud]:
            assert bar[column] == pytest.approx(lip[column], rel=2e-4)
        for column in ("stick_fraction", "normal_force_mean", "normal_force_max"):
            assert bar[column] == pytest.approx(lip[column], rel=2e-3, abs=1e-6)
        assert bar["final_y"] == 0 and bar["lift_off_count"] == 0


@pytest.mark.long
@pytest.mark.parametrize("belt", [{}, {"kind": "wiping", "amplitude": 0.5, "frequency": 5.0}])
def test_a_map_of_the_bar_says_where_the_lip_would_leave_the_glass(belt):
    """Its flight was 0 everywhere, its mechanism another than the lip's, and nobody was told."""
    axes = {
        "attack_angle": {"values": [-30.0, 0.0]},
        "normal_load": {"values": [1.0, 2.0, 15.0]},
    }
    look = {"transient": 0.2, "window": 0.2}
    asked = {"axes": axes, "belt": belt, "run": {**look, "raster": 200, "event_log": 400}}
    bar, lip = (
        wiperjax.sweep({**asked, "model": model}, progress=False) for model in ("bar", "lip")
    )
    flies = lip.flight_fraction > 0
    assert 0 < flies.sum() < flies.size
    np.testing.assert_array_equal(bar.flight_fraction > 0, flies)
    assert lifted_count(bar) == flies.sum() and lifted_count(lip) == 0
    np.testing.assert_array_equal(bar.mechanism.where(~flies), lip.mechanism.where(~flies))
    shares = bar.stick_fraction + bar.slip_fraction + bar.flight_fraction
    np.testing.assert_allclose(shares, 1, rtol=1e-12)
    seen = (bar.regime_raster == Regime.FLIGHT).mean("raster_time")
    np.testing.assert_allclose(seen, bar.flight_fraction, atol=0.02)
    np.testing.assert_array_equal((bar.regime_after == Regime.FLIGHT).any("event"), flies)


@pytest.mark.long
def test_a_run_of_the_bar_says_where_the_lip_would_leave_the_glass():
    """Its events and samples said slip, so `info` said stick-slip where the map said flight."""
    scene = tomllib.loads((noises.SWEEPS / "scenes/chatter_flight.toml").read_text())
    scene["model"], scene["run"] = "bar", {"duration": 0.3, "transient": 0.2}
    run = run_scene(scene)
    spans = [(start, end, name) for start, end, name in regime_spans(run) if end > 0.2]
    flown = sum(end - max(start, 0.2) for start, end, name in spans if name == "flight")
    assert flown == pytest.approx(0.1 * float(run.flight_fraction), rel=1e-6) and flown > 2e-3
    late = run.regime.sel(time=slice(0.2, None)) == Regime.FLIGHT
    assert float(late.mean()) == pytest.approx(10 * flown, abs=3e-3)
    assert words(assess(run))["mechanism"] == "flight"


# --- the table ------------------------------------------------------------------------------------


def rung(model, **values):
    plain = {
        "scene": "s",
        "model": model,
        "label": "squeal",
        "mechanism": "stick_slip",
        "band": "squeal",
        "frequency": 700.0,
        "amplitude": 0.3,
        "ratio": np.nan,
        "seconds": 1.0,
        "steps": 100,
    }
    return compare_rungs.Rung(**plain | values)


@pytest.mark.parametrize(
    ("suffices", "values"),
    [
        (True, {"seconds": 0.5}),
        (True, {"frequency": 713.0, "amplitude": 0.325}),
        (False, {"frequency": 715.0}),
        (False, {"amplitude": 0.331}),
        (False, {"amplitude": np.nan}),
        (False, {"mechanism": "self_excited_slip"}),
        (False, {"label": "other", "band": "low"}),
    ],
)
def test_what_suffices(suffices, values):
    judged = compare_rungs._judged(rung("bar", **values), rung("lip"))
    assert judged.suffices == suffices and judged.share == values.get("seconds", 1.0)
    rungs = [judged, compare_rungs._judged(rung("lip"), rung("lip"))]
    assert compare_rungs.lowest_sufficient(rungs) == ("bar" if suffices else "lip")


def test_a_reversal_is_judged_by_its_forces():
    lip = rung("lip", label="reversal", ratio=4.0, frequency=300.0)
    near = rung("bar", label="reversal", ratio=4.3, frequency=200.0)
    assert compare_rungs._judged(near, lip).suffices
    assert not compare_rungs._judged(replace(near, ratio=4.5), lip).suffices
    quiet = rung("lip", label="quiet", amplitude=1e-9)
    assert compare_rungs._judged(rung("bar", label="quiet", amplitude=1e-7), quiet).suffices


def test_a_bar_that_is_held_where_the_lip_flies_does_not_suffice():
    flies = {"label": "chattering", "mechanism": "flight", "band": "chatter"}
    lip, bar, hinged = (rung(model, **flies) for model in ("lip", "bar", compare_rungs.HINGED))
    rungs = lip, replace(bar, held=True), hinged
    judged = [compare_rungs._judged(each, lip).suffices for each in rungs]
    assert judged == [True, False, True]


def test_a_bar_that_is_held_at_the_turn_alone_is_held(monkeypatch):
    """The ladder asked for the mechanism, which is that of the reversal: only probes knew."""
    columns = {
        "label": LABELS["reversal"],
        "mechanism": MECHANISMS["reversal_pulse"],
        "band": BANDS["none"],
        "dominant_frequency": 300.0,
        "velocity_rms_stroke": 0.01,
        "vibration_reversal": 0.2,
        "normal_force_max_reversal": 60.0,
        "normal_force_mean_stroke": 15.0,
        "flight_fraction": 0.008,
        "steps": 9,
        "rejected_steps": 0,
    }
    columns = {name: np.asarray(value) for name, value in columns.items()}
    monkeypatch.setattr(around_scene, "middle", lambda spec: columns)
    spec = parse_scene({"belt": {"speed": 0.3}, "run": {"duration": 0.1}})
    bar, lip = (compare_rungs._run("s", model, spec) for model in ("bar", "lip"))
    assert bar.held and not lip.held
    assert not compare_rungs._judged(bar, lip).suffices


def test_what_fails_as_the_lip_fails_does_not_suffice():
    fails = {"label": "failed", "mechanism": "none", "band": "none"}
    numbers = {"frequency": np.nan, "amplitude": np.nan}
    rungs = [rung(model, **fails, **numbers) for model in ("block", "bar", "lip")]
    judged = [compare_rungs._judged(each, rungs[-1]) for each in rungs]
    assert compare_rungs.lowest_sufficient(judged) == "lip"


def test_a_model_that_cannot_stand_for_a_scene_says_so(tmp_path, monkeypatch, caplog):
    """The ladder stopped in its middle, and its table was lost."""

    def none(spec):
        raise ValueError("no start")

    monkeypatch.setattr(compare_rungs.around_scene, "ready", lambda scenes: None)
    monkeypatch.setattr(compare_rungs.around_scene, "middle", none)
    file = tmp_path / "s.toml"
    file.write_text("[blade]\nhinge_mass = 1e-3\n[belt]\nspeed = 0.3\n[run]\nduration = 0.1\n")
    rungs = compare_rungs.compare(file, costs=lambda scenes: dict.fromkeys(scenes, 1.0))
    said = {each.model: (each.label, each.suffices) for each in rungs}
    refused = compare_rungs.REFUSED, False
    assert said == {"block": refused, "bar": refused, "lip": ("failed", True)}  # it has its own
    assert (
        "bar cannot stand for it" in caplog.text and "hinge_mass: must be left out" in caplog.text
    )
    row = compare_rungs.table([rungs]).splitlines()[2]
    assert row == "| s | block | cannot stand for it |  |  |  |  |  |  |  | no |"


@pytest.mark.long
def test_ladder_of_squeal():
    rungs = compare_rungs.compare(
        noises.SWEEPS / "scenes" / "squeal.toml", hinged=False, costs=lambda s: dict.fromkeys(s, 2)
    )
    assert [rung.model for rung in rungs] == list(MODELS)
    assert compare_rungs.lowest_sufficient(rungs) == "block"  # as docs/ladder.md says
    block, bar, lip = rungs
    assert bar.frequency == pytest.approx(lip.frequency, rel=1e-4)
    assert bar.steps == pytest.approx(lip.steps, rel=0.01) and lip.share == 1  # the same motion
    # friction sets the steps, not geometry: the block takes about as many, not always fewer
    assert block.steps == pytest.approx(lip.steps, rel=0.1)
    assert (
        compare_rungs.table([rungs]).splitlines()[2].startswith("| squeal | **block** | squeal |")
    )
