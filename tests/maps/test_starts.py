"""Maps of several starts: what they say of a blade with two answers, and that they survive like all
others.
"""

import h5py
import numpy as np
import pytest
import xarray as xr
from stub_sweep import BLOCK, assert_same_map, data_of, make_spec, rewritten, run

import wiperjax
from wiperjax.cli.tables import print_classes
from wiperjax.datasets.map_starts import from_start, hangs_on_start
from wiperjax.machine.files import StoreError
from wiperjax.maps import driver, starts
from wiperjax.maps.block import block_size
from wiperjax.maps.verify import verify
from wiperjax.specs.errors import SpecError
from wiperjax.specs.load import parse_sweep
from wiperjax.store import checksums
from wiperjax.store.manifest import parts_of
from wiperjax.store.partial import open_partial
from wiperjax.vocabulary.codes import LABELS, RESULTS
from wiperjax.vocabulary.schema import SCHEMA

LOW, HIGH = 0.1, 0.6  # belt speeds between which the stub has two answers
REST = 0.3  # below which a start at rest squeals
NAMES = ["at_rest", "steady_slip", "up", "down"]


def evaluate(spec, index, finer=1, room=None, ended=None):
    """Cells with a memory: between two speeds they squeal if the motion they go on from does."""
    speed = np.broadcast_to(spec.cells(index)["belt_speed"], index.shape)
    loud, x = speed < (LOW if spec.start.equilibrium else REST), 0.0
    if ended is not None:
        goes_on = ended["result"] == RESULTS["finished"]
        remembers = np.where(ended["final_vx"] > 0, speed < HIGH, speed < LOW)
        loud = np.where(goes_on, remembers, loud)
        x = np.where(goes_on, 0.5 * ended["final_x"], 0.0)
    time = np.arange(finer * spec.samples) * spec.run.window / (finer * spec.samples)
    failed = (index % 11 == 5) & (index % 7 == 0)
    motion = loud * speed * 0.5
    return {
        "result": np.where(failed, RESULTS["non_finite"], RESULTS["finished"]),
        "velocity_rms": motion,
        "belt_speed_rms": speed,
        "stick_fraction": 0.5 * loud,
        "slip_fraction": 1 - 0.5 * loud,
        "flight_fraction": np.zeros(len(index)),
        "growth_rate": LOW - speed,
        "final_x": 1e-3 * np.sin(index) + x,
        "final_y": np.zeros(len(index)),
        "final_vx": motion,
        "final_vy": np.zeros(len(index)),
        "final_regime": np.ones(len(index)),
        "signal": np.sqrt(2) * motion[:, None] * np.sin(2 * np.pi * 700 * time),
    }


def several(names=NAMES, **more):
    """A sweep of 385 cells from several starts."""
    plain = make_spec().document()
    return parse_sweep(plain | {"starts": {"names": names} | more})


def options(**more):
    return {"evaluate": evaluate, "block": BLOCK} | more


def test_up_and_down_meet_both_answers_and_only_between_them(tmp_path):
    spec, path = several(), tmp_path / "map.h5"
    ds = run(spec, path, **options())
    assert list(ds.start.values) == NAMES
    assert ds.label.dims == (*spec.axes, "start") and "start" not in ds.growth_rate.dims
    squeals = (ds.label == LABELS["squeal"]).transpose("start", ...)
    failed = (ds.label == LABELS["failed"]).any("start")
    clean = ~failed.any("belt_speed")  # a failure ends what is handed on
    speed = ds.belt_speed
    for start, border in (("at_rest", REST), ("steady_slip", LOW), ("up", HIGH), ("down", LOW)):
        expected = (speed < border).broadcast_like(clean)
        assert (squeals.sel(start=start) == expected).where(clean, True).all(), start
    bistable = hangs_on_start(ds)
    assert (bistable == ((speed >= LOW) & (speed < HIGH))).where(clean, True).all()
    masks = dict(zip(ds.class_set.flag_meanings.split(), ds.class_set.flag_masks, strict=True))
    assert masks == {name: 1 << code for name, code in LABELS.items()}
    for name, mask in masks.items():
        xr.testing.assert_equal((ds.class_set & mask) > 0, (ds.label == LABELS[name]).any("start"))


