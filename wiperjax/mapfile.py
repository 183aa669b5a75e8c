"""The finished map, written from a store of blocks in bounded memory; and the unfinished one, read
meanwhile.

The map is one ordinary HDF5 file with netCDF dimension scales, every variable of its full size from
the start: h5netcdf drops a write past the end of an unlimited dimension without an error, and
xarray can append to Zarr only. It is filled slab by slab: a slab is a run of cells in C order that
covers whole chunks, so no chunk is packed twice.
"""

import math
import zlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import h5netcdf
import h5py
import numpy as np
import xarray as xr

from . import checksums, dataset, schema
from .blocks import BlockStore
from .spill import SpillFile
from .storage import StoreError, log, replacing

CHUNK_CELLS = (
    32_768  # 256 KiB of float64: small enough for a slice along any axis, large enough to pack well
)
SLAB_CELLS = 131_072  # most cells held at once while the map is written

Slab = tuple[slice, ...]


def chunk_shape(
    shape: Sequence[int], chunk_cells: int = CHUNK_CELLS, slab_cells: int = SLAB_CELLS
) -> tuple[int, ...]:
    """Chunk of a map of this shape: near-cubic, and such that a row of chunks fits into a slab.

    Cubic chunks make slices along all axes equally cheap. Slabs are contiguous in C order, so the
    leading axes give way where one layer of chunks would be larger than a slab.
    """
    chunk = [1] * len(shape)
    left, budget = len(shape), float(chunk_cells)
    for axis in sorted(
        range(len(shape)), key=lambda k: shape[k]
    ):  # short axes first: the rest share what they leave
        chunk[axis] = max(1, min(shape[axis], int(budget ** (1 / left) + 1e-9)))
        budget /= chunk[axis]
        left -= 1
    for axis in range(len(shape)):
        layer = math.prod(shape[axis + 1 :])
        if layer <= slab_cells:
            chunk[axis] = max(1, min(chunk[axis], slab_cells // layer))
            break
        chunk[axis] = 1
    return tuple(chunk)


def slabs(
    shape: Sequence[int], chunk: Sequence[int], slab_cells: int = SLAB_CELLS
) -> Iterator[tuple[int, int, Slab]]:
    """First cell, one after the last, and index of each slab; they cover the map once, in C
    order.
    """
    split = next(
        (k for k in range(len(shape)) if math.prod(shape[k + 1 :]) <= slab_cells), len(shape) - 1
    )
    layer = math.prod(shape[split + 1 :])
    thickness = chunk[split] * max(1, slab_cells // (layer * chunk[split]))
    for outer in np.ndindex(*shape[:split]):
        base = int(np.ravel_multi_index(outer, shape[:split])) if split else 0
        for low in range(0, shape[split], thickness):
            high = min(shape[split], low + thickness)
            index = (
                *(slice(k, k + 1) for k in outer),
                slice(low, high),
                *(slice(0, n) for n in shape[split + 1 :]),
            )
            yield (base * shape[split] + low) * layer, (base * shape[split] + high) * layer, index


def finalize(
    store: BlockStore, output: str | Path, attributes: Mapping[str, Any] | None = None
) -> None:
    """Writes the map of a complete store to `output`, reads it back, and deletes the store.

    Arguments:

    - `store`: all its blocks done.
    - `output`: replaced if it exists; the caller has asked.
    - `attributes`: further attributes of the map, such as `provenance.record(...)`.

    Raises: `StoreError` if blocks are missing or damaged (the store is kept, resuming computes
        them again), or `output` cannot be written (it is as it was).
    """
    missing = np.flatnonzero(~store.done())
    if missing.size:
        raise StoreError(
            f"{store.parts}: {missing.size} of {store.count} blocks are missing; use --resume"
        )
    with replacing(output, store.parts / ".map.tmp") as temporary:
        with SpillFile(temporary) as target:
            sums = _write(store, target, dict(attributes or {}))
            target.finish()
        _verify(temporary, sums)
        with open(temporary, "r+b") as file:
            checksums.add(file)
    try:
        store.remove()
    except StoreError as error:
        log.warning("%s (the map is complete)", error)


def _write(
    store: BlockStore, target: SpillFile, attributes: dict[str, Any]
) -> list[tuple[Slab, dict[str, int]]]:
    """Writes the map; returns the checksum of each variable in each slab."""
    described = store.manifest["map"]
    coords = described["coords"] | described["further_coords"]
    reader = _Reader(store)
    sums = []
    with h5netcdf.File(target, "w") as file:
        file.dimensions = {name: len(entry["values"]) for name, entry in coords.items()}
        for name, entry in coords.items():
            variable = file.create_variable(name, (name,), data=dataset.coordinate(entry))
            variable.attrs.update(entry["attrs"])
        # Columns of one shape go together: those of the map's, then those with a further dimension.
        groups: dict[tuple[str, ...], list[str]] = {}
        for name in reader.names:
            groups.setdefault(dataset.dimensions(name, described), []).append(name)
        for dims, names in groups.items():
            shape = tuple(len(coords[name]["values"]) for name in dims)
            chunk = chunk_shape(shape)
            for name in names:
                column = schema.SCHEMA[name]
                variable = file.create_variable(
                    name,
                    dims,
                    dtype=column.dtype,
                    chunks=chunk,
                    compression="gzip",
                    compression_opts=4,
                    shuffle=True,
                )
                variable.attrs.update(column.attributes())
            each = math.prod(shape) // store.cells  # numbers of a cell; a slab has whole cells
            for start, stop, index in slabs(shape, chunk):
                columns = reader.cells(start // each, stop // each, names)
                extent = tuple(part.stop - part.start for part in index)
                for name, values in columns.items():
                    file.variables[name][index] = values.reshape(extent)
                    target.check()
                sums.append(
                    (index, {name: zlib.crc32(values.data) for name, values in columns.items()})
                )
        attrs = described["attrs"] | attributes | {"cells": store.cells, "block_cells": store.block}
        if "wall_time" in attrs:
            attrs["wall_time"] = reader.wall_time  # seconds, summed over blocks: survives a resume
        file.attrs.update(dataset.plain_attributes(attrs))
    return sums


def _verify(path: Path, sums: list[tuple[Slab, dict[str, int]]]) -> None:
    """Reads the file back. Raises `StoreError` if anything in it is not what was written."""
    with h5py.File(path, "r") as file:  # not h5netcdf, which fills up what was not written
        for index, expected in sums:
            for name, sum_ in expected.items():
                variable: Any = file[name]
                if zlib.crc32(np.asarray(variable[index]).tobytes()) != sum_:
                    raise StoreError(
                        f"{path}: {name} reads back otherwise than it was written; a failing disk?"
                    )


class _Reader:
    """Reads runs of cells from a store, keeping one block, and adds up the times of blocks."""

    def __init__(self, store: BlockStore):
        self._store = store
        self._number = -1
        self._columns: dict[str, np.ndarray] = {}
        self._times: dict[int, float] = {}
        self._load(0)
        self.names = [name for name in schema.SCHEMA if name in self._columns]

    @property
    def wall_time(self) -> float:
        """Seconds that all the blocks read so far took."""
        return sum(self._times.values())

    def cells(self, start: int, stop: int, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Columns `names` of the cells from `start` up to `stop`."""
        columns = {
            name: np.empty(
                (stop - start, *self._columns[name].shape[1:]), dtype=schema.SCHEMA[name].dtype
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


def open_partial(parts: str | Path, variables: Sequence[str] | None = None) -> xr.Dataset:
    """Map of an unfinished sweep, in memory, with a mask `done` (int8, 1 where the cell is
    computed).

    Cells that are not done hold NaN, or -1 (`not_computed`) in integer variables. It may be called
    while the sweep runs; damaged blocks count as not done.

    Arguments:

    - `parts`: the folder `MAP.h5.parts`.
    - `variables`: names of those to read, all of them if None.

    Raises: `StoreError` if there is no such store.
    """
    store = BlockStore.peek(parts)
    described = store.manifest["map"]
    shape = tuple(described["shape"])
    done = np.zeros(store.cells, dtype=np.int8)
    columns: dict[str, np.ndarray] = {}
    for number in np.flatnonzero(store.done()):
        found = store.read(int(number), variables)
        if found is None:
            continue
        start, stop = store.span(int(number))
        done[start:stop] = 1
        for name, values in found[0].items():
            if name not in columns:
                columns[name] = np.full(
                    (store.cells, *values.shape[1:]),
                    schema.SCHEMA[name].missing,
                    dtype=values.dtype,
                )
            columns[name][start:stop] = values
    ds = dataset.build(described, columns, {"cells": store.cells, "cells_done": int(done.sum())})
    for variable in ds.data_vars.values():
        if "flag_values" in variable.attrs and variable.dtype.kind == "i":
            codes = variable.attrs["flag_values"]
            variable.attrs["flag_values"] = np.append(codes, codes.dtype.type(schema.NOT_COMPUTED))
            variable.attrs["flag_meanings"] += " not_computed"
    ds["done"] = (
        tuple(described["coords"]),
        done.reshape(shape),
        {"long_name": "whether the cell is computed", "units": "1"},
    )
    return ds
