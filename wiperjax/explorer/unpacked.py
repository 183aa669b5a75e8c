"""Pieces of a map's file that stay unpacked while a slider moves through them."""

from collections import OrderedDict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import h5py

MOST = 4  # variables at once, of each of which HDF5 keeps 8 MB


class Unpacked:
    """Variables of a file that are held open.

    A file is packed in pieces of some ten planes. HDF5 keeps those that it unpacked last, but only
    as long as somebody holds the variable open, and xarray opens it anew for each plane: that was
    half of what a plane costs.
    """

    def __init__(self, source: str = "") -> None:
        """Of the file `source`; empty: there is none."""
        self._source = Path(source) if source else None
        self._file: Any = None
        self._open: OrderedDict[str, Any] = OrderedDict()

    def keep(self, names: Iterable[str]) -> None:
        """Holds these variables open, and lets go of those that were shown before the last few."""
        for name in names:
            if self._source is None or not self._source.is_file():
                continue
            if self._file is None:
                self._file = h5py.File(self._source, "r")
            if name not in self._open and name in self._file:
                self._open[name] = self._file[name]
            if name in self._open:
                self._open.move_to_end(name)
        while len(self._open) > MOST:
            self._open.popitem(last=False)

    def close(self) -> None:
        """Lets go of all, and of the file."""
        self._open.clear()
        if self._file is not None:
            self._file.close()
        self._file = None