def test_a_failed_start_is_no_second_class(capsys):
    quiet, squeal, failed = (LABELS[name] for name in ("quiet", "squeal", "failed"))
    pairs = [(quiet, quiet), (quiet, squeal), (quiet, failed), (failed, failed)]
    label = np.array([*pairs, (-1, -1)], dtype=np.int8)  # the last: not computed
    met = np.where(label >= 0, 1 << np.maximum(label, 0), -1)
    ds = xr.Dataset(
        {
            "label": (("belt_speed", "start"), label, SCHEMA["label"].attributes()),
            "class_set": ("belt_speed", np.bitwise_or.reduce(met, axis=1).astype(np.int16)),
        },
        {"start": ["up", "down"]},
    )
    assert hangs_on_start(ds).values.tolist() == [False, True, False, False, False]
    print_classes(ds)
    shown = capsys.readouterr().out
    assert "the class depends on the start in 1 of 4 cells" in shown
    assert "some starts failed in 2 of 4 cells" in shown


def test_a_failure_hands_nothing_on(tmp_path):
    ds = driver.sweep(several(["up"]), progress=False, **options())
    failed = (ds.label == LABELS["failed"]).isel(start=0)
    assert failed.any()
    after = failed.shift(belt_speed=1, fill_value=False) & ~failed
    squeals = (ds.label == LABELS["squeal"]).isel(start=0)
    assert (squeals == (ds.belt_speed < REST)).where(after, True).all()


