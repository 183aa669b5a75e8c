"""Single files that survive: atomic writes, clear errors, reading maps.

Each file is written to a temporary name, flushed to the disk and renamed, so it is there whole or
not at all.
"""

import contextlib
import errno
import io
import logging
import os
import re
import stat
from collections.abc import Iterator, Sequence
from pathlib import Path

import xarray as xr

from . import checks, checksums
from .paths import oddity, same_file

log = logging.getLogger("wiperjax")


class StoreError(RuntimeError):
    """A file or store that cannot be written, read or continued; its text is one line."""


@contextlib.contextmanager
def replacing(path: str | Path, temporary: str | Path | None = None) -> Iterator[Path]:
    """Temporary path to write to; on leaving, its content is on the disk and bears the name `path`.

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
            os.replace(temporary, path)
            sync_folder(path.parent)
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


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
    """Makes renames inside `folder` durable."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_bytes(path: Path, content: bytes) -> None:
    """Writes a file at once or not at all, flushed to the disk."""
    with replacing(path) as temporary, open(temporary, "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


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
    if len(os.fsencode(path.name)) > os.pathconf(path.parent, "PC_NAME_MAX"):
        raise OSError(errno.ENAMETOOLONG, os.strerror(errno.ENAMETOOLONG))
    try:  # without a name: a kill leaves nothing behind
        os.close(os.open(path.parent, os.O_TMPFILE | os.O_WRONLY, 0o600))
    except OSError as error:
        if error.errno not in (errno.EOPNOTSUPP, errno.EISDIR, errno.EINVAL):
            raise
        os.close(os.open(path, os.O_CREAT | os.O_WRONLY, 0o600))  # as on a network disk
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


def write_dataset(ds: xr.Dataset, path: str | Path, force: bool = False) -> None:
    """Writes a whole dataset (a run, a small map) to one HDF5 file with its checksums, at once or
    not at all.

    Raises: `StoreError` if `path` exists and `force` is not set, or it cannot be written.
    """
    check_output(path, force)
    encoding = {
        name: {"zlib": True, "complevel": 4, "shuffle": True, "_FillValue": None}
        for name, variable in ds.data_vars.items()
        if variable.ndim and variable.dtype.kind in "iuf"
    }
    encoding |= {
        str(name): {"_FillValue": None} for name in ds.coords if ds[name].dtype.kind == "f"
    }
    # Written in memory, where the dataset is anyway: HDF5 itself does not survive a full disk (see
    # `spill`).
    buffer = io.BytesIO()
    ds.to_netcdf(buffer, engine="h5netcdf", encoding=encoding)
    checksums.add(buffer)
    write_bytes(Path(path), buffer.getvalue())


def open_map(
    path: str | Path, variables: Sequence[str] | None = None, *, check: bool = False
) -> xr.Dataset:
    """Dataset of a file that wiperjax wrote, read when used; close it, or use it in a `with`
    statement. Of the folder `MAP.h5.parts` of an unfinished sweep, what is done of these
    `variables` (all if None): see `mapfile.open_partial`.

    Arguments:

    - `check`: compare the file with its checksums first, which reads all of it. (Blocks of an
        unfinished sweep always are.)

    Raises: `StoreError` if there is no such file or it is no readable HDF5 file; with `check` also
        if it is damaged (the line says what) or has no checksums.
    """
    checks.path("path", path)
    if variables is not None:
        checks.names("variables", variables)
    path = Path(path)
    if path.is_dir():
        from .mapfile import open_partial  # which is built on this module

        return open_partial(path, variables)
    _check_exists(path)
    if check and not sound(path):
        raise StoreError(
            f"{path}: has no checksums; wiperjax did not write it, another program changed it "
            "since, or its end is lost"
        )
    try:
        return xr.open_dataset(path, engine="h5netcdf")
    except Exception as error:  # of a damaged file, HDF5 and what reads it may raise anything
        raise StoreError(
            f"{path}: is not a readable map or run: {str(error).splitlines()[0]}"
        ) from error


def sound(path: str | Path) -> bool:
    """Whether a file has checksums, and is what they say (so is the folder of an unfinished sweep,
    whose blocks are compared as they are read).

    Raises: `StoreError` that names what is damaged.
    """
    if Path(path).is_dir():
        return True
    damaged = damages(path)
    if damaged:
        raise StoreError(
            f"{path}: is damaged: {listed(damaged)}; a map is mended by the command of its sweep "
            "with --resume"
        )
    return damaged is not None


def damages(path: str | Path) -> list[checksums.Piece] | None:
    """What of a file is damaged, None if it has no checksums; see `checksums.damages`.

    Raises: `StoreError` if it cannot be read, or its checksums are damaged.
    """
    path = Path(path)
    _check_exists(path)
    try:
        with naming(path, "read"):
            return checksums.damages(path)
    except ValueError as error:
        raise StoreError(f"{path}: is damaged: {error}; make it anew with --force") from error


def _check_exists(path: Path) -> None:
    """Raises `StoreError` if `path` is no regular file; where a sweep is unfinished, says so."""
    if not path.exists():
        parts = parts_of(path)
        hint = (
            f"; an unfinished sweep is in {parts}: name that to look at it"
            if parts.is_dir()
            else ""
        )
        raise StoreError(f"{path}: does not exist{hint}")
    check_input(path)


def listed(damaged: Sequence[checksums.Piece]) -> str:
    """Names of damaged variables in a few words."""
    names = sorted({piece.variable for piece in damaged})
    return ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")


def parts_of(output: str | Path) -> Path:
    """Folder beside `output` that holds its finished blocks while the sweep is not complete."""
    return Path(f"{output}.parts")
