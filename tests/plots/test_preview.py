"""What a notebook shows of datasets and systems."""

import io
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from PIL import Image
from stub_sweep import evaluate, make_spec

import wiperjax
from wiperjax.maps import driver
from wiperjax.plots.preview import _shown, preview


def colours(png):
    return set(map(tuple, np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).reshape(-1, 3)))


@pytest.mark.slow
def test_a_map_is_shown_by_its_classes_and_a_run_by_its_motion(squeal):
    found = preview(driver.sweep(make_spec(), evaluate=evaluate, progress=False))
    assert "map of 385 cells (7 attack_angle x 5 normal_load x 11 belt_speed)" in repr(found)
    assert (0xD5, 0x5E, 0x00) in colours(found.png)  # squeal, as in every picture
    assert "<img" in found._repr_html_()
    found = preview(squeal)
    assert "run of 0.2 s" in repr(found) and "780.8 Hz" in repr(found)
    assert len(colours(found.png)) > 10


def test_a_map_of_one_axis_is_a_line_also_one_of_several_starts():
    spec = make_spec().document()
    spec["axes"] = {"belt_speed": spec["axes"]["belt_speed"]}
    line = driver.sweep(spec, evaluate=evaluate, progress=False)
    assert (0xD5, 0x5E, 0x00) in colours(preview(line).png)
    several = line.expand_dims(start=["up", "down"])
    assert "map of 11 cells (11 belt_speed) of 2 starts each" in repr(preview(several))
    assert (0xD5, 0x5E, 0x00) in colours(preview(several).png)
    assert preview(line.isel(belt_speed=[0])).png == b""
    assert repr(preview(line.isel(belt_speed=0))).endswith("map of 1 cell")
    drawn = line.expand_dims({"raster_time": 4}, axis=-1)["label"].rename("regime_raster")
    assert "map of 11 cells (11 belt_speed)" in repr(preview(line.assign(regime_raster=drawn)))


def test_the_extension_shows_maps_with_their_picture_and_nothing_else():
    shown = {}
    html = SimpleNamespace(for_type=shown.__setitem__, pop=shown.pop)
    shell = SimpleNamespace(display_formatter=SimpleNamespace(formatters={"text/html": html}))
    wiperjax.load_ipython_extension(shell)
    ds = driver.sweep(make_spec(), evaluate=evaluate, progress=False)
    picture, page = preview(ds)._repr_html_(), shown[xr.Dataset](ds)
    assert page.startswith(picture) and "xarray.Dataset" in page[len(picture) :]
    other = xr.Dataset({"label": ("x", [1, 2])})
    assert "<img" not in shown[xr.Dataset](other)
    wiperjax.unload_ipython_extension(shell)
    assert shown == {}


@pytest.mark.slow
def test_what_a_notebook_shows_does_not_raise_whatever_was_made_of_it(squeal):
    """A mean, two variables, no cell, a run of few samples: each was a traceback."""
    ds = driver.sweep(make_spec(), evaluate=evaluate, progress=False)
    line = ds.isel(attack_angle=0, normal_load=0)
    run = squeal.isel(time=slice(0, 20000))
    thin = run[["velocity", "regime"]].assign_attrs(title="thin")
    made = {
        "mean": ds.mean("attack_angle", keep_attrs=True),
        "one variable": line[["label"]],
        "no cell": ds.isel(belt_speed=slice(0, 0)),
        "turned round": run.isel(time=slice(None, None, -1)),
        "not even": run.isel(time=[*range(1000), *range(2000, 3000)]),
        "two variables": thin,
        "masked": run.where(run.time > 0.1),
    }
    for what, each in made.items():
        assert "xarray.Dataset" in _shown(each), what
    few = squeal.isel(time=slice(0, 4), event=slice(0, 2))  # as of a run that collapsed at once
    assert len(colours(preview(few).png)) > 10 and "; " not in repr(preview(few))
    assert repr(preview(thin)) == "thin: 10001 time x 2 axis"  # of which nothing can be heard


def test_a_part_of_a_run_is_said_to_be_as_long_and_to_have_the_events_that_are_left():
    """It was called by its end, with the events of the whole run."""
    time = np.linspace(0.0, 0.1, 101)
    run = xr.Dataset({name: ("time", 0.0 * time) for name in ("position", "velocity", "regime")})
    run = run.assign_coords(time=time).assign(event_time=("event", [0.01, 0.0445, 0.0455, 0.09]))
    assert repr(preview(run)) == "dataset: run of 0.1 s, 4 events"
    part = run.isel(time=slice(40, 46))
    assert repr(preview(part)) == "dataset: run of 0.005 s, 1 events"


def test_a_mean_over_cells_is_no_map_any_more():
    """It was called a map of one cell."""
    ds = driver.sweep(make_spec(), evaluate=evaluate, progress=False)
    found = preview(ds.mean())
    assert "no map any more: label must be whole codes, but had " in repr(found)
    assert found.png == b""
    assert "map of 385 cells" in repr(preview(ds.where(ds["belt_speed"] > 0.2)))


def test_words_of_a_dataset_are_words_in_a_notebook():
    found = preview(xr.Dataset(attrs={"title": "<script>alert(1)</script>"}))
    assert found.png == b"" and "<script>" not in found._repr_html_()


def test_a_blade_is_a_table_of_its_parameters_with_units():
    page = wiperjax.Wiper(belt=wiperjax.SteadyBelt(0.3), normal_load=17.5)._repr_html_()
    for words in ("Wiper", "normal_load", "17.5", "N/m", "belt.speed", "0.3", "attack angle"):
        assert f">{words}<" in page
    assert "stribeck_speed" in page
    coulomb = wiperjax.Wiper(friction=wiperjax.Coulomb(0.5))._repr_html_()
    assert "stribeck_speed" not in coulomb and "friction.static" in coulomb


def test_a_belt_and_a_law_are_tables_too():
    """They were shown as they are written, without a unit."""
    belt = wiperjax.WipingBelt(0.5, 1.0)._repr_html_()
    for words in ("WipingBelt", "amplitude", "0.5", "m/s", "belt speed", "Hz"):
        assert f">{words}<" in belt
    law = wiperjax.Stribeck(1.0, 0.5, 0.4)._repr_html_()
    for words in ("Stribeck", "static", "static friction coefficient", "stribeck_speed", "m/s"):
        assert f">{words}<" in law