@pytest.mark.long
@pytest.mark.parametrize("block", [1, 22, 1000])
def test_blocks_are_whole_lines_and_do_not_matter(tmp_path, block):
    spec, path = several(), tmp_path / "map.h5"
    sizes = []

    def counting(spec, index, *look, **ended):
        sizes.append(len(index))
        return evaluate(spec, index, *look, **ended)

    run(spec, path, **options(evaluate=counting, block=block))
    lines = min(-(-block // 11), 35)
    assert {size for size in sizes if size % 11} <= {2 * lines, 2 * (35 % lines)}
    whole = driver.sweep(spec, progress=False, **options())
    with wiperjax.open_map(path, check=True) as ds:
        xr.testing.assert_identical(data_of(ds), data_of(whole))
    assert block_size(spec) % 11 == 0


@pytest.mark.slow
def test_a_killed_sweep_goes_on_and_its_parts_can_be_read(tmp_path):
    spec, path, count = several(), tmp_path / "map.h5", [0]

    class Stop(Exception):
        pass

    def stopping(*given, **ended):
        fourth = given[1][0] >= 3 * 55  # of seven blocks of 13 calls
        count[0] += fourth
        if fourth and count[0] > 6:
            raise Stop
        return evaluate(*given, **ended)

    with pytest.raises(Stop):
        run(spec, path, **options(evaluate=stopping))
    part = open_partial(parts_of(path))
    assert part.done.sum() == 3 * 55 and (part.class_set == -1).sum() == 385 - 165
    assert int(hangs_on_start(part).sum()) > 0
    run(spec, path, **options(resume=True))
    whole = driver.sweep(spec, progress=False, **options())
    with wiperjax.open_map(path, check=True) as ds:
        xr.testing.assert_identical(data_of(ds), data_of(whole))
    with pytest.raises(StoreError, match=r"starts\.kick was 0.0001, now 0.001"):
        half = tmp_path / "other.h5"
        count[0] = 30
        with pytest.raises(Stop):
            run(spec, half, **options(evaluate=stopping))
        run(several(kick=1e-3), half, **options(resume=True))


@pytest.mark.slow
def test_cells_are_verified_from_where_their_neighbours_ended(tmp_path):
    spec, path = several(), tmp_path / "map.h5"
    run(spec, path, **options())
    report = verify(path, cells=60, evaluate=evaluate)
    assert report.passed and report.identical
    with rewritten(path) as file:
        file["final_vx"][:, :, :, NAMES.index("up")] = 0.0
    assert len(verify(path, cells=60, evaluate=evaluate).differing) > 10


def test_the_swept_axis_is_made_the_last(tmp_path):
    spec = several(["down"], along="normal_load")
    assert list(spec.axes) == ["attack_angle", "belt_speed", "normal_load"]
    again = parse_sweep(spec.document())
    assert list(again.axes) == list(spec.axes) and again.digest() == spec.digest()
    index = np.array([0, 4, 5, 9])
    assert list(starts.before(spec, index, "up")) == [-1, 3, -1, 8]
    assert list(starts.before(spec, index, "down")) == [1, -1, 6, -1]
    # up is to larger values, however they are listed
    document = spec.document()
    load = document["axes"]["normal_load"]
    document["axes"]["normal_load"] = load | {"start": load["stop"], "stop": load["start"]}
    falling = parse_sweep(document)
    assert list(starts.before(falling, index, "down")) == [-1, 3, -1, 8]
    assert list(starts.before(falling, index, "up")) == [1, -1, 6, -1]


def random_spec(count=50, **more):
    return parse_sweep(
        make_spec(angles=2, loads=2).document()
        | {"starts": {"random": count, "x": [-1e-3, 1e-3], "vx": [-1.0, 2.0], "seed": 4} | more}
    )


@pytest.mark.slow
def test_shares_of_random_starts_are_those_of_their_box(tmp_path):
    spec, path = random_spec(), tmp_path / "map.h5"
    ds = run(spec, path, **options(block=7))
    assert ds.start_vx.dims == ("start",) and "start_vx" in ds.coords
    assert -1 <= ds.start_vx.min() < -0.7 and 1.8 < ds.start_vx.max() <= 2
    assert (ds.start_y == 0).all() and abs(ds.start_x).max() <= 1e-3
    between = ds.sel(belt_speed=0.3, method="nearest")
    share = between.class_share.sel({"class": "squeal"})
    np.testing.assert_allclose(share, (ds.start_vx > 0).mean())
    np.testing.assert_allclose(ds.class_share.sum("class"), 1)
    error = between.class_share_error.sel({"class": "squeal"})
    np.testing.assert_allclose(error, np.sqrt(share * (1 - share) / 50), rtol=0.1)
    assert (ds.class_share_error > 0).all()  # nothing seen is not nothing there
    whole = driver.sweep(spec, progress=False, **options(block=1000))
    xr.testing.assert_identical(data_of(ds), data_of(whole))
    assert verify(path, cells=20, evaluate=evaluate).identical
    assert ds.attrs["seed"] == 4
    other = driver.sweep(random_spec(seed=5), progress=False, **options())
    assert (other.start_vx != ds.start_vx).all()
    most = from_start(ds)  # the most frequent class, and all else of one run that ended in it
    assert most.label.dims == tuple(spec.axes)
    assert (most.class_share.max("class") == most.class_share.isel({"class": most.label})).all()
    assert (
        ((most.velocity_rms > 0) == (most.label == LABELS["squeal"]))
        .where(most.label != LABELS["failed"], True)
        .all()
    )


def wrong(table, **more):
    return make_spec().document() | {"starts": table} | more


BOX = {"random": 9, "x": [-1e-3, 1e-3]}
WIPING = {"belt": {"kind": "wiping", "frequency": 2.0}}


@pytest.mark.parametrize(
    ("file", "said"),
    [
        (wrong({}), "starts: must have one of names and random, had none"),
        (wrong({"names": ["up"]} | BOX), "starts: must have one of names and random, had both"),
        (wrong({"names": ["left"]}), "starts.names: 'left': unknown key; must be one of at_rest"),
        (wrong({"names": ["up", "up"]}), "starts.names: must not name a start twice"),
        (wrong({"names": ["up"], "along": "x"}), "starts.along: must be one of the axes, was 'x'"),
        (wrong({"names": ["up"], "seed": 3}), "starts.seed: must be left out without starts.ran"),
        (wrong({"names": ["at_rest"], "along": "belt_speed"}), "starts.along: must be left out wi"),
        (wrong({"names": ["up"], "kick": 2}), "starts.kick: must lie inside [0, 0.1], was 2"),
        (wrong(BOX | {"random": 1}), "starts.random: must be a whole number in [2, 10000], was 1"),
        (
            wrong(BOX | {"x": [1e-3, 1e-3]}),
            "starts.random: must have a [from, to] with from < to to be drawn from; all 9 starts",
        ),
        (wrong({"random": 9}), "starts.x: is missing; random starts are drawn from [from, to]"),
        (wrong(BOX | {"x": [1e-3, 0]}), "starts.x: must be [from, to] with from <= to, was [0.001"),
        (wrong(BOX | {"x": [0, 0.5]}), "starts.x: must be shorter than the lip (0.006 m), was 0.5"),
        (wrong(BOX | {"y": [-1e-3, 0]}), "starts.y: must not be negative (the glass is y = 0)"),
        (wrong(BOX | {"y": [0, 1e-3]}, model="bar"), "starts.y: must be left out with model = 'b"),
        (wrong({"names": ["up"]}, start={"angle": 3}), "start: must be left out with [starts]"),
        (wrong({"names": ["up"]}, sensitivities={}), "starts: must be left out with sensitivities"),
        (
            wrong({"names": ["up"]}, **WIPING),
            "run.transient: must make whole periods of the belt with run.window, for the start "
            "'up' or 'down', made 0.8",
        ),
        (wrong({"names": ["steady_slip"]}, **WIPING), "starts.names: must not have 'steady_slip'"),
    ],
)
def test_what_cannot_be_meant_is_one_line(file, said):
    with pytest.raises(SpecError) as refused:
        parse_sweep(file)
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_a_start_that_is_not_there_is_named():
    ds = driver.sweep(several(["up"]), progress=False, **options())
    with pytest.raises(ValueError, match=r"'left' is not in this map's starts; it holds up"):
        from_start(ds, "left")
    with pytest.raises(ValueError, match=r"start must be left out"):
        from_start(from_start(ds), "up")


def test_a_map_of_one_start_is_what_it_was(tmp_path):
    spec, path = make_spec(), tmp_path / "map.h5"
    assert "starts" not in spec.canonical()
    from stub_sweep import evaluate as plain

    ds = run(spec, path, evaluate=plain)
    assert hangs_on_start(ds) is None and from_start(ds) is ds
    assert_same_map(path, spec)


@pytest.mark.long
def test_a_damaged_map_is_mended_by_its_lines(tmp_path):
    spec, path, calls = random_spec(), tmp_path / "map.h5", []
    whole = driver.sweep(spec, progress=False, **options(block=11))
    for variable, again in (("label", True), ("class_share", True), ("start_vx", False)):
        if not path.exists():
            run(spec, path, **options(block=11))
        calls.clear()
        with h5py.File(path) as file:
            start, length = checksums._runs(file[variable])[0]
        content = bytearray(path.read_bytes())
        content[start + length // 2] ^= 1
        path.write_bytes(content)
        with pytest.raises(StoreError, match=f"is damaged: {variable}; a map is mended"):
            wiperjax.open_map(path, check=True)

        def counting(*given, **ended):
            calls.append(given[1])
            return evaluate(*given, **ended)

        run(spec, path, **options(evaluate=counting, resume=True, block=11))
        assert bool(calls) is again
        with wiperjax.open_map(path, check=True) as ds:
            xr.testing.assert_identical(data_of(ds), data_of(whole))
