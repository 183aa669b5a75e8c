"""The batch: lanes that never wait, and never know of each other."""

import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import wiperjax
from wiperjax import Event, Regime, Result, SteadyBelt, Wiper
from wiperjax.engine.carry.problem import Integration, Recording, make_case
from wiperjax.engine.lanes import Pool, run_pool
from wiperjax.engine.sampling.means import Signal
from wiperjax.maps import block, estimate
from wiperjax.maps.block import evaluate_block
from wiperjax.maps.cells import batch, devices
from wiperjax.numerics import wide_masks
from wiperjax.specs.load import parse_sweep
from wiperjax.vocabulary import codes

DURATION = 0.02
CASES = 24
SAMPLES = 64
ROOM = 16  # of the event log: less than some cases need


def blades(rng, cases=CASES):
    wiper = Wiper(
        belt=SteadyBelt(jnp.asarray(rng.uniform(0.05, 1.0, cases))),
        attack_angle=jnp.asarray(np.deg2rad(rng.uniform(-40, 40, cases))),
        normal_load=jnp.asarray(rng.uniform(5, 30, cases)),
    )
    traced = lambda x: jnp.asarray(x) if isinstance(x, int | float) and x != 0 else x
    return jax.tree.map(traced, wiper)


@eqx.filter_jit
def compiled(wiper, position, count, lanes=8, flows=3, max_steps=20_000, room=ROOM):
    still = jnp.zeros_like(position)
    interval = DURATION / SAMPLES
    ring = 2 * flows
    signal = Signal(0.0, interval, SAMPLES, CASES * (SAMPLES + ring), ring, inner=True)
    case = make_case(
        wiper,
        DURATION,
        ((position, still), (still, still)),
        Integration(max_steps=max_steps, max_step=2 * interval),
        Recording(signal=signal, max_events=room),
    )
    return run_pool(Pool(case, count), lanes, flows)


def run(*arguments, **options):
    """Outcomes, samples as (cases, samples), effort."""
    found, samples, effort = compiled(*arguments, **options)
    rows = lambda flat: np.asarray(flat).reshape(CASES, -1)[:, :SAMPLES]
    return found.tree(), jax.tree.map(rows, samples), effort


@pytest.fixture(scope="module")
def pool():
    rng = np.random.default_rng(5)
    wiper = blades(rng)
    position = wiper.lip_length * jnp.sin(wiper.attack_angle)
    return wiper, position, run(wiper, position, jnp.int32(CASES))


TIMES = DURATION / SAMPLES * np.arange(SAMPLES + 1)


@eqx.filter_jit
def alone_solver(wiper):
    """The same, one by one."""
    step = DURATION / SAMPLES
    return wiperjax.solve(wiper, DURATION, rtol=1e-8, max_step=2 * step, sample_times=TIMES)


def same(a, b):
    for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        np.testing.assert_array_equal(np.asarray(x), np.asarray(y))


@pytest.mark.long
def test_the_cases_differ(pool):
    outcome = pool[2][0]
    assert len(set(np.asarray(outcome.steps).tolist())) > CASES // 2
    assert np.all(np.asarray(outcome.result) == Result.FINISHED)
    assert np.asarray(outcome.events).max() > 20


@pytest.mark.slow
def test_ranks_may_be_watched():
    """With ``jax_numpy_rank_promotion = "raise"`` every sweep was refused, in words about shapes
    that no caller has seen."""
    wiper = blades(np.random.default_rng(5))
    with jax.numpy_rank_promotion("raise"):
        compiled.lower(wiper, wiper.lip_length * jnp.sin(wiper.attack_angle), jnp.int32(CASES))


@pytest.mark.long
def test_each_case_equals_the_same_alone(pool):
    wiper, position, (outcome, _, _) = pool
    for case in (0, 7, 23):
        one = jax.tree.map(lambda x, k=case: x[k] if jnp.ndim(x) else x, wiper)
        alone = alone_solver(one)
        assert int(alone.result) == int(outcome.result[case])
        for k in range(2):
            found = float(outcome.position[k][case]) - float(alone.final_position[k])
            assert abs(found) < 1e-7 * wiper.lip_length  # steps differ in their caps: rtol is 1e-8


