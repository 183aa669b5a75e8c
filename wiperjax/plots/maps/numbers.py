"""The numbers and names of a map's cells as they are shown: which cells have none and why, and
scales.
"""

import numpy as np
import xarray as xr
from matplotlib.colors import LogNorm, Normalize, SymLogNorm

from ...noise.class_counts import ENDED, cell_by_cell, whole_codes
from ...vocabulary.cf import flag_names, flags
from ...vocabulary.codes import LABELS, NOT_COMPUTED
from ..style.palette import SPARE, readable

SIGNED = "RdBu_r"  # red above zero, white at it, blue below; told apart by everybody
TONE = "dominant_frequency"
OF_NOISE = ("mechanism", "band")  # names of a noise: none of cells that make none, whatever why


def told(ds: xr.Dataset, name: str) -> xr.DataArray:
    """The number `name` of each cell; NaN in those that ended early, whose counts are of a part of
    their motion, and for the frequency of quiet ones, which is that of rounding noise.

    Raises: `ValueError` for a frequency beside classes that were averaged, as `whole_codes`: which
        of the cells were quiet is lost, and rounding noise is in the mean.
    """
    if name == TONE:
        whole_codes(ds["label"])
    ended = ds["label"].isin(list(_untold(name).values()))
    return ds[name].astype(float).where(~ended)


def told_names(ds: xr.Dataset, name: str) -> xr.Dataset:
    """A map whose names `OF_NOISE`, if `name` is one, are the class in cells that are quiet, failed
    or collapsed: all three are "none" as stored, and what ended is not quiet.

    Raises: `ValueError` as `whole_codes`.
    """
    if name not in OF_NOISE or "flag_values" not in ds[name].attrs:
        return ds
    ds = cell_by_cell(ds)
    known = {word: code for code, word in flag_names(ds[name]).items()}
    codes, label = whole_codes(ds[name]), whole_codes(ds["label"])
    for word in ("quiet", "failed", "collapsed"):
        code = known.setdefault(word, max(known.values()) + 1)
        codes = np.where(label == LABELS[word], code, codes)
    return ds.assign({name: ds[name].copy(data=codes).assign_attrs(flags(known))})


def named_sets(ds: xr.Dataset, name: str) -> xr.Dataset:
    """A map whose sets of names, bit by bit in `name`, have names of their own, `quiet + squeal`:
    the most frequent ones, as many as colours tell apart, the others are `further sets`.
    """
    if "flag_masks" not in (attrs := ds[name].attrs):
        return ds
    bits = np.atleast_1d(attrs["flag_masks"]).tolist()
    words = dict(zip(bits, str(attrs["flag_meanings"]).split(), strict=True))
    codes = whole_codes(ds[name])
    met, counts = np.unique(codes[codes > 0].astype(int), return_counts=True)
    several = [int(code) for code in met[np.argsort(-counts, kind="stable")] if code not in words]
    known = {word: bit for bit, word in words.items() if bit in met}
    known |= {
        "_+_".join(words.get(bit, str(bit)) for bit in _bits(code)): code
        for code in several[: len(SPARE)]
    }
    if rest := several[len(SPARE) :]:
        known["further_sets"] = max(bits) * 2
        codes = np.where(np.isin(codes, rest), known["further_sets"], codes)
    if (codes == NOT_COMPUTED).any():
        known["not_computed"] = NOT_COMPUTED
    plain = {key: value for key, value in attrs.items() if key != "flag_masks"}
    sets = ds[name].copy(data=codes)
    sets.attrs = plain | flags(known, np.int32)
    return ds.assign({name: sets})


def _bits(code: int) -> list[int]:
    """The powers of two that make up a number."""
    return [1 << place for place in range(code.bit_length()) if code >> place & 1]


def why_untold(ds: xr.Dataset, name: str) -> str:
    """Why cells have no number `name`: `quiet, failed`; empty if all have one."""
    lacking, label = ~np.isfinite(told(ds, name)), ds["label"]
    codes = _untold(name)
    words = [readable(one) for one, code in codes.items() if (lacking & (label == code)).any()]
    other = (lacking & ~label.isin(list(codes.values()))).any()
    return ", ".join(words + ["no number"] * bool(other))


def _untold(name: str) -> dict[str, int]:
    return {"quiet": LABELS["quiet"]} | ENDED if name == TONE else ENDED


def tones(values: np.ma.MaskedArray) -> LogNorm:
    """Scale for the frequencies of a plane, or its speeds: logarithmic, of three decades at
    most.
    """
    heard = values.compressed()
    heard = heard[heard > 0]
    low, top = (float(heard.min()), float(heard.max())) if heard.size else (10.0, 1000.0)
    return LogNorm(max(min(low, 0.9 * top), 1e-3 * top), max(top, 1.1 * low))


def on_scale(values: np.ma.MaskedArray, norm: Normalize | None) -> np.ma.MaskedArray:
    """Numbers as a scale can show them: to a logarithmic one zero, and all below it, is no number,
    and is given one below its lowest.
    """
    if not isinstance(norm, LogNorm) or norm.vmin is None:
        return values
    return np.ma.where(values <= 0, 0.5 * norm.vmin, values)


def suited(
    values: np.ma.MaskedArray, signed: bool, cmap: str = "viridis"
) -> tuple[Normalize | None, str]:
    """Scale and colour map for the numbers of a plane.

    Numbers of both signs, or `signed` ones whatever these are, have two colours that part at zero,
    as far to one side as to the other; beyond thirty times the typical size the scale is
    logarithmic on either side. Positive ones that span three decades have a logarithmic scale, of
    four decades at most: what quiet cells leave is rounding noise. Of zeros alone, or no number, it
    ends at 1. All others: None and `cmap`.
    """
    if not values.count() and signed:
        return None, cmap
    low, high = (float(values.min()), float(values.max())) if values.count() else (0.0, 0.0)
    if low == high == 0 and not signed:  # matplotlib's own has negative speeds then
        return Normalize(0.0, 1.0), cmap
    if low > 0 and high > 1e3 * low and not signed:
        return LogNorm(max(low, 1e-4 * high), high), cmap
    if not (signed or low < 0 < high):
        return None, cmap
    sizes = np.abs(values.compressed())
    top = float(sizes.max()) or 1.0
    typical = float(np.median(sizes[sizes > 0])) if (sizes > 0).any() else top
    if top > 30 * typical:
        return SymLogNorm(typical, vmin=-top, vmax=top, base=10), SIGNED
    return Normalize(-top, top), SIGNED
