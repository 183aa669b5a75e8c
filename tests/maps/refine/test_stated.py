"""What a refinement states is true: wrong answers lie within the stated bracket of a border."""

import numpy as np
import pytest
import xarray as xr
from border_maps import AXES, border_spec, coarse_map, engine, places_of, refined

from wiperjax.cli import main
from wiperjax.cli.refine import print_borders
from wiperjax.maps.refine import judge
from wiperjax.maps.refine.cubes import Cubes
from wiperjax.maps.refine.grid import Grid
from wiperjax.maps.refine.judge import REASONS
from wiperjax.maps.refine.replay import replay
from wiperjax.vocabulary.codes import BANDS, CROSSINGS

PLANE = ("attack_angle", "belt_speed")


def hard(x, y, z):
    """Three answers that meet in a curve, all borders bent, and a ball without order."""
    ball = (x - 0.2) ** 2 + (y - 0.25) ** 2 + (z - 0.25) ** 2 < 0.12**2
    noise = np.sin(1e4 * x + 3e4 * y) * np.cos(2.3e4 * z - 1e4 * y) > 0
    dome = (x - 0.6) ** 2 + (y - 0.5) ** 2 + (z - 0.5) ** 2 < 0.35**2
    pitch = np.where(dome, np.where(z > 0.55 + 0.1 * np.sin(3 * x), 2000.0, 700.0), 300.0)
    return np.where(ball, np.where(noise, 700.0, 300.0), pitch), np.where(dome, 0.4, 0.0)


def flat(x, y):
    return hard(x, 0.25 + 0 * x, y)


def asked(path, told, names, count=20_000):
    """The finished search of a map, which of random points it tells wrong, how deep within their
    answers they lie, and which are said to be right.
    """
    search, _ = replay(path)
    unit = np.random.default_rng(3).random((len(names), count))
    values = {
        n: AXES[n]["start"] + u * (AXES[n]["stop"] - AXES[n]["start"])
        for n, u in zip(names, unit, strict=True)
    }
    places = places_of(search.grid, values)
    pitch = told(*unit)[0]
    truth = np.select([pitch < 500, pitch < 1000], [BANDS["low"], BANDS["squeal"]], BANDS["high"])
    code, depth = search.answer(places)
    return search, code != truth, depth, search.sure(places)


@pytest.mark.long
@pytest.mark.parametrize(("told", "names"), [(hard, tuple(AXES)), (flat, PLANE)])
def test_every_wrong_answer_lies_within_the_stated_bracket(tmp_path, capsys, told, names):
    path, calls = tmp_path / "map.h5", []

    def counted(spec, index, finer=1, room=None):
        calls.append(len(index))
        return engine(told)(spec, index)

    coarse_map(path, engine(told), axes=names)
    found = refined(path, counted, levels=5, on="band", probes=1000)
    search, wrong, depth, sure = asked(path, told, names)
    assert (wrong & (depth > 2)).sum() > 5  # so one bracket would not be true everywhere,
    assert not (wrong & sure).any()  # and what is stated is
    said = found.attrs
    assert sure.mean() > 0.7 and 0 < said["wide_cubes_volume_share"] < 0.3
    for reason in ("irregular", "meeting"):
        assert said[f"wide_cubes_{reason}"] > 0
    assert said["wide_cubes"] == sum(said[f"wide_cubes_{reason}"] for reason in REASONS)
    assert said["sure_probes"] > 500 and said["sure_probes_wrong_share_at_most"] < 0.01
    plain = np.array([said[f"bracket_share_{name}"] for name in names])[found.axis]
    widest = np.array([said[f"widest_bracket_share_{name}"] for name in names])[found.axis]
    wide = found.bracket_share > plain * (1 + 1e-9)
    assert (found.bracket_share >= plain).all() and (found.bracket_share <= widest).all()
    assert wide.sum() == said["wide_points"] > 0 and not wide.all()
    assert main(["info", str(path)]) == 0
    shown = capsys.readouterr().out
    assert f"in {said['wide_cubes']} of {len(search.cubes)} cubes" in shown
    assert f"{said['wide_points']} points have such a cube, at most attack_angle 1/8" in shown
    assert sum(calls) == said["simulations"] and len(calls) < 45  # few requests, and so large ones


