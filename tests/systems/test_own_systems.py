"""Systems of one's own through the public way only: a file, or a mapping shaped like one."""

import linecache
import os
import subprocess
import sys

import numpy as np
import own_systems
import pytest
import scipy.integrate
import scipy.optimize

import wiperjax
from wiperjax.maps.cells.batch import prepare
from wiperjax.maps.starts import kicked
from wiperjax.noise.run_class import GATHERED
from wiperjax.specs.errors import SpecError
from wiperjax.store.whole import write_dataset
from wiperjax.vocabulary.codes import LABELS

SWEEP = {
    "system": "own_systems:Oscillator",
    "axes": {
        "belt_speed": {"values": [0.1, 0.2, 0.4]},
        "stiffness": {"values": [1.0, 2.0]},
    },
    "run": {"transient": 60.0, "window": 60.0, "samples": 512, "rtol": 1e-8},
    "classes": {"squeal_band": [0.2, 1.0], "chatter_band": [0.0, 0.2]},
}


def stick_slip(speed: float, stiffness: float, steepness: float = 3.0) -> tuple[float, ...]:
    """Period of the stick-slip motion of `Oscillator` (mass, load and limit 1), its share of stick
    and its largest acceleration, by scipy: slip from the place where the spring overcomes friction
    to where the block moves as the belt does, then stick back to that place.
    """

    def rates(t, z):
        return z[1], -stiffness * z[0] + 1 / (1 + steepness * (speed - z[1]))

    def caught(t, z):
        return z[1] - speed if t > 1e-3 else -1.0

    caught.terminal, caught.direction = True, 1
    start = [1 / stiffness, speed - 1e-12]
    found = scipy.integrate.solve_ivp(
        rates, (0, 100), start, events=caught, rtol=1e-11, atol=1e-13, dense_output=True
    )
    slip, stick = found.t[-1], (start[0] - found.y[0, -1]) / speed
    path = found.sol(np.linspace(0, slip, 10_001))
    return slip + stick, stick / (slip + stick), np.abs(rates(0, path)[1]).max()


@pytest.fixture(scope="module")
def oscillators():
    return wiperjax.sweep(SWEEP)


@pytest.mark.long
def test_leines_oscillator_swept_has_the_period_and_the_shares_of_an_independent_code(oscillators):
    assert dict(oscillators.sizes) == {"belt_speed": 3, "stiffness": 2, "coordinate": 1}
    for speed in oscillators.belt_speed.values:
        for stiffness in oscillators.stiffness.values:
            cell = oscillators.sel(belt_speed=speed, stiffness=stiffness)
            period, share, steepest = stick_slip(speed, stiffness)
            assert float(cell.dominant_frequency) == pytest.approx(1 / period, rel=2e-3)
            # the window holds no whole number of periods
            assert float(cell.stick_fraction) == pytest.approx(share, abs=0.5 * period / 60)
            assert float(cell.acceleration_max) == pytest.approx(steepest, rel=2e-3)


@pytest.mark.long
def test_a_map_tells_units_names_and_classes_of_a_system_of_ones_own(oscillators):
    assert oscillators.stiffness.attrs["units"] == "N/m"
    assert oscillators.stiffness.attrs["long_name"] == "stiffness of the spring"
    assert oscillators.normal_force_mean.attrs["units"] == "N"
    told = [str(of.attrs.get("long_name", "")) for of in oscillators.variables.values()]
    assert "rms of the output velocity about its mean" in told and "largest gap" in told
    assert not [words for words in told if "tip" in words.split() or "glass" in words]
    assert oscillators.attrs["system"] == "own_systems:Oscillator"
    assert oscillators.attrs["tilt"] == 0.0 and "tilt: degrees" in oscillators.parameter_units
    assert list(oscillators.coordinate.values) == ["x"]
    assert "final_x" not in oscillators and "growth_rate" not in oscillators
    assert "attack_angle" not in oscillators.attrs
    squeals = [LABELS["squeal"] == x for x in oscillators.label.values.ravel()]
    assert squeals == [f >= 0.2 for f in oscillators.dominant_frequency.values.ravel()]


