"""What a picture is of, in words: the title of a run or map and its parameters."""

import json
import textwrap

import numpy as np
import xarray as xr
from matplotlib.figure import Figure, SubFigure

from ...datasets.kinds import kind_of
from ...datasets.run_dataset import pitch
from ...datasets.run_fit import doubts
from ...datasets.stated import BLADES, is_own
from ...noise.run_class import assess, is_of_a_scene, why_no_frequency, words
from ...noise.samples import sample_interval
from ...vocabulary.cf import units_of
from ...vocabulary.codes import Result, result_name
from ...vocabulary.columns import SYSTEM
from ...vocabulary.kinds import BELTS
from ...vocabulary.parameters import PARAMETERS
from ...vocabulary.ranges import FEWEST_SETTLED
from .axes import SHOWN, is_numeric, long_name, number
from .palette import readable

ALWAYS = ("attack_angle", "normal_load", "belt_speed")
DIRECTIONS = {"x": "along the glass", "y": "normal to the glass"}
UNSAID = ("", "steady", "lip", "stribeck")  # kinds that a caption leaves out


def parameters_text(ds: xr.Dataset) -> str:
    """`attack angle 5°, normal load 15 N/m, belt speed 0.3 m/s, ...`: the three that are always
    named, every other that is not the reference blade's, and the belt, the model and the friction
    law where they are not. Axes of a map are left out.

    Of a system of one's own every one.
    """
    own, stated = is_own(ds), units_of(ds.attrs)
    words = []
    for name in stated if own else dict.fromkeys([*ALWAYS, *PARAMETERS, *stated]):
        entry = None if own else PARAMETERS.get(name)
        value, unit = _value(ds, name, stated.get(name) or (entry.edge_unit if entry else "1"))
        if value is None:
            continue
        usual = None if entry is None or name in ALWAYS else entry.reference
        if entry is not None and usual is not None and unit == entry.edge_unit:
            usual = entry.to_edge(usual)
        if usual is None or not np.isclose(value, usual, rtol=1e-9, atol=0):
            factor, unit = SHOWN.get(unit, (1.0, unit))
            gap, unit = ("", "°") if unit == "deg" else (" ", unit)
            called = name.replace("_", " ") if entry is None else entry.long_name
            words.append(f"{called} {number(factor * value)}{gap}{unit}".strip())
    return ", ".join(words + _kinds(ds) if words else words)


def _value(ds: xr.Dataset, name: str, unit: str) -> tuple[float | None, str]:
    """A parameter and its unit; None for an axis and for what no one knows. The coordinate of a
    slice counts: the attribute may be that of another map that it was joined with.
    """
    if name in ds.coords and not ds[name].ndim and is_numeric(ds[name]):
        return float(ds[name]), str(ds[name].attrs.get("units", unit))
    known = name in ds.attrs and name not in {*ds.coords, *ds.dims}
    return float(ds.attrs[name]) if known else None, unit


def _kinds(ds: xr.Dataset) -> list[str]:
    """`wiping belt`, `block model`, `coulomb friction`: what is not the usual kind; `law own`: of
    maps that were joined over texts, which one.
    """
    attrs = ds.attrs
    belt = str(attrs.get("belt_kind", attrs.get("belt", "")))
    belt = {f"{name}belt": name for name in BELTS}.get(belt.lower(), belt)  # or a class of its own
    model = "" if is_own(ds) else attrs.get("model", BLADES.get(str(attrs.get(SYSTEM)), ""))
    kinds = {"belt": belt, "model": model, "friction": str(attrs.get("friction", ""))}
    joined = {*ds.coords, *ds.dims}  # an axis: the attribute is that of the first map alone
    said = {w: kind for w, kind in kinds.items() if kind.lower() not in UNSAID and w not in joined}
    kinds_said = [f"{kind.rpartition(':')[2]} {what}" for what, kind in said.items()]  # no path
    scalars = [] if kind_of(ds) == "run" else [c for c in ds.coords.values() if not c.ndim]
    return kinds_said + [f"{long_name(c)} {c.item()}" for c in scalars if not is_numeric(c)]


def moving(ds: xr.Dataset) -> str:
    """What vibrates in a map or run: `tip velocity`, of a system of one's own `output velocity`."""
    return "output velocity" if is_own(ds) else "tip velocity"


def partner(ds: xr.Dataset) -> str:
    """What the contact slides over: `glass`, of a system of one's own `belt`."""
    return "belt" if is_own(ds) else "glass"


def direction(ds: xr.Dataset, component: int) -> str:
    """Which coordinate of a run one is: `along the glass`, of a system of one's own its name."""
    if "axis" not in ds.coords:
        numbered = f"coordinate {component}"
        return numbered if is_own(ds) else list(DIRECTIONS.values())[component]
    name = str(np.atleast_1d(ds["axis"])[component])
    return name if is_own(ds) else DIRECTIONS.get(name, name)


def quantity_words(ds: xr.Dataset, values: xr.DataArray) -> str:
    """What a variable of a run is, in words; of one coordinate of a system of one's own with the
    name of that."""
    words, axis = long_name(values).removesuffix(" of the tip"), values.coords.get("axis")
    return f"{words} {axis.item()}" if axis is not None and axis.ndim == 0 and is_own(ds) else words


