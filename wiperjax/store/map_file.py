"""The finished map, written from a store of blocks in bounded memory; and the unfinished one, read
meanwhile.

The map is one ordinary HDF5 file with netCDF dimension scales, every variable of its full size from
the start: h5netcdf drops a write past the end of an unlimited dimension without an error, and
xarray can append to Zarr only. It is filled slab by slab: a slab is a run of cells in C order that
covers whole chunks, so no chunk is packed twice.
"""

import math
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import h5netcdf
import h5py
import numpy as np
import xarray as xr

from ..datasets import map_dataset
from ..machine.files import StoreError, log, replacing
from ..vocabulary import cf
from ..vocabulary.columns import attributes_of, column_of
from . import checksums
from .blocks import BlockStore
from .levels import Level, write_levels
from .partial import Reader
from .spill import SpillFile

CHUNK_CELLS = (
    32_768  # 256 KiB of float64: small enough for a slice along any axis, large enough to pack well
)
SLAB_CELLS = 131_072  # most cells held at once while the map is written

Slab = tuple[slice, ...]


def chunk_shape(shape: Sequence[int]) -> tuple[int, ...]:
    """Chunk of a map of this shape: near-cubic, and such that a row of chunks fits into a slab.

    Cubic chunks make slices along all axes equally cheap. Slabs are contiguous in C order, so the
    leading axes give way where one layer of chunks would be larger than a slab.
    """
    chunk = [1] * len(shape)
    left, budget = len(shape), float(CHUNK_CELLS)
    for axis in sorted(
        range(len(shape)), key=lambda k: shape[k]
    ):  # short axes first: the rest share what they leave
        chunk[axis] = max(1, min(shape[axis], int(budget ** (1 / left) + 1e-9)))
        budget /= chunk[axis]
        left -= 1
    for axis in range(len(shape)):
        layer = math.prod(shape[axis + 1 :])
        if layer <= SLAB_CELLS:
            chunk[axis] = max(1, min(chunk[axis], SLAB_CELLS // layer))
            break
        chunk[axis] = 1
    return tuple(chunk)


def slabs(shape: Sequence[int], chunk: Sequence[int]) -> Iterator[tuple[int, int, Slab]]:
    """First cell, one after the last, and index of each slab; they cover the map once, in C
    order.
    """
    split = next(
        (k for k in range(len(shape)) if math.prod(shape[k + 1 :]) <= SLAB_CELLS), len(shape) - 1
    )
    layer = math.prod(shape[split + 1 :])
    thickness = chunk[split] * max(1, SLAB_CELLS // (layer * chunk[split]))
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
    store: BlockStore,
    output: str | Path,
    attributes: Mapping[str, Any] | None = None,
    last: Callable[[], Mapping[str, float]] = dict,
    groups: tuple[Sequence[Level], xr.Dataset] | None = None,
) -> None:
    """Writes the map of a complete store to `output`, reads it back, and deletes the store.

    Arguments:

    - `store`: all its blocks done.
    - `output`: replaced if it exists; the caller has asked.
    - `attributes`: further attributes of the map, such as `provenance.record(...)`.
    - `last`: numbers among them that are known when all is written and read back: called then.
    - `groups`: levels and borders that a map had which is mended: it is never seen without them.

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
        checksums.seal(temporary, last())
        if groups is not None:
            mark = checksums.mark(temporary)
            write_levels(temporary, mark, *groups, store.parts / ".levels.tmp")
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
    reader = Reader(store)
    sums = []
    with h5netcdf.File(target, "w") as file:
        own = {name: entry for name, entry in coords.items() if "along" not in entry}
        beside = coords.keys() - own.keys()  # coordinates of another's dimension
        file.dimensions = {name: len(entry["values"]) for name, entry in own.items()}
        for name, entry in coords.items():
            values = map_dataset.coordinate(entry)
            if values.dtype.kind == "U":  # HDF5 has no such type
                values = values.astype(h5py.string_dtype())
            variable = file.create_variable(name, (entry.get("along", name),), data=values)
            variable.attrs.update(entry["attrs"])
        # Columns of one shape go together: those of the map's, then those with a further dimension.
        groups: dict[tuple[str, ...], list[str]] = {}
        for name in reader.names:
            groups.setdefault(map_dataset.dimensions(name, described), []).append(name)
        for dims, names in groups.items():
            shape = tuple(len(coords[name]["values"]) for name in dims)
            chunk = chunk_shape(shape)
            for name in names:
                column = column_of(name)
                variable = file.create_variable(
                    name,
                    dims,
                    dtype=column.dtype,
                    chunks=chunk,
                    compression="gzip",
                    compression_opts=4,
                    shuffle=True,
                )
                variable.attrs.update(attributes_of(name, described["attrs"]))
                if beside and "start" in dims:
                    variable.attrs["coordinates"] = " ".join(sorted(beside))
            each = math.prod(shape) // store.cells  # numbers of a cell; a slab has whole cells
            for start, stop, index in slabs(shape, chunk):
                columns = reader.read(start // each, stop // each, names)
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
        file.attrs.update(cf.plain_attributes(attrs))
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