@pytest.mark.long
def test_a_map_opens_plots_and_tells_itself_without_the_module_and_without_jax(
    oscillators, tmp_path
):
    path = tmp_path / "map.h5"
    write_dataset(oscillators, path)
    code = (
        "import sys, wiperjax\n"
        "from wiperjax.plots.style.caption import parameters_text\n"
        f"ds = wiperjax.open_map({str(path)!r}).load()\n"
        "assert 'own_systems' not in sys.modules and 'jax' not in sys.modules\n"
        "print(parameters_text(ds))\n"
    )
    found = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    assert "load 1 N" in found.stdout and "mass 1 kg" in found.stdout


@pytest.mark.parametrize("command", ["sweep", "simulate", "follow"])
def test_settings_precede_the_module_of_a_system(command, tmp_path):
    """It may start jax's device, and what is set after that does not count: maps of systems of
    one's own were computed on one core, by other programs than `verify` has."""
    (tmp_path / "early.py").write_text(
        "import os\nraise RuntimeError('while_loop' in os.environ.get('XLA_FLAGS', ''))\n"
    )
    tables = "run.duration = 1.0"
    if command == "sweep":
        tables = "axes.k.values = [1.0]\nrun.transient = 1.0\nrun.window = 1.0"
    (tmp_path / "own.toml").write_text(f"system = 'early:One'\n{tables}\n")
    words = [command, "own.toml", "-o", "out.h5"]
    words += ["--over", "k", "--from", "0", "--to", "1"] if command == "follow" else []
    environment = {k: v for k, v in os.environ.items() if k != "XLA_FLAGS"}
    found = subprocess.run(
        [sys.executable, "-m", "wiperjax", *words],
        capture_output=True, text=True, cwd=tmp_path, env=environment,
    )  # fmt: skip
    assert "RuntimeError: True" in found.stderr and found.stderr.count("\n") == 1


@pytest.mark.slow
def test_a_scene_is_the_same_motion_as_its_cell_and_knows_its_class(oscillators):
    scene = {key: SWEEP[key] for key in ("system", "classes")}
    scene |= {"belt": {"speed": 0.4}, "parameters": {"stiffness": 2.0}}
    motion = {"duration": 120.0, "rtol": 1e-8}
    run = wiperjax.run_scene(scene | {"run": motion | {"sample_interval": 0.02}})
    cell = oscillators.sel(belt_speed=0.4, stiffness=2.0)
    np.testing.assert_allclose(run.final_position, cell.final_position, atol=1e-5)
    found = wiperjax.assess(run)
    assert int(found.label) == int(cell.label)
    tone = float(cell.dominant_frequency)
    assert float(found.dominant_frequency) == pytest.approx(tone, rel=1e-3)
    # whatever its samples
    coarse = wiperjax.run_scene(scene | {"run": motion | {"sample_interval": 0.4}})
    names = {*GATHERED, "slip_rate"} & {*cell.data_vars}
    assert len(names) == 8
    for told in (found, wiperjax.assess(coarse)):
        for name in names:
            assert float(told[name]) == pytest.approx(float(cell[name]), rel=2e-3), name
    assert float(found.acceleration_max) == pytest.approx(stick_slip(0.4, 2.0)[2], rel=2e-3)
    assert np.isnan(wiperjax.assess(coarse, transient=30.0).acceleration_max)  # samples cannot tell
    cut = coarse.sel(time=slice(None, 100.0))
    assert np.isnan(wiperjax.assess(cut).acceleration_max)
    assert run.energy_per_slip.attrs["units"] == "J" and run.attrs["statistics_start"] == 60.0
    assert run.attrs["stiffness"] == 2.0 and list(run.axis.values) == ["x"]
    np.testing.assert_array_equal(run.output, run.velocity[:, 0])


