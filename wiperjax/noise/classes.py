"""Noise class of each cell from its statistics (docs/model.md, section 11), in plain numpy.

The order of the rules matters and is this: what the solver could not finish is `failed`; the phi
limit is `collapsed`; then squeal, chattering, reversal, quiet, other, the first that holds. Squeal
and chattering ask for motion that is not quiet, so rounding noise at 700 Hz is no squeal. On a belt
that reverses, all but the reversal itself is judged by the strokes between (`signals.py`).

Beside the class stand two names that say more, also of `other`: the MECHANISM, what keeps the
motion going, and the BAND of its frequency. `docs/classes.md` tells what each is good for.
"""

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np

from ..vocabulary.codes import BANDS, LABELS, MECHANISMS, RESULTS, SETTLED, TOLD
from ..vocabulary.thresholds import Thresholds, silence


def stored(attrs: Mapping[str, Any]) -> Thresholds:
    """Thresholds in the attributes `class_...` of a map or run, else the defaults.

    Raises: ValueError for what no file of ours has (`Thresholds`).
    """
    found = {}
    for field in fields(Thresholds):
        if (value := attrs.get(f"class_{field.name}")) is not None:
            numbers = np.asarray(value).reshape(-1).tolist()
            found[field.name] = numbers[0] if len(numbers) == 1 else tuple(numbers)
    try:
        return Thresholds(**found)
    except ValueError as error:
        raise ValueError(f"class_{error}") from None


def class_bands(limits: Any) -> list[tuple[str, float, float]]:
    """Name of a class, lowest and highest frequency [Hz] that tell it: chattering has what of its
    band is none of squeal's.
    """
    (low, high), (lowest, highest) = limits.squeal_band, limits.chatter_band
    rest = (lowest, min(highest, low)), (max(lowest, high), highest)
    return [("squeal", low, high)] + [("chattering", a, b) for a, b in rest if a < b]


def classify(columns: Mapping[str, Any], thresholds: Any = None) -> dict[str, np.ndarray]:
    """Codes `label`, `mechanism` and `band` of cells, int8, of the shape of the columns; also
    `settled` if it is among these.

    Arguments:

    - `columns`: name -> array, or a dataset: `result`, `velocity_rms` (m/s), `belt_speed_rms`
        (m/s; not needed with `quiet_velocity`), `dominant_frequency` (Hz, NaN where the velocity is
        constant), `stick_fraction`, `flight_fraction`; and, for belts that reverse,
        `reversal_count` (by which they are known), `normal_force_max_reversal` and
        `normal_force_mean_stroke` (N/m), `vibration_reversal`, `vibration_stroke` and
        `velocity_rms_stroke` (m/s), `stick_fraction_stroke`, `flight_fraction_stroke`,
        `impact_impulse_reversal` and `impact_impulse_max` (N s/m), `tone_time_before` and
        `tone_time_after` (s), `stick_count`; on others `velocity_mean` (m/s), where it is known;
        of systems with stops `blow_count`; `frequency_told` (`codes.TOLD`) where the frequency is
        NaN for want of samples.
    - `thresholds`: `Thresholds`, or anything with its attributes; the defaults if None.

    A finished cell with NaN among the columns its class rests on is `failed`, never silently
    another class: on a belt that reverses also one that shows nothing just after a turn, or no
    stroke. One exception: a motion whose frequency the finest samples do not tell
    (`frequency_told` is "no"), or that has no line (it is "yes" all the same). Its shares and its
    standard deviation are exact, its frequency is NaN: `other`, without a band, and `settled` comes
    back `unknown`.

    A tip that rides on the belt for the whole window is neither quiet, though a steady belt gives
    it a constant velocity (the spring must pull it back sooner or later: the window is too short),
    nor oscillating: it is `other`, with the mechanism `carried`, `settled` unknown. So is one whose
    slip lies in the window with so little of itself that it would be quiet.

    Raises: `KeyError` if a column is missing.
    """
    limits = thresholds if thresholds is not None else Thresholds()
    seen = _heard(columns, limits)
    label = _label(seen, limits)
    unheard = np.isin(label, [LABELS[name] for name in ("collapsed", "failed", "quiet")])
    reversal = label == LABELS["reversal"]
    codes = {
        "label": label,
        "mechanism": _mechanism(seen, limits, unheard, reversal),
        "band": _band(seen, limits, unheard | reversal),
    }
    if "settled" in columns:
        codes["settled"] = np.where(
            seen.unseen | seen.carried, SETTLED["unknown"], np.asarray(columns["settled"])
        )
    return {name: values.astype(np.int8) for name, values in codes.items()}


class _Heard(NamedTuple):
    """What a class rests on, an array over the cells each; of belts that reverse, the strokes."""

    of: Callable[[str], np.ndarray]  # any column, NaN where there is none
    result: np.ndarray
    reverses: np.ndarray
    stick: np.ndarray  # shares of time
    flight: np.ndarray
    frequency: np.ndarray
    tone: np.ndarray  # s, of the tone at a turn
    known: np.ndarray  # nothing is missing
    carried: np.ndarray
    quiet: np.ndarray
    at_turn: np.ndarray  # silent strokes with a tone at the turn: `frequency` is that of the tone
    unseen: np.ndarray  # a sound whose frequency the samples do not tell, or that has no line
    below: Any  # m/s, the rms velocity of what is quiet


