"""A refinement by the engine itself, from the command line to the picture."""

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")

from wiperjax.cli import main
from wiperjax.maps.cells.batch import Settings
from wiperjax.maps.refine.grid import Grid
from wiperjax.maps.refine.points import Points
from wiperjax.maps.verify import verify
from wiperjax.specs.load import load_sweep
from wiperjax.store.whole import borders, open_map
from wiperjax.vocabulary import cf, codes

FILE = """
[axes]
attack_angle = { start = -20, stop = 20, num = 5 }
belt_speed = { start = 0.2, stop = 0.8, num = 4 }
[run]
transient = 0.1
window = 0.1
"""


@pytest.mark.parametrize("window", [0.1, 100.0])
def test_points_are_computed_by_the_program_of_their_map_however_many_are_asked_for(
    window, tmp_path
):
    """Of many points, more than 100 s of motion, it was another program than of the few that
    `verify` computes again: it told of points that differ, where nothing was damaged."""
    file = tmp_path / "map.toml"
    file.write_text(FILE.replace("window = 0.1", f"window = {window}"))
    spec = load_sweep(file)
    of_map = Settings.of(spec, 4096)
    for count in (1, 64, 4096):
        assert Settings.of(Points(spec, Grid(spec.axes, 8), np.arange(count)), 4096) == of_map


@pytest.mark.long
def test_a_sweep_with_borders_from_the_command_line(tmp_path, capsys):
    file, path = tmp_path / "map.toml", tmp_path / "map.h5"
    file.write_text(FILE)
    words = ["sweep", str(file), "-o", str(path), "--workers", "1", "--refine", "3"]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "borders of label" in said and "bracket, as a share of the axis" in said
    assert path.with_suffix(".png").exists()
    found = borders(path)
    assert found.sizes["border"] > 4 and not (found.side_low == found.side_high).any()
    with open_map(path, ["label"], level=3) as fine:
        done = fine.where(fine.computed == 1)
        for low, high, axis, angle, speed, side in zip(
            *(found[n].values for n in ("bracket_low", "bracket_high", "axis")),
            *(found[n].values for n in ("attack_angle", "belt_speed", "side_high")),
            strict=True,
        ):
            assert low < high
            along = {"attack_angle": angle, "belt_speed": speed}
            along[("attack_angle", "belt_speed")[axis]] = high
            assert done.label.sel(along, method="nearest") == side
    report = verify(path, cells=8)
    assert report.identical and report.points == 8
    # the linear border of steady slip takes no simulation, and changes no point
    assert main(["refine", str(path), "--levels", "3", "--on", "growth_rate=0"]) == 0
    linear = borders(path)
    assert set(np.unique(linear.kind)) == {codes.CROSSINGS["smooth"]}
    assert cf.flag_names(linear.side_low)[1] == "above"
    assert verify(path, cells=8).identical
