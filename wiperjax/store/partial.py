"""A map that is not finished, read from its blocks."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from ..datasets import map_dataset
from ..machine.files import StoreError
from ..vocabulary import cf, codes
from ..vocabulary.columns import column_of, derivative, ordered
from ..vocabulary.schema import SCHEMA
from .blocks import BlockStore
from .levels import check_held


class Reader:
    """Reads runs of cells from a store, keeping one block, and adds up the times of blocks."""

    def __init__(self, store: BlockStore):
        self._store = store
        self._number = -1
        self._columns: dict[str, np.ndarray] = {}
        self._times: dict[int, float] = {}
        self._load(0)
        self.names = ordered(self._columns)

    @property
    def wall_time(self) -> float:
        """Seconds that all the blocks read so far took."""
        return sum(self._times.values())

    def read(self, start: int, stop: int, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Columns `names` of the cells from `start` up to `stop`."""
        columns = {
            name: np.empty(
                (stop - start, *self._columns[name].shape[1:]), dtype=column_of(name).dtype
            )
            for name in names
        }
        cell = start
        while cell < stop:
            self._load(cell // self._store.block)
            low, high = self._store.span(self._number)
            end = min(stop, high)
            for name, values in columns.items():
                values[cell - start : end - start] = self._columns[name][cell - low : end - low]
            cell = end
        return columns

    def _load(self, number: int) -> None:
        if number == self._number:
            return
        found = self._store.read(number)
        if found is None:
            raise StoreError(
                f"{self._store.parts}: block {number} is damaged; use --resume to compute it again"
            )
        columns, wall_time = found
        if self._number >= 0 and set(columns) != set(self._columns):
            raise StoreError(
                f"{self._store.parts}: block {number} has other columns than the first; use --force"
            )
        self._times[number] = wall_time
        self._number, self._columns = number, columns


def open_partial(
    parts: str | Path, variables: Sequence[str] | None = None, *, wide: bool = True
) -> xr.Dataset:
    """Map of an unfinished sweep, in memory, with a mask `done` (int8, 1 where the cell is
    computed).

    Cells that are not done hold NaN, or -1 (`not_computed`) in integer variables. It may be called
    while the sweep runs; damaged blocks count as not done.

    Arguments:

    - `parts`: the folder `MAP.h5.parts`.
    - `variables`: names of those to read, all of them if None.
    - `wide`: also those with a dimension beside those of the map.

    Raises: `StoreError` if there is no such store, or what is done lacks one of `variables` (where
        nothing is: if no map can have it).
    """
    store = BlockStore.peek(parts)
    described = store.manifest["map"]
    shape = tuple(described["shape"])
    done = np.zeros(store.cells, dtype=np.int8)
    columns: dict[str, np.ndarray] = {}
    there = np.flatnonzero(store.done())
    if variables is not None:
        first = store.read(int(there[0])) if there.size else None
        # before the first block no one knows what there will be, but what no map has
        held = [*SCHEMA, *filter(derivative, variables)] if first is None else first[0]
        check_held(Path(parts), variables, [*held, "done", *described["coords"]])
    for number in there:
        found = store.read(int(number), variables)
        if found is None:
            continue
        start, stop = store.span(int(number))
        done[start:stop] = 1
        for name, values in found[0].items():
            if column_of(name).along and not wide:
                continue
            if name not in columns:
                columns[name] = np.full(
                    (store.cells, *values.shape[1:]),
                    column_of(name).missing,
                    dtype=values.dtype,
                )
            columns[name][start:stop] = values
    ds = map_dataset.build(
        described, columns, {"cells": store.cells, "cells_done": int(done.sum())}
    )
    for variable in ds.data_vars.values():
        if "flag_values" in variable.attrs and variable.dtype.kind == "i":
            names = {name: code for code, name in cf.flag_names(variable).items()}
            names["not_computed"] = codes.NOT_COMPUTED
            variable.attrs |= cf.flags(names, variable.dtype)
    ds["done"] = (
        tuple(described["coords"]),
        done.reshape(shape),
        {"long_name": "whether the cell is computed", "units": "1"},
    )
    return ds