def _heard(columns: Mapping[str, Any], limits: Any) -> _Heard:
    """`_Heard` of the columns of `classify`."""
    result = np.asarray(columns["result"])

    def of(name: str, required: bool = False) -> np.ndarray:
        if name in columns or required:
            return np.asarray(columns[name], dtype=float)
        return np.full(result.shape, np.nan)

    mean = of("normal_force_mean_stroke")
    reverses = np.full(result.shape, "reversal_count" in columns)

    def stroke(name: str, on_reversing: str) -> np.ndarray:
        return np.where(reverses, of(on_reversing), of(name, required=True))

    speed = stroke("velocity_rms", "velocity_rms_stroke")
    stick = stroke("stick_fraction", "stick_fraction_stroke")
    flight = stroke("flight_fraction", "flight_fraction_stroke")
    belt = of("belt_speed_rms")
    below = silence(limits, belt if "belt_speed_rms" in columns else None)
    frequency = of("dominant_frequency", required=True)

    silent = speed <= below
    # a slip that the window cuts short: over whole periods the mean is 0
    rides = silent & ~reverses & (stick > 0.5) & (np.abs(of("velocity_mean")) > 0.5 * belt)
    carried = ((stick >= 1.0) | rides) & (belt > 0.0)
    silent &= ~carried
    tone = np.fmax(of("tone_time_before"), of("tone_time_after"))
    at_turn = silent & reverses & (tone >= limits.tone_time)
    quiet = silent & ~at_turn
    looked = np.isin(of("frequency_told"), [TOLD["no"], TOLD["yes"]])
    unseen = ~quiet & ~carried & np.isnan(frequency) & looked

    known = np.isfinite(speed) & np.isfinite(below) & np.isfinite(stick) & np.isfinite(flight)
    # a constant velocity has no line
    known &= np.isfinite(frequency) | quiet | carried | unseen
    at_reversal = np.isfinite(of("vibration_reversal")) & np.isfinite(of("vibration_stroke"))
    known &= ~reverses | (np.isfinite(mean) & at_reversal)
    return _Heard(
        *(of, result, reverses, stick, flight, frequency, tone),
        *(known, carried, quiet, at_turn, unseen, below),
    )


def _label(seen: _Heard, limits: Any) -> np.ndarray:
    """Codes of `codes.LABELS`."""
    sounds, frequency = ~seen.quiet & ~seen.carried, seen.frequency
    low, high = limits.squeal_band
    squeal = sounds & (frequency >= low) & (frequency <= high)
    low, high = limits.chatter_band
    chattering = sounds & (frequency >= low) & (frequency < high)
    chattering &= (seen.stick > 0) | (seen.flight > 0)
    peak, mean = seen.of("normal_force_max_reversal"), seen.of("normal_force_mean_stroke")
    vibration = seen.of("vibration_reversal")
    started = vibration > seen.below
    started &= vibration >= limits.vibration_ratio * seen.of("vibration_stroke")
    classes = {
        "collapsed": seen.result == RESULTS["collapsed"],
        "failed": (seen.result != RESULTS["finished"]) | ~seen.known,
        "squeal": squeal,
        "chattering": chattering,
        "reversal": seen.reverses & (peak >= limits.reversal_ratio * mean) & started,
        "quiet": seen.quiet,
    }
    codes = [LABELS[name] for name in classes]
    return np.select(list(classes.values()), codes, default=LABELS["other"])


def _mechanism(seen: _Heard, limits: Any, unheard, reversal) -> np.ndarray:
    """Codes of `codes.MECHANISMS`."""
    impulse = seen.of("impact_impulse_reversal")
    hit = (impulse > 0) & (impulse >= seen.of("impact_impulse_max"))  # the hardest hit of all
    # a tone that lasts for a part of the stroke: it sticks in every second period at least
    cycles = np.maximum(seen.of("reversal_count"), 1) * seen.tone * seen.frequency
    again = (seen.tone >= limits.tone_time) & (seen.of("stick_count") >= 0.5 * cycles)
    sticks = (seen.stick >= limits.stick_share) & ~seen.at_turn | seen.reverses & again
    found = (
        ("none", unheard),
        ("reversal_impulse", reversal & hit),
        ("reversal_pulse", reversal),
        ("carried", seen.carried),
        ("flight", seen.flight > 0),
        ("stick_slip", sticks),
        ("vibro_impact", seen.of("blow_count") > 0),
    )
    codes = [MECHANISMS[name] for name, _ in found]
    return np.select([where for _, where in found], codes, default=MECHANISMS["self_excited_slip"])


def _band(seen: _Heard, limits: Any, unnamed) -> np.ndarray:
    """Codes of `codes.BANDS`; none where `unnamed`, or where no frequency makes the sound.

    What the bands of squeal and of chatter both hold is squeal's, as it is in `_label`.
    """
    low, high = limits.squeal_band
    found = (
        ("none", unnamed | seen.carried | seen.unseen),
        ("squeal", (seen.frequency >= low) & (seen.frequency <= high)),
        ("chatter", seen.frequency < limits.chatter_band[1]),
        ("low", seen.frequency < low),
    )
    codes = [BANDS[name] for name, _ in found]
    return np.select([where for _, where in found], codes, default=BANDS["high"])
