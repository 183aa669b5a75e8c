"""Lanes as rows: windows written into a long record, and trees of numbers as a row each.

XLA's CPU compiler has no place for a scatter inside the one function that a loop becomes
(`jax_settings.COMPILER`): it is compiled apart, and the loop around it run kernel by kernel. So
what is written often is copied in a loop over the lanes, and what is written rarely is few arrays.
"""

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax


def put(record, at, windows):
    """Return ``record`` (n,) with ``windows`` (lanes, w) copied to its places ``at`` (lanes,).

    Of two lanes with the same place the later one stays; on an accelerator, either. ``at`` must be
    in [0, n - w]: what is to be dropped needs a place of its own.
    """
    if jax.default_backend() != "cpu":
        numbers = lax.ScatterDimensionNumbers((1,), (), (0,))
        return lax.scatter(record, at[:, None], windows, numbers)

    def put_one(lane, record):
        return lax.dynamic_update_slice(record, windows[lane], (at[lane],))

    return lax.fori_loop(0, windows.shape[0], put_one, record)


class Packing(NamedTuple):
    """How a tree of numbers with lanes last becomes rows, one table for each of their types."""

    tree: Any  # its structure
    shapes: tuple[tuple[int, ...], ...]  # of each leaf, for one lane
    types: tuple[np.dtype, ...]

    @classmethod
    def of(cls, shapes) -> "Packing":
        """Return that of a tree, or of its shapes and types."""
        leaves, tree = jax.tree.flatten(shapes)
        types = tuple(np.dtype(x.dtype) for x in leaves)
        return cls(tree, tuple(x.shape[:-1] for x in leaves), types)

    @property
    def kinds(self) -> tuple[np.dtype, ...]:
        """The types, one for each table."""
        return tuple(dict.fromkeys(self.types))

    def empty(self, rows: int) -> list:
        """Return tables of ``rows`` rows of zeros."""
        sizes = {kind: 0 for kind in self.kinds}
        for shape, kind in zip(self.shapes, self.types, strict=True):
            sizes[kind] += math.prod(shape)
        return [jnp.zeros((rows, size), kind) for kind, size in sizes.items()]

    def pack(self, tree) -> list:
        """Return the tables of a tree, a row a lane."""
        leaves = [x.reshape(-1, x.shape[-1]) for x in jax.tree.leaves(tree)]

        def table(kind):
            return jnp.concatenate(
                [x for x, t in zip(leaves, self.types, strict=True) if t == kind]
            )

        return [table(kind).T for kind in self.kinds]


class Rows(eqx.Module):
    """Tables, and the tree that their rows are of: as tables they leave a compiled program, in
    which each leaf of the tree would be cut out by a function of its own.
    """

    tables: list
    packing: Packing = eqx.field(static=True)

    def tree(self):
        """Return the tree with rows first; of NumPy's tables as views of them."""
        tables, used = dict(zip(self.packing.kinds, self.tables, strict=True)), {}
        leaves = []
        for shape, kind in zip(self.packing.shapes, self.packing.types, strict=True):
            start = used.get(kind, 0)
            used[kind] = start + math.prod(shape)
            leaf = tables[kind][:, start : used[kind]]
            leaves.append(leaf.reshape(leaf.shape[0], *shape))
        return jax.tree.unflatten(self.packing.tree, leaves)
