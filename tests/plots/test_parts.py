"""Pictures of parts of maps: slices, masks, maps that were joined, and axes in disorder."""

import matplotlib
import numpy as np
import pytest
import xarray as xr

matplotlib.use("Agg")

from wiperjax import plots, preview
from wiperjax.datasets import map_dataset
from wiperjax.plots.style.caption import parameters_text
from wiperjax.specs.load import parse_sweep
from wiperjax.vocabulary.codes import LABELS, MECHANISMS

QUIET, SQUEAL = LABELS["quiet"], LABELS["squeal"]


def a_map(**tables):
    """Angles 0, 5, 10 and speeds 1 to 4: squeal below 3, steady slip from there on."""
    axes = {"attack_angle": {"values": [0, 5, 10]}, "belt_speed": {"values": [1, 2, 3, 4]}}
    run = {"transient": 0.1, "window": 0.1}
    spec = parse_sweep({"axes": axes, "run": run} | tables)
    speed = np.tile([1.0, 2.0, 3.0, 4.0], 3)
    loud = speed < 3
    columns = {
        "label": np.where(loud, SQUEAL, QUIET),
        "mechanism": np.where(loud, MECHANISMS["stick_slip"], MECHANISMS["none"]),
        "belt_speed_rms": speed,
        "velocity_rms": 1.0 * loud,
        "dominant_frequency": np.full(12, 700.0),
        "stick_fraction": 0.5 * loud,
        "slip_fraction": 1 - 0.5 * loud,
        "flight_fraction": np.zeros(12),
    }
    return map_dataset.assemble(spec, columns)


def heading(ax):
    return np.ravel(ax)[0].figure.get_suptitle()


@pytest.mark.parametrize("units", [{}, {"units": "N/m"}])
def test_a_slice_of_joined_maps_is_headed_with_its_own_parameter(units):
    """The attributes of maps that are joined are those of the first."""
    parts = [a_map(blade={"normal_load": load}) for load in (10.0, 25.0)]
    load = xr.DataArray([10.0, 25.0], dims="normal_load", name="normal_load", attrs=units)
    both = xr.concat(parts, load, combine_attrs="override")
    for value in (10, 25):
        assert f"normal load {value} N/m\n" in heading(plots.class_map(both.sel(normal_load=value)))
    beside = both.rename_dims(normal_load="case").isel(case=[0, 1])
    assert "normal load" not in parameters_text(beside)  # no single one


def test_a_slice_is_headed_with_where_it_lies():
    said = heading(plots.along_axis(a_map().isel(belt_speed=2)))
    assert said.splitlines()[1] == "normal load 15 N/m, belt speed 3 m/s"


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({}, []),
        ({"model": "block"}, ["block model"]),
        ({"blade": {"friction": "coulomb"}}, ["coulomb friction"]),
        ({"model": "bar", "blade": {"friction": "coulomb"}}, ["bar model", "coulomb friction"]),
    ],
)
def test_a_heading_names_the_model_and_the_law_that_are_not_the_usual_ones(tables, words):
    said = parameters_text(a_map(**tables)).split(", ")
    assert said == ["normal load 15 N/m", *words]


def test_a_law_of_ones_own_is_named_also_where_it_is_called_as_the_usual_one():
    said = parameters_text(a_map().assign_attrs(friction="mine:Stribeck"))
    assert said.endswith("N/m, Stribeck friction")


@pytest.mark.parametrize("order", [[2, 0, 1], [0, 1, 1]])
def test_an_axis_in_disorder_is_refused_only_where_it_is_drawn(order):
    ds = a_map().isel(attack_angle=order)
    for draw in (
        plots.class_map,
        plots.map_overview,
        lambda ds: plots.value_map(ds, "velocity_rms"),
        lambda ds: plots.along_axis(ds, along="attack_angle"),
    ):
        with pytest.raises(ValueError, match="attack_angle must have values that rise, or fall"):
            draw(ds)
    assert "attack angle" in heading(plots.along_axis(ds, along="belt_speed"))
    assert preview(ds).png and not preview(ds.isel(belt_speed=0)).png
    assert plots.class_map(a_map().isel(attack_angle=[2, 1, 0])).shape == (1,)


@pytest.mark.parametrize("speeds", [slice(None), slice(0, 3)])
def test_a_label_of_axes_in_another_order_is_of_the_same_cells(speeds):
    """`xr.where` orders the axes as its mask does: on a square map other cells were drawn."""
    ds = a_map().isel(belt_speed=speeds)
    broken = (ds["belt_speed"] == 1) & (ds["attack_angle"] == 10)
    turned = xr.where(broken, LABELS["failed"], ds["label"]).assign_attrs(ds["label"].attrs)
    assert turned.dims == ds["label"].dims[::-1]
    ours = ds.assign(label=turned.transpose(*ds["label"].dims))
    turned = ds.assign(label=turned)
    assert (plots.motion(turned) == plots.motion(ours)).all()
    for draw in (plots.regime_map, plots.mechanism_map):
        codes, same = (draw(one)[0].collections[0].get_array() for one in (turned, ours))
        np.testing.assert_array_equal(codes, same)


