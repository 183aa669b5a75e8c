"""A finished map that was damaged since: what is still right in it goes back into a store of
blocks, and only the rest is computed again.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
import xarray as xr

from ..machine.files import StoreError, log, naming
from ..vocabulary.columns import ordered
from . import checksums
from .blocks import BlockStore
from .checksums import REST, Piece
from .levels import Level, is_refined, read_levels
from .swept import check_swept, otherwise
from .whole import borders, damages, listed, open_map


class Finished(NamedTuple):
    """A finished map: cells of its blocks (0 if it had none), and what of it is damaged."""

    block: int
    damaged: list[Piece]


def finished(output: Path, spec: Any, known: Mapping[str, str]) -> Finished | None:
    """The map at `output`, None if it is not of the sweep `spec` made as is `known`, or it has no
    checksums. A damaged header is written anew from its copy before it is read.

    Raises: `StoreError` if the checksums themselves are damaged, or the header cannot be written.
    """
    damaged = damages(output)
    if damaged and any(piece.variable == REST for piece in damaged):
        with naming(output):
            checksums.restore(output)
        log.warning("%s: is damaged: %s; its header is written anew", output, listed(damaged))
        damaged = damages(output)
    if damaged is None:
        return None
    try:
        with open_map(output) as ds:
            if otherwise(ds.attrs, spec, known):
                return None
            return Finished(int(ds.attrs.get("block_cells", 0)), damaged)
    except StoreError:
        return None


def not_gone_on_with(output: Path, spec: Any, known: Mapping[str, str]) -> StoreError:
    """Why there is nothing to go on with in a file of which `finished` finds no map."""
    if damages(output) is None:
        why = "its end is lost, or another program made or changed it; --force replaces it"
        return StoreError(f"{output}: has no checksums by which it could be mended: {why}")
    with open_map(output) as ds:
        check_swept(ds, output, read=False)
        said = otherwise(ds.attrs, spec, known)
    do = "use --force to replace it, or another name"
    return StoreError(f"{output}: was made otherwise than this sweep ({said}); {do}")


def salvage(output: Path, damaged: Sequence[Piece], store: BlockStore) -> None:
    """Puts the blocks of a map that no damaged chunk touches into `store`, which is of its sweep.

    The seconds that they took are taken from the map, alike for each.
    """
    done = store.done()
    with h5py.File(output, "r") as file:
        names = ordered(file)
        lost = {
            int(number)
            for name in names
            for number in _touched(file[name], {p.start for p in damaged}, store)
        }
        seconds = np.asarray(file.attrs.get("wall_time", 0.0)).item() / store.count
        for number in range(store.count):
            if not done[number] and number not in lost:
                span = store.span(number)
                store.write(number, {n: _cells(file[n], span, store) for n in names}, seconds)


def kept_levels(output: Path, damaged: Sequence[Piece]) -> tuple[list[Level], xr.Dataset] | None:
    """Levels and borders of a refined map, as `write_levels` puts them into the mended one; None of
    a map that is not refined. Those that are damaged themselves are lost, with a warning.
    """
    if not is_refined(output):
        return None
    if any("/" in piece.variable for piece in damaged):  # in a group
        lost = "its borders and finer points are damaged, and are not kept: refine it again"
        log.warning("%s: %s", output, lost)
        return None
    return read_levels(output), borders(output)


def _touched(variable: Any, starts: set[int], store: BlockStore) -> set[int]:
    """Blocks with cells in those chunks of a variable that begin at one of the bytes `starts`."""
    found: set[int] = set()
    shape = _map_shape(variable, store)
    for chunk in checksums.chunks_of(variable):
        if chunk.byte_offset in starts:
            corner = zip(chunk.chunk_offset, variable.chunks, shape, strict=False)
            box = np.ix_(*(range(low, min(low + n, most)) for low, n, most in corner))
            cells = np.ravel_multi_index(box, shape)
            found |= set((np.unique(cells) // store.block).tolist())
    return found


def _cells(variable: Any, span: tuple[int, int], store: BlockStore) -> np.ndarray:
    """Values of a run of cells, the cells first, as a store of blocks has them."""
    shape = _map_shape(variable, store)
    further = variable.shape[len(shape) :]
    parts = [variable[box].reshape(-1, *further) for box in _boxes(shape, *span)]
    return np.concatenate(parts)


def _map_shape(variable: Any, store: BlockStore) -> tuple[int, ...]:
    return variable.shape[: len(store.manifest["map"]["shape"])]


def _boxes(shape: Sequence[int], start: int, stop: int) -> Iterator[tuple[slice, ...]]:
    """Boxes of an array of this shape that are, one after another, its numbers from `start` up to
    `stop` in C order.
    """
    if len(shape) == 1:
        yield (slice(start, stop),)
        return
    layer = math.prod(shape[1:])
    while start < stop:
        row, within = divmod(start, layer)
        rows = (stop - start) // layer if within == 0 else 0
        if rows:  # whole layers
            yield (slice(row, row + rows), *(slice(0, n) for n in shape[1:]))
            start += rows * layer
        else:
            end = min(stop, (row + 1) * layer)
            for box in _boxes(shape[1:], within, within + end - start):
                yield (slice(row, row + 1), *box)
            start = end
