"""Lock of a folder: one writer at a time, freed by the system however its holder ends."""

import contextlib
import errno
import fcntl
import os
from pathlib import Path

from .files import StoreError, naming, reason


def acquire(path: Path) -> int:
    """Descriptor of the lock file `path`. Raises `StoreError` if another process holds it."""
    with naming(path):
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        # A finished sweep deletes its lock: what we hold must be the file that is there now.
        if os.fstat(descriptor).st_ino != os.stat(path).st_ino:
            raise FileNotFoundError
        os.ftruncate(descriptor, 0)
        os.write(descriptor, f"{os.getpid()}\n".encode())
        return descriptor
    except OSError as error:
        holder = os.pread(descriptor, 32, 0).decode(errors="replace").strip()
        os.close(descriptor)
        if error.errno in (errno.EWOULDBLOCK, errno.EACCES) or isinstance(error, FileNotFoundError):
            who = f"process {holder}" if holder else "another process"
            raise StoreError(
                f"{path.parent}: is being written by {who}; two writers cannot share it"
            ) from None
        raise StoreError(f"{path}: cannot be locked: {reason(error)}") from error


def release(lock: int) -> None:
    """Frees a lock, or does nothing if it is free."""
    with contextlib.suppress(OSError):
        os.close(lock)
