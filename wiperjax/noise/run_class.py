"""Class of one run: the columns of a map, taken from the samples and events of a trajectory.

The rules are those of maps (`classify`), so a scene and the cell of a map that stands for it are
called the same. Regimes and impacts come from the events; levels, forces and the cost of slips
from what the engine gathered beside the samples: these are exact. Frequencies are of the samples.
"""

from typing import Any

import numpy as np
import xarray as xr

from ..vocabulary import checks
from ..vocabulary.cf import flag_names
from ..vocabulary.codes import BANDS, EVENTS, LABELS, MECHANISMS, RESULTS, SETTLED, TOLD
from ..vocabulary.kinds import BELT_KINDS, since_reversal, usual_transient
from ..vocabulary.ranges import FEWEST_SETTLED, Range
from ..vocabulary.thresholds import FEWEST_PERIODS, Thresholds, silence
from .class_counts import whole_codes
from .classes import classify, stored
from .samples import judged, sample_interval
from .signals import signal_columns
from .spectrum import interval_means

TURN = 2 * np.pi

GATHERED = (
    *("velocity_mean", "velocity_rms", "normal_force_mean", "normal_force_max", "force_drop"),
    *("energy_per_slip", "acceleration_max", "normal_force_max_reversal"),
    "normal_force_mean_stroke",
)
"""Columns that the engine knows exactly, and samples do not."""


def is_of_a_scene(run: xr.Dataset) -> bool:
    """Whether a run is of a scene file, and so says what it is judged by."""
    return "belt_kind" in run.attrs and "event_time" in run


def assess(run: xr.Dataset, thresholds: Any = None, transient: float | None = None) -> xr.Dataset:
    """Class, mechanism, band and the statistics they rest on of a run of a scene.

    Arguments:

    - `run`: a run of a scene file (`run_scene`, or a file of `wiperjax simulate`); its attributes
        tell the belt.
    - `thresholds`: `Thresholds`; None: those stored with the run.
    - `transient`: time [s] that is left out; None: what the engine left out (`statistics_start`),
        of a run without that `usual_transient`.

    Returns: a dataset of scalars named as the columns of a map (`label` and the like hold codes,
    see `words`). Those of `GATHERED` are exact where the run was gathered from `transient` on
    (`run_scene`) and is not cut; else they are those of the samples, which miss what is quick, and
    `acceleration_max` is NaN.

    Raises: ValueError for a run that is no run of a scene, on a belt of unknown kind, or of fewer
    than `FEWEST_SETTLED` samples after the transient.
    """
    checks.instance("run", run, xr.Dataset, "a run of a scene file")
    if thresholds is not None:
        checks.instance("thresholds", thresholds, Thresholds, "Thresholds(...)")
    if not is_of_a_scene(run):
        raise ValueError(
            "run must be a run of a scene file, but had no belt_kind in its attributes or no events"
        )
    limits = thresholds if thresholds is not None else stored(run.attrs)
    kind, end = str(run.attrs["belt_kind"]), float(run["final_time"])
    belt = BELT_KINDS[checks.choice("belt_kind", kind, BELT_KINDS)] if kind else None
    transient = _transient(run, transient)
    kept = run.isel(time=np.flatnonzero(np.asarray(run["time"], dtype=float) >= transient))
    time = np.asarray(kept["time"], dtype=float)
    finished = int(run["result"]) == RESULTS["finished"]
    if finished and time.size < FEWEST_SETTLED:
        must = f"must have {FEWEST_SETTLED} samples after the transient"
        raise ValueError(f"run {must}, but had {time.size}")
    columns: dict[str, Any] = {"result": int(run["result"])}
    if belt is not None:
        columns["belt_speed_rms"] = belt.of(run.attrs)
    if not finished or time.size < FEWEST_SETTLED:
        absent = ("velocity_rms", "dominant_frequency", "stick_fraction", "flight_fraction")
        columns |= dict.fromkeys(absent, np.nan)
        return _named(columns | classify(columns, limits))

    place, velocity = judged(kept)
    force = np.asarray(kept["normal_force"], dtype=float)
    interval = sample_interval(kept)
    whole = np.allclose((time[0], time[-1]), (transient, end), rtol=0, atol=1.5 * interval)
    if not whole:  # what is counted is of the time that the samples are of
        transient, end = float(time[0]), float(time[-1])
    since = None if kind in ("", "steady") else _since_reversal(run, time)
    wiping = run.attrs.get("belt_frequency")
    columns |= {
        "velocity_mean": (place[-1] - place[0]) / (time[-1] - time[0]),  # samples miss its peaks
        "velocity_rms": velocity.std(),
        "normal_force_mean": force.mean(),
        "normal_force_max": force.max(),
    }
    columns |= _events(run, transient, end, None) | _slips(kept, transient, end)
    if since is not None:
        near = np.abs(since) <= limits.reversal_window
        columns["normal_force_max_reversal"] = force[near].max() if near.any() else np.nan
        columns["normal_force_mean_stroke"] = force[~near].mean() if (~near).any() else np.nan
        columns |= _events(run, transient, end, limits.reversal_window)
    if whole and float(run.attrs.get("statistics_start", np.nan)) == transient:
        columns |= _gathered(run, limits)
    quiet = silence(limits, columns.get("belt_speed_rms"))
    mean, inner = interval_means(place, velocity, interval)
    if since is None:
        inner = inner.mean(keepdims=True)
    else:
        since = since[:-1] + 0.5 * interval
    found = signal_columns(mean[None], interval, limits, quiet, since, wiping, inner[None])
    columns |= {name: values[0] for name, values in found.items()}
    if columns["frequency_told"] == TOLD["no"]:
        columns["dominant_frequency"] = np.nan
    return _named(columns | classify(columns, limits))


