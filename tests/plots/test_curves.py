"""Pictures of curves in two parameters: alone, over a map, and never over another blade's."""

import json

import matplotlib
import numpy as np
import pytest
from pictures import inside_the_page, legends

matplotlib.use("Agg")

import wiperjax  # noqa: E402
from wiperjax import plots  # noqa: E402
from wiperjax.cli import main  # noqa: E402
from wiperjax.cycles import Curve, curves_dataset  # noqa: E402
from wiperjax.cycles.curve.equations import Facts  # noqa: E402
from wiperjax.cycles.curve.walk import Mark  # noqa: E402
from wiperjax.datasets import map_dataset  # noqa: E402
from wiperjax.datasets.branch_dataset import TAKEN, with_curves  # noqa: E402
from wiperjax.plots.curves import check_drawn, curve_page  # noqa: E402
from wiperjax.specs.load import parse_sweep  # noqa: E402
from wiperjax.store.whole import write_dataset  # noqa: E402
from wiperjax.vocabulary.codes import CurveEnd  # noqa: E402

SPEEDS, LOADS = np.array([0.2, 0.4, 0.6, 0.8]), np.array([5.0, 10.0, 15.0])


@pytest.fixture(scope="module")
def curves():
    """A Hopf curve that ends as it should and a fold that fails, of a blade at 5 degrees."""
    blade = wiperjax.Wiper(attack_angle=np.deg2rad(5.0))
    names = ("belt_speed", "normal_load")
    at_rest = Facts(np.zeros(4), 0.0, 1e-3, {"bautin": 0.2})
    cycle = Facts(np.zeros(4), 1e-4, 1e-3, {})
    hopf = np.stack([np.linspace(0.4, 0.5, 5), np.linspace(5, 15, 5)], axis=1)
    fold = hopf[:3] + [0.2, 0.0]
    whole = (CurveEnd.RANGE, "the end of the range of normal_load")
    lost = (CurveEnd.FAILED, "no solution was found at the smallest step")
    mark = Mark("bautin", "the onset turns from soft to hard", 2)
    return curves_dataset(
        [
            Curve("hopf", blade, names, hopf, [at_rest] * 5, [mark], (whole, whole)),
            Curve("fold", blade, names, fold, [cycle] * 3, [], (whole, lost)),
        ]
    ).assign_attrs(fixed=json.dumps({"attack_angle": 5.0}))


def a_map(**axes):
    """Quiet cells over belt speed and load, and over what else is an axis."""
    every = {
        **{name: {"values": values} for name, values in axes.items()},
        "normal_load": {"values": list(LOADS)},
        "belt_speed": {"values": list(SPEEDS)},
    }
    blade = {} if axes else {"attack_angle": 5.0}
    spec = parse_sweep({"axes": every, "blade": blade, "run": {"transient": 0.1, "window": 0.1}})
    cells = np.prod([len(axis["values"]) for axis in every.values()])
    numbers = {"velocity_rms": np.zeros(cells), "growth_rate": np.full(cells, -1.0)}
    return map_dataset.assemble(spec, {"label": np.zeros(cells, int), **numbers})


def lines(ax):
    return {line.get_label() for line in ax.lines}


def test_curves_are_drawn_over_a_map_that_is_masked(curves):
    """Each cell had a copy of them, or none, and the picture was a TypeError."""
    ds = plots.with_curves(a_map(), curves)
    (ax,), (same,) = (plots.class_map(one) for one in (ds.where(ds["belt_speed"] > 0.3), ds))
    assert [str(line) for line in ax.lines] == [str(line) for line in same.lines] != []


def test_curves_of_a_dataset_say_where_each_begins(curves):
    assert curves["row_size"].values.tolist() == [5, 3] and curves.sizes["point"] == 8
    assert curves["special_point"].values.tolist() == [2]
    np.testing.assert_allclose(curves["belt_speed"][5:8], [0.6, 0.625, 0.65])
    assert curves["lyapunov"].values[:5] == pytest.approx(0.2)
    assert np.isnan(curves["lyapunov"].values[5:]).all()
    names = {str(name) for name in (*curves.variables, *curves.dims)}
    assert names - {"belt_speed", "normal_load"} <= TAKEN
    with pytest.raises(ValueError, match="curves must hold at least one curve"):
        curves_dataset([])


def test_curves_lie_over_a_map_where_they_belong(curves):
    (ax,) = plots.class_map(plots.with_curves(a_map(), curves))
    (text,) = legends(ax.figure)
    words = [entry.get_text() for entry in text.get_texts()]
    assert "steady slip loses stability (Hopf)" in words
    assert "two cycles merge (fold)" in words and "onset turns soft or hard (Bautin)" in words
    hopf = next(line for line in ax.lines if line.get_label().startswith("steady slip"))
    np.testing.assert_allclose(hopf.get_xdata(), np.linspace(5, 15, 5))  # load is across
    np.testing.assert_allclose(hopf.get_ydata(), np.linspace(0.4, 0.5, 5))
    assert inside_the_page(ax.figure) == []
    low, high = ax.get_ylim()
    assert low < SPEEDS[0] and high < 1.0  # those of the map


