"""`bench speed --device`: what is asked for and is not there is one line; the text has its rows."""

import jax
import pytest
import xarray as xr

from wiperjax import cli
from wiperjax_bench.measurements import device
from wiperjax_bench.reports import device_text


@pytest.mark.parametrize(
    "kind, said",
    [("tpu", "must be cpu or gpu, but was 'tpu'"), ("gpu", "it computes on cpu; install jax with")],
)
def test_a_device_that_is_not_there_is_one_line(kind, said, tmp_path, capsys):
    if jax.default_backend() == kind:
        pytest.skip("it is there")
    assert cli.main(["bench", "speed", "--device", kind, "-o", str(tmp_path / "speed.h5")]) == 1
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_the_text_has_a_row_for_each_batch():
    names = ("rtol", "cells", "lanes", "first_call", "state_error", "event_time_error", "failed")
    names += ("wrong_events", "wall", "wall_low", "wall_high", "cpu", "per_second", "occupancy")
    numbers = {name: ("row", [0.5, 0.25]) for name in (*names, "turn")}
    attrs = {"device": "H200", "machine": "m", "created": "now", "duration": 0.1, "repeats": 3}
    coords = {"method": ("row", ["engine Tsit5", "engine Dopri8"])}
    text = device_text.text(xr.Dataset(numbers, coords=coords, attrs=attrs))
    assert "H200 (m), 0.1 s of motion" in text
    assert text.count("| engine ") == 2 and "| 5e+05 |" in text


def test_the_processor_is_a_device():
    if jax.default_backend() == "cpu":
        assert device.found("cpu") == jax.devices()[0].device_kind
