"""Whether what has the variables of a run is one, and which of its numbers are none: what another
program has changed is neither told as if it were right, nor left out without a word.
"""

from collections.abc import Iterator

import numpy as np
import xarray as xr

from ..noise.samples import LARGEST, beyond_its_end, untold
from ..vocabulary.codes import Event, Regime

_CODES = {
    "regime": Regime,
    "regime_before": Regime,
    "regime_after": Regime,
    "event_kind": Event,
}


def unfit(ds: xr.Dataset) -> str:
    """Why what has the variables of a run is none any more, in words; empty if it is one."""
    if not ds.sizes.get("time"):
        return "holds no samples over time"
    for name, own in (("regime", ("time",)), ("event_time", ("event",))):
        if name in ds and ds[name].dims != own:
            part = "run.sel(time=slice(...)) takes a part of a run, run.where and xr.concat do not"
            return f"its {name} lies along {' and '.join(map(str, ds[name].dims))}: {part}"
    if (unit := str(ds["time"].attrs.get("units", "s"))) != "s":  # that of its events, too
        return f"its time must be in s, but is in {unit}"
    for name in _measured(ds):
        if ds[name].dtype.kind not in "biuf":
            return f"its {name} must be numbers, but is of {ds[name].dtype}"
    return next(_of_times(ds), "") or next(_of_codes(ds), "")


def doubts(run: xr.Dataset) -> list[str]:
    """What of a run can be told with gaps only, in words: numbers over time or of events that are
    none, or too large to be told, such as those of a motion that grows without bound.
    """
    found = []
    for name, variable in run.variables.items():
        if variable.dtype.kind != "f" or not {"time", "event"} & {*variable.dims}:
            continue
        if (wrong := untold(variable.values)).any():
            along = "time" if "time" in variable.dims else "event"
            first = np.argwhere(wrong)[0][variable.dims.index(along)]
            moment = run["time" if along == "time" else "event_time"].values[first]
            must = f"{name} must be finite numbers up to {LARGEST:g} in size"
            had = f"{wrong.sum()} of {wrong.size} not, the first {variable.values[wrong][0]:g}"
            found.append(f"{must}, but had {had} at {moment:g} s")
    return found


def _measured(ds: xr.Dataset) -> list[str]:
    """Names of what is measured over time or of events; a person may add words, without a unit."""
    return [
        str(name)
        for name, variable in ds.variables.items()
        if name == "time" or "units" in variable.attrs and {"time", "event"} & {*variable.dims}
    ]


def _of_times(ds: xr.Dataset) -> Iterator[str]:
    time = np.asarray(ds["time"], dtype=float)
    if (wrong := time[~np.isfinite(time)]).size:
        yield f"its time must be finite numbers, but had {wrong[0]:g}"
    steps = np.diff(time)
    if (steps > 0).any() and not (steps > 0).all():  # of what falls throughout sorting is all
        last, after = time[np.argmin(steps > 0) :][:2]
        yield f"its time must rise from sample to sample, but had {after:g} after {last:g} s"
    if why := beyond_its_end(ds):
        yield f"its time {why}"
    moments = np.asarray(ds.get("event_time", ()), dtype=float)
    if (wrong := moments[~np.isfinite(moments)]).size:
        yield f"its event_time must be finite numbers, but had {wrong[0]:g}"
    if (falls := np.flatnonzero(np.diff(moments) < 0)).size:
        last, after = moments[falls[0] :][:2]
        yield f"its event_time must not fall, but had {after:g} after {last:g} s"
    end = float(ds.get("final_time", np.inf))
    if moments.size and moments[-1] > end * (1 + 1e-9):  # rounding
        yield f"its event_time must lie before its final_time, {end:g} s, but had {moments[-1]:g}"


def _of_codes(ds: xr.Dataset) -> Iterator[str]:
    for name, table in _CODES.items():
        codes = np.asarray(ds[name]) if name in ds else np.zeros(0)
        if codes.dtype.kind == "f" and (between := codes[codes != np.round(codes)]).size:
            part = "it was averaged or interpolated; run.sel takes whole samples"
            yield f"its {name} must be whole codes, but had {between[0]:g}: {part}"
        if (strange := codes[~np.isin(codes, list(table))]).size:
            known = ", ".join(f"{int(code)} ({code.name.lower()})" for code in table)
            yield f"its {name} must be {known}, but had {strange[0]:g}"
