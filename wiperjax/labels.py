"""Noise class of each cell from its statistics (MODEL.md section 11), in plain numpy.

The order of the rules matters and is this: what the solver could not finish is `failed`; the phi
limit is `collapsed`; then squeal, chattering, reversal, quiet, other, the first that holds. Squeal
and chattering ask for motion that is not quiet, so rounding noise at 700 Hz is no squeal. On a belt
that reverses, all but the reversal itself is judged by the strokes between (`signals.py`).

Beside the class stand two names that say more, also of `other`: the MECHANISM, what keeps the
motion going, and the BAND of its frequency. `docs/classes.md` tells what each is good for.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import xarray as xr

from .results import RESULTS
from .schema import BANDS, LABELS, MECHANISMS, SETTLED, TOLD, flag_names


@dataclass(frozen=True)
class Thresholds:
    """Borders of the classes; sources disagree on them, so they are stored with every map.

    Attributes:
        quiet_velocity_ratio: std of the tip velocity over the belt speed below which a cell is
            quiet.
        squeal_band: dominant frequency of squeal [Hz], both ends included.
        chatter_band: dominant frequency of chattering [Hz], upper end excluded.
        reversal_window: time [s] on either side of V = 0 that counts as the reversal (used by the
            engine).
        reversal_ratio: largest normal force there over the mean outside, from which it is a noise
            if it starts a vibration.
        vibration_ratio: vibration (faster than `chatter_band`) just after V = 0 over that of the
            strokes, from which the reversal is what starts it.
        tone_time: time [s] that a tone around the turn lasts at least (`turns.tones`); what is
            shorter is a click, or rings down.
        stick_share: share of the time in stick from which an oscillation is stick-slip, and below
            which it is self-excited slip.
        settled_change: most that standard deviation and frequency may change from the first half
            of the window to the second in a settled motion.
    """

    quiet_velocity_ratio: float = 0.01
    squeal_band: tuple[float, float] = (500.0, 1000.0)
    chatter_band: tuple[float, float] = (0.0, 100.0)
    reversal_window: float = 0.025
    reversal_ratio: float = 2.0
    vibration_ratio: float = 2.0
    tone_time: float = 0.015
    stick_share: float = 0.01
    settled_change: float = 0.1


def stored(attrs: Mapping[str, Any]) -> Thresholds:
    """Thresholds in the attributes `class_...` of a map or run, else the defaults."""
    found = {}
    for field in fields(Thresholds):
        if (value := attrs.get(f"class_{field.name}")) is not None:
            pair = np.ndim(value) > 0
            found[field.name] = tuple(float(x) for x in value) if pair else float(value)
    return Thresholds(**found)


def label(columns: Mapping[str, Any], thresholds: Any = None) -> np.ndarray:
    """Class codes (`schema.LABELS`) of cells; see `classify`."""
    return classify(columns, thresholds)["label"]


def classify(columns: Mapping[str, Any], thresholds: Any = None) -> dict[str, np.ndarray]:
    """Codes `label`, `mechanism` and `band` of cells, int8, of the shape of the columns; also
    `settled` if it is among these.

    Arguments:

    - `columns`: name -> array, or a dataset: `result`, `velocity_rms` (m/s), `belt_speed_rms`
        (m/s), `dominant_frequency` (Hz, NaN where the velocity is constant), `stick_fraction`,
        `flight_fraction`; and, for belts that reverse, NaN elsewhere, `normal_force_max_reversal`
        and `normal_force_mean_stroke` (N/m), `vibration_reversal`, `vibration_stroke` and
        `velocity_rms_stroke` (m/s), `stick_fraction_stroke`, `flight_fraction_stroke`,
        `impact_impulse_reversal` and `impact_impulse_max` (N s/m), `tone_time_before` and
        `tone_time_after` (s), `stick_count` and `reversal_count`; `frequency_told` (`schema.TOLD`)
        where the frequency is NaN for want of samples.
    - `thresholds`: `Thresholds`, or anything with its attributes; the defaults if None.

    A finished cell with NaN among the columns its class rests on is `failed`, never silently
    another class. One exception: a motion whose frequency the finest samples do not tell
    (`frequency_told` is "no"). Its shares and its standard deviation are exact, its frequency is
    NaN: `other`, without a band, and `settled` comes back `unknown`.

    A tip that rides on the belt for the whole window is neither quiet, though a steady belt gives
    it a constant velocity (the spring must pull it back sooner or later: the window is too short),
    nor oscillating: it is `other`, with the mechanism `carried`.

    Raises: `KeyError` if a column is missing.
    """
    limits = thresholds if thresholds is not None else Thresholds()
    result = np.asarray(columns["result"])

    def of(name: str, required: bool = False) -> np.ndarray:
        if name in columns or required:
            return np.asarray(columns[name], dtype=float)
        return np.full(result.shape, np.nan)

    peak, mean = of("normal_force_max_reversal"), of("normal_force_mean_stroke")
    reverses = np.isfinite(peak)

    def stroke(name: str, on_reversing: str) -> np.ndarray:
        return np.where(reverses, of(on_reversing), of(name, required=True))

    speed = stroke("velocity_rms", "velocity_rms_stroke")
    stick = stroke("stick_fraction", "stick_fraction_stroke")
    flight = stroke("flight_fraction", "flight_fraction_stroke")
    belt = of("belt_speed_rms", required=True)
    frequency = of("dominant_frequency", required=True)
    vibration, before = of("vibration_reversal"), of("vibration_stroke")

    carried = (stick >= 1.0) & (belt > 0.0)
    silent = (speed <= limits.quiet_velocity_ratio * belt) & ~carried
    # silent strokes with a tone at the turn; `frequency` is then that of the tone
    tone = np.fmax(of("tone_time_before"), of("tone_time_after"))
    at_turn = silent & reverses & (tone >= limits.tone_time)
    quiet = silent & ~at_turn
    sounds = ~quiet & ~carried
    unseen = sounds & np.isnan(frequency) & (of("frequency_told") == TOLD["no"])
    low, high = limits.squeal_band
    squeal = sounds & (frequency >= low) & (frequency <= high)
    low, high = limits.chatter_band
    chattering = sounds & (frequency >= low) & (frequency < high) & ((stick > 0) | (flight > 0))
    pulse = reverses & (peak >= limits.reversal_ratio * mean)
    started = vibration > limits.quiet_velocity_ratio * belt
    started &= vibration >= limits.vibration_ratio * before
    reversal = pulse & started

    needed = np.isfinite(speed) & np.isfinite(belt) & np.isfinite(stick) & np.isfinite(flight)
    # a constant velocity has no line
    needed &= np.isfinite(frequency) | quiet | carried | unseen
    needed &= ~reverses | (np.isfinite(mean) & np.isfinite(vibration) & np.isfinite(before))

    label = np.select(
        [
            result == RESULTS["collapsed"],
            (result != RESULTS["finished"]) | ~needed,
            squeal,
            chattering,
            reversal,
            quiet,
        ],
        [
            LABELS[name]
            for name in ("collapsed", "failed", "squeal", "chattering", "reversal", "quiet")
        ],
        default=LABELS["other"],
    )
    impulse = of("impact_impulse_reversal")
    hit = (impulse > 0) & (impulse >= of("impact_impulse_max"))  # the hardest hit of all
    # a tone that lasts for a part of the stroke: it sticks in every second period at least
    cycles = of("reversal_count") * tone * frequency
    again = (tone >= limits.tone_time) & (of("stick_count") >= 0.5 * cycles)
    sticks = (stick >= limits.stick_share) & ~at_turn | reverses & again
    unheard = np.isin(label, [LABELS[name] for name in ("collapsed", "failed", "quiet")])
    reversal = label == LABELS["reversal"]
    mechanism = np.select(
        [unheard, reversal & hit, reversal, carried, flight > 0, sticks],
        [
            MECHANISMS[name]
            for name in (
                *("none", "reversal_impulse", "reversal_pulse"),
                *("carried", "flight", "stick_slip"),
            )
        ],
        default=MECHANISMS["self_excited_slip"],
    )
    band = np.select(
        [
            unheard | reversal | carried | unseen,
            frequency < limits.chatter_band[1],
            frequency < limits.squeal_band[0],
            frequency <= limits.squeal_band[1],
        ],
        [BANDS[name] for name in ("none", "chatter", "low", "squeal")],
        default=BANDS["high"],
    )
    codes = {"label": label, "mechanism": mechanism, "band": band}
    if "settled" in columns:
        codes["settled"] = np.where(unseen, SETTLED["unknown"], np.asarray(columns["settled"]))
    return {name: values.astype(np.int8) for name, values in codes.items()}


def class_table(ds: xr.Dataset, variable: str = "label") -> list[tuple[str, int, float]]:
    """Name, number of cells and share of each class of a map, in the order of the codes; also of
    `mechanism`, `band`, `settled` and `result`.

    Cells that are not computed (a partly finished store) are not counted.
    """
    names = flag_names(ds[variable])
    codes, counts = np.unique(np.asarray(ds[variable]), return_counts=True)
    found = {int(code): int(count) for code, count in zip(codes, counts, strict=True) if code >= 0}
    total = max(1, sum(found.values()))
    unnamed = {code: f"code_{code}" for code in found if code not in names}
    return [
        (name, found.get(code, 0), found.get(code, 0) / total)
        for code, name in (names | unnamed).items()
        if code >= 0
    ]


def anatomy(ds: xr.Dataset, label: str = "other") -> list[tuple[str, str, int]]:
    """Mechanism, band and number of cells of one class of a map, the most frequent first."""
    chosen = np.asarray(ds["label"]) == LABELS[label]
    mechanisms, bands = flag_names(ds["mechanism"]), flag_names(ds["band"])
    pairs = np.stack([np.asarray(ds[name])[chosen] for name in ("mechanism", "band")])
    kinds, counts = np.unique(pairs, axis=1, return_counts=True)
    rows = [
        (mechanisms[int(m)], bands[int(b)], int(n))
        for (m, b), n in zip(kinds.T, counts, strict=True)
    ]
    return sorted(rows, key=lambda row: -row[2])


def untold(ds: xr.Dataset) -> int:
    """Number of noisy cells whose frequency the finest samples do not tell."""
    if "frequency_told" not in ds:
        return 0
    quiet = np.asarray(ds["label"]) == LABELS["quiet"]
    return int(np.sum((np.asarray(ds["frequency_told"]) == TOLD["no"]) & ~quiet))


def unsettled(ds: xr.Dataset) -> int:
    """Number of cells whose motion had not settled in the window, or is irregular for good."""
    return int(np.sum(np.asarray(ds["settled"]) == SETTLED["no"])) if "settled" in ds else 0
