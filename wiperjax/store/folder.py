"""The folder of an unfinished sweep: which files in it are whose."""

import os
import re
from pathlib import Path

from ..machine.files import StoreError, naming
from .manifest import MANIFEST

LOCK = "lock"
BLOCK_NAME = re.compile(r"block-(\d{8})-([0-9a-f]{64})\.h5")


def scan(parts: Path) -> dict[int, str]:
    """Number -> file name of the finished blocks; of two with one number, the newer."""
    names: dict[int, str] = {}
    with naming(parts, "read"):
        for entry in sorted(os.scandir(parts), key=lambda e: e.stat().st_mtime_ns):
            if match := BLOCK_NAME.fullmatch(entry.name):
                names[int(match[1])] = entry.name
    return names


def remove_temporary(parts: Path) -> None:
    for path in parts.glob(".*.tmp"):
        path.unlink(missing_ok=True)


def clear(parts: Path) -> None:
    """Deletes what is ours, the manifest last. Raises `StoreError` if anything else is there."""
    remove_temporary(parts)
    paths = [path for path in parts.iterdir() if path.name != LOCK]
    strange = [
        path for path in paths if path.name != MANIFEST and not BLOCK_NAME.fullmatch(path.name)
    ]
    if strange:
        raise StoreError(
            f"{strange[0]}: is no part of a sweep; move it away, {parts.name} is left as it is"
        )
    for path in sorted(paths, key=lambda p: p.name == MANIFEST):
        path.unlink()