@pytest.mark.long
def test_the_event_log_of_each_case_is_that_of_the_same_alone(pool):
    wiper, position, (outcome, _, _) = pool
    log = jax.tree.map(np.asarray, outcome.log)
    np.testing.assert_array_equal(log.count, outcome.events)
    assert log.count.min() < ROOM < log.count.max()
    for case in (0, 7, 23, int(log.count.argmin()), int(log.count.argmax())):
        one = jax.tree.map(lambda x, k=case: x[k] if jnp.ndim(x) else x, wiper)
        alone = jax.tree.map(np.asarray, alone_solver(one).events)
        assert alone.count == log.count[case]
        held = min(alone.count, ROOM)
        for name in ("kind", "before", "after"):
            found = getattr(log, name)[case]
            np.testing.assert_array_equal(found[:held], getattr(alone, name)[:held], err_msg=name)
        np.testing.assert_allclose(log.time[case][:held], alone.time[:held], atol=1e-6 * DURATION)
        np.testing.assert_allclose(
            log.impulse[case][:held], alone.impulse[:held], rtol=1e-4, atol=1e-12
        )
        assert np.all(np.isnan(log.time[case][held:]))  # not the events of a lane's last case


def test_bitwise_the_same_in_any_order(pool):
    wiper, position, (outcome, signal, _) = pool
    order = np.random.default_rng(1).permutation(CASES)
    turned = jax.tree.map(lambda x: x[order] if jnp.ndim(x) else x, wiper)
    other, other_signal, _ = run(turned, position[order], jnp.int32(CASES))
    same(jax.tree.map(lambda x: x[order], (outcome, signal)), (other, other_signal))


def test_bitwise_the_same_with_failing_neighbours(pool):
    wiper, position, (outcome, signal, _) = pool
    broken = [3, 4, 11]
    load = wiper.normal_load.at[jnp.asarray(broken)].set(jnp.nan)
    sick = eqx.tree_at(lambda w: w.normal_load, wiper, load)
    other, other_signal, _ = run(sick, position, jnp.int32(CASES))
    assert np.all(np.asarray(other.result)[broken] == Result.NON_FINITE)
    well = np.setdiff1d(np.arange(CASES), broken)
    same(
        jax.tree.map(lambda x: x[well], (outcome, signal)),
        jax.tree.map(lambda x: x[well], (other, other_signal)),
    )


def test_a_part_of_the_pool_leaves_the_rest_alone(pool):
    wiper, position, (outcome, signal, _) = pool
    some, _, _ = run(wiper, position, jnp.int32(10))
    same(jax.tree.map(lambda x: x[:10], outcome), jax.tree.map(lambda x: x[:10], some))
    assert np.all(np.asarray(some.steps)[10:] == 0)


@pytest.mark.slow
def test_the_signal_is_the_mean_of_the_output_velocity(pool):
    """Means of x' are differences of x; with the variance inside they are the exact mean square."""
    wiper, position, (outcome, samples, _) = pool
    means, inner = samples.output.astype(float), samples.inner.astype(float)
    square = np.asarray(outcome.observed.output_square_integral) / DURATION
    for case in (0, 7):
        one = jax.tree.map(lambda x, k=case: x[k] if jnp.ndim(x) else x, wiper)
        place = alone_solver(one).samples.position[0]
        exact = np.diff(place) / (DURATION / SAMPLES)
        # friction bends the curve sharply at captures: the cubic is good to a part in a thousand
        size = max(float(one.belt.speed), 0.3)
        assert np.max(np.abs(means[case] - exact)) < 1e-3 * size
        np.testing.assert_allclose(np.mean(means[case] ** 2 + inner[case]), square[case], rtol=1e-4)


