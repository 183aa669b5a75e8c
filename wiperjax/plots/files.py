"""Pictures of files: every picture by name, what it can be drawn from, and where it goes."""

import contextlib
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.animation import FuncAnimation
from matplotlib.figure import Figure

from ..dataset import SCHEMA
from ..runs import between, check_quantity, is_run, last_periods, settled
from ..storage import StoreError, check_output, open_map, replacing
from . import (
    animation,
    branches,
    classes,
    friction,
    line,
    overview,
    planes,
    portrait,
    run_page,
    spectra,
)

STILLS = (".png", ".pdf", ".svg")
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
    """

    shows: str
    draw: Callable[..., Any]
    options: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    part: Callable[[xr.Dataset], xr.Dataset] = field(default=lambda run: run)


def _phase(part: xr.Dataset, whole: xr.Dataset, component: int = 0):
    if part.sizes["time"] == whole.sizes["time"]:
        return portrait.phase_portrait(part, component=component)
    return portrait.phase_portrait(part, component=component, transient=whole)


def _value(ds: xr.Dataset, quantity: str = "velocity_rms", **options: Any):
    return planes.value_map(ds, quantity, **options)


def _run_page(part: xr.Dataset, whole: xr.Dataset) -> Figure:
    return run_page.run_overview(part, whole)


_PLANE = ("x", "y", "at")
_TIMES = ("start", "stop")
_SHARES = ("stick_fraction", "flight_fraction", "velocity_rms", "belt_speed_rms")
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
    },
    "run": {
        "overview": Picture(
            "all of the stills below on one page", _run_page, _TIMES, _MOTION, last_periods
        ),
        "history": Picture(
            "velocity, position and forces over time, with bands of regime",
            lambda part, whole, quantity=None: run_page.history_page(part, quantity),
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
            (*_MOTION, "belt_velocity", "normal_force", "friction_force"),
            settled,
        ),
        "spectrum": Picture(
            "spectrum of the settled half, with the bands of the classes",
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
            lambda run: last_periods(run, 2.0),
        ),
    },
}
"""Pictures of maps, branches and runs by name; the first of each is the default."""

FLAGS = {  # option -> how the command line calls it, where not by its own name
    "start": "--from",
    "stop": "--to",
}


def plot_file(
    path: str | Path,
    output: str | Path,
    *,
    picture: str | None = None,
    force: bool = False,
    dpi: int = 150,
    **options: Any,
) -> None:
    """Draws one picture of a file into `output`; its ending says the format.

    Arguments:

    - `path`: a map, a run, a branch, or the folder `MAP.h5.parts` of an unfinished sweep.
    - `output`: .png, .pdf, .svg; for an animation .gif, or .mp4 where ffmpeg is installed.
    - `picture`: a name in `PICTURES`; `overview` if None, `animation` for its endings.
    - `force`: replace `output`.
    - `dpi`: dots per inch.
    - `options`: those the picture takes, None for its own choice: `start`, `stop` (s), `quantity`,
        `component`, `seconds` (of the animation); `x`, `y` (names of axes), `at` (axis -> value).

    Raises: `StoreError` if the file holds nothing to draw or `output` cannot be written,
        `ValueError` for a picture or an option that does not suit the file.
    """
    output = Path(output)
    ending = output.suffix.lower()
    if picture is None and ending in animation.WRITERS:
        picture = "animation"
    with opened(path, raster=picture == "raster") as (ds, kind):
        chosen = _chosen(kind, picture or "overview", path)
        _check_ending(output, picture == "animation")
        check_output(output, force)
        drawn = _drawn(ds, kind, picture or "overview", chosen, path, options)
        _write(drawn, output, dpi)


def plot_all(
    path: str | Path, output: str | Path, *, force: bool = False, dpi: int = 150, **options: Any
) -> list[Path]:
    """Draws every picture that a file allows, as `NAME-picture.png` for `output` NAME.png.

    The animation is a .gif. Pictures that lack what they need (a raster, a second axis) are left
    out; options go to those that take them.

    Returns: the files made.

    Raises: as `plot_file`; nothing is written if one of the files exists and `force` is not set.
    """
    output = Path(output)
    _check_ending(output, False)
    made = []
    with opened(path) as (ds, kind):
        targets = {
            name: output.with_name(
                f"{output.stem}-{name}{'.gif' if name == 'animation' else output.suffix}"
            )
            for name in PICTURES[kind]
        }
        for target in targets.values():
            check_output(target, force)
        for name, target in targets.items():
            chosen = PICTURES[kind][name]
            if any(variable not in ds for variable in chosen.needs):
                continue
            taken = {key: value for key, value in options.items() if key in chosen.options}
            try:
                drawn = _drawn(ds, kind, name, chosen, path, taken)
            except ValueError:
                if any(value is not None for value in taken.values()):
                    raise  # what was asked for does not fit
                continue
            _write(drawn, target, dpi)
            made.append(target)
    return made


@contextlib.contextmanager
def opened(path: str | Path, raster: bool = False) -> Iterator[tuple[xr.Dataset, str]]:
    """Dataset of a file or of the folder of an unfinished sweep, and whether it is `map`, `branch`
    or `run`.

    Of an unfinished sweep, which is read into memory, only with `raster` what is large.

    Raises: `StoreError` if it is none of them, or no cell is computed yet.
    """
    cellwise = [name for name, column in SCHEMA.items() if raster or not column.along]
    with open_map(path, cellwise) as ds:
        if "label" in ds:
            yield ds, "map"
        elif "special_kind" in ds:
            yield ds.load(), "branch"
        elif is_run(ds):
            yield ds.load(), "run"
        elif "cells_done" in ds.attrs:
            raise StoreError(f"{path}: no block of this sweep is computed yet")
        else:
            raise StoreError(f"{path}: is no map, run or branch; there is nothing to draw")


def _chosen(kind: str, name: str, path: str | Path) -> Picture:
    there = f"of a {kind} there are {', '.join(PICTURES[kind])}"
    if name in PICTURES[kind]:
        return PICTURES[kind][name]
    for other, pictures in PICTURES.items():
        if name in pictures:
            raise ValueError(f"{name!r} is a picture of a {other}, and {path} is a {kind}; {there}")
    raise ValueError(f"{name!r} is no picture; {there}")


def _check_ending(output: Path, moving: bool) -> None:
    endings = animation.WRITERS if moving else STILLS
    if output.suffix.lower() not in endings:
        what = "an animation" if moving else "a still picture"
        raise ValueError(f"{output}: {what} must end in {' or '.join(endings)}")
    animation.check_writer(output)


def _drawn(
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
            raise ValueError(f"{flag} does not suit the picture {name!r} of a {kind}")
    if missing := [variable for variable in picture.needs if variable not in ds]:
        raise StoreError(f"{path}: has no {missing[0]}, which the picture {name!r} needs")
    if kind != "run":
        return _figure(picture.draw(ds, **given))
    if "quantity" in given:
        check_quantity(ds, given["quantity"])
    start, stop = given.pop("start", None), given.pop("stop", None)
    asked = start is not None or stop is not None
    part = between(ds, start, stop) if asked else picture.part(ds)
    return _figure(picture.draw(part, ds, **given))


def _figure(drawn: Any) -> Drawn:
    """Page of what a picture returned: itself, or that of its axes."""
    if isinstance(drawn, Figure | FuncAnimation):
        return drawn
    return np.ravel(drawn)[0].figure


def _write(drawn: Drawn, output: Path, dpi: int) -> None:
    ending = output.suffix.lower()
    # writers of animations know a format by its ending only
    hidden = output.with_name(f".{output.stem}.{os.getpid()}{ending}")
    with replacing(output, hidden) as temporary:
        if isinstance(drawn, FuncAnimation):
            animation.save(drawn, temporary, dpi=min(dpi, 80))
        else:
            drawn.savefig(temporary, dpi=dpi, format=ending[1:])
