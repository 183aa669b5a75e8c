"""Classes counted: the table and the anatomy of a map, and the error of a share."""

from typing import Any

import numpy as np
import xarray as xr

from ..vocabulary import checks
from ..vocabulary.cf import flag_names
from ..vocabulary.codes import LABELS, NOT_COMPUTED, SETTLED, TOLD, VALIDITY
from ..vocabulary.products import PRODUCTS
from ..vocabulary.ranges import COUNT, NON_NEGATIVE
from .agreement import held

ENDED = {  # cells that hold what was counted until they ended, if anything
    "failed": LABELS["failed"],
    "collapsed": LABELS["collapsed"],
    "not_computed": NOT_COMPUTED,
}


def class_table(ds: xr.Dataset, variable: str = "label") -> list[tuple[str, int, float]]:
    """Name, number of cells and share of each class of a map, in the order of the codes; also of
    `mechanism`, `band`, `settled` and `result`.

    Cells that are not computed (a partly finished store) are not counted.

    Raises: ValueError for what is no map, or has no such codes (`whole_codes`).
    """
    checks.instance("ds", ds, xr.Dataset, PRODUCTS["map"].such_as)
    if "label" not in ds:
        raise ValueError(f"ds must be {PRODUCTS['map'].such_as}, but has no label")
    coded = [str(name) for name in ds.data_vars if "flag_values" in ds[name].attrs]
    checks.choice("variable", variable, dict.fromkeys(["label", *coded]))
    names = flag_names(ds[variable])
    codes, counts = np.unique(whole_codes(ds[variable]), return_counts=True)
    found = {int(code): int(count) for code, count in zip(codes, counts, strict=True) if code >= 0}
    total = max(1, sum(found.values()))
    unnamed = {code: f"code_{code}" for code in found if code not in names}
    return [
        (name, found.get(code, 0), found.get(code, 0) / total)
        for code, name in (names | unnamed).items()
        if code >= 0
    ]


def whole_codes(variable: xr.DataArray) -> np.ndarray:
    """Codes of the cells of a map, of the same shape; NaN where `ds.where` took a cell out.

    Raises: ValueError where one is no number, or lies between two codes, which is no answer of any
        cell.
    """
    codes = np.asarray(variable)
    if codes.dtype.kind not in "biuf":
        raise ValueError(f"{variable.name} must be whole codes, but is of {codes.dtype}")
    broken = codes[np.isfinite(codes) & (codes != np.round(codes))]
    if broken.size:
        must = f"{variable.name} must be whole codes, but had {broken[0]:g}"
        raise ValueError(f"{must}: they were averaged or interpolated; ds.sel takes whole cells")
    return codes


def cell_by_cell(ds: xr.Dataset) -> xr.Dataset:
    """A map whose variables have the dimensions of its label in their order, so that what has the
    same place in two of them is of one cell: `xr.where` orders as its condition names them.
    """
    return ds.transpose(*ds["label"].dims, ...)


def anatomy(ds: xr.Dataset, label: str = "other") -> list[tuple[str, str, int]]:
    """Mechanism, band and number of cells of one class of a map, the most frequent first."""
    ds = cell_by_cell(ds)
    chosen = np.asarray(ds["label"]) == LABELS[label]
    mechanisms, bands = flag_names(ds["mechanism"]), flag_names(ds["band"])
    pairs = np.stack([np.asarray(ds[name])[chosen] for name in ("mechanism", "band")])
    kinds, counts = np.unique(pairs, axis=1, return_counts=True)
    rows = [
        (mechanisms[int(m)], bands[int(b)], int(n))
        for (m, b), n in zip(kinds.T, counts, strict=True)
    ]
    return sorted(rows, key=lambda row: -row[2])


def failures(ds: xr.Dataset) -> list[tuple[str, int]]:
    """Result and number of the cells of a map that failed, the most frequent first. Those that
    `finished` lack numbers that their class rests on.
    """
    if "result" not in ds:
        return []
    failed = ds[["label", "result"]].where(ds["label"] == LABELS["failed"])
    rows = [(name, count) for name, count, _ in class_table(failed, "result") if count]
    return sorted(rows, key=lambda row: -row[1])


def untold_count(ds: xr.Dataset) -> int:
    """Number of noisy cells whose frequency the finest samples do not tell."""
    if "frequency_told" not in ds:
        return 0
    return int(((ds["frequency_told"] == TOLD["no"]) & (ds["label"] != LABELS["quiet"])).sum())


def unsettled(ds: xr.Dataset) -> xr.DataArray:
    """Which cells' motion had not settled in the window, or is irregular for good."""
    if "settled" not in ds:
        return xr.zeros_like(ds["label"], dtype=bool)
    return (ds["settled"] == SETTLED["no"]) & ~ds["label"].isin(list(ENDED.values()))


def unsettled_count(ds: xr.Dataset) -> int:
    """Number of cells that are `unsettled`."""
    return int(unsettled(ds).sum())


def cut_count(ds: xr.Dataset) -> int:
    """Number of noisy cells on no belt that turns whose derivatives are called fine, but which did
    not come back to themselves in the window: its ends cut their noise at no phase that is kept.
    """
    if "noise_period" not in ds:
        return 0
    silent = [*ENDED.values(), LABELS["quiet"]]
    cut = (ds["sensitivity_code"] == VALIDITY["fine"]) & ds["noise_period"].isnull()
    return int((cut & ds["label"].notnull() & ~ds["label"].isin(silent)).sum())


def lifted_count(ds: xr.Dataset) -> int:
    """Number of cells of a map in which its model is `held` on the glass."""
    return int(held(ds.attrs.get("model"), ds).sum()) if "flight_fraction" in ds else 0


def share_error(count: Any, of: int) -> np.ndarray:
    """Standard error of a share, `count` seen among `of` independent ones.

    Of (count + 2)/(of + 4), the middle of Wilson's interval at two standard errors (A. Agresti and
    B. A. Coull, The American Statistician 52 (1998) 119): what was never seen is not known to be
    impossible. Raises: `ValueError` for counts that cannot be.
    """
    checks.numbers("of", of, COUNT)
    seen, total = checks.array("count", count, NON_NEGATIVE), np.asarray(of, dtype=float)
    checks.at_most("count", seen, total, "of")
    share = (seen + 2) / (total + 4)
    return np.sqrt(share * (1 - share) / (total + 4))
