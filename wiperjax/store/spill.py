"""A file for HDF5 that does not fail while HDF5 holds it.

HDF5 cannot close a file whose disk is full: it keeps it open, and the next access in the same
process ends in a segmentation fault (seen with HDF5 of h5py 3.16: three files on a full disk, one
process dead). So writes that fail are kept in memory, where HDF5 finds them again, and the error is
told afterwards. The writer asks `check` often, so that what is kept stays small.
"""

import io
import os
from pathlib import Path


class SpillFile(io.RawIOBase):
    """New file at `path` for `h5py.File(SpillFile(path), "w")`; `check` and `finish` raise what
    went wrong.
    """

    def __init__(self, path: str | Path):
        self._file = io.FileIO(path, "w+")
        self._place = 0
        self._size = 0
        self._kept: list[tuple[int, bytes]] = []
        self._error: OSError | None = None

    def check(self) -> None:
        """Raises the first error of a write, if there was one."""
        if self._error is not None:
            raise OSError(self._error.errno, os.strerror(self._error.errno or 0))

    def finish(self) -> None:
        """Makes everything durable once HDF5 has closed its file. Raises `OSError` if anything is
        not on the disk.
        """
        self.check()
        self._file.truncate(self._size)
        os.fsync(self._file.fileno())

    # -- what HDF5 calls --

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        self._place = (
            offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: self._size}[whence]
        )
        return self._place

    def tell(self) -> int:
        return self._place

    def truncate(self, size: int | None = None) -> int:
        self._size = (
            self._place if size is None else size
        )  # carried out by `finish`: it can fail, too
        return self._size

    def write(self, data) -> int:
        view = memoryview(data).cast("B")
        place, end = self._place, self._place + len(view)
        if self._error is None:
            try:
                self._file.seek(place)
                while place < end:
                    place += self._file.write(view[place - self._place :])
            except OSError as error:
                self._error = error
        if place < end:
            self._kept.append((place, bytes(view[place - self._place :])))
        self._place = end
        self._size = max(self._size, end)
        return len(view)

    def readinto(self, buffer) -> int:
        view = memoryview(buffer).cast("B")
        length = max(0, min(len(view), self._size - self._place))
        self._file.seek(self._place)
        content = self._file.read(length)
        view[:length] = content.ljust(length, b"\0")
        for start, piece in self._kept:  # in the order of writing, so the last one wins
            low, high = max(start, self._place), min(start + len(piece), self._place + length)
            if low < high:
                view[low - self._place : high - self._place] = piece[low - start : high - start]
        self._place += length
        return length

    def close(self) -> None:
        self._file.close()
        super().close()
