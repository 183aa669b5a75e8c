"""Single files that survive: atomic writes, clear errors, reading maps.

Each file is written to a temporary name, flushed to the disk and renamed, so it is there whole or
not at all.
"""

import contextlib
import io
import logging
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import xarray as xr

from . import checks

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
    temporary = Path(temporary) if temporary else path.with_name(f".{path.name}.{os.getpid()}.tmp")
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


def check_output(path: str | Path, force: bool = False) -> None:
    """Raises `StoreError` if `path` exists (without `force`) or cannot be made in its folder."""
    path = Path(path)
    if not path.parent.is_dir():
        raise StoreError(f"{path}: cannot be written: {path.parent} is not an existing folder")
    if path.is_dir():
        raise StoreError(f"{path}: cannot be written: it is a folder")
    if path.exists() and not force:
        raise StoreError(f"{path}: exists already; use --force to replace it, or another name")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise StoreError(f"{path}: cannot be written: no permission to write in {path.parent}")


def write_dataset(ds: xr.Dataset, path: str | Path, force: bool = False) -> None:
    """Writes a whole dataset (a run, a small map) to one HDF5 file, at once or not at all.

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
    write_bytes(Path(path), buffer.getvalue())


def open_map(path: str | Path, variables: Sequence[str] | None = None) -> xr.Dataset:
    """Dataset of a file that wiperjax wrote, read when used; close it, or use it in a `with`
    statement. Of the folder `MAP.h5.parts` of an unfinished sweep, what is done of these
    `variables` (all if None): see `mapfile.open_partial`.

    Raises: `StoreError` if there is no such file or it is no readable HDF5 file.
    """
    checks.path("path", path)
    if variables is not None:
        checks.names("variables", variables)
    path = Path(path)
    if path.is_dir():
        from .mapfile import open_partial  # which is built on this module

        return open_partial(path, variables)
    if not path.exists():
        parts = parts_of(path)
        hint = (
            f"; an unfinished sweep is in {parts}: name that to look at it"
            if parts.is_dir()
            else ""
        )
        raise StoreError(f"{path}: does not exist{hint}")
    try:
        return xr.open_dataset(path, engine="h5netcdf")
    except (OSError, ValueError, KeyError) as error:
        raise StoreError(
            f"{path}: is not a readable map or run: {str(error).splitlines()[0]}"
        ) from error


def parts_of(output: str | Path) -> Path:
    """Folder beside `output` that holds its finished blocks while the sweep is not complete."""
    return Path(f"{output}.parts")
