"""What a notebook shows of datasets and systems."""

import io

import numpy as np
import xarray as xr
from PIL import Image
from stub_sweep import evaluate, make_spec

import wiperjax
from wiperjax.maps import driver
from wiperjax.plots.preview import preview


def colours(png):
    return set(map(tuple, np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).reshape(-1, 3)))


def test_a_map_is_shown_by_its_classes_and_a_run_by_its_motion(squeal):
    found = preview(driver.sweep(make_spec(), evaluate=evaluate, progress=False))
    assert "map of 385 cells (7 attack_angle x 5 normal_load x 11 belt_speed)" in repr(found)
    assert (0xD5, 0x5E, 0x00) in colours(found.png)  # squeal, as in every picture
    assert "<img" in found._repr_html_()
    found = preview(squeal)
    assert "run of 0.2 s" in repr(found) and "780.8 Hz" in repr(found)
    assert len(colours(found.png)) > 10


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
