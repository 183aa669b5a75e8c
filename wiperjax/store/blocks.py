"""Store of the finished blocks of a sweep, durable one by one.

A sweep into `MAP.h5` keeps its finished blocks in the folder `MAP.h5.parts/` until the map is
complete:

    manifest.json                what the map is (coordinates, attributes), what made it (versions)
    block-00000012-<sha256>.h5   one file for each finished block, named by the hash of its content
    lock                         held while a process writes here; freed when that process dies

Since its checksum is its name, a block and its checksum cannot be out of step. (`sha256sum` checks
a store by hand.) Inside it says its cells and the checksum of its manifest, so that the two cannot
be of different sweeps. An HDF5 file that grows block by block is avoided: a writer that is killed
leaves it unreadable.
"""

import contextlib
import hashlib
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..datasets import map_dataset
from ..machine.files import StoreError, log, naming, reason, write_bytes
from ..machine.lock import acquire, release, remove
from ..machine.paths import oddity
from ..vocabulary.columns import ordered
from . import manifest
from .folder import LOCK, clear, remove_temporary, scan
from .manifest import MANIFEST, parts_of


class BlockStore:
    """Finished blocks of one sweep on the disk, locked until closed; use it in a `with` statement.

    A block is a run of `block` cells in C order (the last one shorter). `identity` is what must
    agree for blocks to be parts of one map: text -> text.
    """

    def __init__(
        self, parts: Path, described: dict[str, Any], lock: Any, anew: str = manifest.ANEW
    ):
        self.parts = parts
        self._anew = anew
        self.manifest = described
        self._lock = lock
        self._names = scan(parts)

    # -- opening and closing --

    @classmethod
    def open(
        cls,
        output: str | Path,
        spec: Any,
        *,
        block: int,
        identity: Mapping[str, str],
        resume: bool = False,
        force: bool = False,
        anew: str = manifest.ANEW,
    ) -> "BlockStore":
        """Store beside `output`: a new one, or with `resume` the one that is there, its bad blocks
        removed.

        Arguments:

        - `block`: cells in a block; a store that is resumed keeps its own.
        - `identity`: versions, precision and whatever else must agree between parts of one map.
        - `resume`: go on with an unfinished store, if there is one.
        - `force`: throw an unfinished store away (without `resume`).
        - `anew`: what a person may do where the store is of no use.

        Raises: `StoreError` if the store is in use, was made otherwise (the line says what
            differs), is there though neither `resume` nor `force` is set, or cannot be written.
        """
        if block < 1:
            raise StoreError(f"block must be at least 1 cell, but is {block}")
        parts = parts_of(output)
        identity = dict(identity) | {"specification": spec.digest()}
        with naming(parts):
            parts.mkdir(exist_ok=True)
        lock = acquire(parts / LOCK)
        try:
            found = None if force and not resume else manifest.read(parts, anew)
            if found is not None and resume:
                found = manifest.resumed(parts, found, spec, identity, anew)
            elif found is not None:
                raise StoreError(
                    f"{parts}: holds an unfinished sweep; use --resume to go on, "
                    "or --force to start anew"
                )
            else:
                clear(parts)
                found = manifest.create(parts, spec, block, force, identity)
            store = cls(parts, found, lock, anew)
            remove_temporary(parts)
            store.check()
            return store
        except BaseException:
            release(lock)
            raise

    @classmethod
    def peek(cls, parts: str | Path) -> "BlockStore":
        """Store for reading only, without a lock, while it is being written or after its writer
        died.
        """
        parts = Path(parts)
        found = manifest.read(parts)
        if found is None:
            raise StoreError(f"{parts}: is not the folder of an unfinished sweep")
        return cls(parts, found, None)

    @staticmethod
    def may_replace(output: str | Path) -> bool:
        """Whether the unfinished sweep beside `output` was started with leave to replace it."""
        found = manifest.read(parts_of(output))
        return found is not None and bool(found.get("replace"))

    def close(self) -> None:
        """Frees the lock; finished blocks stay."""
        if self._lock is not None:
            release(self._lock)
            self._lock = None

    def remove(self) -> None:
        """Deletes the store, its manifest last: a deletion that is interrupted can be taken up
        again.
        """
        with naming(self.parts, "removed"):
            clear(self.parts)
            if self._lock is not None:
                remove(self._lock)
                self._lock = None
            self.parts.rmdir()

    def __enter__(self) -> "BlockStore":
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Closes it; one that holds nothing is removed where the sweep itself is refused: what a
        person mends then is another sweep."""
        if kind is not None and issubclass(kind, ValueError) and not self._names:
            self.remove()
        else:
            self.close()

    # -- blocks --

    @property
    def cells(self) -> int:
        """Number of cells of the map."""
        return self.manifest["cells"]

    @property
    def block(self) -> int:
        """Number of cells in a block."""
        return self.manifest["block"]

    @property
    def count(self) -> int:
        """Number of blocks."""
        return -(-self.cells // self.block)

    def span(self, number: int) -> tuple[int, int]:
        """First cell of a block and the one after its last."""
        return number * self.block, min(self.cells, (number + 1) * self.block)

    def done(self) -> np.ndarray:
        """Whether each block is finished, shape (count,), bool."""
        done = np.zeros(self.count, dtype=bool)
        done[[number for number in self._names if number < self.count]] = True
        return done

    def cells_done(self) -> int:
        """Number of cells in finished blocks."""
        spans = (self.span(int(number)) for number in np.flatnonzero(self.done()))
        return sum(stop - start for start, stop in spans)

    def write(self, number: int, columns: Mapping[str, np.ndarray], wall_time: float = 0.0) -> None:
        """Makes a block durable: once this returns, no kill and no power cut loses it.

        Raises: `StoreError` if it cannot be written; no other block is touched. `ValueError`
        for wrong shapes.
        """
        start, stop = self.span(number)
        several = map_dataset.start_count(self.manifest["map"])
        chosen = map_dataset.select(columns, stop - start, several)
        buffer = io.BytesIO()
        with h5py.File(buffer, "w") as file:
            file.attrs.update(manifest.place(self.manifest, (start, stop)))
            file.attrs["wall_time"] = float(wall_time)
            for name, values in chosen.items():
                packed = {"compression": "gzip"} if values.ndim > 1 else {}
                file.create_dataset(name, data=values, **packed)
        content = buffer.getvalue()
        name = f"block-{number:08d}-{hashlib.sha256(content).hexdigest()}.h5"
        write_bytes(self.parts / name, content)
        previous = self._names.get(number)
        self._names[number] = name
        if previous not in (None, name):
            (self.parts / previous).unlink(missing_ok=True)

    def read(
        self, number: int, names: Sequence[str] | None = None
    ) -> tuple[dict[str, np.ndarray], float] | None:
        """Columns of a finished block and the seconds it took, its checksum tested; None if it is
        absent or corrupt.

        A corrupt one is reported in one warning line, taken out of `done()` and, if this store is
        locked by us, deleted, so that a resumed sweep computes it again.
        """
        content = self._verified(number)
        if content is None:
            return None
        with h5py.File(io.BytesIO(content), "r") as file:
            wanted = [name for name in ordered(file) if names is None or name in names]
            columns = {name: np.asarray(file[name]) for name in wanted}
            return columns, float(np.asarray(file.attrs["wall_time"]))

    def check(self) -> list[int]:
        """Numbers of the blocks that were found corrupt, all of them tested; see `read`."""
        return [number for number in sorted(self._names) if self._verified(number) is None]

    def _verified(self, number: int) -> bytes | None:
        name = self._names.get(number)
        if name is None:
            return None
        path = self.parts / name
        try:
            if odd := oddity(path):
                return self._drop(number, path, f"is {odd}")
            content = path.read_bytes()
        except OSError as error:
            return self._drop(number, path, f"cannot be read ({reason(error)})")
        if hashlib.sha256(content).hexdigest() not in name:
            return self._drop(number, path, "is damaged (its content does not match its checksum)")
        self._check_place(number, path, content)
        return content

    def _check_place(self, number: int, path: Path, content: bytes) -> None:
        """Raises `StoreError` if a block is whole but does not belong where it is."""
        with h5py.File(io.BytesIO(content), "r") as file:
            told = dict(file.attrs)
        expected = manifest.place(self.manifest, self.span(number))
        if wrong := [name for name in expected if told.get(name) != expected[name]]:
            differs = ", ".join(f"{n} is {told.get(n)}, must be {expected[n]}" for n in wrong)
            raise StoreError(
                f"{path}: is not block {number} of {MANIFEST} beside it ({differs}); one of the "
                f"two was put here or changed: move the block away, or {self._anew}"
            )

    def _drop(self, number: int, path: Path, what: str) -> None:
        log.warning("%s: %s; its cells will be computed again", path, what)
        del self._names[number]
        if self._lock is not None:
            with contextlib.suppress(OSError):
                path.unlink()
