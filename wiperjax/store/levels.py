"""A refined map: finer points and borders as groups beside the map, which stays as it is.

    /            the map, as its sweep made it
    /level_K     points that only level K has, as a list: CF "compression by gathering", `cell` is
                 the number of each in the grid of that level (level_0: looked at again for longer)
    /borders     points on borders, their brackets and kinds, and what the search took

The new file is written elsewhere and takes the place of the old one whole.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import h5netcdf
import h5py
import numpy as np
import xarray as xr

from ..machine.files import StoreError, replacing
from ..vocabulary import cf
from ..vocabulary.columns import attributes_of, column_of, ordered
from ..vocabulary.wording import not_there
from . import checksums
from .spill import SpillFile

LIST, BORDERS, FACTOR, COMPUTED = "cell", "borders", "window_factor", "computed"
FINE = "_fine"  # ending of a level's axes: dimensions of one name have one length down a tree
FACTOR_ATTRS = {"long_name": "window over that of the map", "units": "1"}
MOST_BYTES = 8 * 10**9  # of a level read as a regular grid


class Level(NamedTuple):
    """Points of one level."""

    number: int
    axes: Mapping[str, np.ndarray]  # values of the level's grid, edge units
    index: np.ndarray  # of the points in it, C order, sorted
    factor: np.ndarray  # int16: times as long a window as the map's
    columns: Mapping[str, np.ndarray]


def write_levels(
    path: Path,
    mark: bytes,
    levels: Sequence[Level],
    borders: xr.Dataset,
    temporary: Path,
    last: Callable[[], Mapping[str, float]] = dict,
) -> None:
    """Puts groups into the finished map at `path`, in place of any that it has.

    Arguments:

    - `mark`: `checksums.mark` of the map that they are of.
    - `temporary`: where the new file is written; whoever clears that folder after a kill finds it.
    - `last`: numbers among the attributes of `borders` that are known when all is written and read
        back: called then.

    Raises: `StoreError` if it is another one by now, or cannot be written; it is then as it was.
    """
    with replacing(path, temporary):
        with SpillFile(temporary) as target:
            with open(path, "rb") as source:
                left = checksums.length(path)
                while left:
                    piece = source.read(min(left, 2**24))
                    target.write(piece)
                    target.check()
                    left -= len(piece)
            target.seek(0)
            with h5py.File(target, "r+") as file:
                for name in [n for n in file if isinstance(file[n], h5py.Group)]:
                    del file[name]
            target.check()
            with h5netcdf.File(target, "r+") as file:
                for level in levels:
                    _write_level(file, level)
                    target.check()
                _write_dataset(file.create_group(BORDERS), borders)
            target.finish()
        _read_back(temporary, levels)
        checksums.seal(temporary, last(), BORDERS)
        if checksums.mark(path) != mark:
            raise StoreError(
                f"{path}: was changed or replaced meanwhile: it is not the map whose borders were "
                "located; refine it again"
            )


def _write_level(file: Any, level: Level) -> None:
    group = file.create_group(f"level_{level.number}")
    sizes = {name + FINE: len(values) for name, values in level.axes.items()}
    group.dimensions = sizes | {LIST: len(level.index)}
    for name, values in level.axes.items():
        variable = group.create_variable(name + FINE, (name + FINE,), data=values)
        for key in ("units", "long_name"):
            variable.attrs[key] = file[name].attrs[key]
    attrs = {"compress": " ".join(sizes), "long_name": "number of the point in the level"}
    _variable(group, LIST, level.index, attrs | {"units": "1"})
    _variable(group, FACTOR, level.factor, FACTOR_ATTRS)
    for name, values in level.columns.items():
        _variable(group, name, values, attributes_of(name, file.attrs))
    group.attrs["level"] = level.number


def _variable(group: Any, name: str, values: np.ndarray, attrs: Mapping[str, Any]) -> None:
    packed = {"compression": "gzip", "shuffle": True} if len(values) > 64 else {}
    variable = group.create_variable(name, (LIST,), data=values, **packed)
    variable.attrs.update(attrs)


def _write_dataset(group: Any, ds: xr.Dataset) -> None:
    group.dimensions = {str(name): size for name, size in ds.sizes.items()}
    for name, variable in ds.variables.items():
        group.create_variable(name, variable.dims, data=variable.values).attrs.update(
            variable.attrs
        )
    group.attrs.update(cf.plain_attributes(ds.attrs))


def _read_back(path: Path, levels: Sequence[Level]) -> None:
    """Raises `StoreError` if a level reads back otherwise than it was written."""
    with h5py.File(path, "r") as file:
        for level in levels:
            group: Any = file[f"level_{level.number}"]
            for name, values in (
                {LIST: level.index, FACTOR: level.factor} | dict(level.columns)
            ).items():
                if not np.array_equal(group[name][...], values, equal_nan=values.dtype.kind == "f"):
                    raise StoreError(
                        f"{path}: {name} of level {level.number} reads back otherwise than it was "
                        "written; a failing disk?"
                    )


def read_levels(path: str | Path, variables: Sequence[str] | None = None) -> list[Level]:
    """The levels of a finished map, coarse to fine; none of a map that is not refined."""
    found = []
    with h5py.File(path, "r") as file:
        names = sorted(
            (n for n in map(str, file) if n.startswith("level_")), key=lambda n: int(n[6:])
        )
        for name in names:
            group: Any = file[name]
            axes = str(group[LIST].attrs["compress"]).split()
            columns = [c for c in ordered(group) if variables is None or c in variables]
            found.append(
                Level(
                    int(name[6:]),
                    {axis.removesuffix(FINE): group[axis][...] for axis in axes},
                    group[LIST][...],
                    group[FACTOR][...],
                    {name: group[name][...] for name in columns},
                )
            )
    return found


def is_refined(path: str | Path) -> bool:
    """Whether a file is a map with borders."""
    try:
        with h5py.File(path, "r") as file:
            return BORDERS in file
    except OSError:
        return False


def check_held(path: Path, variables: Sequence[str], held: Iterable[str]) -> None:
    """Raises `StoreError` unless the names of `variables` are all among those `held` by a file."""
    held = list(held)
    if missing := [name for name in variables if name not in held]:
        raise StoreError(f"{path}: {not_there(missing[0], 'file', held)}")


def at_level(ds: xr.Dataset, path: Path, level: int, variables: Sequence[str] | None) -> xr.Dataset:
    """A refined map `ds` as a regular grid of a level, in memory, with `computed` (int8, 1 where a
    point was looked at) and `window_factor` (int16, 0 elsewhere); elsewhere its variables hold what
    is not computed: NaN or -1.

    Raises: `StoreError` if it has no such level or lacks a variable, or there are too many points
        for the memory.
    """
    levels = read_levels(path, variables)
    last = max((one.number for one in levels), default=0)
    if level > last or not levels:
        reach = f"its levels are 0 to {last}" if levels else "it is not refined"
        raise StoreError(f"{path}: has no level {level}; {reach}")
    axes = {name: values[:: 2 ** (last - level)] for name, values in levels[-1].axes.items()}
    levels = [one for one in levels if one.number <= level]
    shape = tuple(len(values) for values in axes.values())
    names = [n for n in ordered(map(str, ds)) if ds[n].dims == tuple(axes)]
    if variables is not None:
        check_held(path, variables, [*names, COMPUTED, FACTOR, *axes])
        names = [n for n in names if n in variables]
    size = int(np.prod([float(n) for n in shape]))
    if 8 * size * (len(names) + 1) > MOST_BYTES:
        raise StoreError(
            f"{path}: level {level} is a grid of {size:.3g} points; name fewer `variables`, or a "
            "coarser level"
        )
    found = {name: np.full(size, column_of(name).missing, column_of(name).dtype) for name in names}
    factors = np.zeros(size, dtype=np.int16)

    def put(places: Any, number: int, factor: Any, columns: Mapping[str, Any]) -> None:
        scaled = [place << (level - number) for place in places]
        flat = np.ravel_multi_index(scaled, shape)
        factors[flat] = factor
        for name in names:
            if name in columns:
                found[name][flat] = columns[name]

    whole = [np.ravel(place) for place in np.indices([ds.sizes[name] for name in axes])]
    put(whole, 0, 1, {n: ds[n].transpose(*axes).values.ravel() for n in names})
    for one in levels:
        counts = tuple(len(values) for values in one.axes.values())
        put(np.unravel_index(one.index, counts), one.number, one.factor, one.columns)
    dims = tuple(axes)
    variables_ = {n: (dims, v.reshape(shape), attributes_of(n, ds.attrs)) for n, v in found.items()}
    words = {"long_name": "whether the point was looked at", "units": "1"}
    variables_[COMPUTED] = (dims, (factors > 0).astype(np.int8).reshape(shape), words)
    variables_[FACTOR] = (dims, factors.reshape(shape), FACTOR_ATTRS)
    coords = {name: ((name,), values, ds[name].attrs) for name, values in axes.items()}
    return xr.Dataset(variables_, coords=coords, attrs=ds.attrs | {"level": level})
