"""A map that is explored: checked once, then read plane by plane, so that memory stays bounded."""

import html
import json
import math
from collections.abc import Iterable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..datasets.kinds import check_kind
from ..datasets.map_starts import from_start
from ..machine.files import StoreError, naming
from ..noise.class_counts import ENDED
from ..plots.maps.borders import PREFIX, with_borders
from ..plots.maps.planes import map_dims, usual_plane
from ..plots.style.axes import axis_numbers, is_ordered, long_name, shown
from ..specs.imported import paths_in
from ..specs.load import SpecError
from ..store.levels import is_refined
from ..store.swept import otherwise, read_again
from ..store.whole import borders, open_finished, sound
from ..vocabulary.cf import flag_names
from ..vocabulary.wording import shorten
from .unpacked import Unpacked

MOST_PLANE = 4_000_000  # cells of a plane: more than a screen has points
MOST_CHUNK = 2**26  # cells that are unpacked at once: a file may claim any number
MOST_AXES = 12
EVERY = ("label", "growth_rate", "class_set", "class_share")  # what each plane needs
MOST_KEPT = 2**25  # bytes of a variable of these that is kept in memory, of any size of map
USUAL = (  # variables that are offered first, as far as a map has them
    *("label", "mechanism", "dominant_frequency", "stick_fraction", "flight_fraction"),
    *("velocity_rms", "normal_force_max", "growth_rate", "settled", "band"),
)


@dataclass(frozen=True, eq=False)  # two are one only if they are the same object
class Explored:
    """A map whose planes are read when they are shown.

    Attributes:
        name: of the file, for a person.
        ds: the map; its variables are read when used.
        spec: the sweep it was made from, None if its cells cannot be simulated.
        unable: why they cannot; empty if they can.
        dims: its axes.
        starts: names or numbers of the starts of a cell that the map holds; empty where it does not
            tell starts apart.
        unpacked: pieces of its file that planes side by side share.
    """

    name: str
    ds: xr.Dataset
    spec: Any
    unable: str
    dims: tuple[str, ...]
    starts: tuple[Any, ...] = ()
    unpacked: Unpacked = field(default_factory=Unpacked)

    @cached_property
    def variables(self) -> dict[str, str]:
        """Variable -> its words, of those with a value for each cell; usual ones first."""
        held = [
            str(name)
            for name, variable in self.ds.data_vars.items()
            if set(variable.dims) - {"start"} == set(self.dims)
            and variable.dtype.kind in "iuf"
            and "flag_masks" not in variable.attrs
        ]
        order = [name for name in USUAL if name in held]
        order += [name for name in held if name not in order]
        return {name: plain(long_name(self.ds[name])) for name in order}

    @property
    def usual_start(self) -> str:
        """Which start is shown where none is chosen; empty where each cell has but one."""
        if len(self.starts) < 2:
            return ""
        first = "first of most frequent class" if "class_share" in self.ds else self.starts[0]
        return plain(str(first))

    def axis_words(self, name: str) -> tuple[str, str, list[str]]:
        """What an axis is, its unit, and its values, all as text; of no axis ("") nothing."""
        if not name:
            return "", "", [""]
        values, unit = shown(self.ds[name])
        texts = [f"{text} {unit}".strip() for text in axis_numbers(values)]
        return plain(long_name(self.ds[name])), plain(unit), texts

    def plane(self, x: str, y: str, at: dict[str, int], start: Any, names: set[str]) -> xr.Dataset:
        """The variables `names` of one plane, in memory; what else a plane needs is read too.

        Arguments: axes across and up ("": none, the plane is one row of cells); axis -> place of
        each other one; start, None: the usual one.

        Raises: `ValueError` for a plane that no screen could show, `StoreError` for a file that has
            been damaged since it was opened.
        """
        rows = self.ds.sizes[y] if y else 1
        if self.ds.sizes[x] * rows > MOST_PLANE:
            size = f"{self.ds.sizes[x]:,} x {rows:,}"
            raise ValueError(f"a plane of {size} cells cannot be shown; at most {MOST_PLANE:,} can")
        wanted = names.union(EVERY)
        held = [
            str(name)
            for name in self.ds.variables
            if name in wanted or str(name).startswith(PREFIX)
        ]
        whole = dict.fromkeys(self.dims, slice(None))  # said: else the map itself would be loaded
        plane = self.ds[held].isel(whole | {k: n for k, n in at.items() if k not in (x, y)})
        with self._reading():
            self.unpacked.keep(n for n in held if not self.ds[n].variable._in_memory)
            plane = from_start(plane.load(), start)
        return (plane if y else plane.expand_dims({y: 1})).transpose(y, x, ...)

    def plane_axes(self) -> tuple[str, str]:
        """Axes that are shown first across and up; "" up in a map of one axis."""
        x, y = usual_plane([dim for dim in self.dims if self.ds.sizes[dim] > 1])
        return x or "", y or ""

    def cell(
        self, place: dict[str, int], names: Iterable[str], start: Any = None
    ) -> dict[str, float]:
        """The numbers `names` of one cell, as far as the map has them; of one that ended early its
        class alone: the others are of a part of its motion. Of one that `ds.where` took out none.

        Raises: `StoreError` as `plane`.
        """
        held = [name for name in names if name in self.variables]
        wanted = {*held, "label", *(n for n in ("class_share", "class_set") if n in self.ds)}
        with self._reading():
            one = from_start(self.ds[sorted(wanted)].isel(place).load(), start)
        code = float(one["label"])
        told = ["label"] if code in ENDED.values() else held
        return {} if np.isnan(code) else {name: float(one[name]) for name in held if name in told}

    def _reading(self) -> AbstractContextManager[None]:
        """Names the file where it cannot be read: what HDF5 says of it is no sentence."""
        source = Path(self.ds.encoding.get("source", self.name))
        return naming(Path(source.name), "read")


