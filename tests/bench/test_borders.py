"""The rivals of a refined map, where the truth is a formula."""

import numpy as np
import pytest
from border_maps import coarse_map, engine, refined

from wiperjax.maps.refine.replay import replay
from wiperjax_bench.measurements.borders import full_grids, octrees


def disc(x, y):
    return np.where((x - 0.45) ** 2 + (y - 0.5) ** 2 < 0.3**2, 700.0, 300.0)


@pytest.mark.slow
def test_an_octree_tells_what_a_full_grid_tells_for_fewer_simulations(tmp_path):
    path = tmp_path / "map.h5"
    coarse_map(path, engine(disc))
    found = refined(path, engine(disc), levels=5)
    search, _ = replay(path)
    unit = np.random.default_rng(3).random((2000, 2))
    truth = np.where(disc(*unit.T) > 500, 1, 4)
    places = unit * (search.grid.shape - 1)
    full, tree = list(full_grids(search, places)), list(octrees(search, places))
    assert [row[2] for row in full] == [(8 * 2**k + 1) ** 2 for k in range(1, 6)]
    for one, two in zip(full, tree, strict=True):
        assert one[1] == two[1] and two[2] < one[2]
        np.testing.assert_array_equal(one[3], two[3])  # the disc is larger than a cell
    wrong = [float((row[3] != truth).mean()) for row in full]
    assert wrong[0] > 0.02 > 0.005 > wrong[-1]
    own = float((search.answer(places)[0] != truth).mean())
    assert own <= wrong[-1] and found.attrs["simulations"] - 1000 < tree[-1][2]