def test_curves_are_drawn_in_the_slice_of_their_blade_alone(curves):
    ds = plots.with_curves(a_map(attack_angle=[0.0, 5.0]), curves)
    options = {"x": "belt_speed", "y": "normal_load", "panel": "attack_angle"}
    zero, five = plots.class_map(ds, **options)
    assert not zero.lines and "two cycles merge (fold)" in lines(five)
    (ax,) = plots.class_map(ds, x="belt_speed", y="attack_angle")[:1]
    assert not ax.lines  # over other parameters
    (text,) = legends(ax.figure)  # which names no curve that is not there
    assert [entry.get_text() for entry in text.get_texts()] == ["quiet (100.0%)"]
    says = r"with --x belt_speed --y normal_load, where attack_angle is 5; this picture 'classes'"
    with pytest.raises(ValueError, match=says):
        check_drawn(ds, ax.figure, "classes")
    check_drawn(ds, five.figure, "classes")


def test_curves_of_another_blade_or_over_other_parameters_are_refused(curves):
    other = curves.assign_attrs(fixed=json.dumps({"attack_angle": -5.0}))
    with pytest.raises(ValueError, match="attack_angle is -5 for them and 5 in the map"):
        plots.with_curves(a_map(), other)
    plane = a_map().isel(normal_load=0, drop=True)
    with pytest.raises(ValueError, match="the map has no axis normal_load"):
        plots.with_curves(plane, curves)
    with pytest.raises(ValueError, match="curves must hold curves"):
        plots.with_curves(a_map(), a_map())


def test_a_page_of_curves_is_not_headed_by_what_its_axes_run_through(curves):
    about = {"attack_angle": 5.0, "belt_speed": 0.5, "normal_load": 10.0, "title": "two curves"}
    units = {"parameter_units": "attack_angle: degrees; belt_speed: m/s; normal_load: N/m"}
    branch = with_curves(a_map().drop_vars("label").assign_attrs(about | units), curves)
    (ax,) = curve_page(branch).axes
    said = ax.figure.get_suptitle()
    assert "two curves" in said and "attack angle 5°" in said and "normal load" not in said
    assert ax.get_ylabel() == "normal load (N/m)"
    assert next(one for one in ax.lines if one.get_label() == "the branch").get_ydata()[0] == 10


@pytest.mark.slow
def test_commands_draw_and_tell_of_the_curves_in_a_file(curves, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ds = with_curves(a_map().drop_vars("label").drop_dims("belt_speed"), curves)
    about = {"over": "belt_speed", "ends": "", "normal_load": 10.0}
    empty = {f"special_{key}": ("special", np.array([], object)) for key in ("kind", "detail")}
    empty |= {"special_parameter": ("special", np.zeros(0)), "stable": ("point", np.zeros(2))}
    empty |= {"trivial_error": ("point", np.zeros(2))}
    empty["belt_speed"] = ("point", SPEEDS[:2], {"units": "m/s", "long_name": "belt speed"})
    write_dataset(ds.assign(empty).assign_attrs(about), "branch.h5")
    write_dataset(a_map(), "map.h5")
    assert main("plot map.h5 -p classes --curves branch.h5 -o one.png".split()) == 0
    assert main("plot branch.h5 -p curves -o two.png".split()) == 0
    capsys.readouterr()
    assert main(["info", "branch.h5"]) == 0
    said = capsys.readouterr().out
    assert "curve    fold: 3 points" in said
    assert "ends at belt_speed 0.65 m/s, normal_load 10 N/m: no solution was found" in said
    assert "(failed)" in said and "belt_speed 0.45 m/s, normal_load 10 N/m: bautin" in said
    assert main("plot branch.h5 --curves branch.h5 -o three.png".split()) == 1
    assert "curves are drawn over a map, and branch.h5 holds a branch" in capsys.readouterr().err
    write_dataset(curves, "alone.h5")
    assert main("plot map.h5 -p classes --curves alone.h5 -o one.png --force".split()) == 0
    capsys.readouterr()
    assert main(["info", "alone.h5"]) == 0
    assert "curve    fold: 3 points" in capsys.readouterr().out
    assert main("plot alone.h5 -o three.png".split()) == 1
    assert "alone.h5: holds curves; only a map, a branch, " in capsys.readouterr().err
    assert main("plot map.h5 --curves map.h5 -o three.png".split()) == 1
    assert "curves must hold curves" in capsys.readouterr().err
