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
from .run_dataset import unfit


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


def check_kind(ds: xr.Dataset, wanted: Iterable[str], use: str, path: str | Path = "") -> str:
    """The kind of a dataset, from the file at `path` if it is from one.

    Raises: `StoreError` unless it is one of `wanted`, which alone can be `use`d.
    """
    kind = kind_of(ds)
    if kind not in wanted:
        *others, last = (PRODUCTS[name].words for name in wanted)
        only = f"{', '.join(others)} or {last}" if others else last
        where = f"{path}: " if path else ""
        no_run = PRODUCTS["run"].told_by
        why = f", for {unfit(ds)}" if not kind and set(no_run) <= {*map(str, ds.variables)} else ""
        raise StoreError(f"{where}{holds(kind)}{why}; only {only} can be {use}")
    return kind


def check_argument(name: str, value: Any, wanted: Iterable[str]) -> str:
    """The kind of an argument. Raises: `ValueError` unless it is a dataset of a kind `wanted`."""
    such = " or ".join(PRODUCTS[one].such_as for one in wanted)
    checks.instance(name, value, xr.Dataset, such)
    if (kind := kind_of(value)) not in wanted:
        why = "" if kind else unfit(value)
        raise ValueError(f"{name} must be {such}, but {why or holds(kind)}")
    return kind
