"""Lock of a folder: one writer at a time, freed by the system however its holder ends."""

import contextlib
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from .files import StoreError, reason

if TYPE_CHECKING:
    from filelock import FileLock


def acquire(path: Path) -> "FileLock":
    """The lock file `path`, held until `release` or the end of what is returned. Raises
    `StoreError` if another process holds it.
    """
    from filelock import FileLock, Timeout  # takes a while, and what reads alone needs none

    lock = FileLock(path, timeout=0, thread_local=False)
    try:
        lock.acquire()
    except Timeout:
        holder = ""
        with contextlib.suppress(OSError):  # Windows lets nobody else read it
            holder = path.read_text(encoding="utf-8", errors="replace").strip()
        who = f"process {holder}" if holder else "another process"
        raise StoreError(
            f"{path.parent}: is being written by {who}; two writers cannot share it"
        ) from None
    except OSError as error:
        raise StoreError(f"{path}: cannot be locked: {reason(error)}") from error
    with contextlib.suppress(OSError):
        path.write_text(f"{os.getpid()}\n", encoding="utf-8")
    return lock


def release(lock: "FileLock") -> None:
    """Frees a lock, or does nothing if it is free."""
    with contextlib.suppress(OSError):
        lock.release()


def remove(lock: "FileLock") -> None:
    """Frees a lock whose file goes with it. Raises `OSError` if that cannot be."""
    if sys.platform == "win32":  # removes no file that is open
        release(lock)
    Path(lock.lock_file).unlink(missing_ok=True)
    release(lock)