@pytest.mark.slow
def test_a_finer_look_is_the_same_motion_in_the_same_program():
    spec = sweep_spec()
    coarse = batch.evaluate(spec, np.arange(7), 1, 64)
    compiled = len(batch.compute.found)
    fine = batch.evaluate(spec, np.array([2, 5]), 4, 64)
    assert len(batch.compute.found) == compiled
    assert fine["signal"].shape == (2, 4 * spec.samples)
    means = fine["signal"].reshape(2, spec.samples, 4).mean(axis=-1)
    # other steps, the same motion to the tolerance
    np.testing.assert_allclose(means, coarse["signal"][[2, 5]], atol=1e-3)
    assert np.abs(fine["signal"]).max() > 0.1


def sweep_spec(angles=(-30, 30), speed=0.3, **run):
    settings = {"transient": 0.005, "window": 0.01, "samples": 64, **run}
    return parse_sweep(
        {
            "axes": {"attack_angle": {"start": angles[0], "stop": angles[1], "num": 7}},
            "belt": {"speed": speed},
            "run": settings,
        },
        "test.toml",
    )


@pytest.mark.slow
def test_flows_and_a_jump_are_one_compiled_function_each(pool):
    """By `jax_settings.COMPILER` (a new XLA may rename its options); and barriers keep it small.
    So are rounds of both, what a flush writes of two samples, a refill, what it writes of numbers
    of three types, and each of the five numbers of an event in the log."""
    wiper, position, _ = pool
    text = compiled.lower(wiper, position, jnp.int32(CASES)).compile().compiled.as_text()
    assert text.count('xla_cpu_small_call="true"') == 14
    assert text.count(" = ") < 30_000


@pytest.mark.long
def test_wide_masks_tell_the_same(pool, monkeypatch):
    """A processor with registers for masks gets another program than one without (`wide_masks`)."""
    wiper, position, _ = pool
    found = []
    for registers in (True, False):
        monkeypatch.setattr(wide_masks, "mask_registers", lambda there=registers: there)
        program = eqx.filter_jit(lambda *given: compiled.__wrapped__(*given))  # traced anew
        text = program.lower(wiper, position, jnp.int32(CASES)).compile().compiled.as_text()
        flow = max(text.split("\n}\n"), key=lambda part: part.count(" fusion("))
        truths = len(re.findall(r"= pred\[8\]\S* fusion\(", flow))
        assert truths > 40 if registers else truths == 0
        found.append(program(wiper, position, jnp.int32(CASES))[0].tree())
    narrow, wide = found
    for name in ("result", "regime", "events"):
        np.testing.assert_array_equal(getattr(wide, name), getattr(narrow, name), err_msg=name)
    for name in ("final_time", "position", "velocity", "observed"):
        for a, b in zip(*(jax.tree.leaves(getattr(x, name)) for x in found), strict=True):
            np.testing.assert_allclose(b, a, rtol=1e-6, atol=1e-9, err_msg=name)


@pytest.mark.slow
def test_one_compilation_serves_a_whole_sweep():
    spec = sweep_spec()
    batch.evaluate(spec, np.arange(7))
    compiled = len(batch.compute.found)
    for part in (np.arange(3), np.arange(3, 7), np.array([6])):
        batch.evaluate(spec, part)
    assert len(batch.compute.found) == compiled


@pytest.mark.slow
def test_blocks_do_not_matter():
    spec = sweep_spec()
    whole = batch.evaluate(spec, np.arange(7))
    parts = [batch.evaluate(spec, part) for part in (np.arange(2), np.arange(2, 7))]
    for name, values in whole.items():
        if np.ndim(values):
            joined = np.concatenate([part[name] for part in parts])
            np.testing.assert_array_equal(values, joined, err_msg=name)


@pytest.mark.long
def test_a_program_that_is_compiled_fast_makes_the_same_motion(monkeypatch):
    """That of a brief sweep: stages in a loop, which round otherwise, and a jump apart."""
    spec = sweep_spec(rtol=1e-9)
    brief = batch.evaluate(spec, np.arange(7))
    monkeypatch.setattr(devices, "BRIEF", 0.0)
    other = batch.evaluate(spec, np.arange(7))
    assert not np.array_equal(brief["signal"], other["signal"])  # another program
    for name in other.keys() - {"occupancy", "steps", "rejected_steps", "unproved_steps"}:
        np.testing.assert_allclose(brief[name], other[name], rtol=1e-5, atol=1e-7, err_msg=name)


