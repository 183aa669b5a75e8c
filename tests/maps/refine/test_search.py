"""What a refinement finds where the truth is a formula: borders, islands, and what has none."""

import shutil

import numpy as np
import pytest
from border_maps import AXES, coarse_map, engine, places_of, refined, unit

from wiperjax.cli import main
from wiperjax.maps.refine.replay import replay
from wiperjax.store.whole import open_map
from wiperjax.vocabulary.codes import CROSSINGS, LABELS


def to_unit(ds, names=("attack_angle", "belt_speed")):
    return [
        (ds[name].values - AXES[name]["start"]) / (AXES[name]["stop"] - AXES[name]["start"])
        for name in names
    ]


def random_points(count, names=("attack_angle", "belt_speed")):
    """Random values of axes, and the same from 0 to 1."""
    units = np.random.default_rng(1).random((len(names), count))
    span = {n: (AXES[n]["start"], AXES[n]["stop"]) for n in names}
    values = {
        n: low + u * (high - low) for u, (n, (low, high)) in zip(units, span.items(), strict=True)
    }
    return values, units


def disc(x, y):
    return np.where((x - 0.45) ** 2 + (y - 0.5) ** 2 < 0.3**2, 700.0, 300.0)


def wave(x, y):
    return 400 * np.exp(y + 0.3 * x**2 - 0.5)  # crosses 500 Hz smoothly


def test_a_jump_is_enclosed_on_both_sides_and_the_answer_between_points_is_right(tmp_path):
    path = tmp_path / "map.h5"
    coarse_map(path, engine(disc))
    found = refined(path, engine(disc), levels=5)
    x, y = to_unit(found)
    assert found.sizes["border"] >= 30 and set(found.kind.values) == {CROSSINGS["jump"]}
    bracket = 1 / (8 * 2**5)
    assert np.abs(np.hypot(x - 0.45, y - 0.5) - 0.3).max() < bracket
    sides = np.stack([found.side_low, found.side_high])
    assert (
        set(sides.ravel()) == {LABELS["squeal"], LABELS["other"]} and (sides[0] != sides[1]).all()
    )
    along = np.where(found.axis == 0, found.attack_angle, found.belt_speed)
    assert ((found.bracket_low <= along) & (along <= found.bracket_high)).all()
    # degrees beside m/s, of no unit together
    assert "units" not in found.bracket_low.attrs and "units" not in found.bracket_high.attrs
    assert found.attrs["simulations"] + 81 < found.attrs["full_grid_cells"] / 40
    search, _ = replay(path)
    values, units = random_points(4000)
    code, depth = search.answer(places_of(search.grid, values))
    wrong = code != np.where(disc(*units) > 500, LABELS["squeal"], LABELS["other"])
    assert wrong.mean() < 0.005 and (depth[wrong] < 2).all() and np.isinf(depth).any()


@pytest.mark.slow
def test_a_smooth_crossing_takes_few_looks_and_is_interpolated(tmp_path):
    smooth, jump = tmp_path / "smooth.h5", tmp_path / "jump.h5"
    steps = engine(lambda x, y: np.where(wave(x, y) > 500, 700.0, 300.0))
    coarse_map(smooth, engine(wave))
    coarse_map(jump, steps)
    found = refined(smooth, engine(wave), levels=8, probes=0)
    other = refined(jump, steps, levels=8, probes=0)
    assert set(found.kind.values) == {CROSSINGS["smooth"]}
    assert np.abs(np.log(wave(*to_unit(found)) / 500)).max() < 1e-6  # a bracket is 5e-4
    assert found.attrs["simulations"] < 0.7 * other.attrs["simulations"]


def test_a_number_that_jumps_across_its_threshold_is_a_jump(tmp_path):
    lines = engine(lambda x, y: np.where(y + 0.2 * x < 0.53, 480.0 + 10 * y, 530.0 + 10 * y))
    coarse_map(tmp_path / "map.h5", lines)
    found = refined(tmp_path / "map.h5", lines, levels=6)
    x, y = to_unit(found)
    assert set(found.kind.values) == {CROSSINGS["jump"]}
    assert np.abs(y + 0.2 * x - 0.53).max() < 1.2 / (8 * 2**6)