@pytest.mark.slow
def test_the_law_of_a_file_counts():
    one = SWEEP | {"axes": {"steepness": {"values": [3.0, 6.0]}}, "belt": {"speed": 0.1}}
    ds = wiperjax.sweep(one | {"parameters": {"stiffness": 2.0}})  # of the program of the others
    for steepness in (3.0, 6.0):
        period, *_ = stick_slip(0.1, 2.0, steepness)
        found = float(ds.dominant_frequency.sel(steepness=steepness))
        assert found == pytest.approx(1 / period, rel=2e-3)
    other = one | {"axes": {"mu_static": {"values": [1.0, 1.0 - 1e-9]}}}
    coulomb = other | {"parameters": {"friction": "coulomb", "mu_minimum": 0.9}}
    assert set(wiperjax.parse_sweep(coulomb).parameter_names) >= {"mu_static", "mu_minimum"}


@pytest.mark.long
def test_a_bouncing_ball_swept_over_its_restitution_keeps_what_it_must():
    height, gravity, time = 0.5, 9.81, 3.0
    values = [0.0, 0.3, 0.7, 0.9, 1.0]
    ds = wiperjax.sweep(
        {
            "system": own_systems.Ball,
            "axes": {"restitution": {"values": values}},
            "start": {"position": [height]},
            "run": {
                "transient": 0.0,
                "window": time,
                "event_log": 32,
                "samples": 64,
                "rtol": 1e-10,
            },
            "classes": {"quiet_velocity": 1e-6},
        }
    )
    fall = np.sqrt(2 * height / gravity)
    for e in values:
        cell = ds.sel(restitution=e)
        flights = 2 * fall * np.cumsum(e ** np.arange(1, 100.0))
        exact = fall + np.concatenate([[0.0], flights]) if e else np.array([fall])
        exact = exact[exact < time]
        impacts = cell.event_impulse.values > 0
        logged = cell.event_time.values[impacts][: min(len(exact), 20)]
        np.testing.assert_allclose(logged[: len(exact)], exact[: len(logged)], atol=1e-8)
        if e < 0.8:  # Zeno: at rest after 2 fall e / (1 - e) more
            assert float(cell.final_position[0]) == 0.0
    last = ds.sel(restitution=1.0)
    q, v = float(last.final_position[0]), float(last.final_velocity[0])
    assert gravity * q + v**2 / 2 == pytest.approx(gravity * height, rel=1e-9)
    assert "belt_speed_rms" not in ds and ds.attrs["class_quiet_velocity"] == 1e-6


@pytest.mark.long
def test_two_blocks_share_the_parameters_of_one():
    ds = wiperjax.sweep(
        {
            "system": "own_systems:TwoBlocks",
            "parameters": {"second": 1e-9, "link": 0.0},
            "axes": {"belt_speed": {"values": [0.1, 0.2, 0.4]}},
            "run": SWEEP["run"],
            "classes": SWEEP["classes"],
        }
    )
    for speed in (0.1, 0.2, 0.4):  # the second block hangs on nothing
        period, *_ = stick_slip(speed, 1.0)
        found = float(ds.dominant_frequency.sel(belt_speed=speed))
        assert found == pytest.approx(1 / period, rel=2e-3)
    assert ds.sizes["coordinate"] == 2


WRONG = {
    "own_systems:Nothing": r"module 'own_systems' has no class 'Nothing'",
    "own_systems:NUMBER": r"has no class but something else named 'NUMBER'",
    "no_such_module:Ball": r"module 'no_such_module' is not found",
    "own_systems": r"must be 'wiper', .* or an import path 'module:Class', was 'own_systems'",
    **{
        path: r"must be an import path such as 'my_module:MyClass' \(no folder, no .py\) of a class"
        for path in (":Ball", "own_systems.py:Ball", "./own_systems:Ball", "/own_systems:Ball")
    },
    "own_systems:Unfinished": r"lacks directions, free_acceleration",
    "own_systems:Nameless": r"must name its coordinates: coordinates = \('x', ...\)",
    "own_systems:Falling": r"is no system \(wiperjax.AbstractSystem\): it lacks",
    "own_systems:Twice": r"has two parameters of the name 'belt_speed'",
}


