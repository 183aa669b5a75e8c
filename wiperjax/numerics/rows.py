"""Trees of numbers as rows of tables, one row for each trajectory of a batch.

A scatter is a loop over the lanes, and what leaves a compiled program is cut out by a function of
its own: both are dear to compile for each of a score of numbers.
"""

import math
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np


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


@partial(jax.tree_util.register_dataclass, data_fields=["tables"], meta_fields=["packing"])
@dataclass(frozen=True)
class Rows:
    """Tables, and the tree that their rows are of: as tables they leave a compiled program, in
    which each leaf of the tree would be cut out by a function of its own.
    """

    tables: list
    packing: Packing

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
