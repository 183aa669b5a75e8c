"""Pictures of files: where they come from, and where they go."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib
import xarray as xr
from matplotlib.animation import FuncAnimation
from matplotlib.figure import Figure
from PIL import Image

from ..datasets.kinds import check_kind, holds
from ..datasets.stated import wrong_attribute
from ..machine.files import StoreError, check_output, replacing
from ..machine.interrupt import heeded
from ..store.levels import is_refined
from ..store.partial import open_partial
from ..store.whole import borders, open_map, sound
from ..vocabulary import checks
from ..vocabulary.pictures import DPI, DPI_MOVING, MOVING, STILLS
from .catalogue import PICTURES, Drawn, draw, find, lacks, usual, usual_of_map
from .curves import check_drawn, with_curves
from .door import check_options
from .maps.borders import with_borders
from .runs import animation

SUBJECT = "Description"  # the key of a .png file that holds it


@contextlib.contextmanager
def _house_style() -> Iterator[None]:
    """Draws as matplotlib's own defaults have it, whatever style a person has set: what a file of
    pictures looks like, and whether it can be made, must not hang on that. Ctrl-C is heeded."""
    with heeded(), matplotlib.rc_context():
        matplotlib.rcdefaults()
        yield


@_house_style()
def plot_file(
    path: str | Path,
    output: str | Path,
    *,
    picture: str | None = None,
    curves: str | Path | None = None,
    force: bool = False,
    dpi: int | None = None,
    **options: Any,
) -> None:
    """Draws one picture of a file into `output`; its ending says the format.

    Arguments:

    - `path`: a map, a run, a branch, or the folder `MAP.h5.parts` of an unfinished sweep.
    - `output`: .png, .pdf, .svg; for an animation .gif, or .mp4 where ffmpeg is installed.
    - `picture`: a name in `PICTURES`; if None the one that suits the file (`usual_of_file`),
        for the endings of an animation that.
    - `curves`: a branch file with curves in two axes of the map, drawn over its classes.
    - `force`: replace `output`.
    - `dpi`: dots per inch, if None `DPI`, of an animation `DPI_MOVING`. (A .gif is put together in
        memory, 4 bytes a dot and frame: at 300 dpi and 6 s nearly 2 GB; an .mp4 is not.)
    - `options`: those the picture takes, None for its own choice: `start`, `stop` (s), `quantity`,
        `component`, `seconds` (of the animation); `x`, `y` (names of axes), `at` (axis -> value).

    Raises: `StoreError` if the file is damaged or has nothing to draw, or `output` is not writable,
        `ValueError` for a picture or an option that does not suit the file.
    """
    _check(path, output, force, dpi, options | {"picture": picture})
    output = Path(output)
    ending = output.suffix.lower()
    if picture is None and ending in MOVING:
        picture = "animation"
    with opened(path, raster=picture == "raster") as (ds, kind):
        name = picture or usual(ds, kind, path)
        chosen = find(kind, name, path)
        _check_ending(output, name == "animation")
        if curves is not None:
            ds = _with_curves(ds, kind, path, curves)
        try:
            drawn = draw(ds, kind, name, chosen, path, options)
        except ValueError as error:  # of samples that tell no spectrum, say
            raise ValueError(f"{path}: {error}") if kind == "run" else error from None
        if curves is not None and isinstance(drawn, Figure):
            check_drawn(ds, drawn, name)
        check_output(output, force, path)  # after what is wrong with the picture itself
        shows = subject(name, ds.attrs.get("specification_digest", "no map"))
        _write(drawn, output, force, dpi, shows)


def usual_of_file(path: str | Path) -> str:
    """Name of the picture that suits a file. Raises: as `plot_file`."""
    with opened(path) as (ds, kind):
        return usual(ds, kind, path)


@_house_style()
def plot_all(
    path: str | Path,
    output: str | Path,
    *,
    curves: str | Path | None = None,
    force: bool = False,
    dpi: int | None = None,
    **options: Any,
) -> list[Path]:
    """Draws every picture that a file allows, as `NAME-picture.png` for `output` NAME.png.

    The animation is a .gif of `DPI_MOVING`; `dpi` is that of the stills. Pictures that lack what
    they need (a raster, a second axis) are left out; options go to those that take them.

    Returns: the files made.

    Raises: as `plot_file`, and `ValueError` for a file that allows none; nothing is written if one
        of the files exists and `force` is not set.
    """
    _check(path, output, force, dpi, options)
    output = Path(output)
    _check_ending(output, False)
    made, why = [], ""
    with opened(path) as (ds, kind):
        usual(ds, kind, path)  # refuses a map of one cell
        targets = {
            name: output.with_name(
                f"{output.stem}-{name}{'.gif' if name == 'animation' else output.suffix}"
            )
            for name in PICTURES[kind]
        }
        for target in targets.values():
            check_output(target, force, path)
        if curves is not None:
            ds = _with_curves(ds, kind, path, curves)
        for name, target in targets.items():
            chosen = PICTURES[kind][name]
            if lack := lacks(ds, name, chosen):
                why = why or f": {lack}"
                continue
            taken = {key: value for key, value in options.items() if key in chosen.options}
            try:
                drawn = draw(ds, kind, name, chosen, path, taken)
            except ValueError as error:
                if any(value is not None for value in taken.values()):
                    raise  # what was asked for does not fit
                why = why or f": {error}"
                continue
            _write(drawn, target, force, None if name == "animation" else dpi)
            made.append(target)
    if not made:
        raise ValueError(f"{path}: has nothing to draw{why}")
    return made


def _with_curves(ds: xr.Dataset, kind: str, path: Any, curves: str | Path) -> xr.Dataset:
    """A map with the curves of another file."""
    checks.path("curves", curves)
    if kind != "map":
        raise ValueError(f"curves are drawn over a map, and {path} {holds(kind)}")
    sound(curves)
    with open_map(curves) as held:
        return with_curves(ds, held.load())


def _check(path: Any, output: Any, force: Any, dpi: Any, options: dict[str, Any]) -> None:
    checks.path("path", path)
    checks.path("output", output)
    check_options(options | {"force": force, "dpi": dpi})


@contextlib.contextmanager
def opened(path: str | Path, raster: bool = False) -> Iterator[tuple[xr.Dataset, str]]:
    """Dataset of a file or of the folder of an unfinished sweep, and its kind, of `PICTURES`.

    Of an unfinished sweep, which is read into memory, only with `raster` what is large.

    Raises: `StoreError` if it is none of these, or damaged, or states what cannot be.
    """
    sound(path)  # else HDF5 may hang in what is damaged, or show what is wrong
    parts = Path(path).is_dir()
    with open_partial(path, wide=raster) if parts else open_map(path) as ds:
        kind = check_kind(ds, PICTURES, "drawn", path)
        if why := wrong_attribute(ds):
            raise StoreError(f"{path}: its attribute {why}")
        if kind == "map" and is_refined(path):
            ds = with_borders(ds, borders(path))
        yield ds if kind == "map" else ds.load(), kind


def _check_ending(output: Path, moving: bool) -> None:
    endings = MOVING if moving else STILLS
    if output.suffix.lower() not in endings:
        what = "an animation" if moving else "a still picture"
        raise ValueError(f"{output}: {what} must end in {' or '.join(endings)}")
    animation.check_writer(output)


def subject(picture: str, digest: str) -> str:
    """What a picture shows: its name, and the digest of the sweep that the map was made from."""
    return f"{picture} of {digest}"


def subject_of(path: Path) -> str:
    """What the picture in a .png file shows, if `plot_file` drew it; empty if not."""
    try:
        with Image.open(path) as image:
            return str(image.info.get(SUBJECT, ""))
    except (OSError, ValueError, SyntaxError):  # no picture at all
        return ""


def is_usual_of(spec: Any, path: Path) -> bool:
    """Whether the picture in a .png file is the one that is drawn of the map of a sweep."""
    return subject_of(path) == subject(usual_of_map(spec.shape), spec.digest())


def _write(drawn: Drawn, output: Path, force: bool, dpi: int | None, shows: str = "") -> None:
    ending = output.suffix.lower()
    # writers of animations know a format by its ending only
    hidden = output.with_name(f".{output.stem}.{os.getpid()}{ending}")
    with heeded() as check, replacing(output, hidden, force) as temporary:
        if isinstance(drawn, FuncAnimation):
            animation.save(drawn, temporary, dpi=dpi or DPI_MOVING)
        else:
            said = {SUBJECT: shows} if ending == ".png" else None
            drawn.savefig(temporary, dpi=dpi or DPI, format=ending[1:], metadata=said)
        check()  # matplotlib keeps weak references: a Ctrl-C in their callbacks is dropped