def test_one_cell_is_refused_as_a_plane():
    cell = a_map().isel(attack_angle=0, belt_speed=0)
    for draw in (plots.class_map, plots.regime_map, plots.mechanism_map):
        with pytest.raises(
            ValueError, match="^a map needs at least two axes of more than one number"
        ):
            draw(cell)


def test_maps_that_were_joined_over_texts_are_drawn_for_each_of_them():
    """Two laws or two solvers: a text could not be converted to a number."""
    laws = xr.Variable("law", ["coulomb", "stribeck"])
    both = xr.concat([a_map(), a_map()], laws)
    drawn = plots.class_map(both)
    assert [ax.get_title() for ax in drawn] == ["law coulomb", "law stribeck"]
    assert "law stribeck" in heading(plots.value_map(both, "velocity_rms"))
    one = plots.class_map(both.sel(law="coulomb"))
    assert one.shape == (1,) and "law coulomb" in heading(one)
    plots.along_axis(both.isel(belt_speed=0))  # along the angles, though the laws are first
    loads = both.assign_coords(law=["light", "heavy"]).rename(law="normal_load")
    assert "normal load" not in heading(plots.class_map(loads.isel(normal_load=0)))
    says = (
        "^law must have numbers, for a picture along it or a cut at one, but has coulomb; ds.isel"
    )
    for draw in (
        lambda: plots.class_map(both, x="law"),
        lambda: plots.along_axis(both, along="law"),
        lambda: plots.class_map(both, at={"law": 1}),
    ):
        with pytest.raises(ValueError, match=says):
            draw()
    stacked = a_map().stack(case=("attack_angle", "belt_speed"))
    with pytest.raises(ValueError, match="^a map needs at least two axes of more than one number"):
        plots.class_map(stacked)
    with pytest.raises(ValueError, match=r"^case must have numbers, .*, but has \(0.0, 1.0\); ds"):
        plots.along_axis(stacked, along="case")


def test_an_axis_of_laws_or_models_is_not_that_of_the_first_map():
    """The attributes of joined maps are the first's: `coulomb friction, friction stribeck`."""
    parts = [a_map(blade={"friction": law}) for law in ("coulomb", "stribeck")]
    assert "coulomb friction" in heading(plots.class_map(parts[0]))
    both = xr.concat(parts, xr.Variable("friction", ["coulomb", "stribeck"]))
    assert "coulomb" not in heading(plots.class_map(both))
    assert "stribeck" in heading(plots.class_map(both.sel(friction="stribeck")))
    assert "coulomb" not in heading(plots.class_map(both.sel(friction="stribeck")))


def test_a_title_is_no_formula():
    """Of `$5 and $6` the signs were gone, and what is between them in italics."""
    title = "costs $5 and $6"
    drawn = np.ravel(plots.class_map(a_map(title=title)))[0].figure
    assert drawn._suptitle.get_text().startswith(r"costs \$5 and \$6")
    assert not matplotlib.cbook.is_math_text(drawn._suptitle.get_text())


def test_a_selection_of_nothing_is_refused_by_the_name_of_its_axis():
    falling = a_map().sortby("attack_angle", ascending=False)
    nothing = falling.sel(attack_angle=slice(0, 5))
    for draw in (plots.class_map, plots.map_overview, plots.along_axis):
        with pytest.raises(
            ValueError, match=r"^attack_angle must have values, .* slice\(high, low"
        ):
            draw(nothing)
    assert plots.class_map(falling.sel(attack_angle=slice(5, 0))).shape == (1,)


def test_cells_that_are_masked_are_left_blank():
    """They are neither slip, nor quiet, nor an error."""
    ds = a_map()
    masked = ds.where(ds["belt_speed"] > 1)
    for draw in (plots.class_map, plots.regime_map, plots.mechanism_map):
        (ax,) = draw(masked)
        codes = ax.collections[0].get_array().reshape(4, 3)
        assert np.ma.getmaskarray(codes)[0].all() and not np.ma.getmaskarray(codes)[1:].any()
    shares = plots.along_axis(masked, along="belt_speed")[2].patches
    tops = [band.get_data().values for band in shares]
    assert np.isnan(tops).all(axis=0).tolist() == [True, False, False, False]
