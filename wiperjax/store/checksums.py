"""Checksums of a finished file, in a record behind its last byte: any change is noticed and named.

HDF5 has checksums of what it packs, but none of coordinates, attributes and texts; and reading what
is damaged, it may stay in a loop for ever. So bytes are compared, before HDF5 sees them:

    the HDF5 file        read by every program as if nothing followed
    one line of JSON     {"size": of the HDF5 file,
                          "pieces": [[variable, first byte, length, checksum], ...]
                          "rest": checksum of all other bytes (names, shapes, attributes, texts)}
    the rest, packed     small, so it is kept twice
    the foot             MAGIC, length of the two above, their SHA-256

A program that writes into the file with HDF5 cuts the record off.
"""

import hashlib
import json
import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import h5py

MAGIC = b"wiperjax"
FOOT = struct.Struct("<8sQ32s")
REST = "the header"


class Piece(NamedTuple):
    """A run of bytes that holds numbers of one variable."""

    variable: str
    start: int
    length: int
    checksum: str = ""


class Record(NamedTuple):
    """What a file was when it was finished."""

    size: int
    pieces: list[Piece]
    rest: str
    copy: bytes  # of the rest, packed


def add(file: BinaryIO) -> None:
    """Puts the record behind the HDF5 file `file`, open for reading and writing."""
    with h5py.File(file, "r") as opened:
        names: list[str] = []
        opened.visititems(lambda name, it: names.append(name) if hasattr(it, "shape") else None)
        pieces = [Piece(name, *run) for name in names for run in _runs(opened[name])]
    for number, piece in enumerate(pieces):
        pieces[number] = piece._replace(checksum=_checksum(_bytes(file, piece)))
    size = file.seek(0, 2)
    rest = b"".join(_bytes(file, gap) for gap in _gaps(pieces, size))
    line = json.dumps({"size": size, "pieces": pieces, "rest": _checksum(rest)}).encode()
    content = line + b"\n" + zlib.compress(rest)
    file.seek(size)
    file.write(content + FOOT.pack(MAGIC, len(content), hashlib.sha256(content).digest()))


def seal(path: Path, last: Mapping[str, float], group: str = "/") -> None:
    """Ends the HDF5 file at `path`: numbers that stand among the attributes of a `group` become
    those of `last`, which are known now that all is written and read back; then the record.
    """
    with h5py.File(path, "r+") as file:
        for name, value in last.items():
            file[group].attrs.modify(name, value)  # in its place: needs no room on the disk
    with open(path, "r+b") as file:
        add(file)


def damages(path: str | Path) -> list[Piece] | None:
    """The pieces of a file that are not as they were written, the rest as one called `REST`; None
    if the file has no record.

    Raises: `ValueError` if the record itself is damaged, `OSError`.
    """
    with open(path, "rb") as file:
        record = _read(file)
        if record is None:
            return None
        found = [p for p in record.pieces if _checksum(_bytes(file, p)) != p.checksum]
        rest = b"".join(_bytes(file, gap) for gap in _gaps(record.pieces, record.size))
        return found + [Piece(REST, 0, len(rest))] * (_checksum(rest) != record.rest)


def restore(path: str | Path) -> None:
    """Writes the rest of a file anew, from its copy.

    Raises: as `damages`.
    """
    with open(path, "r+b") as file:
        record = _read(file)
        if record is None:
            return
        rest = memoryview(zlib.decompress(record.copy))
        for gap in _gaps(record.pieces, record.size):
            file.seek(gap.start)
            file.write(rest[: gap.length])
            rest = rest[gap.length :]


def mark(path: str | Path) -> bytes:
    """What a file with a record has at its end and no other one has: its foot.

    Raises: `OSError`.
    """
    with open(path, "rb") as file:
        file.seek(max(0, file.seek(0, 2) - FOOT.size))
        return file.read()


def length(path: str | Path) -> int:
    """Bytes of the HDF5 file before the record, of all of it if there is none.

    Raises: as `damages`.
    """
    with open(path, "rb") as file:
        record = _read(file)
        return file.seek(0, 2) if record is None else record.size


def chunks_of(variable: Any) -> list[Any]:
    """Chunks of a variable, each with its `chunk_offset` (indices), `byte_offset` and `size`."""
    found: list[Any] = []
    variable.id.chunk_iter(found.append)
    return found


def _runs(variable: Any) -> list[tuple[int, int]]:
    """First byte and length of each run of bytes in which HDF5 keeps the numbers of a variable."""
    if variable.chunks:
        return [(chunk.byte_offset, chunk.size) for chunk in chunks_of(variable)]
    start = variable.id.get_offset()  # none if it has no numbers, or lies in the header
    return [] if start is None else [(start, variable.id.get_storage_size())]


def _read(file: BinaryIO) -> Record | None:
    end = file.seek(0, 2) - FOOT.size
    if end < 0:
        return None
    file.seek(end)
    magic, length, expected = FOOT.unpack(file.read())
    if magic != MAGIC:
        return None
    file.seek(max(0, end - length))
    content = file.read(min(length, end))
    if hashlib.sha256(content).digest() != expected:
        raise ValueError("its record of checksums is damaged")
    line, copy = content.split(b"\n", 1)
    record = json.loads(line)
    return Record(record["size"], [Piece(*p) for p in record["pieces"]], record["rest"], copy)


def _gaps(pieces: list[Piece], size: int) -> Iterator[Piece]:
    """The runs of bytes between the pieces."""
    place = 0
    for piece in [*sorted(pieces, key=lambda p: p.start), Piece(REST, size, 0)]:
        yield Piece(REST, place, piece.start - place)
        place = piece.start + piece.length


def _bytes(file: BinaryIO, piece: Piece) -> bytes:
    file.seek(piece.start)
    return file.read(piece.length)


def _checksum(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]
