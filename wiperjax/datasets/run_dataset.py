"""What a run consists of: regimes and events in time, a stretch of it, its settled part, its last
periods, its pitch.
"""

from collections.abc import Iterator

import numpy as np
import xarray as xr

from ..noise.classes import stored
from ..noise.samples import judged, sample_interval
from ..noise.spectrum import interval_means, strongest_lines
from ..vocabulary.cf import flag_names
from ..vocabulary.thresholds import FEWEST_PERIODS, silence
from ..vocabulary.wording import not_there

ROUNDING = 1e-13  # of velocities, relative to what they are sums of
FEWEST = 8  # samples of a part of a run
MOST_SPANS = 24  # stretches of regime that a picture of usual width shows apart


def check_quantity(ds: xr.Dataset, quantity: str) -> xr.DataArray:
    """Variable of a run over time. Raises: `ValueError` that lists those there are."""
    names = [
        str(n) for n in ds.data_vars if "time" in ds[n].dims and "flag_values" not in ds[n].attrs
    ]
    if quantity not in names:
        raise ValueError(not_there(quantity, "run", names))
    return ds[quantity]


def _has_events(ds: xr.Dataset, *told: str) -> bool:
    """Whether a run has events. Raises: `ValueError` if it lacks a variable of `told`."""
    if not ds.sizes.get("event", 0):
        return False
    if lost := [name for name in told if name not in ds]:
        without = "run.drop_dims('event') is the run without them"
        raise ValueError(f"the events of a run must have {lost[0]}, but have none; {without}")
    return True


def regime_spans(ds: xr.Dataset) -> Iterator[tuple[float, float, str]]:
    """Start, end (s) and name of each stretch of time in one regime, within the samples of `ds`."""
    names = flag_names(ds["regime"])
    time = np.asarray(ds["time"], dtype=float)
    if "regime_after" in ds and _has_events(ds, "regime_before", "event_time"):
        codes = np.concatenate(
            [[int(ds["regime_before"][0])], np.asarray(ds["regime_after"], dtype=int)]
        )
        borders = np.concatenate([[time[0]], np.asarray(ds["event_time"], dtype=float), [time[-1]]])
        borders = np.clip(borders, time[0], time[-1])  # events may reach beyond a cut run
    else:
        codes = np.asarray(ds["regime"], dtype=int)
        borders = np.concatenate([time, time[-1:]])
    begin = 0
    for k in range(1, len(codes) + 1):
        if k == len(codes) or codes[k] != codes[begin]:
            if borders[k] > borders[begin]:
                yield borders[begin], borders[k], names.get(int(codes[begin]), str(codes[begin]))
            begin = k


def event_times(ds: xr.Dataset) -> dict[str, np.ndarray]:
    """Kind of event -> times (s) of those within the samples of a run; kinds that occur."""
    if not _has_events(ds, "event_kind", "event_time"):
        return {}
    kinds, times = np.asarray(ds["event_kind"], dtype=int), np.asarray(ds["event_time"], float)
    start, stop = float(ds["time"][0]), float(ds["time"][-1])
    inside = (times >= start) & (times <= stop)
    return {
        name: times[inside & (kinds == code)]
        for code, name in flag_names(ds["event_kind"]).items()
        if (inside & (kinds == code)).any()
    }


def between(ds: xr.Dataset, start: float | None = None, stop: float | None = None) -> xr.Dataset:
    """Samples and events of a run from `start` to `stop` (s), both included; None: its own ends.

    Raises: `ValueError` unless at least `FEWEST` samples lie there.
    """
    time = np.asarray(ds["time"], dtype=float)
    low = time[0] if start is None else start
    high = time[-1] if stop is None else stop
    inside = (time >= low) & (time <= high)
    if inside.sum() < FEWEST:
        part = "" if start is None else f" from {start:g} s"
        part += " on" if stop is None else f" up to {stop:g} s"
        raise ValueError(
            f"at least {FEWEST} samples must lie between the times given, but {inside.sum()} "
            f"lie{part}; the run has {time.size} in {time[0]:g} ... {time[-1]:g} s"
        )
    chosen = {"time": np.flatnonzero(inside)}
    if _has_events(ds, "event_time"):
        moment = np.asarray(ds["event_time"], dtype=float)
        chosen["event"] = np.flatnonzero((moment >= low) & (moment <= high))
    return ds.isel(chosen)


def contact_axis(ds: xr.Dataset) -> int | None:
    """Number of the coordinate whose velocity is that of the contact point, which slides over its
    partner; None where it is no coordinate's, as on the rim of a shaft, or nothing tells it.
    """
    if "slip_speed" not in ds:
        return None
    return axis_of(ds, *(ds[name] for name in ("slip_speed", "belt_velocity") if name in ds))


