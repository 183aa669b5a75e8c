"""Single files that survive: atomic writes, clear errors.

Each file is written to a temporary name, flushed to the disk and renamed, so it is there whole or
not at all.
"""

import contextlib
import errno
import logging
import os
import re
import shutil
import stat
import sys
from collections.abc import Iterator
from pathlib import Path

from .paths import oddity, same_file

log = logging.getLogger("wiperjax")


class StoreError(RuntimeError):
    """A file or store that cannot be written, read or continued; its text is one line."""


@contextlib.contextmanager
def replacing(
    path: str | Path, temporary: str | Path | None = None, force: bool = True
) -> Iterator[Path]:
    """Temporary path to write to; on leaving, its content is on the disk and bears the name `path`,
    with the mode of a file that it replaces. Without `force` it replaces none.

    On any error `path` is as it was, the temporary file is gone, and an `OSError` has become a
    `StoreError`.
    """
    path = Path(path)
    temporary = Path(temporary) if temporary else temporary_beside(path)
    try:
        with naming(path):
            yield temporary
            with open(temporary, "rb") as file:
                os.fsync(file.fileno())
            if force:
                with contextlib.suppress(OSError):  # nothing is there, or the disk has no modes
                    shutil.copymode(path, temporary)
                os.replace(temporary, path)
            else:
                _name(temporary, path)
            sync_folder(path.parent)
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


def _name(temporary: Path, path: Path) -> None:
    """Gives a file the name `path`. Raises: `StoreError` if another one has it: of two programs
    that look first, both would write.
    """
    try:
        os.link(temporary, path)
    except FileExistsError:
        raise StoreError(
            f"{path}: was made by another program meanwhile; use --force to replace it, or another "
            "name"
        ) from None
    except OSError:  # a disk without links
        os.replace(temporary, path)


def temporary_beside(path: Path) -> Path:
    """Name of the file that becomes `path`, for this process."""
    return path.with_name(f".{path.name}.{os.getpid()}.tmp")


@contextlib.contextmanager
def naming(path: Path, deed: str = "written") -> Iterator[None]:
    """Turns an `OSError` inside into a `StoreError` of one line that names `path`."""
    try:
        yield
    except OSError as error:
        raise StoreError(f"{path}: cannot be {deed}: {reason(error)}") from error


def reason(error: OSError) -> str:
    """What the system says, also where HDF5 wraps it in several lines."""
    if error.errno:
        return os.strerror(error.errno)
    text = str(error)
    found = re.search(r"errno = (\d+)", text)
    return (
        os.strerror(int(found[1]))
        if found
        else text.splitlines()[0]
        if text
        else type(error).__name__
    )


def sync_folder(folder: Path) -> None:
    """Makes renames inside `folder` durable; Windows opens no folder, and takes its own time."""
    if sys.platform == "win32":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_bytes(path: Path, content: bytes, force: bool = True) -> None:
    """Writes a file at once or not at all, flushed to the disk; `force` as in `replacing`."""
    with replacing(path, force=force) as temporary:
        temporary.write_bytes(content)


def check_input(path: str | Path) -> None:
    """Raises `StoreError` if something other than a regular file stands at `path`: reading a pipe
    waits for ever.
    """
    with naming(Path(path), "read"):
        if odd := oddity(path):
            raise StoreError(f"{path}: cannot be read: it is {odd}, and no regular file")


def check_output(path: str | Path, force: bool = False, source: str | Path | None = None) -> None:
    """Raises `StoreError` if `path` exists (without `force`) or cannot be made: whatever would fail
    at the end of the work fails here.

    Arguments:

    - `force`: whether a file there may be replaced.
    - `source`: the file that is read, which must be another one.
    """
    path = Path(path)
    _check_name(path)
    with naming(path):
        if not path.parent.is_dir():
            raise StoreError(f"{path}: cannot be written: {path.parent} is not an existing folder")
        if source is not None and same_file(path, source):
            raise StoreError(f"{path}: must be another file than the input")
        if path.is_symlink():  # a rename would replace the link and not the file
            target = os.readlink(path)
            raise StoreError(
                f"{path}: cannot be written: it is a link to {target}; name that file itself"
            )
        if odd := oddity(path):
            raise StoreError(f"{path}: cannot be written: it is {odd}")
        if path.exists():
            _check_replaceable(path, force)
        if not os.access(path.parent, os.W_OK | os.X_OK):
            raise StoreError(f"{path}: cannot be written: no permission to write in {path.parent}")
        _try(temporary_beside(path))


def _try(path: Path) -> None:
    """Raises `OSError` if no file can be made at `path`: permissions do not say it all."""
    if sys.platform != "win32" and len(os.fsencode(path.name)) > os.pathconf(
        path.parent, "PC_NAME_MAX"
    ):
        raise OSError(errno.ENAMETOOLONG, os.strerror(errno.ENAMETOOLONG))
    if sys.platform == "linux":
        try:  # without a name: a kill leaves nothing behind
            return os.close(os.open(path.parent, os.O_TMPFILE | os.O_WRONLY, 0o600))
        except OSError as error:  # network disks have no such files
            if error.errno not in (errno.EOPNOTSUPP, errno.EISDIR, errno.EINVAL):
                raise
    os.close(os.open(path, os.O_CREAT | os.O_WRONLY, 0o600))
    os.unlink(path)


def _check_name(path: Path) -> None:
    """Raises `StoreError` for a name that attributes of files and other programs cannot hold."""
    name = str(path)
    if "\x00" in name:
        raise StoreError(f"{name!r}: must have a name in UTF-8 without null characters")
    try:
        name.encode()
    except UnicodeEncodeError:
        raise StoreError(
            f"output must have a name in UTF-8, but was {os.fsencode(name)!r}"
        ) from None


def _check_replaceable(path: Path, force: bool) -> None:
    """Raises `StoreError` unless the file at `path` may be replaced, and can be."""
    if not force:
        raise StoreError(f"{path}: exists already; use --force to replace it, or another name")
    if not os.access(path, os.W_OK):
        raise StoreError(f"{path}: cannot be written: it is read-only")
    if sys.platform == "win32":
        return
    folder, me = os.stat(path.parent), os.geteuid()
    if folder.st_mode & stat.S_ISVTX and me not in (0, folder.st_uid, os.stat(path).st_uid):
        raise StoreError(f"{path}: cannot be written: its folder lets only its owner replace it")


def check_move(folder: Path, path: Path) -> None:
    """Raises `StoreError` if a file cannot be moved from `folder` to `path`: from another disk."""
    try:  # nothing is moved, for there is nothing: but disks are compared first
        os.rename(folder / ".nothing.tmp", path.with_name(f".{path.name}.nothing.tmp"))
    except FileNotFoundError:
        reached = os.stat(folder).st_dev == os.stat(path.parent).st_dev
    except OSError as error:
        reached = error.errno != errno.EXDEV
    if not reached:
        why = os.strerror(errno.EXDEV)
        raise StoreError(
            f"{folder}: must be on the disk of {path}, for files are moved there ({why})"
        )
