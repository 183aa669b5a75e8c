"""The sweep that a map was made by, read from the map: what computes more of it asks here, so that
nothing of another system is put beside what the map holds.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import xarray as xr

from ..datasets.kinds import kind_of
from ..machine.files import StoreError
from ..specs.imported import findable, paths_in
from ..specs.load import parse_sweep
from ..specs.sweep import SweepSpec
from .manifest import unlike


def sweep_of(ds: xr.Dataset, path: str | Path) -> SweepSpec:
    """The sweep that the map at `path`, opened as `ds`, was made by.

    Raises: `StoreError` for what is no such map, and where its sweep means something else by now (a
    class of one's own has another source or table, or a version of wiperjax reads it otherwise);
    `SpecError` where it cannot be read any more.
    """
    check_swept(ds, path)
    spec = read_again(json.loads(ds.attrs["specification"]), Path(path), str(path))
    check_made_from(spec, ds, path)
    return spec


def read_again(specification: Any, path: Path, source: str) -> SweepSpec:
    """The sweep of the specification in the map at `path`; modules that it names may lie beside the
    map, as beside a sweep file. Raises: `SpecError` that begins with `source`.
    """
    if paths_in(specification):  # else nothing there is imported
        findable(path.parent)
    return parse_sweep(specification, source)


def check_swept(ds: xr.Dataset, path: str | Path, read: bool = True) -> None:
    """Raises `StoreError` unless the dataset of a file is a map that a sweep made; `read`: whose
    specification can be read again.
    """
    wanted = {"specification_digest"} | ({"specification"} if read else set())
    if not wanted <= ds.attrs.keys() or kind_of(ds) != "map":
        raise StoreError(f"{path}: is not a map that a sweep made")


def check_made_from(
    spec: Any, ds: xr.Dataset, path: str | Path, identity: Mapping[str, str] | None = None
) -> None:
    """Raises `StoreError` that says what differs unless a map was made from the sweep `spec`, and
    by what has this `identity`, if one is given.
    """
    if said := otherwise(ds.attrs, spec, identity):
        raise StoreError(f"{path}: was made otherwise ({said}); sweep it anew")


def otherwise(
    attrs: Mapping[str, Any], spec: Any, identity: Mapping[str, str] | None = None
) -> str:
    """What differs between that which a map with these attributes was made from and a sweep, in
    words for a person; empty if nothing does. `identity`: what else must agree, if it must.
    """
    was = {"specification": str(attrs.get("specification_canonical", "{}"))}
    if identity is not None:
        was |= json.loads(attrs.get("identity", "{}"))
    return unlike(was, {"specification": spec.canonical()} | dict(identity or {}))