def axis_of(ds: xr.Dataset, *speeds: xr.DataArray) -> int | None:
    """Number of the first coordinate whose velocity is the sum of ``speeds`` over time, to within
    its rounding; None where it is that of none.
    """
    parts = [np.asarray(speed, dtype=float) for speed in speeds]
    velocity = np.asarray(ds["velocity"].transpose("time", ...), dtype=float)
    apart = np.abs(velocity.reshape(len(parts[0]), -1) - np.sum(parts, axis=0)[:, None])
    room = ROUNDING * sum(np.abs(part).max(initial=0.0) for part in parts)
    same = (apart <= room).all(axis=0)
    return int(same.argmax()) if same.any() else None


def on_belt(ds: xr.Dataset) -> bool:
    """Whether a coordinate slides on a belt, so that its velocity lies beside the belt's."""
    return "belt_velocity" in ds and contact_axis(ds) is not None


def usual_axis(ds: xr.Dataset) -> int:
    """Number of the coordinate that stands for a motion: the contact's, if it is one's."""
    return contact_axis(ds) or 0


def signal(
    ds: xr.Dataset, quantity: str | None = None, component: int | None = None
) -> xr.DataArray:
    """One number over time: a scalar quantity of a run, or one component of position or velocity
    (`usual_axis`, if None). Without either it is the velocity that the motion is judged by: that
    of the tip along the glass, of a system of one's own its output.

    Raises: `ValueError` if the run has no such quantity or component.
    """
    if quantity is None:
        quantity = "output" if component is None and "output" in ds else "velocity"
    values = check_quantity(ds, quantity)
    if values.ndim == 1:
        return values
    component = usual_axis(ds) if component is None else component
    other = next(dim for dim in values.dims if dim != "time")
    if not 0 <= component < values.sizes[other]:
        raise ValueError(f"component must be 0 ... {values.sizes[other] - 1}, was {component}")
    return values.isel({other: component})


def is_steady(ds: xr.Dataset) -> bool:
    """Whether the glass moves at one speed, so that a motion can settle."""
    belt = ds.get("belt_velocity")
    return belt is None or bool(np.ptp(np.asarray(belt)) == 0)


def settled(ds: xr.Dataset) -> xr.Dataset:
    """A run on a steady belt after its transient, by which it is judged (`statistics_start`); the
    second half where none is stored, or the run is cut before its end. On another belt all of it.
    """
    time = np.asarray(ds["time"], dtype=float)
    if not is_steady(ds) or time.size < 16:
        return ds
    begin = float(ds.attrs.get("statistics_start", np.inf))
    whole = time[-1] > float(ds.attrs.get("duration", np.inf)) - 1.5 * (time[1] - time[0])
    known = whole and np.count_nonzero(time >= begin) >= 8
    return between(ds, begin if known else 0.5 * (time[0] + time[-1]))


def is_quiet(ds: xr.Dataset) -> bool:
    """Whether what a motion is judged by moves no more than counts as quiet; where nothing tells
    what does (no belt, and no speed that does) it is not.
    """
    limits, scale = stored(ds.attrs), None
    if "belt_velocity" in ds:
        scale = float(np.sqrt(np.mean(np.square(np.asarray(ds["belt_velocity"])))))
    told = scale is not None or limits.quiet_velocity is not None
    return bool(told and np.std(np.asarray(signal(ds))) <= silence(limits, scale))


def pitch(ds: xr.Dataset) -> float:
    """Dominant frequency (Hz) of what the motion is judged by, in the settled part.

    NaN if it is quiet or has no two periods there, or is too fast for its samples; and on a belt
    that is not steady: there the stroke itself is the strongest line.

    Raises: `ValueError` as `judged` and `sample_interval`.
    """
    if not is_steady(ds):
        return float("nan")
    part = settled(ds)
    place, speed = judged(part)
    if is_quiet(part):
        return float("nan")
    step = sample_interval(part)
    mean, inner = interval_means(place, speed, step)
    # longer periods than are told are looked for too: else a side lobe stands in for them
    line = strongest_lines(mean, step, averaged=True, inner=[inner.mean()], minimum_cycles=1.0)
    frequency = float(line.frequency) if line.told else float("nan")
    return frequency if frequency * step * speed.size >= FEWEST_PERIODS else float("nan")


def last_periods(ds: xr.Dataset, periods: float = 6.0, always: bool = False) -> xr.Dataset:
    """The end of a run with so many of its periods, if it has more; all of it otherwise.

    All of it too if it has no period or few samples, or samples that tell none, or the belt is not
    steady; and, unless `always` the end is wanted, if its regimes can be told apart.
    """
    many = always or sum(1 for _ in regime_spans(ds)) > MOST_SPANS
    if not many or ds.sizes["time"] < FEWEST:
        return ds
    try:
        frequency, step = pitch(ds), sample_interval(ds)
    except ValueError:
        return ds
    if np.isnan(frequency):
        return ds
    start = float(ds["time"][-1]) - max(periods / frequency, FEWEST * step)
    return between(ds, start) if start > float(ds["time"][0]) else ds
