"""Finished maps: written whole, opened whole."""

import io
from collections.abc import Sequence
from pathlib import Path

import h5py
import xarray as xr

from ..datasets.borders import unfit, unfit_report
from ..machine.files import StoreError, check_input, check_output, naming, write_bytes
from ..vocabulary import checks
from ..vocabulary.ranges import Range
from . import checksums
from .blocks import BlockStore
from .levels import BORDERS, at_level, check_held, is_refined
from .manifest import parts_of
from .partial import open_partial


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
    write_bytes(Path(path), buffer.getvalue(), force)


def open_map(
    path: str | Path,
    variables: Sequence[str] | None = None,
    *,
    check: bool = False,
    level: int | None = None,
) -> xr.Dataset:
    """Dataset of a file that wiperjax wrote, read when used; close it, or use it in a `with`
    statement. Of the folder `MAP.h5.parts` of an unfinished sweep, what is done: see
    `partial.open_partial`.

    Arguments:

    - `variables`: names of those that are wanted; all if None.
    - `check`: compare the file with its checksums first, which reads all of it. (Blocks of an
        unfinished sweep always are.)
    - `level`: of a refined map the regular grid of this level, in memory, with `computed` (1 where
        a point was looked at) and `window_factor` (how many times the map's window it had, 0 where
        none was: counts of unlike windows do not compare).

    Raises: `StoreError` if there is no such file, it is no readable HDF5 file, or it lacks one of
        `variables`; with `check` also if it is damaged (the line says what) or has no checksums.
    """
    checks.path("path", path)
    if variables is not None:
        checks.names("variables", variables)
    checks.flag("check", check)
    if level is not None:
        checks.whole("level", level, Range(0, whole=True))
    path = Path(path)
    if path.is_dir():
        return open_partial(path, variables)
    check_exists(path)
    if check and not sound(path):
        raise StoreError(
            f"{path}: has no checksums; wiperjax did not write it, another program changed it "
            "since, or its end is lost"
        )
    try:
        with h5py.File(path) as file:
            _ = "Conventions" in file.attrs  # else h5netcdf fails, and once more as it is let go
        # of a strange file, whose dimensions have no names, without a warning of xarray's
        ds = xr.open_dataset(path, engine="h5netcdf", phony_dims="access")
    except Exception as error:  # of a damaged file, HDF5 and what reads it may raise anything
        raise StoreError(
            f"{path}: is not a readable map or run: {str(error).splitlines()[0]}"
        ) from error
    if level is not None:
        with ds:
            return at_level(ds, path, level, variables)
    for variable in ds.variables.values():
        if variable.dtype.kind in "iu":  # else the cells that `xr.concat` has no code for are saved
            variable.encoding.pop("dtype", None)  # as 0, which is quiet
    if variables is None:
        return ds
    try:
        check_held(path, variables, map(str, ds.variables))
    except StoreError:
        ds.close()
        raise
    chosen = ds[list(variables)]
    chosen.set_close(ds.close)
    return chosen


def open_finished(path: str | Path, *, check: bool = False) -> xr.Dataset:
    """`open_map` of a file; raises `StoreError` for a folder, of an unfinished sweep or another."""
    if Path(path).is_dir():
        BlockStore.peek(path)  # says so of another
        raise StoreError(f"{path}: is not a finished map; finish it with --resume first")
    return open_map(path, check=check)


def borders(path: str | Path) -> xr.Dataset:
    """Points on the borders of a refined map, in memory, one along `border`: its place along each
    axis, the axis along which it is enclosed, the bracket, the answers on both sides, the kind of
    crossing; as attributes what the search took and what it can promise.

    Raises: `StoreError` if `path` is no readable map, is not refined, or has borders that another
        program changed into none.
    """
    checks.path("path", path)
    check_exists(Path(path))
    try:
        with xr.open_dataset(path, engine="h5netcdf", group=BORDERS) as ds:
            found = ds.load()
    except Exception as error:  # of a damaged file, HDF5 and what reads it may raise anything
        if is_refined(path):
            raise StoreError(f"{path}: has borders that cannot be read: {error}") from error
        raise StoreError(
            f"{path}: has no borders; 'wiperjax refine' locates those of a map"
        ) from None
    if why := unfit(found) or unfit_report(found):
        raise StoreError(f"{path}: its borders have {why}: another program changed them")
    return found


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
            "with --resume, others are computed again"
        )
    return damaged is not None


def damages(path: str | Path) -> list[checksums.Piece] | None:
    """What of a file is damaged, None if it has no checksums; see `checksums.damages`.

    Raises: `StoreError` if it cannot be read, or its checksums are damaged.
    """
    path = Path(path)
    check_exists(path)
    try:
        with naming(path, "read"):
            return checksums.damages(path)
    except ValueError as error:
        raise StoreError(f"{path}: is damaged: {error}; make it anew with --force") from error


def check_exists(path: Path) -> None:
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
