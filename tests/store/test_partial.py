"""Unfinished sweeps as maps."""

import numpy as np
import pytest
import xarray as xr
from stub_sweep import evaluate, fill, make_spec, open_store, whole

from wiperjax.cli import main
from wiperjax.machine.files import StoreError
from wiperjax.maps.verify import verify
from wiperjax.store import partial
from wiperjax.store.manifest import parts_of
from wiperjax.store.whole import open_map
from wiperjax.vocabulary import cf


def test_a_name_that_no_map_has_is_refused_before_the_first_block(tmp_path):
    spec, path = make_spec(), tmp_path / "map.h5"
    with open_store(path, spec):
        pass
    with pytest.raises(StoreError, match="'labl' is not in this file; did you mean label"):
        open_map(parts_of(path), ["labl"])
    asked = ["label", "belt_speed", "d_velocity_rms_d_belt_speed"]
    assert list(open_map(parts_of(path), asked).data_vars) == ["done"]


def test_an_unfinished_store_opens_with_a_mask(tmp_path, capsys):
    spec, path = make_spec(), tmp_path / "map.h5"
    with open_store(path, spec) as store:
        fill(store, spec, [1, 7])
        ds = partial.open_partial(parts_of(path))  # while it is locked by its writer
    cells = np.zeros(385, dtype=bool)
    cells[50:100] = cells[350:] = True
    np.testing.assert_array_equal(ds.done.values.ravel(), cells)
    expected = whole(spec)
    for name in ("stick_fraction", "steps", "label"):
        found = ds[name].values.ravel()
        np.testing.assert_array_equal(found[cells], expected[name].values.ravel()[cells])
        assert (np.isnan(found) if found.dtype.kind == "f" else found == -1)[~cells].all()
    assert cf.flag_names(ds.label)[-1] == "not_computed" and ds.attrs["cells_done"] == 85
    assert list(partial.open_partial(parts_of(path), ["label"]).data_vars) == ["label", "done"]
    with pytest.raises(StoreError, match="not the folder of an unfinished sweep"):
        partial.open_partial(tmp_path)
    xr.testing.assert_identical(open_map(parts_of(path)), ds)
    with pytest.raises(StoreError, match="is not a finished map"):
        verify(parts_of(path), evaluate=evaluate)
    with pytest.raises(StoreError, match="not the folder of an unfinished sweep"):
        verify(tmp_path, evaluate=evaluate)
    assert main(["info", str(parts_of(path))]) == 0
    said = capsys.readouterr().out
    assert "cells_done: 85" in said and "squeal " in said and "not_computed" not in said