def _transient(run: xr.Dataset, given: float | None) -> float:
    """Time [s] that is left out: as `given`, else by the engine; of a run that says none the usual
    one.
    """
    if given is not None:
        allowed = Range(0, float(run["final_time"]), high_open=True, unit="s")
        return checks.number("transient", given, allowed)
    usual = usual_transient(float(run.attrs["duration"]), str(run.attrs["belt_kind"]))
    return float(run.attrs.get("statistics_start", usual))


def words(columns: Any) -> dict[str, str]:
    """Names of the codes `label`, `mechanism`, `band` and `settled` of one assessment."""
    flags = {"label": LABELS, "mechanism": MECHANISMS, "band": BANDS, "settled": SETTLED}
    return {
        name: {code: word for word, code in table.items()}[int(columns[name])]
        for name, table in flags.items()
        if name in columns
    }


def why_no_frequency(columns: Any) -> str:
    """Why an assessment tells no frequency: what a class rests on is not there; or what sticks or
    strikes says how often it does, and with fewer than two periods no samples tell one."""
    if int(columns["result"]) != RESULTS["finished"]:
        return "the motion ended early"
    for name, what in (("vibration_reversal", "turn"), ("normal_force_mean_stroke", "stroke")):
        if np.isnan(columns.get(name, 0.0)):
            return f"no {what} in the settled part (run.duration, run.transient)"
    if int(columns.get("frequency_told", TOLD["unknown"])) != TOLD["no"]:
        return "no line"
    blows = float(columns.get("blow_count", 0.0))
    most = max(float(columns["stick_count"]), float(columns["impact_count"]), blows)
    shares = float(columns["stick_fraction"]), float(columns["flight_fraction"])
    if max(*shares, blows) > 0 and most < FEWEST_PERIODS:
        return "window too short (run.duration)"
    return "not told by these samples (run.sample_interval)"


def _named(columns: dict[str, Any]) -> xr.Dataset:
    return xr.Dataset({name: ((), np.asarray(value)[()]) for name, value in columns.items()})


