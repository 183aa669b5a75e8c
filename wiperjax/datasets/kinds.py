"""Which of the products of this package a dataset is: every place that draws, prints, hears or
writes one asks here.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import xarray as xr

from ..machine.files import StoreError
from ..vocabulary import checks
from ..vocabulary.products import PRODUCTS
from . import branch_dataset, map_fit, run_fit
from .run_fit import unfit


def kind_of(ds: xr.Dataset) -> str:
    """Name in `PRODUCTS`; empty of what is none of them, or none any more: joined or cut so that
    regimes do not lie along time, say.
    """
    names = {*map(str, ds.variables)}
    if str(ds.attrs.get("cells_done")) == "0":
        names.add("cells_done")
    kind = next((kind for kind, made in PRODUCTS.items() if names.issuperset(made.told_by)), "")
    if kind == "modes" and set(ds["shape_amplitude"].dims) != {"axis", "mode"}:
        return ""
    return "" if kind == "run" and unfit(ds) else kind


def holds(kind: str) -> str:
    """What a file with a dataset of this kind holds, in words."""
    return f"holds {PRODUCTS[kind].words if kind else 'something else'}"


def why_none(ds: xr.Dataset) -> str:
    """Why a dataset of no kind is no run, in words; empty of what has little of one."""
    lost = [name for name in PRODUCTS["run"].told_by if name not in ds.variables]
    if not lost:
        return unfit(ds)
    return f"it has no {lost[0]}, which a run has" if len(lost) == 1 else ""


def doubts(ds: xr.Dataset) -> list[str]:
    """What a dataset holds that its kind cannot, or of which no more can be told, in words."""
    of = {"run": run_fit.doubts, "map": map_fit.doubts, "branch": branch_dataset.doubts}
    return list(of.get(kind_of(ds), lambda ds: ())(ds))


def check_kind(ds: xr.Dataset, wanted: Iterable[str], use: str, path: str | Path = "") -> str:
    """The kind of a dataset, from the file at `path` if it is from one.

    Raises: `StoreError` unless it is one of `wanted`, which alone can be `use`d.
    """
    kind = kind_of(ds)
    if kind not in wanted:
        *others, last = (PRODUCTS[name].words for name in wanted)
        only = f"{', '.join(others)} or {last}" if others else last
        where = f"{path}: " if path else ""
        why = f", for {why}" if not kind and (why := why_none(ds)) else ""
        raise StoreError(f"{where}{holds(kind)}{why}; only {only} can be {use}")
    return kind


def check_argument(name: str, value: Any, wanted: Iterable[str]) -> str:
    """The kind of an argument. Raises: `ValueError` unless it is a dataset of a kind `wanted`."""
    such = " or ".join(PRODUCTS[one].such_as for one in wanted)
    checks.instance(name, value, xr.Dataset, such)
    if (kind := kind_of(value)) not in wanted:
        why = "" if kind else why_none(value)
        raise ValueError(f"{name} must be {such}, but {why or holds(kind)}")
    return kind