def open_explored(path: str | Path, trusted: bool = False) -> tuple[Explored, Any]:
    """A map from its file, and the file, to be closed; `trusted` as in `explored`.

    Raises: `StoreError`, one line, for what is damaged, cannot be read or is no map to be shown.
    """
    sound(path)  # else HDF5 may hang in what is damaged, or show what is wrong
    ds = open_finished(path)
    try:
        found = explored(ds, Path(path).name, trusted)
        if is_refined(path):
            found = replace(found, ds=with_borders(found.ds, borders(path)))
        return found, ds
    except StoreError as error:
        ds.close()
        raise StoreError(f"{path}: {error}") from None
    except Exception as error:  # a file may hold anything under any name
        ds.close()
        raise StoreError(f"{path}: cannot be explored: {plain(str(error))}") from None


def explored(ds: xr.Dataset, name: str = "", trusted: bool = False) -> Explored:
    """A dataset as a map to explore. Only if it is `trusted` are modules imported that it names (of
    a system or a friction law of one's own): importing runs them.

    Raises: `StoreError` for one that cannot be shown.
    """
    check_kind(ds, ["map"], "explored")
    dims = tuple(dim for dim in map_dims(ds) if dim != "start")
    if not 1 <= len(dims) <= MOST_AXES:
        raise StoreError(f"must have 1 to {MOST_AXES} axes, but has {len(dims)}")
    for dim in dims:
        _check_axis(ds, dim)
    if all(ds.sizes[dim] < 2 for dim in dims):
        raise StoreError("has one cell alone; 'wiperjax simulate' shows the motion of a scene")
    if "flag_values" not in ds["label"].attrs:
        raise StoreError("has classes without names ('label' has no flag_values)")
    for variable in ds.data_vars.values():
        _check_variable(variable)
    told = "start" in ds["label"].dims or "start" in ds.coords and not ds["start"].ndim
    starts = tuple(ds["start"].values.reshape(-1).tolist()) if told else ()
    spec, unable = _specification(ds, dims, starts, trusted)
    ds = ds.copy()
    for every in EVERY:  # else a slider waits for the file, three times a plane
        if every in ds and ds[every].nbytes <= MOST_KEPT:
            ds[every].load()
    source = str(ds.encoding.get("source", ""))
    return Explored(plain(name), ds, spec, unable, dims, starts, Unpacked(source))