@pytest.mark.slow
def test_a_threshold_of_any_stored_number_and_another_name_are_borders_too(tmp_path):
    both = engine(lambda x, y: (wave(x, y), np.where(x > 0.3, 0.5, 0.0)))
    coarse_map(tmp_path / "map.h5", both)
    found = refined(tmp_path / "map.h5", both, levels=4, on="dominant_frequency=430")
    assert np.abs(np.log(wave(*to_unit(found)) / 430)).max() < 1 / (8 * 2**4)
    found = refined(tmp_path / "map.h5", both, levels=4, on="mechanism")
    assert np.abs(to_unit(found)[0] - 0.3).max() < 1 / (8 * 2**4)
    assert found.attrs["on"] == "mechanism" and (found.axis == 0).all()


@pytest.mark.slow
def test_three_axes_three_classes(tmp_path):
    def ball(x, y, z):
        inside = (x - 0.5) ** 2 + (y - 0.4) ** 2 + (z - 0.5) ** 2 < 0.35**2
        return np.where(inside, np.where(z > 0.55, 2000.0, 700.0), 300.0), np.where(inside, 0.4, 0)

    path, three = tmp_path / "map.h5", engine(ball)
    coarse_map(path, three, axes=tuple(AXES))
    found = refined(path, three, levels=4, on="band", probes=800)
    x, y, z = to_unit(found, tuple(AXES))
    off = np.abs(np.sqrt((x - 0.5) ** 2 + (y - 0.4) ** 2 + (z - 0.5) ** 2) - 0.35)
    brackets = 1 / (np.array([8, 5, 8])[found.axis] * 2**4)
    assert (np.minimum(off, np.abs(z - 0.55)) < brackets).all()
    search, _ = replay(path)
    values, units = random_points(4000, tuple(AXES))
    code, _ = search.answer(places_of(search.grid, values))
    pitch = ball(*units)[0]
    truth = np.select([pitch == 300, pitch == 700], [2, 3], 4)  # low, squeal, high
    assert (code == truth).mean() > 0.97
    share = found.attrs["border_probes_wrong_share_at_most"]
    assert found.attrs["border_probes_wrong"] / found.attrs["border_probes"] < share < 0.15


def island(radius):
    def pitch(x, y):
        return np.where((x - 0.44) ** 2 + (y - 0.56) ** 2 < radius**2, 700.0, 300.0)

    return engine(pitch)


@pytest.mark.slow
def test_an_island_smaller_than_a_cell_is_found_by_probes(tmp_path):
    coarse_map(tmp_path / "map.h5", island(0.05))  # cells are 0.125 wide, and none is in it
    missed = refined(tmp_path / "map.h5", island(0.05), levels=5, probes=0)
    assert missed.sizes["border"] == 0
    found = refined(tmp_path / "map.h5", island(0.05), levels=5, probes=1500, splits=3)
    x, y = to_unit(found)
    assert found.attrs["probes_wrong"] > 0 and found.sizes["border"] >= 4
    assert np.abs(np.hypot(x - 0.44, y - 0.56) - 0.05).max() < 1.5 / (8 * 2**5)


def test_an_island_that_no_probe_meets_is_within_the_miss_rate_stated(tmp_path):
    radius = 0.01
    coarse_map(tmp_path / "map.h5", island(radius))
    found = refined(tmp_path / "map.h5", island(radius), levels=5, probes=100)
    assert found.attrs["probes_wrong"] == 0 and found.sizes["border"] == 0
    bound = found.attrs["probes_wrong_share_at_most"]
    count = found.attrs["probes"]
    assert bound == pytest.approx(1 - 0.05 ** (1 / count))  # Clopper and Pearson, of none wrong
    assert np.pi * radius**2 < bound < 0.05


@pytest.mark.slow
def test_a_border_that_never_sharpens_is_called_irregular_and_ends(tmp_path):
    def noisy(x, y):
        noise = np.sin(1e4 * x + 3e4 * y) * np.cos(2.3e4 * x - 1e4 * y) > 0
        return np.where(x < 0.4, 300.0, np.where(noise, 700.0, 300.0))

    coarse_map(tmp_path / "map.h5", engine(noisy))
    found = refined(tmp_path / "map.h5", engine(noisy), levels=8, probes=0)
    irregular = found.kind == CROSSINGS["irregular"]
    x, _ = to_unit(found)
    assert irregular.mean() > 0.5 and (x[irregular] > 0.37).all()
    assert found.attrs["irregular_points"] == irregular.sum()
    assert found.attrs["simulations"] < 5000  # of 263 169 points


