"""Numbers and sound of a motion as HTML: every word that comes from a file is escaped."""

import base64
from typing import Any

import numpy as np
import xarray as xr

from ..noise.run_class import words
from ..noise.samples import sample_interval
from ..plots.maps.numbers import OF_NOISE, TONE
from ..plots.style.palette import CLASSES, UNKNOWN, readable
from ..sound import COARSEST, sound
from ..vocabulary.cf import flag_names
from ..vocabulary.codes import LABELS, Result
from .explored import escaped

ROWS = (  # column of a map, and what it is called here
    (TONE, "frequency"),
    ("velocity_rms", "velocity, rms"),
    ("stick_fraction", "share in stick"),
    ("flight_fraction", "share in flight"),
    ("normal_force_max", "largest normal force"),
    ("impact_count", "impacts in the window"),
    ("blow_count", "blows in the window"),
)
CODED = (("mechanism", "mechanism"), ("band", "band"), ("settled", "settled"))
COMPARED = ("label", *(name for name, *_ in (*CODED, *ROWS)))  # of the map, beside the run


def heading(run: xr.Dataset, told: dict[str, float], title: str, part: str) -> str:
    """Class of a motion with its colour, its tone, the parameters of the cell, and which `part` of
    the motion is drawn, in words, if any is.
    """
    name = words(told)["label"] if told else _ended(Result(int(run["result"])))
    text = readable(name)
    if not told:
        text += f" after {_time(float(run['final_time']))}"
    tone = _told(told, TONE)
    if np.isfinite(tone):
        text += f", {tone:.4g} Hz"
    colour = CLASSES.get(name, UNKNOWN)
    drawn = f'<p class="note">{part}.</p>' if part else ""
    return (
        f'<div class="head"><span class="chip" style="background:{colour}"></span>'
        f'<b class="noise">{escaped(text)}</b><br>'
        f'<span class="where">{escaped(title)}</span>{drawn}</div>'
    )


def table(run: xr.Dataset, told: dict[str, float], stored: dict[str, float], ds: Any) -> str:
    """What is told of a run beside what the map `ds` has `stored` of its cell."""
    rows, result = [], Result(int(run["result"]))
    named = words(told) if told else {"label": _ended(result)}
    for name, label in (("label", "class"), *CODED):
        here = readable(_silent(name, named)) if name in named else "-"
        names = {key: _stored_name(ds, key, stored) for key in ("label", name)}
        rows.append((name, label, here, readable(_silent(name, names)), ""))
    for name, label in ROWS:
        here, there = (_told(source, name) for source in (told, stored))
        unit = str(ds[name].attrs.get("units", "1")) if name in ds else "1"
        share = name.endswith("_fraction")
        factor, unit = (100.0, "%") if share else (1.0, "" if unit == "1" else escaped(unit))
        rows.append((name, label, _number(factor * here), _number(factor * there), unit))
    attrs = run.attrs
    rows += [
        ("events", "events, whole run", f"{run.sizes.get('event', 0):,}", "", ""),
        ("steps", "steps (rejected)", f"{attrs['steps']:,} ({attrs['rejected_steps']:,})", "", ""),
        ("result", "result", result.name.lower().replace("_", " "), "", ""),
    ]
    body = "".join(
        f'<tr data-name="{name}"><th scope="row">{label}</th><td class="here">{escaped(here)}</td>'
        f'<td class="map">{escaped(there)}</td><td class="unit">{unit}</td></tr>'
        for name, label, here, there, unit in rows
        if here != "-" or there
    )
    message = ""
    if result != Result.FINISHED:
        message = f'<p class="fault">{escaped(attrs["result_message"])}</p>'
    head = '<tr><th></th><th scope="col">here</th><th scope="col">map</th><th></th></tr>'
    return f'<table class="numbers">{head}{body}</table>{message}'


def _ended(result: Result) -> str:
    """Class of a motion that did not finish, as a map has it."""
    return "collapsed" if result == Result.COLLAPSED else "failed"


def _time(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"


def _told(source: dict[str, float], name: str) -> float:
    """A number of a motion, NaN where there is none: what moves by rounding alone has no tone."""
    quiet = name == TONE and source.get("label") == LABELS["quiet"]
    return float("nan") if quiet else source.get(name, float("nan"))


def _stored_name(ds: Any, name: str, stored: dict[str, float]) -> str:
    """Meaning of a code of the map."""
    if name not in stored or "flag_values" not in ds[name].attrs:
        return ""
    return flag_names(ds[name]).get(int(stored[name]), "not_computed")


def _silent(name: str, names: dict[str, str]) -> str:
    """What is said of a code: of the noise of a quiet cell that it is quiet, as over the map."""
    return "quiet" if name in OF_NOISE and names["label"] == "quiet" else names[name]


def _number(value: float) -> str:
    return f"{value:.5g}" if np.isfinite(value) else "-"


def audio(run: xr.Dataset, reference: float, seconds: float) -> str:
    """An audio element with so many seconds of a run, again and again; of one that has no period
    the run as it is, once. Full scale is `reference`.
    """
    if sample_interval(run) > COARSEST:
        return '<p class="note">No sound: its motions are too slow to be heard.</p>'
    try:
        heard, loop = sound(run, reference=reference, seconds=seconds), " loop"
    except ValueError:  # no whole period in the settled part
        try:
            heard, loop = sound(run, reference=reference), ""
        except ValueError as error:
            return f'<p class="fault">no sound: {escaped(error)}</p>'
    data = base64.b64encode(heard.wav()).decode()
    warning = "; peaks beyond full scale are clipped" if heard.peak > heard.reference else ""
    once = "" if loop else " of the whole run, once: it has no period to repeat"
    level = heard.describe().partition("full scale")[2].replace(" 1,", ",")
    return (
        f'<audio controls{loop} preload="auto" src="data:audio/wav;base64,{data}"></audio>'
        f'<p class="note">velocity{once}, full scale {escaped(level)}{warning}. '
        "Not a sound pressure: radiation is not modelled.</p>"
    )