def _check_axis(ds: xr.Dataset, dim: str) -> None:
    """Raises StoreError for an axis that has no sensible values."""
    if dim not in ds.coords:
        raise StoreError(f"has an axis without values ({plain(dim)})")
    values = ds[dim].values
    if values.dtype.kind not in "iuf" or not np.isfinite(values.astype(float)).all():
        raise StoreError(f"has an axis whose values are no finite numbers ({plain(dim)})")
    if not is_ordered(values):
        raise StoreError(f"has an axis whose values neither rise nor fall ({plain(dim)})")


def _check_variable(variable: xr.DataArray) -> None:
    """Raises StoreError for a variable that would fill the memory, or whose names do not fit."""
    name = plain(str(variable.name))
    chunk = variable.encoding.get("chunksizes") or (1,)
    if math.prod(int(n) for n in chunk) > MOST_CHUNK:
        raise StoreError(f"has a variable in pieces too large to be read ({name})")
    if "flag_values" in variable.attrs:
        try:
            flag_names(variable)
        except (KeyError, ValueError, TypeError):
            raise StoreError(f"has codes whose names do not fit ({name})") from None


def _specification(
    ds: xr.Dataset, dims: tuple[str, ...], starts: tuple[Any, ...], trusted: bool
) -> tuple[Any, str]:
    """The sweep that a map was made from, or None and why its cells cannot be simulated."""
    text = ds.attrs.get("specification")
    if not isinstance(text, str):
        return None, "the map does not say what it was made from"
    try:
        data = json.loads(text)
        if not trusted and (named := sorted(paths_in(data).values())):
            return None, plain(f"it names a module ({named[0]}), which only --trust imports")
        path = Path(ds.encoding.get("source", ""))
        spec = read_again(data, path, "the specification in the map")
        differs = otherwise(ds.attrs, spec)
    except (SpecError, ValueError, RecursionError) as error:
        return None, plain(str(error))
    axes = spec.axes_values()
    same = tuple(axes) == dims and all(
        len(axes[dim]) == ds.sizes[dim] and np.allclose(axes[dim], ds[dim], rtol=1e-12, atol=0)
        for dim in dims
    )
    if not same:
        return None, "the axes of the map are not those it was made from"
    for name, value in spec.fixed().items():  # attributes and axes may be those of another map
        entry = spec.parameter_table.get(name)
        made = entry.to_edge(value) if entry else value
        if name in ds.coords and not np.allclose(ds[name], made, rtol=1e-9, atol=0):
            return None, f"{name} is not the {made:g} that the map says it was made with"
    if spec.starts is not None and not _are_of(starts, spec.starts):
        return None, "the starts of the map are not those it was made from"
    if differs:  # else motions are drawn that are not the map's
        return None, plain(f"the map was made otherwise ({differs})")
    return spec, ""


def _are_of(starts: tuple[Any, ...], made: Any) -> bool:
    """Whether a map has starts, and only such as the table `[starts]` names or draws."""
    return bool(starts) and set(starts) <= set(made.names or range(made.count))


def plain(text: str, length: int = 200) -> str:
    """Words of a file as text on one line: nothing in them is read as mark-up or mathematics."""
    text = " ".join("".join(c if c.isprintable() else " " for c in str(text)).split())
    for mark in ("$$", "\\(", "\\["):
        text = text.replace(mark, " ")
    return shorten(text, length)


def escaped(text: Any) -> str:
    """`plain` text for use in HTML."""
    return html.escape(plain(str(text)))