@pytest.mark.parametrize("path", WRONG)
def test_a_system_that_cannot_be_is_one_line(path):
    spec = SWEEP | {"system": path, "axes": {"mass": {"values": [1.0]}}}
    with pytest.raises(SpecError, match=WRONG[path]) as caught:
        wiperjax.parse_sweep(spec)
    assert str(caught.value).startswith("sweep: system: ")
    assert "\n" not in str(caught.value)


KEYS = {
    "blade": ({"attack_angle": 5.0}, r"blade: must be left out with system = .*\[parameters\]"),
    "model": ("bar", r"model: must be left out with system"),
    "parameters": ({"mas": 1.0}, r"parameters.mas: unknown key; did you mean 'mass'\?"),
    "sensitivities": ({"parameters": ["mas"]}, r"sensitivities.parameters: 'mas': .*'mass'"),
    "start": ({"position": [0.0, 1.0]}, r"start.position: must be a list of 1 numbers \(x\)"),
    "belt": ({"kind": "wiping"}, r"belt.frequency: is missing; with kind = 'wiping'"),
}


@pytest.mark.parametrize("key", KEYS)
def test_a_key_that_does_not_suit_the_system_is_one_line(key):
    value, words = KEYS[key]
    with pytest.raises(SpecError, match=words):
        wiperjax.parse_sweep(SWEEP | {"axes": {"stiffness": {"values": [1.0]}}, key: value})


def test_a_number_in_place_of_a_law_is_one_line():
    given = {"friction": 0.3}
    words = r"parameters.friction: must be the name of a law in quotes, was 0.3$"
    with pytest.raises(SpecError, match=words):
        wiperjax.parse_sweep(SWEEP | {"parameters": given})
    with pytest.raises(SpecError, match=words):
        wiperjax.parse_scene(
            {"system": SWEEP["system"], "run": {"duration": 1}} | {"parameters": given}
        )


def test_numbers_of_a_law_that_do_not_go_together_are_refused_before_anything_is_stored(tmp_path):
    damped = SWEEP | {"system": "own_systems:Damped"}
    words = r"must be at most mu_static \(0.2\) with this friction, was 1"
    for given in ({"mu_minimum": 1.0}, {"mu_minimum": 1}):
        numbers = {"friction": "coulomb", "mu_static": 0.2, **given}
        with pytest.raises(SpecError, match=f"^sweep: parameters.mu_minimum: {words}$"):
            wiperjax.sweep(damped | {"parameters": numbers}, output=tmp_path / "map.h5")
    axes = {"mu_minimum": {"values": [0.1, 1.0]}}
    numbers = {"friction": "coulomb", "mu_static": 0.2}
    with pytest.raises(SpecError, match=f"^sweep: axes.mu_minimum: {words}$"):
        wiperjax.sweep(damped | {"parameters": numbers, "axes": axes}, output=tmp_path / "map.h5")
    with pytest.raises(SpecError, match=r"^sweep: parameters.mu_minimum: .* was 0.3$"):
        wiperjax.sweep(damped | {"parameters": numbers}, output=tmp_path / "map.h5")
    assert not list(tmp_path.iterdir())


def test_a_parameter_of_the_wiper_is_not_sent_to_its_tables():
    with pytest.raises(SpecError, match=r"axes.attack_angle: unknown key; must be one of mass"):
        wiperjax.parse_sweep(SWEEP | {"axes": {"attack_angle": {"values": [1.0]}}})