def set_caption(figure: Figure | SubFigure, ds: xr.Dataset, *notes: str) -> None:
    """Heads a page with the title of a dataset, its parameters, the noise of a run, and notes."""
    title = str(ds.attrs.get("title", "")) or str(ds.attrs.get("system", ""))
    lines = [parameters_text(ds), noise_text(ds), *notes, _fault(ds), *_doubts(ds)]
    width = 12.5 * figure.get_figwidth() if isinstance(figure, Figure) else 120
    title = textwrap.fill(title, int(0.9 * width)).replace("$", r"\$")  # no formula
    text = "\n".join(wrapped(line, width) for line in lines if line)
    figure.suptitle(f"{title}\n{text}" if title and text else title or text, fontsize="medium")


def noise_text(ds: xr.Dataset) -> str:
    """`squeal (stick-slip), 780.8 Hz`: class, mechanism and frequency of a run of a scene, as
    `assess` finds them; of another run its frequency; empty where neither is known.

    A part of a run cannot tell what the whole is: `with_noise` notes it before the run is cut.
    """
    if "noise" in ds.attrs:
        return str(ds.attrs["noise"])
    if kind_of(ds) != "run":
        return ""
    try:
        return _noise(ds)
    except ValueError:  # of samples that tell none, as `assess` says: the motion can be drawn
        return ""


def _noise(ds: xr.Dataset) -> str:
    """`noise_text` of a run. Raises: `ValueError` where its samples do not tell it."""
    if not is_of_a_scene(ds):
        if "belt_velocity" not in ds:
            return ""
        return f"{tone:.4g} Hz" if np.isfinite(tone := pitch(ds)) else ""
    time = np.asarray(ds["time"], float)
    begin = float(ds.attrs.get("statistics_start", time.mean()))
    if time[0] > 0 or np.count_nonzero(time >= begin) < FEWEST_SETTLED:
        return ""
    if time[-1] + 1.5 * sample_interval(ds) < float(ds["final_time"]):
        return ""
    found = assess(ds)
    names = words(found)
    if names["label"] == "failed" and int(found["result"]) == Result.FINISHED:
        return f"failed: {why_no_frequency(found)}"
    if names["label"] in ("quiet", "collapsed", "failed"):
        return names["label"]
    text = f"{names['label']} ({readable(names['mechanism'])})"
    tone = float(found["dominant_frequency"])
    if names["band"] != "none" and np.isfinite(tone):
        text += f", {tone:.4g} Hz"
    return text + (", not settled" if names.get("settled") == "no" else "")


def with_noise(run: xr.Dataset) -> xr.Dataset:
    """The run, with what `noise_text` says of it among its attributes, where its parts have it."""
    return run.assign_attrs(noise=noise_text(run))


def wrapped(text: str, width: float) -> str:
    """Line broken at commas so that none is longer than `width` letters, if they allow it."""
    rows = [""]
    for piece in text.split(", "):
        joined = f"{rows[-1]}, {piece}" if rows[-1] else piece
        if len(joined) > width and rows[-1]:
            rows[-1] += ","
            rows.append(piece)
        else:
            rows[-1] = joined
    return "\n".join(rows)


def _fault(ds: xr.Dataset) -> str:
    """Why a run ended early, or that a map is not finished."""
    if "cells_done" in ds.attrs:
        return f"unfinished sweep: {ds.attrs['cells_done']:,} of {ds.attrs['cells']:,} cells"
    if "result_message" in ds.attrs and int(ds["result"]) != Result.FINISHED:
        name = result_name(int(ds["result"])).replace("_", " ")
        return f"ended at {float(ds['final_time']):.4g} s: {name}"
    return ""


def _doubts(ds: xr.Dataset) -> list[str]:
    """What of the run that is drawn can be told with gaps only."""
    return doubts(ds) if kind_of(ds) == "run" else []


def start_text(ds: xr.Dataset) -> str:
    """Which of several starts is shown; empty where each cell has but one."""
    several = "class_set" in ds or not ds.attrs.keys().isdisjoint({"starts_names", "starts_random"})
    return f"start: {ds.attrs['start']}" if several and "start" in ds.attrs else ""


def footnote(ds: xr.Dataset) -> str:
    """How a map was made: its start, the borders of its classes, its settled window."""
    attrs = ds.attrs
    pieces = []
    if "start" in attrs:
        start = str(attrs["start"])
        if start.startswith("{"):
            start = ", ".join(f"{key} {value}" for key, value in json.loads(start).items())
        pieces.append(f"start: {start}")
    if "class_squeal_band" in attrs and "class_chatter_band" in attrs:
        squeal, chatter = (
            np.atleast_1d(attrs[name]) for name in ("class_squeal_band", "class_chatter_band")
        )
        low = f"{chatter[0]:g}-" if chatter[0] > 0 else "below "
        pieces.append(f"squeal {squeal[0]:g}-{squeal[-1]:g} Hz, chattering {low}{chatter[-1]:g} Hz")
    if "class_quiet_velocity" in attrs:
        pieces.append(f"quiet below {attrs['class_quiet_velocity']:g} m/s")
    elif "class_quiet_velocity_ratio" in attrs:
        pieces.append(f"quiet below {attrs['class_quiet_velocity_ratio']:g} of belt speed")
    if "run_window" in attrs:
        pieces.append(
            f"settled window {attrs['run_window']:g} s after {attrs.get('run_transient', 0):g} s"
        )
    pieces.append(str(attrs.get("source", "")))
    return "; ".join(piece for piece in pieces if piece)