def test_a_budget_ends_it_and_says_so(tmp_path):
    path = tmp_path / "map.h5"
    coarse_map(path, engine(disc))
    found = refined(path, engine(disc), levels=6, max_cells=100)
    assert found.attrs["simulations"] == 100 and found.attrs["budget_spent"] == 1
    assert found.attrs["unresolved_points"] == (found.kind == CROSSINGS["unresolved"]).sum() > 0
    wide = found.bracket_high - found.bracket_low
    steps = np.where(found.axis == 0, wide / 80, wide / 0.8) * 8 * 2**6
    np.testing.assert_array_equal(found.kind == CROSSINGS["unresolved"], steps > 1.5)


@pytest.mark.slow
def test_a_resolution_is_held_along_every_axis(tmp_path):
    path = tmp_path / "map.h5"
    coarse_map(path, engine(disc), axes=("attack_angle", "normal_load"))
    found = refined(path, engine(disc), resolution=0.004)
    wide = np.where(found.axis == 0, 80, 25) * 0.004
    assert (found.bracket_high - found.bracket_low <= wide * (1 + 1e-9)).all()
    assert found.attrs["levels"] == 6  # 5 steps of the load must become 250 at least


@pytest.fixture
def uneven(monkeypatch):
    """Speeds listed from 0.1 to 0.9, the last of whose cells has 13/16 of the axis."""
    monkeypatch.setitem(AXES, "belt_speed", {"values": [0.1, 0.15, 0.2, 0.25, 0.9]})


@pytest.mark.usefixtures("uneven")
def test_a_resolution_is_held_where_values_are_listed_unevenly(tmp_path):
    def layers(x, y):
        return np.select([y < 0.1 + 0.02 * x, y < 0.6 + 0.2 * x], [300.0, 700.0], 2000.0)

    coarse_map(tmp_path / "map.h5", engine(layers))
    found = refined(tmp_path / "map.h5", engine(layers), resolution=0.01, on="band")
    largest = found.attrs["bracket_share_belt_speed"]
    found = found.isel(border=found.axis.values == 1)
    wide = (found.bracket_high - found.bracket_low).values / 0.8
    assert wide.max() <= 0.01 * (1 + 1e-9) and 0.005 < largest <= 0.01
    lower = found.belt_speed.values < 0.3
    assert lower.sum() == (~lower).sum() == 9  # of two borders, each in cells of one length
    np.testing.assert_allclose(found.bracket_share[lower], largest / 13)
    np.testing.assert_allclose(found.bracket_share[~lower], largest)


@pytest.mark.usefixtures("uneven")
def test_probes_are_spread_evenly_over_an_axis_of_uneven_values(tmp_path):
    def island(x, y):
        inside = ((x - 0.44) / 0.05) ** 2 + ((y - 0.6) / 0.13) ** 2 < 1
        return np.where(inside, 700.0, 300.0)

    coarse_map(tmp_path / "map.h5", engine(island))
    found = refined(tmp_path / "map.h5", engine(island), levels=7, probes=3000)
    met, area = found.attrs["probes_wrong"] / found.attrs["probes"], np.pi * 0.05 * 0.13
    assert met == pytest.approx(area, abs=4 * np.sqrt(area / 3000))
    assert area < found.attrs["probes_wrong_share_at_most"]


def test_a_share_of_a_geometric_axis_is_of_its_logarithm_and_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(AXES, "belt_speed", AXES["belt_speed"] | {"spacing": "geometric"})
    path = tmp_path / "map.h5"
    coarse_map(path, engine(disc))
    found = refined(path, engine(disc), resolution=0.02)
    found = found.isel(border=found.axis.values == 1)
    wide = np.log(found.bracket_high / found.bracket_low) / np.log(9)
    np.testing.assert_allclose(wide, 1 / 64)
    assert main(["info", str(path)]) == 0
    assert "attack_angle 1/64, belt_speed 1/64 of its logarithm" in capsys.readouterr().out


