"""What is shown of a motion, as numbers: curves, ranges and frames. Nothing is drawn here."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from ..datasets.run_dataset import (
    event_times,
    is_steady,
    last_periods,
    on_belt,
    pitch,
    settled,
    signal,
    usual_axis,
)
from ..datasets.stated import is_own
from ..noise.classes import class_bands, stored
from ..plots.runs.bands import pieces
from ..plots.runs.friction import law_over
from ..plots.runs.history import MARKED
from ..plots.runs.levels import levels, lines
from ..plots.runs.portrait import orbit
from ..plots.style.axes import label, shown
from ..plots.style.caption import quantity_words
from ..plots.style.palette import CLASSES, EVENT_NAMES, EVENTS, REGIMES, UNKNOWN
from ..vocabulary.cf import flag_names
from .explored import plain
from .frames import lip_frames
from .spectrogram import level_images

MOST_POINTS = 3000  # of a curve: more than a screen is wide
MOST_TURNS = 12_000  # points of the phase portrait: a round of it has some twenty
MOST_TICKS = 2000  # of one kind of event
LONG = 10.0  # s: a run whose times are shown in seconds
DECADES = 4  # of the spectrum
NAME = 0.2  # of the axis of the spectrum, that the name of a band takes
ROOM = 0.08  # of an axis, beside what it shows

PICTURES = ("history", "portrait", "spectrum", "spectrogram", "ticks", "friction", "lip")

Columns = dict[str, Any]


@dataclass
class Content:
    """What a panel shows of one motion.

    Attributes:
        columns: source -> name -> values.
        ranges: axis -> its two ends.
        texts: place -> HTML or plain text.
        hidden: those of `PICTURES` that this motion has not.
        labels: picture -> what is across and what is up.
        part: which pictures show what part of the motion, in words.
    """

    columns: dict[str, Columns] = field(default_factory=dict)
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    hidden: set[str] = field(default_factory=set)
    labels: dict[str, tuple[str, str]] = field(default_factory=dict)
    part: str = ""


def content_of(run: xr.Dataset) -> Content:
    """Curves of a run: its last periods over time and in phase (all of it, if it has none), its
    settled part over frequency, all of it as a spectrogram.

    Raises: `ValueError` for one that is too short for that.
    """
    content, part = Content(), last_periods(run)
    _history(content, part)
    _portrait(content, part)
    _spectrum(content, settled(run))
    _spectrogram(content, run)
    _friction(content, part)
    _lip(content, run)
    whole, (first, last) = part.sizes["time"] == run.sizes["time"], content.ranges["time"]
    end = f"the last {last - first:.3g} {_clock(part)[1]}"
    named = "Velocity and phase portrait"
    named = named if "friction" in content.hidden else "Velocity, phase portrait and friction"
    content.part = f"{named}: {'all of the run, its start too' if whole else end}"
    shows = (signal(run, name, usual_axis(run)) for name in ("position", "velocity"))
    place, speed = (label(_words(run, values), shown(values)[1]) for values in shows)
    judged = signal(run)
    strength = label(f"{_words(run, judged)}, rms of line", shown(judged)[1])
    sliding = "slip speed" if is_own(run) else "slip speed, tip over glass"
    content.labels = {
        "history": (f"time ({_clock(part)[1]})", speed),
        "portrait": (place, speed),
        "spectrum": ("frequency (Hz)", strength),
        "friction": (label(sliding, "m/s"), "friction / normal force"),
        "ticks": (f"time ({_clock(run)[1]})", ""),
    }
    return content


def _words(run: xr.Dataset, values: xr.DataArray) -> str:
    return plain(quantity_words(run, values), 60)


def thinned(
    *curves: np.ndarray, most: int = MOST_POINTS, along: np.ndarray | None = None
) -> np.ndarray:
    """Places of the samples that are drawn: of each stretch the least and the greatest of every
    curve, so that no peak is lost. They are equally long in `along`, which rises, or in samples.
    """
    count = len(curves[0])
    if count <= most:
        return np.arange(count)
    along = np.arange(count) if along is None else along
    cuts = np.linspace(along[0], along[-1], max(1, most // (2 * len(curves))) + 1)[1:-1]
    stretches = np.split(np.arange(count), np.unique(np.searchsorted(along, cuts)))
    stretches = [s for s in stretches if s.size]
    ends = [s[[0, -1]] for s in (stretches[0], stretches[-1])]
    chosen = [s[[np.argmin(c[s]), np.argmax(c[s])]] for s in stretches for c in curves]
    return np.unique(np.concatenate([*ends, *chosen]))


def with_room(values: np.ndarray) -> tuple[float, float]:
    """The ends of an axis that shows all of `values`, and `ROOM` more on either side."""
    low, high = float(np.min(values)), float(np.max(values))
    room = ROOM * (high - low) or 0.5 * abs(high) or 1.0
    return low - room, high + room


def _clock(part: xr.Dataset) -> tuple[float, str]:
    """Factor and unit of the times that are shown: of a slow system seconds."""
    return (1.0, "s") if float(part.attrs["duration"]) > LONG else (1e3, "ms")


def _history(content: Content, part: xr.Dataset) -> None:
    """Velocity over time, the glass, bands of regime, marks of events."""
    scale, _ = _clock(part)
    time = scale * np.asarray(part["time"], dtype=float)
    speed = orbit(part, usual_axis(part))[1]
    chosen = thinned(speed)
    content.columns["velocity"] = {"t": time[chosen], "v": speed[chosen]}
    glass = shown(part["belt_velocity"])[0][chosen] if on_belt(part) else speed[:0]
    content.columns["glass"] = {"t": time[chosen][: glass.size], "v": glass}
    boxes: dict[str, list] = {"left": [], "right": [], "bottom": [], "top": [], "colour": []}
    for start, stop, shares in pieces(part):
        low = 0.0
        for name in sorted(shares, key=lambda n: [*REGIMES, n].index(n)):
            row = (scale * start, scale * stop, low, low + shares[name], REGIMES.get(name, UNKNOWN))
            for key, value in zip(boxes, row, strict=True):
                boxes[key].append(value)
            low += shares[name]
    content.columns["bands"] = boxes
    marks = {name: times for name, times in event_times(part).items() if name in MARKED}
    shape = {
        "v": "inverted_triangle", "^": "triangle", "*": "star", "D": "diamond", "s": "square",
    }  # fmt: skip
    content.columns["marks"] = {
        "t": np.concatenate([scale * times[:400] for times in marks.values()] or [[]]),
        "shape": [shape[EVENTS[name]] for name, times in marks.items() for _ in times[:400]],
    }
    content.ranges["time"] = (float(time[0]), float(time[-1]))
    content.ranges["velocity"] = with_room(np.concatenate([speed, glass]))


def _portrait(content: Content, part: xr.Dataset) -> None:
    """Velocity over position, a curve for each stretch in one regime."""
    x, v = orbit(part, usual_axis(part))
    pieces = np.hypot(*(np.diff(c) / (np.ptp(c) or 1.0) for c in (x, v)))
    # by the way it goes: of a motion that dies away all of it is in the first samples
    chosen = thinned(x, v, most=MOST_TURNS, along=np.append(0.0, np.cumsum(pieces)))
    x, v = x[chosen], v[chosen]
    codes = np.asarray(part["regime"], dtype=int)[chosen]
    names = flag_names(part["regime"])
    cuts = [0, *(np.flatnonzero(np.diff(codes)) + 1).tolist(), len(codes)]
    spans = [(a, min(b + 1, len(codes))) for a, b in zip(cuts, cuts[1:], strict=False)]
    content.columns["orbit"] = {
        "x": [x[a:b] for a, b in spans],
        "v": [v[a:b] for a, b in spans],
        "colour": [REGIMES.get(names.get(int(codes[a]), ""), UNKNOWN) for a, _ in spans],
    }
    steady = on_belt(part) and is_steady(part)
    glass = float(part["belt_velocity"][0]) if steady else np.nan
    content.ranges["position"], content.ranges["speed"] = with_room(x), with_room(v)
    ends = np.array(content.ranges["position"]) if steady else np.zeros(0)
    content.columns["glass_speed"] = {"x": ends, "v": np.full(ends.size, glass)}


def _spectrum(content: Content, part: xr.Dataset) -> None:
    """Lines of the tip velocity, the bands of the classes, what counts as quiet."""
    found = lines(part)
    peak = max(float(found.amplitude.max(initial=0.0)), found.quiet) or 1.0
    floor = peak * 10.0**-DECADES
    heights = np.maximum(found.amplitude, 0.1 * floor)
    chosen = thinned(np.log(heights), along=np.log(found.frequency))
    content.columns["lines"] = {"f": found.frequency[chosen], "a": heights[chosen]}
    low, high = float(found.frequency[0]), float(found.frequency[-1])
    rows = [(name, max(a, low), min(b, high)) for name, a, b in class_bands(stored(part.attrs))]
    rows = [row for row in rows if row[1] < row[2]]
    name_room = NAME * np.log(high / low)
    content.columns["classes"] = {
        "left": [a for _, a, _ in rows],
        "right": [b for *_, b in rows],
        "colour": [CLASSES[name] for name, *_ in rows],
        "name": ["" if 0 < abs(np.log(a / rows[0][1])) < name_room else n for n, a, _ in rows],
    }
    tone = found.strongest
    seen = bool(np.isfinite(tone) and low <= tone <= high)
    near = int(np.argmin(np.abs(found.frequency - tone))) if seen else 0
    content.columns["tone"] = {
        "f": [tone] * seen,
        "a": [float(found.amplitude[near])] * seen,
        "text": [f"{tone:.4g} Hz"] * seen,
    }
    steady = is_steady(part) and found.quiet > 0
    content.columns["quiet"] = {"f": [low, high] * steady, "a": [found.quiet] * 2 * steady}
    content.ranges["frequency"] = (low, high)
    content.ranges["amplitude"] = (floor, peak * 20)


def _spectrogram(content: Content, run: xr.Dataset) -> None:
    """Level over time and frequency as shades, and ticks of the events below."""
    tone, (scale, _) = pitch(run), _clock(run)
    top = max(2 * stored(run.attrs).squeal_band[1], 8 * tone if np.isfinite(tone) else 0.0)
    found = levels(run, highest=top)
    found = found._replace(time=scale * found.time)
    top, start, stop = float(found.frequency[-1]), float(found.time[0]), float(found.time[-1])
    content.columns["levels"] = level_images(found)
    rows = event_times(run)
    order = [name for name in EVENTS if name in rows][::-1]
    content.columns["ticks"] = {
        "t": scale * np.concatenate([rows[name][:MOST_TICKS] for name in order] or [[]]),
        "row": [
            f"{EVENT_NAMES[name]} ({rows[name].size})"
            for name in order
            for _ in rows[name][:MOST_TICKS]
        ],
    }
    others = ", ".join(f"{name.replace('_', ' ')} ({times.size})" for name, times in rows.items())
    nothing = plain(f"only {others}", 40) if others else "no events"
    named = list(dict.fromkeys(content.columns["ticks"]["row"])) or [nothing]
    content.columns["rows"] = {"row": named}
    content.ranges["whole"], content.ranges["pitch"] = (start, stop), (0.0, top)


def _friction(content: Content, part: xr.Dataset) -> None:
    """Friction over normal force by slip speed, on its law where the run tells it."""
    empty = {"slip": [], "mu": []}
    content.columns |= {"law": empty, "force": empty | {"colour": []}}
    normal = np.asarray(part.get("normal_force", ()), dtype=float)
    touching = np.flatnonzero(normal > 1e-6 * normal.max(initial=0.0))
    if "slip_speed" not in part or not touching.size:
        content.hidden.add("friction")
        return
    slip = np.asarray(part["slip_speed"], dtype=float)[touching]
    share = np.asarray(part["friction_force"])[touching] / normal[touching]
    speed, law = law_over(part, slip, 401)
    known = np.isfinite(law)
    content.columns["law"] = {"slip": speed[known], "mu": law[known]}
    names = flag_names(part["regime"])
    chosen = thinned(slip, share, most=1500)
    codes = np.asarray(part["regime"], dtype=int)[touching][chosen]
    content.columns["force"] = {
        "slip": slip[chosen],
        "mu": share[chosen],
        "colour": [REGIMES.get(names.get(int(code), ""), UNKNOWN) for code in codes],
    }
    content.ranges["slip"] = (float(speed[0]), float(speed[-1]))
    content.ranges["mu"] = with_room(np.concatenate([law[known], share]))


def _lip(content: Content, run: xr.Dataset) -> None:
    """The lip in slow motion: of a wiper only."""
    found = lip_frames(run, *_clock(run))
    if found is None:
        content.hidden.add("lip")
    else:
        content.columns["frames"], ranges = found
        content.ranges |= ranges
