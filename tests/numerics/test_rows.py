"""Windows written into a record, and trees of lanes as rows."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from wiperjax.numerics import rows
from wiperjax.numerics.rows import Packing, Rows, put


@pytest.fixture
def written():
    rng = np.random.default_rng(3)
    return rng.normal(size=50), jnp.array([40, 0, 7, 21]), jnp.asarray(rng.normal(size=(4, 6)))


def test_windows_are_written_at_their_places(written, monkeypatch):
    record, at, windows = written
    found = jax.jit(put)(*written)
    wanted = record.copy()
    for place, window in zip(at, windows, strict=True):
        wanted[place : place + len(window)] = window
    np.testing.assert_array_equal(found, wanted)
    # and so by what an accelerator does
    monkeypatch.setattr(rows.jax, "default_backend", lambda: "cuda")
    np.testing.assert_array_equal(jax.jit(lambda *x: put(*x))(record, at, windows), wanted)


def test_in_a_loop_no_copy_of_the_record_is_made(written):
    """A copy a lane would make a flush as dear as the record is long."""
    _, at, windows = written
    record = jnp.zeros(1_000_000)

    def often(record):
        return lax.fori_loop(0, 10, lambda k, r: put(r, at + k, windows), record)

    memory = jax.jit(often, donate_argnums=0).lower(record).compile().memory_analysis()
    assert memory.temp_size_in_bytes < record.nbytes / 2


def test_a_tree_comes_back_from_its_rows_with_its_types():
    rng = np.random.default_rng(4)
    lanes = 5
    tree = {
        "time": rng.normal(size=lanes),
        "log": rng.integers(0, 9, (3, lanes)).astype(np.int8),
        "pair": (rng.normal(size=lanes), rng.integers(0, 9, lanes).astype(np.int32)),
        "short": rng.normal(size=(2, lanes)).astype(np.float32),
        "nothing": None,
    }
    packing = Packing.of(jax.eval_shape(lambda: jax.tree.map(jnp.asarray, tree)))
    tables = packing.pack(jax.tree.map(jnp.asarray, tree))
    assert [x.dtype for x in tables] == [x.dtype for x in packing.empty(lanes)]
    assert [x.shape for x in tables] == [x.shape for x in packing.empty(lanes)]
    back = Rows([np.asarray(x) for x in tables], packing).tree()
    wanted = jax.tree.map(lambda x: np.moveaxis(x, -1, 0), tree)
    assert jax.tree.structure(back) == jax.tree.structure(wanted)
    for a, b in zip(jax.tree.leaves(back), jax.tree.leaves(wanted), strict=True):
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)