@pytest.mark.long
@pytest.mark.parametrize("most", [1, 30, 100, 300, 600])
def test_it_is_true_too_where_the_budget_ended_it(tmp_path, most):
    def disc(x, y):
        inside = (x - 0.45) ** 2 + (y - 0.5) ** 2 < 0.3**2
        return np.where(inside, 700.0, 300.0), np.zeros_like(x)

    coarse_map(tmp_path / "map.h5", engine(disc))
    found = refined(tmp_path / "map.h5", engine(disc), levels=6, on="band", max_cells=most)
    assert found.attrs["budget_spent"] == 1 and found.attrs["wide_cubes_unresolved"] > 0
    _, wrong, _, sure = asked(tmp_path / "map.h5", disc, PLANE)
    assert wrong.any() and not (wrong & sure).any()


def test_a_border_beside_answers_that_never_settle_is_no_sharper_than_its_cubes(tmp_path):
    never = engine(lambda x, y: (np.where(y > 0.3 + 0.1 * x, 700.0, 300.0), 0.0), lambda *_: 0)
    coarse_map(tmp_path / "map.h5", never)
    found = refined(tmp_path / "map.h5", never, levels=4, on="band")
    said = found.attrs
    assert said["wide_cubes"] == said["wide_cubes_unsettled"] == said["cubes_with_border"] > 0
    assert said["sure_probes"] == 0 and said["border_probes"] > 400
    np.testing.assert_allclose(found.bracket_share, 1 / 8)


def test_every_reason_is_told(monkeypatch, capsys):
    monkeypatch.setattr(judge, "REASONS", {"bent": "whose border is no plane", "new": "of another"})
    said = {"on": "band", "linear_points": 1, "cubes": 5, "wide_cubes": 3, "wide_points": 0}
    said |= {"wide_cubes_bent": 1, "wide_cubes_new": 2, "wide_cubes_volume_share": 0.5}
    said |= {f"{kind}_points": 0 for kind in CROSSINGS} | {"unsettled_points": 0, "budget_spent": 0}
    print_borders(xr.Dataset(coords={"border": []}, attrs=said))
    assert "is the cube: 1 whose border is no plane, 2 of another\n" in capsys.readouterr().out


def test_cubes_that_touch_are_those_whose_corners_are_in_one_another():
    grid = Grid(border_spec(tuple(AXES)).axes, 3)
    cubes = Cubes.of_map(grid, np.zeros(3, int), np.array([3, 3, 3]))
    random = np.random.default_rng(5)
    for _ in range(2):
        cubes = cubes.split((random.random(len(cubes)) < 0.3) & (cubes.size > 2))
    which = random.random(len(cubes)) < 0.03
    low, high = cubes.origin, cubes.origin + cubes.size[:, None]
    meet = (low[:, None] <= high[which]) & (high[:, None] >= low[which])
    np.testing.assert_array_equal(cubes.touching(which), meet.all(axis=-1).any(axis=-1))
    assert len(np.unique(cubes.size)) == 3 and which.any()


@pytest.mark.long
def test_a_border_finer_than_the_smallest_cube_is_not_promised_beside_it_either(tmp_path):
    def rough(x, y, z):
        ripple = 0.03 * np.sin(61 * x + 7) * np.sin(53 * y) * np.sin(47 * z + 1)
        return np.where(z > 0.45 + 0.2 * x + ripple, 700.0, 300.0), 0.0 * x

    path = tmp_path / "map.h5"
    coarse_map(path, engine(rough), axes=tuple(AXES))
    found = refined(path, engine(rough), levels=6, on="band")
    search, wrong, depth, sure = asked(path, rough, tuple(AXES))
    bent = search.why == 1 + list(REASONS).index("bent")
    assert (bent & search.now.pure).any() and found.attrs["wide_cubes_bent"] == bent.sum()
    assert wrong.sum() > 50 and not (wrong & sure).any()
    assert (wrong & np.isinf(depth)).any()  # where no border is seen
