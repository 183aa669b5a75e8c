"""Trees of lanes as rows of tables."""

import pickle

import jax
import jax.numpy as jnp
import numpy as np

from wiperjax.numerics.rows import Packing, Rows


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
    found = Rows([np.asarray(x) for x in tables], packing)
    # a program that is kept keeps how its answers are put together (`numerics.kept`)
    leaves, structure = jax.tree.flatten(found)
    back = jax.tree.unflatten(pickle.loads(pickle.dumps(structure)), leaves).tree()
    wanted = jax.tree.map(lambda x: np.moveaxis(x, -1, 0), tree)
    assert jax.tree.structure(back) == jax.tree.structure(wanted)
    for a, b in zip(jax.tree.leaves(back), jax.tree.leaves(wanted), strict=True):
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)