def test_numbers_outside_their_range_are_one_line_in_files_and_in_python():
    with pytest.raises(SpecError, match=r"parameters.mass: must be a finite number > 0 kg, was -1"):
        wiperjax.parse_sweep(SWEEP | {"parameters": {"mass": -1.0}})
    with pytest.raises(SpecError, match=r"axes.tilt: must lie inside \[-45, 45\] degrees, was 50"):
        wiperjax.parse_sweep(SWEEP | {"axes": {"tilt": {"values": [0.0, 50.0]}}})
    with pytest.raises(ValueError, match=r"^mass must be a finite number > 0 kg, but was 0$"):
        own_systems.Oscillator(mass=0.0)
    with pytest.raises(ValueError, match=r"^tilt .* were degrees meant\? 5 degrees are"):
        own_systems.Oscillator(tilt=5.0)
    with pytest.raises(ValueError, match=r"^load must be a number of N, but was 'a'$"):
        own_systems.Oscillator(load="a")
    with pytest.raises(SpecError, match=r"parameters.drag: is missing; it must be a finite number"):
        spec = {"system": "own_systems:Untold", "axes": {"gravity": {"values": [1.0]}}}
        wiperjax.parse_sweep(SWEEP | spec | {"classes": {"quiet_velocity": 0.1}})
    with pytest.raises(SpecError, match=r"classes.quiet_velocity: is missing; .* has no belt"):
        spec = {"system": "own_systems:Ball", "axes": {"gravity": {"values": [1.0]}}}
        wiperjax.parse_sweep(SWEEP | spec)