@pytest.mark.slow
def test_a_cell_that_spends_its_budget_fails_alone():
    columns = batch.evaluate(sweep_spec(max_steps=150), np.arange(7))
    spent = columns["result"] == Result.STEP_BUDGET_SPENT
    assert 0 < spent.sum() < 7
    assert np.all(np.isnan(columns["stick_fraction"][spent]))
    assert np.all(np.isfinite(columns["stick_fraction"][~spent]))
    # samples up to where it came, and nothing behind
    run, samples = sweep_spec().run, sweep_spec().samples
    ends = run.transient + run.window / samples * np.arange(1, samples + 1)
    reached = ends <= columns["final_time"][:, None] * (1 + 1e-12)
    np.testing.assert_array_equal(np.isfinite(columns["signal"]), reached)
    assert not reached[spent].all()


@pytest.mark.parametrize("shares", [1, 2, 3, 7])
def test_cells_are_dealt_out_and_come_back_in_their_order(shares, monkeypatch):
    monkeypatch.setattr(devices, "devices", lambda: jax.devices()[:1] * shares)
    size = devices.capacity(1000, shares)
    order = np.random.default_rng(shares).permutation(1000)
    taken = []

    def compute(given, count):
        values, plain = given
        taken.append((np.asarray(values)[: int(count)], plain))
        return values, values[:, None] * np.ones(3), (1.0, 2.0)

    (one, three), effort = devices.deal(compute, (np.arange(float(size)), "plain"), order)
    np.testing.assert_array_equal(one, np.arange(1000))
    np.testing.assert_array_equal(three, np.arange(1000.0)[:, None] * np.ones(3))
    np.testing.assert_array_equal(effort, (shares, 2 * shares))
    found = sorted(taken, key=lambda part: order.tolist().index(int(part[0][0])))
    for share, (values, plain) in enumerate(found):
        np.testing.assert_array_equal(values, order[share::shares])
        assert plain == "plain"


def test_blocks_of_any_size_can_be_dealt_to_any_number_of_devices():
    for shares in (*range(1, 17), 24, 64):
        for count in (1, 63, 64, 65, 1000, 4096, 8192, 9471, 32768):
            capacity = devices.capacity(count, shares)
            assert capacity % shares == 0 and capacity >= count
            assert capacity // shares >= -(-count // shares)
            few = next((n for n in devices.FEW if count <= n * shares), 0)
            assert capacity <= max(1.26 * count + 128 * shares, few * shares)


def test_small_sweeps_share_a_program_whatever_their_samples_and_what_varies():
    rooms = {devices.sample_room(devices.capacity(n), s) for n in (1, 64) for s in (512, 8192)}
    assert len(rooms) == 1
    size = devices.capacity(200)
    for varying in ({"attack_angle": np.linspace(0.1, 0.5, size)}, {"tip_mass": 2e-4}):
        made = devices.alike(Wiper(belt=SteadyBelt(0.3), **varying), "float64", size)
        shapes = {jnp.shape(x) for x in jax.tree.leaves(made) if isinstance(x, jax.Array)}
        assert shapes == {(size,)}
        assert made.hinge_mass == 0 and not isinstance(made.hinge_mass, jax.Array)
    assert devices.sample_room(devices.capacity(64), 20_000) >= 20_000
    assert devices.sample_room(devices.capacity(32768), 1000) <= 1.26 * 1000


def test_dear_cells_begin_first():
    blades = Wiper(
        belt=SteadyBelt(np.array([1.0, 0.1, 0.1, 0.5])),
        normal_load=np.array([5.0, 5.0, 20.0, 20.0]),
    )
    assert devices.dearest_first(blades, 4).tolist() == [2, 3, 1, 0]
    assert devices.dearest_first(blades, 2).tolist() == [1, 0]
    same_load = Wiper(belt=SteadyBelt(0.3), normal_load=15.0)
    assert devices.dearest_first(same_load, 3).tolist() == [0, 1, 2]