def test_only_the_box_is_looked_at(tmp_path):
    path = tmp_path / "map.h5"
    coarse_map(path, engine(disc))
    found = refined(path, engine(disc), levels=4, box={"attack_angle": (-30, -5)})
    assert found.sizes["border"] > 5
    assert ((found.attack_angle >= -30) & (found.attack_angle <= 0)).all()
    assert found.attrs["map_cells"] == 4 * 9  # of the box, as the grid that it stands for
    assert found.attrs["full_grid_cells"] == (3 * 2**4 + 1) * (8 * 2**4 + 1)


@pytest.mark.slow
def test_answers_that_are_not_settled_are_asked_with_a_longer_window(tmp_path):
    """A border that depends on the window: the short one sees it elsewhere, and knows it."""

    def settled(window, x, y):
        return (np.abs(y - 0.5) > 0.2) | (window > 0.5)

    def evaluate(spec, index, finer=1, room=None):
        at = 0.6 if spec.run.window < 0.5 else 0.5
        pitch = lambda x, y: np.where(y > at, 700.0, 300.0)
        return engine(pitch, settled)(spec, index)

    coarse_map(tmp_path / "map.h5", evaluate)
    shutil.copy(tmp_path / "map.h5", tmp_path / "short.h5")
    found = refined(tmp_path / "map.h5", evaluate, levels=5)
    assert np.abs(to_unit(found)[1] - 0.5).max() < 1 / (8 * 2**5)
    assert found.attrs["lengthened_points"] > 0 and found.attrs["unsettled_points"] == 0
    short = refined(tmp_path / "short.h5", evaluate, levels=5, lengthen=1)
    assert np.abs(to_unit(short)[1] - 0.6).max() < 1 / (8 * 2**5)


def test_points_are_counted_as_unsettled_also_where_no_window_is_lengthened(tmp_path):
    evaluate = engine(disc, lambda window, x, y: y < 0.3)
    for name, box in (("whole", {}), ("part", {"attack_angle": (-30, -10)})):
        path = tmp_path / f"{name}.h5"
        coarse_map(path, evaluate)
        found = refined(path, evaluate, levels=2, lengthen=1, box=box)
        fine = open_map(path, level=2)
        fine = fine.sel(attack_angle=slice(*box.get("attack_angle", (None, None))))
        lost = int(((fine.settled == 0) & (fine.computed == 1)).sum())
        assert found.attrs["unsettled_points"] == lost > 0 == found.attrs["lengthened_points"]


@pytest.mark.slow
def test_the_border_of_what_settles_is_that_of_the_windows_of_the_map(tmp_path):
    """In windows four times as long everything has settled: looked for there, it is nowhere."""
    evaluate = engine(lambda x, y: 0 * x + 700.0, lambda window, x, y: (y > 0.45) | (window > 0.5))
    path = tmp_path / "map.h5"
    coarse_map(path, evaluate)
    found = refined(path, evaluate, levels=3, on="settled")
    assert np.abs(to_unit(found)[1] - 0.45).max() < 1 / (8 * 2**3)
    assert found.attrs["lengthened_points"] == found.attrs["wide_cubes_unsettled"] == 0
    fine = open_map(path, level=3)
    expected = np.linspace(0, 1, 65) > 0.45
    assert (fine.settled.values == expected)[fine.computed == 1].all()


@pytest.mark.slow
def test_counts_are_compared_in_windows_of_one_length(tmp_path):
    """Of a motion that never settles: a window four times as long has four times the count."""
    path, never = tmp_path / "map.h5", engine(disc, lambda *_: 0)

    def counted(y, window):
        return np.floor((5 + 10 * y) * window + 1e-9)  # 1 to 3 in the map's 0.2 s

    def evaluate(spec, index, finer=1, room=None):
        count = counted(unit(spec, index)[1], spec.run.window)
        return never(spec, index) | {"stick_count": count.astype(int)}

    coarse_map(path, evaluate)
    refined(path, evaluate, levels=3)  # its points beside the disc have the longer window
    found = refined(path, evaluate, levels=3, on="stick_count=1.5")
    assert np.abs(to_unit(found)[1] - 0.5).max() < 1 / (8 * 2**3)
    assert found.attrs["lengthened_points"] == found.attrs["wide_cubes_unsettled"] == 0
    fine = open_map(path, level=3)
    expected = counted(np.linspace(0, 1, 65), 0.2 * fine.window_factor.values)
    assert (fine.stick_count.values == expected)[fine.computed == 1].all()
    assert set(np.unique(fine.window_factor)) == {0, 1, 4}