MISTAKES = {
    "Lopsided": (
        {"position": [0.0, 1.0]},
        r"^Lopsided.free_acceleration must return 2 numbers, .*, but returned a tuple of 1$",
    ),
    "Failing": ({"position": [1.0]}, r"^Failing.free_acceleration fails: IndexError: tuple index"),
    "Listing": (
        {"position": [1.0]},
        r"^Listing.gap must return a number, but returned a tuple of 1$",
    ),
    "Bodiless": ({"position": [1.0]}, r"^Bodiless.gap is missing: a unilateral system must define"),
    "Floating": (None, r"^Floating.default_state must return 1 positions and 1 velocities .* 1.0"),
    "Ball": (None, r"^start.position: is missing; \[start\] must have it"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_system_that_says_something_else_than_asked_is_one_line(name):
    start, words = MISTAKES[name]
    spec = {
        "system": f"own_systems:{name}",
        "axes": {"gravity": {"values": [1.0]}},
        "run": {"transient": 0.0, "window": 1.0},
        "classes": {"quiet_velocity": 0.1},
    }
    with pytest.raises(ValueError, match=words):
        wiperjax.sweep(spec if start is None else spec | {"start": start})


def test_a_class_within_a_function_has_no_import_path():
    class Local(own_systems.Ball):
        pass

    with pytest.raises(SpecError, match=r"system: must be an import path .* of a class at the top"):
        wiperjax.parse_sweep(SWEEP | {"system": Local})


def test_a_changed_source_is_another_map(tmp_path, monkeypatch):
    text = "import own_systems\nclass Ball(own_systems.Ball):\n    pass\n"
    spec = {"system": "changing:Ball", "axes": {"restitution": {"values": [0.5]}}}
    spec |= {"run": SWEEP["run"], "classes": {"quiet_velocity": 0.1}}
    monkeypatch.chdir(tmp_path)
    digests = []
    for more in ("", "# changed\n"):
        sys.modules.pop("changing", None)
        (tmp_path / "changing.py").write_text(text + more)
        digests.append(wiperjax.parse_sweep(spec).digest())
    sys.modules.pop("changing", None)
    monkeypatch.setattr(sys, "path", [p for p in sys.path if p != str(tmp_path)])
    assert digests[0] != digests[1]


def test_a_changed_base_is_another_map(tmp_path, monkeypatch):
    spec = {"system": "changing_class:Ball", "axes": {"restitution": {"values": [0.5]}}}
    spec |= {"run": SWEEP["run"], "classes": {"quiet_velocity": 0.1}}
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    text = "from changing_base import Base\nclass Ball(Base):\n    pass\n"
    (tmp_path / "changing_class.py").write_text(text)
    digests = []
    for more in ("", "# changed\n"):
        for name in ("changing_class", "changing_base"):
            sys.modules.pop(name, None)
        text = "import own_systems\nclass Base(own_systems.Ball):\n    pass\n"
        (tmp_path / "changing_base.py").write_text(text + more)
        linecache.clearcache()
        digests.append(wiperjax.parse_sweep(spec).digest())
    for name in ("changing_class", "changing_base"):
        sys.modules.pop(name, None)
    assert digests[0] != digests[1]


def test_a_module_that_fails_on_import_is_one_line(tmp_path, monkeypatch):
    (tmp_path / "broken_on_import.py").write_text("1 / 0\n")
    (tmp_path / "sweep.toml").write_text(
        'system = "broken_on_import:Ball"\n[axes]\ngravity = {values = [1.0]}\n'
        "[run]\ntransient = 0\nwindow = 1\n"
    )
    monkeypatch.setattr(sys, "path", list(sys.path))
    with pytest.raises(SpecError, match=r"cannot be imported: ZeroDivisionError: divis"):
        wiperjax.load_sweep(tmp_path / "sweep.toml")


BISTABLE = {  # the friction oscillator of docs/basins.md, whose bistable zone is known exactly
    "system": "own_systems:Damped",
    "run": {"transient": 400.0, "window": 50.0, "samples": 256},
    "classes": {"squeal_band": [0.05, 1.0], "chatter_band": [0.0, 0.01]},
}


@pytest.mark.long
def test_a_sweep_up_and_down_finds_the_bistable_zone_of_a_system_of_ones_own():
    starts = {"names": ["at_rest", "up", "down"], "kick": 1e-3}
    axes = {"belt_speed": {"values": [0.8, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7, 1.9]}}
    ds = wiperjax.sweep(BISTABLE | {"axes": axes, "starts": starts})
    loud = (ds.label == LABELS["squeal"]).transpose("start", ...)
    # steady sliding is unstable below ln(10)/2 = 1.151, the cycle ends at 1.8366
    assert loud.sel(start="up").values.tolist() == [True] * 7 + [False]
    assert loud.sel(start="down").values.tolist() == [True] + [False] * 7
    assert ds.final_position.dims == ("belt_speed", "start", "coordinate")


def test_what_touches_goes_on_in_the_next_cell_on_its_partner():
    """A kick along the gap led into the belt, and the cell failed; the impulse that takes what
    sticks to the speed of another belt drove it off or in, where inertia is shared."""
    regimes = [wiperjax.Regime.STICK, wiperjax.Regime.SLIP_NEG, wiperjax.Regime.FLIGHT]
    places = np.array([[0.1, 0.01], [0.1, 0.01], [0.05, 0.01]])
    rates = np.array([[0.0, 0.1], [0.0, 0.02], [0.2, 0.02]])
    (y, x), (vy, vx) = gone_on(own_systems.Hung, places, rates, regimes)
    np.testing.assert_allclose(y, [0.1, 0.1, 0.051], atol=1e-15)
    np.testing.assert_allclose(vy, [0.0, 0.0, 0.2], atol=1e-15)
    np.testing.assert_allclose(vx, [0.4, 0.02, 0.02], atol=1e-15)
    np.testing.assert_allclose(x[2], 0.01)


def gone_on(kind, places, rates, regimes):
    """The states of the cell at a belt speed of 0.4 that goes on from these at 0.1, kicked."""
    axes = {"belt_speed": {"values": [0.1, 0.4]}}
    run, starts = {"transient": 0.0, "window": 0.01}, {"names": ["up"], "kick": 1e-3}
    spec = wiperjax.parse_sweep({"system": kind, "axes": axes, "run": run, "starts": starts})
    ended = {"final_position": np.array(places), "final_velocity": np.array(rates)}
    ended |= {"final_regime": np.array(regimes), "result": np.zeros(len(regimes), int)}
    cells = np.ones(len(regimes), int)
    _, *state = prepare(spec, cells, ended=kicked(spec, cells, ended))
    return np.asarray(state)[..., : len(regimes)]


def test_the_kick_of_a_cell_leads_away_from_what_it_would_lead_into():
    """A stop, or the partner in front of a flight: the cell failed, and the next began at rest."""
    slip, flight = wiperjax.Regime.SLIP_NEG, wiperjax.Regime.FLIGHT
    places, rates = [[0.5995], [-0.5995], [0.3]], [[-0.1], [-0.1], [0.0]]
    (x,), (v,) = gone_on(own_systems.Walled, places, rates, [slip] * 3)
    np.testing.assert_allclose(x, [0.5985, -0.5985, 0.301], atol=1e-15)
    np.testing.assert_allclose(v, [-0.1, -0.1, 0.0])
    (y, x), (vy, _) = gone_on(own_systems.Hung, [[0.0995, 0.01]], [[0.2, 0.0]], [flight])
    np.testing.assert_allclose((y, x, vy), [[0.0985], [0.01], [0.2]])


@pytest.mark.long
def test_shares_of_random_starts_are_those_of_bstab():
    starts = {"random": 128, "position": [[-2.0, 2.0]], "velocity": [[0.0, 2.0]]}
    axes = {"belt_speed": {"values": [1.4, 1.55]}}
    shares, errors = [], []
    for seed in range(4):  # as many cells at once as the program of the test above has
        ds = wiperjax.sweep(BISTABLE | {"axes": axes, "starts": starts | {"seed": seed}})
        shares.append(ds.class_share.sel({"class": "quiet"}).values)
        errors.append(ds.class_share_error.sel({"class": "quiet"}).values)
    share, error = np.mean(shares, axis=0), np.sqrt(np.sum(np.square(errors), axis=0)) / 4
    assert np.all(np.abs(share - [0.2122652, 0.3565963]) < 3 * error)
    assert "start_position_0" in ds.coords and float(ds.start_velocity_0.min()) >= 0.0


def test_starts_that_do_not_suit_the_system_are_one_line():
    spec = SWEEP | {"axes": {"stiffness": {"values": [1.0, 2.0]}}}
    for starts, words in (
        ({"names": ["steady_slip"]}, r"starts.names: must not have 'steady_slip' with system"),
        ({"random": 5}, r"starts.position: is missing; .* of each of x$"),
        ({"random": 5, "x": [0, 1]}, r"starts.x: must be left out with system"),
        ({"random": 5, "position": [[0, 1], [0, 1]]}, r"must be a list of 1 pairs \(x\), had 2"),
        ({"random": 5, "position": [[1, 0]]}, r"with from <= to, had \[1, 0\]"),
    ):
        with pytest.raises(SpecError, match=words):
            wiperjax.parse_sweep(spec | {"starts": starts})
    with pytest.raises(SpecError, match=r"starts.position: must be left out of a wiper"):
        axes, run = {"normal_load": {"values": [10.0]}}, {"transient": 0.0, "window": 0.01}
        starts = {"random": 5, "x": [0.0, 1e-3], "position": [[0, 1]]}
        wiperjax.parse_sweep({"axes": axes, "run": run, "starts": starts})


@pytest.mark.long
def test_a_map_of_ones_own_is_refined_verified_and_resumed(tmp_path):
    path = tmp_path / "map.h5"
    axes = {
        "stiffness": {"start": 1.0, "stop": 2.0, "num": 5},
        "belt_speed": {"values": [0.1, 0.2]},
    }
    wiperjax.sweep(SWEEP | {"axes": axes}, path, progress=False)
    wiperjax.sweep(SWEEP | {"axes": axes}, path, progress=False, resume=True)
    assert wiperjax.verify(path, 4).differing == ()
    found = wiperjax.refine(path, levels=2, probes=4, on="dominant_frequency=0.1", progress=False)
    assert found.sizes["border"] > 0 and found.stiffness.attrs["units"] == "N/m"
    at = found.where(found.belt_speed < 0.11, drop=True).stiffness.values[0]
    exact = scipy.optimize.brentq(lambda k: 1 / stick_slip(0.1, k)[0] - 0.1, 1.0, 2.0)
    assert at == pytest.approx(exact, abs=1.0 / 16)


@pytest.mark.long
def test_a_wiper_takes_a_law_of_ones_own_from_a_file():
    scene = {
        "blade": {"friction": "own_systems:Falling", "attack_angle": 5.0},
        "parameters": {"steepness": 4.0, "static": 0.8},
        "run": {"duration": 0.01},
    }
    run = wiperjax.run_scene(scene)
    assert run.attrs["friction"] == "own_systems:Falling" and run.attrs["steepness"] == 4.0
    slips = (run.regime >= 1) & (run.regime <= 2)
    speed = abs(run.velocity.sel(axis="x") - run.belt_velocity)
    mu = abs(run.friction_force) / run.normal_force
    np.testing.assert_allclose(mu[slips], (0.8 / (1 + 4 * speed))[slips], rtol=1e-9)
    with pytest.raises(SpecError, match=r"parameters.steep: unknown key; did you mean 'steepness'"):
        wiperjax.parse_scene(scene | {"parameters": {"steep": 1.0}})
    with pytest.raises(SpecError, match=r"blade.mu_minimum: must be left out with blade.friction"):
        wiperjax.parse_scene(scene | {"blade": scene["blade"] | {"mu_minimum": 0.1}})


def test_a_default_outside_its_own_range_is_refused_where_it_is_declared():
    for ends, words in (
        ({"low": 2.0}, "default must be a finite number >= 2, but was 1"),
        ({"high": 0.5}, "default must be a finite number <= 0.5, but was 1"),
        ({"above": 1.0}, "default must be a finite number > 1, but was 1"),
        ({"below": 1.0}, "default must be a finite number < 1, but was 1"),
        ({"below": 1.0, "high": 2.0}, "below must be left out with high, but was 1"),
    ):
        with pytest.raises(ValueError, match=f"^{words}"):
            wiperjax.parameter(1.0, **ends)
    # its ends may be meant in radians as well as its default in degrees: both units are said
    words = r"default must lie inside \[-1.57, 1.57\] degrees, but was 0.3 rad \(17.19 degrees\)$"
    with pytest.raises(ValueError, match=words):
        wiperjax.parameter(0.3, "rad", low=-1.57, high=1.57)
    words = r"default must lie inside \[0, 90\] degrees, but was 30 rad \(1719 degrees\)$"
    with pytest.raises(ValueError, match=words):
        wiperjax.parameter(30.0, "rad", low=0, high=90)


def test_a_default_without_an_annotation_is_refused():
    """Python takes it for no field: the number of the base would be used without a word."""

    class Heavy(own_systems.Oscillator):
        mass = 3.0

    class Steep(own_systems.Falling):
        steepness = 9.0

    class Smooth(own_systems.Oscillator):
        friction = None

    class Fast(wiperjax.SteadyBelt):
        speed = 3.0

    class Loose(wiperjax.SteadyBelt):
        slack: float = wiperjax.parameter(0.1, low=0, high=1)

    class Annotated(own_systems.Oscillator):
        mass: float = 3.0

    class Below(Annotated):
        unilateral = False

    with pytest.raises(ValueError, match=r"^Heavy.mass must be annotated, .*; was mass = 3.0$"):
        Heavy()
    with pytest.raises(ValueError, match=r"^Steep.steepness must be annotated, .*= 9.0$"):
        Steep()
    with pytest.raises(ValueError, match=r"^Smooth.friction must be annotated, .*= None$"):
        Smooth()
    with pytest.raises(ValueError, match=r"^Fast.speed must be annotated, .*= 3.0$"):
        Fast()
    with pytest.raises(ValueError, match=r"^slack must lie inside \[0, 1\], but was 7$"):
        Loose(slack=7.0)
    assert Annotated().mass == Below().mass == 3.0
