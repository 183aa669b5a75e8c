"""Checking a finished map: a random sample of its cells computed again and compared."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import xarray as xr

from ..datasets import map_dataset
from ..machine import provenance
from ..machine.files import StoreError
from ..specs.sweep import SweepSpec
from ..store.levels import read_levels
from ..store.swept import check_made_from, check_swept, sweep_of
from ..store.whole import open_finished
from ..vocabulary import checks
from ..vocabulary.cf import plain_attributes
from ..vocabulary.codes import NOT_COMPUTED
from ..vocabulary.columns import attributes_of
from ..vocabulary.ranges import NON_NEGATIVE, Range
from .block import MOST_CELLS, Evaluate, engine, evaluate_block
from .refine.grid import Grid
from .refine.points import sample
from .starts import before, ended_columns

NO_NUMBERS = ("title", "specification", "specification_text", *provenance.maker())
PROSE = ("long_name", "comment")  # of a variable: another version may word them otherwise


@dataclass(frozen=True)
class VerifyReport:
    """How a random sample of recomputed cells agrees with a map.

    Attributes:
        cells: number of cells recomputed.
        points: number of points of the levels of a refined map recomputed.
        columns: number of columns compared.
        largest: column -> largest relative difference, of the columns that are not bit-identical.
        differing: numbers of the cells in which anything differs by more than the tolerance; of
            finer points their number in the grid of the finest level.
        tolerance: relative difference allowed; codes and counts must be equal.
        same_versions: whether the map was made with the library versions of now.
    """

    cells: int
    columns: int
    tolerance: float
    same_versions: bool
    points: int = 0
    largest: dict[str, float] = field(default_factory=dict)
    differing: tuple[int, ...] = ()

    @property
    def identical(self) -> bool:
        """Whether every number agrees to the last bit."""
        return not self.largest

    @property
    def passed(self) -> bool:
        """Whether every number agrees within the tolerance."""
        return not self.differing


def verify(
    path: str | Path,
    cells: int = 64,
    seed: int = 0,
    *,
    tolerance: float = 1e-9,
    spec: SweepSpec | None = None,
    evaluate: Evaluate | None = None,
) -> VerifyReport:
    """Recomputes a random sample of the cells of a map and compares all their columns. Before that,
    compares the file with its checksums, and its coordinates (of a refined map also those of its
    finer points) and attributes with its sweep. Borders are not located again.

    Arguments:

    - `path`: the map.
    - `cells`, `seed`: size of the sample, drawn without repetition; of a refined map as many of its
        finer points beside.
    - `tolerance`: largest relative difference that passes.
    - `spec`: the sweep; read from the map if None.
    - `evaluate`: as in `sweep`.

    Raises: `StoreError` if `path` is no map, is damaged or has no checksums, or `spec` is not
        what it was made from, or the map says something else of its cells.
    """
    checks.path("path", path)
    cells = checks.whole("cells", cells, Range(1, MOST_CELLS, whole=True))
    seed = checks.whole("seed", seed, Range(0, whole=True))
    tolerance = checks.number("tolerance", tolerance, NON_NEGATIVE)
    if spec is not None:
        checks.instance("spec", spec, SweepSpec, "a sweep of wiperjax.load_sweep or parse_sweep")
    with open_finished(path, check=True) as ds:
        if spec is None:
            spec = sweep_of(ds, path)
        else:
            check_swept(ds, path, read=False)
            check_made_from(spec, ds, path)
        _check_said(ds, spec, path)
        same = json.loads(ds.attrs.get("versions", "{}")) == provenance.versions()
        index = np.sort(
            np.random.default_rng(seed).choice(spec.size, size=min(cells, spec.size), replace=False)
        )
        names = [str(name) for name in ds.data_vars]
    # Cell by cell, and not through xarray: it would read all that lies between them, or take long.
    places = list(zip(*np.unravel_index(index, spec.shape), strict=True))
    with h5py.File(path, "r") as file:
        stored = {name: _values(file, name, places) for name in names}
        neighbours = _neighbours(file, spec, index) if spec.starts is not None else None
    evaluate = evaluate or engine()[0]
    fresh, _ = evaluate_block(spec, index, evaluate, neighbours)
    compared = _Compared(tolerance)
    differing = index[compared.add(fresh, stored)]
    points = 0
    for some, columns in sample(Path(path), spec, cells, seed):
        points += len(some.index)
        now, _ = evaluate_block(some, np.arange(some.size), evaluate)
        wrong = compared.add(now, columns)
        differing = np.concatenate([differing, some.index[wrong]])
    return VerifyReport(
        cells=len(index),
        points=points,
        columns=len(fresh.keys() & stored.keys()),
        tolerance=tolerance,
        same_versions=same,
        largest=dict(sorted(compared.largest.items())),
        differing=tuple(int(cell) for cell in differing),
    )


def _check_said(ds: xr.Dataset, spec: Any, path: str | Path) -> None:
    """Raises `StoreError` where coordinates, attributes, or units or codes of variables are not
    those that a map of the sweep `spec` has: right numbers would stand at wrong places, or mean
    something else.
    """
    described = map_dataset.describe(spec)
    known = plain_attributes(described["attrs"])
    every = described["coords"] | described["further_coords"]
    wrong = [
        name
        for name, entry in every.items()
        if name not in ds
        or not np.array_equal(ds[name].values, map_dataset.coordinate(entry))
        or _unlike(ds[name].attrs, entry["attrs"])
    ]
    for name, variable in ds.data_vars.items():
        if _unlike(variable.attrs, attributes_of(str(name), described["attrs"])):
            wrong.append(str(name))
    wrong += _unlike(ds.attrs, {k: v for k, v in known.items() if k not in NO_NUMBERS})
    if levels := read_levels(path, ()):  # of a refined map
        grid = Grid(spec.axes, levels[-1].number)
        for level in levels:
            finer = _unlike(level.axes, grid.along_level(level.number))
            wrong += [f"{name} of level {level.number}" for name in finer]
    if wrong:
        said = ", ".join(wrong[:6])
        raise StoreError(f"{path}: was changed: what it says of {said} is not that of its sweep")


def _unlike(was: Mapping[str, Any], wanted: Mapping[str, Any]) -> list[str]:
    """Names of what is not as wanted, prose aside."""
    names = [name for name in wanted if name not in PROSE]
    return [n for n in names if n not in was or not np.array_equal(was[n], wanted[n])]


def _neighbours(file: h5py.File, spec: Any, index: np.ndarray) -> dict[str, dict[str, np.ndarray]]:
    """Way -> where the cells ended from which the cells `index` go on."""
    found = {}
    for way in spec.starts.ways:
        cells, start = before(spec, index, way), spec.starts.names.index(way)
        places = list(zip(*np.unravel_index(np.maximum(cells, 0), spec.shape), strict=True))
        found[way] = {name: _values(file, name, places)[:, start] for name in ended_columns(spec)}
        found[way]["result"] = np.where(cells < 0, NOT_COMPUTED, found[way]["result"])
    return found


class _Compared:
    """Columns computed again beside those that are stored, and what differs most."""

    def __init__(self, tolerance: float):
        self.tolerance = tolerance
        self.largest: dict[str, float] = {}

    def add(self, fresh: dict[str, np.ndarray], stored: dict[str, np.ndarray]) -> np.ndarray:
        """Which cells differ by more than the tolerance, of the columns that both have."""
        wrong = np.zeros(len(next(iter(fresh.values()))), dtype=bool)
        for name in fresh.keys() & stored.keys():
            now, was = fresh[name], stored[name]
            equal = (now == was) | ((now != now) & (was != was))
            if equal.all():
                continue
            with np.errstate(all="ignore"):
                gap = np.abs(now.astype(float) - was) / np.maximum(
                    np.abs(now.astype(float)), np.abs(was)
                )
            gap = np.where(equal, 0.0, np.nan_to_num(gap, nan=np.inf))
            self.largest[name] = max(self.largest.get(name, 0.0), float(gap.max()))
            too_far = gap > (self.tolerance if now.dtype.kind == "f" else 0.0)
            wrong |= too_far.reshape(len(wrong), -1).any(axis=1)
        return wrong


def _values(file: h5py.File, name: str, places: list[tuple[int, ...]]) -> np.ndarray:
    """Values of the variable `name` at some cells, the cells first."""
    variable: Any = file[name]
    return np.stack([variable[place] for place in places])