def _events(run: xr.Dataset, start: float, end: float, window: float | None) -> dict[str, float]:
    """Shares of time in stick and flight, impacts and blows from `start` to `end`; with a `window`,
    those shares of the strokes, and the hardest impact in it.
    """
    names = flag_names(run["regime"])
    times = np.asarray(run["event_time"], dtype=float)
    if not (np.isfinite(times).all() and np.all(np.diff(times) >= 0)):
        raise ValueError("the event_time of the run must be finite numbers that do not fall")
    after = np.asarray(run["regime_after"], dtype=int)
    # what is cut to a part without events need not be in the regime that the run ended in
    first = int(run["regime_before"][0]) if times.size else int(run["regime"][0])
    borders = np.clip(np.concatenate([[0.0], times, [end]]), start, end)
    inside = (times >= start) & (times <= end)
    regimes = [names[code] for code in (first, *after)]
    caught = np.array([name == "stick" for name in regimes])
    caught = caught[1:] & ~caught[:-1]
    impulse = np.where(inside, np.asarray(run["event_impulse"], dtype=float), 0.0)
    if window is None:
        length, suffix = np.diff(borders), ""
        found = {
            "impact_count": float(np.sum(impulse > 0)),
            "impact_impulse_max": impulse.max(initial=0.0),
            "stick_count": float(np.sum(caught & inside)),
        }
        if "blow_count" in run:  # of a system with stops
            struck = np.asarray(run["event_kind"], dtype=int) == EVENTS["blow"]
            found["blow_count"] = float(np.sum(struck & inside))
    else:
        # time outside the window: the integral of a function that is 1 on the strokes
        fine = np.linspace(start, end, 200_001)
        stroke = np.abs(_since_reversal(run, fine)) > window
        total = np.concatenate([[0.0], np.cumsum(stroke[1:] * np.diff(fine))])
        length, suffix = np.diff(np.interp(borders, fine, total)), "_stroke"
        near = np.abs(_since_reversal(run, times)) <= window
        found = {"impact_impulse_reversal": np.where(near, impulse, 0.0).max(initial=0.0)}
    whole = length.sum()
    for regime in ("stick", "flight"):
        # added up as the whole is: a run in one regime has a share of 1 itself
        mine = np.where([name == regime for name in regimes], length, 0.0)
        found[f"{regime}_fraction{suffix}"] = float(mine.sum() / whole) if whole > 0 else np.nan
    return found


def _gathered(run: xr.Dataset, limits: Any) -> dict[str, float]:
    """What the engine has gathered, with the `limits` that it had."""
    names = [name for name in GATHERED if name in run]
    if limits.reversal_window != stored(run.attrs).reversal_window:
        names = [name for name in names if not name.endswith(("_reversal", "_stroke"))]
    return {name: float(run[name]) for name in names}


def _slips(run: xr.Dataset, start: float, end: float) -> dict[str, float]:
    """What slips out of stick cost from `start` to `end` [s], which the samples of `run` cover:
    their rate is exact, forces and work are those of the samples, of what is quicker too little;
    they cannot tell an acceleration, nor a work without their slip speed.
    """
    time = np.asarray(run["time"], dtype=float)
    names = flag_names(run["regime"])
    regime, before, after = (
        np.array([names[code] for code in whole_codes(run[name]).tolist()], dtype=str)
        for name in ("regime", "regime_before", "regime_after")
    )
    at = np.asarray(run["event_time"], dtype=float)
    out = (before == "stick") & np.char.startswith(after, "slip")
    out &= (at >= time[0]) & (at <= end)
    count = int(out.sum())
    friction = np.asarray(run["friction_force"], dtype=float)
    stick, slip = regime == "stick", np.char.startswith(regime, "slip")
    drop = 0.0
    if stick.any() and slip.any():
        drop = max(np.abs(friction[stick]).max() - np.abs(friction[slip]).min(), 0.0)
    work = np.nan
    if "slip_speed" in run:
        power = np.where(slip, -friction * np.asarray(run["slip_speed"]), 0.0)
        work = float(np.trapezoid(power, time))
    return {
        "slip_rate": count / (end - start),
        "force_drop": drop,
        "energy_per_slip": work / count if count else 0.0,
        "acceleration_max": np.nan,
    }


def _since_reversal(run: xr.Dataset, time: np.ndarray) -> np.ndarray:
    """Time [s] since the nearest V = 0."""
    turns = run.attrs.get("belt_phase", 0.0) / 360
    return since_reversal(time, run.attrs["belt_frequency"], turns)