@pytest.mark.long
def test_the_event_log_of_a_cell_is_that_of_its_settled_window():
    spec = sweep_spec(event_log=12, raster=20)  # by the program of `test_cluster`
    columns = batch.evaluate(spec, np.arange(7))
    kind, time = columns["event_kind"], columns["event_time"]
    held = np.minimum(columns["event_count"], 12)
    np.testing.assert_array_equal(np.sum(kind != codes.NONE, axis=1), held)
    np.testing.assert_array_equal(columns["event_overflow"], columns["event_count"] > 12)
    assert 0 < columns["event_overflow"].sum() < 7
    used = np.arange(12) < held[:, None]
    assert np.all((time[used] >= 0) & (time[used] <= 0.01)) and np.all(np.isnan(time[~used]))
    assert np.all(np.diff(time, axis=1)[used[:, 1:]] >= 0)
    whole = ~columns["event_overflow"]
    sticks = (columns["regime_after"] == Regime.STICK) & (columns["regime_before"] != Regime.STICK)
    counts = {"lift_off_count": kind == Event.LIFT_OFF, "stick_count": sticks & used}
    for name, happened in counts.items():
        np.testing.assert_array_equal(columns[name][whole], happened.sum(axis=1)[whole])
    # regimes are a chain: each event starts from where the one before it led
    chained = columns["regime_before"][:, 1:] == columns["regime_after"][:, :-1]
    assert np.all(chained[used[:, 1:]])

    def of(spec, index, *finer):
        return {name: x[index] if np.ndim(x) else x for name, x in columns.items()}

    stored, _ = block.evaluate_block(spec, np.arange(7), of)
    plain, packed = estimate.bytes_of_a_cell(spec)
    assert stored.keys() == {column.name for column in estimate.columns(spec)}
    assert sum(x.nbytes for x in stored.values() if x.ndim == 1) == 7 * plain
    assert sum(x.nbytes for x in stored.values() if x.ndim == 2) == 7 * packed
    without = batch.evaluate(sweep_spec(), np.arange(7))
    for name, values in without.items():
        np.testing.assert_array_equal(values, columns[name], err_msg=name)


@pytest.mark.long
def test_float32_sees_the_same_events():
    index = np.arange(7)
    double = batch.evaluate(sweep_spec(), index)
    single = batch.evaluate(sweep_spec(rtol=1e-5, precision="float32"), index)
    assert np.all(single["result"] == Result.FINISHED)
    np.testing.assert_array_equal(single["stick_count"], double["stick_count"])
    np.testing.assert_allclose(single["stick_fraction"], double["stick_fraction"], atol=5e-3)


@pytest.mark.long
@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_tip_that_is_carried_has_the_share_one_exactly(precision):
    """The times in a regime are sums of steps, which miss the window by 1e-15 of it or, in float32,
    by 5e-7: the tip was called quiet or other as rounding would have it."""
    rtol = 1e-6 if precision == "float64" else 1e-5  # in programs that are compiled anyway
    spec = sweep_spec(angles=(0, 20), speed=0.01, rtol=rtol, precision=precision)
    found, _ = evaluate_block(spec, np.arange(7), batch.evaluate)
    assert np.all(found["stick_fraction"] == 1.0)
    assert np.all(found["label"] == codes.LABELS["other"])
    assert np.all(found["mechanism"] == codes.MECHANISMS["carried"])


@pytest.mark.long
def test_float32_does_not_creep_behind_a_stiff_shoulder():
    """The last digit of x, times the shoulder's stiffness, is an error that no short step lowers:
    steps that tried took nine times as many. And steps shorter than that digit must add up: where
    each was rounded away, four of these seven stopped on the way."""
    index = np.arange(7)
    asked = {"angles": (39, 40), "speed": 0.0245, "window": 0.3, "rtol": 1e-6}
    double = batch.evaluate(sweep_spec(**asked, solver="tsit5"), index)  # as single precision has
    single = batch.evaluate(sweep_spec(**asked, precision="float32"), index)
    assert np.all(single["result"] == Result.FINISHED)
    np.testing.assert_array_equal(single["stick_count"], double["stick_count"])
    assert np.all(single["steps"] < 1.5 * double["steps"])
