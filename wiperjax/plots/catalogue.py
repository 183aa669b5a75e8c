"""Every picture by name: what it shows, what it is drawn from, and which options it takes."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.animation import FuncAnimation
from matplotlib.figure import Figure

from ..datasets.kinds import holds
from ..datasets.run_dataset import between, check_quantity, last_periods, settled
from ..machine.files import StoreError
from ..vocabulary.products import PRODUCTS
from . import branches, curves, modes
from .door import at_start
from .maps import categories, classes, line, numbers, overview, planes
from .runs import animation, friction, page, portrait, spectra
from .style.caption import with_noise

Drawn = Figure | FuncAnimation


@dataclass(frozen=True)
class Picture:
    """One kind of picture.

    Attributes:
        shows: what is seen in it, in words.
        draw: makes it from the dataset and the options; a run comes as (part, whole run).
        options: names of the options it takes.
        needs: variables that the dataset must hold.
        part: the part of a run that is drawn if no times are given.
        without: what a file is that lacks what it needs, where the names of that say little.
    """

    shows: str
    draw: Callable[..., Any]
    options: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    part: Callable[[xr.Dataset], xr.Dataset] = field(default=lambda run: run)
    without: str = ""


def _phase(part: xr.Dataset, whole: xr.Dataset, component: int | None = None):
    if part.sizes["time"] == whole.sizes["time"]:
        return portrait.phase_portrait(part, component=component)
    return portrait.phase_portrait(part, component=component, transient=whole)


def _value(ds: xr.Dataset, quantity: str = "velocity_rms", **options: Any):
    planes.check_cellwise(ds, quantity)
    ds = numbers.named_sets(ds, quantity)
    if "flag_values" in ds[quantity].attrs:  # codes are names, not numbers
        return categories.category_map(ds, quantity, **options)
    return planes.value_map(ds, quantity, **options)


_PLANE = ("x", "y", "at")
_TIMES = ("start", "stop")
_SHARES = ("stick_fraction", "flight_fraction", "velocity_rms")
_MOTION = ("position", "velocity", "regime")

PICTURES: Mapping[str, Mapping[str, Picture]] = {
    "map": {
        "overview": Picture(
            "classes over two axes and a third, frequency, stick, level, shares",
            overview.map_overview,
            _PLANE,
            ("dominant_frequency", "stick_fraction", "velocity_rms"),
        ),
        "classes": Picture("noise classes over two axes and a third", classes.class_map, _PLANE),
        "regimes": Picture(
            "which of stick, slip and flight occur, over two axes and a third",
            classes.regime_map,
            _PLANE,
            _SHARES,
        ),
        "mechanisms": Picture(
            "what keeps the motion going, over two axes and a third",
            classes.mechanism_map,
            _PLANE,
            ("mechanism",),
        ),
        "frequency": Picture(
            "dominant frequency over two axes",
            planes.frequency_map,
            _PLANE,
            ("dominant_frequency",),
        ),
        "value": Picture(
            "any stored number over two axes (--quantity)", _value, ("quantity", *_PLANE)
        ),
        "line": Picture(
            "frequency, amplitude and regimes along one axis, belt speed if there (--x)",
            lambda ds, x=None, at=None: line.along_axis(ds, along=x, at=at),
            ("x", "at"),
            ("dominant_frequency", "velocity_rms", "slip_fraction", *_SHARES[:2]),
        ),
        "shares": Picture(
            "shares of the classes along one axis (--x), of a sweep with [starts] random",
            lambda ds, x=None, at=None: line.class_shares(ds, along=x, at=at),
            ("x", "at"),
        ),
        "raster": Picture(
            "regime over time along one axis (--y), of a sweep with [run] raster",
            lambda ds, y=None, at=None: line.regime_raster(ds, along=y, at=at),
            ("y", "at"),
        ),
    },
    "branch": {
        "overview": Picture(
            "cycles over the parameter, their multipliers and frequency", branches.branch_overview
        ),
        "cycles": Picture(
            "any number of the cycles over the parameter (--quantity), stable and unstable",
            branches.branch_page,
            ("quantity",),
        ),
        "multipliers": Picture("size of the multipliers", branches.multipliers),
        "curves": Picture(
            "its folds and Hopf points over two parameters (follow --second)",
            curves.curve_page,
            (),
            ("curve_row_size",),
            without="was made without --second, or has no fold and no Hopf point: no curves",
        ),
    },
    "modes_over": {
        "overview": Picture(
            "real part and frequency of every mode over an axis; the largest over two",
            modes.modes_page,
        )
    },
    "run": {
        "overview": Picture(
            "all of the stills below on one page", page.run_overview, _TIMES, _MOTION, last_periods
        ),
        "history": Picture(
            "velocity, position and forces over time, with bands of regime",
            lambda part, whole, quantity=None: page.history_page(part, quantity),
            ("quantity", *_TIMES),
            _MOTION,
            last_periods,
        ),
        "phase": Picture(
            "velocity over position, coloured by regime",
            _phase,
            ("component", *_TIMES),
            _MOTION,
            last_periods,
        ),
        "friction": Picture(
            "friction force over slip speed, on the Stribeck curve",
            lambda part, whole: friction.friction_page(part),
            _TIMES,
            (*_MOTION, "slip_speed", "normal_force", "friction_force"),
            settled,
        ),
        "spectrum": Picture(
            "spectrum of the settled part, with the bands of the classes",
            lambda part, whole, **options: spectra.spectrum(part, **options),
            ("quantity", "component", *_TIMES),
            (),
            settled,
        ),
        "spectrogram": Picture(
            "level over time and frequency, with ticks of the events",
            lambda part, whole, **options: spectra.spectrogram(part, **options),
            ("quantity", "component", *_TIMES),
            ("regime",),
        ),
        "animation": Picture(
            "the lip in slow motion with its contact force (.gif, .mp4)",
            lambda part, whole, seconds=6.0: animation.animate(part, seconds=seconds),
            ("seconds", *_TIMES),
            (*_MOTION, "belt_velocity", "normal_force", "friction_force"),
            lambda run: animation.slow_part(run, 2.0),
        ),
    },
}
"""Kind of dataset -> its pictures by name; the first of each is the default (`usual`)."""

FLAGS = {  # option -> how the command line calls it, where not by its own name
    "start": "--from",
    "stop": "--to",
}


def usual(ds: xr.Dataset, kind: str, path: str | Path) -> str:
    """Name of the page that suits a dataset: the first of its kind, of a map along one axis `line`.

    Raises: `ValueError` for a map of one cell, or whose axes are all of one number, or of texts.
    """
    if kind != "map":
        return next(iter(PICTURES[kind]))
    name = usual_of_map([ds.sizes[dim] for dim in planes.long_axes(ds) if dim != "start"])
    if not name:
        alone = ds["label"].size == ds.sizes.get("start", 1)
        has = "one cell" if alone else "no axis of more than one number"
        raise ValueError(f"{path}: has {has}; a map needs an axis of two values to be drawn")
    return name


def usual_of_map(shape: Iterable[int]) -> str:
    """The same of a map with so many values along its axes; empty for one cell."""
    return ("", "line", "overview")[min(2, sum(count > 1 for count in shape))]


def find(kind: str, name: str, path: str | Path) -> Picture:
    there = f"of {PRODUCTS[kind].words} there are {', '.join(PICTURES[kind])}"
    if name in PICTURES[kind]:
        return PICTURES[kind][name]
    for other, pictures in PICTURES.items():
        if name in pictures:
            of = PRODUCTS[other].words
            raise ValueError(f"{name!r} is a picture of {of}, and {path} {holds(kind)}; {there}")
    raise ValueError(f"{name!r} is no picture; {there}")


def lacks(ds: xr.Dataset, name: str, picture: Picture) -> str:
    """What a dataset has not, or is not, that a picture is drawn from; empty if it has all."""
    missing = [variable for variable in picture.needs if variable not in ds]
    if not missing:
        return ""
    return picture.without or f"has no {missing[0]}, which the picture {name!r} needs"


def draw(
    ds: xr.Dataset,
    kind: str,
    name: str,
    picture: Picture,
    path: str | Path,
    options: Mapping[str, Any],
) -> Drawn:
    given = {key: value for key, value in options.items() if value is not None}
    for key in given:
        if key not in picture.options:
            flag = FLAGS.get(key, f"--{key}")
            raise ValueError(f"{flag} does not suit the picture {name!r} of {PRODUCTS[kind].words}")
    if lack := lacks(ds, name, picture):
        raise StoreError(f"{path}: {lack}")
    if kind == "map":
        ds, at = at_start(ds, given.pop("at", None))
        given |= {} if at is None else {"at": at}
    if kind != "run":
        return _figure(picture.draw(ds, **given))
    if "quantity" in given:
        check_quantity(ds, given["quantity"])
    ds = with_noise(ds)
    start, stop = given.pop("start", None), given.pop("stop", None)
    asked = start is not None or stop is not None
    part = between(ds, start, stop) if asked else picture.part(ds)
    return _figure(picture.draw(part, ds, **given))


def _figure(drawn: Any) -> Drawn:
    """Page of what a picture returned: itself, or that of its axes."""
    if isinstance(drawn, Figure | FuncAnimation):
        return drawn
    return np.ravel(drawn)[0].figure
