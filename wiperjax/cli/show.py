"""Commands that show what there is: pictures, sound, text."""

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from ..vocabulary.pictures import MOVING, PLAYED, STILLS
from .modes import print_modes, print_modes_over
from .options import (
    SOUND_SUFFIXES,
    Begin,
    Component,
    Curves,
    Dpi,
    End,
    Force,
    beside,
    check_source,
    check_target,
    cuts,
    print_doubts,
    print_stated,
    read,
    told_of,
)
from .refine import print_borders
from .tables import (
    print_anatomy,
    print_attributes,
    print_class,
    print_classes,
    print_curves,
    print_end,
    print_events,
    print_open,
    print_sensitivities,
    print_special,
)

TOLD: Mapping[str, Sequence[Callable[[Any], None]]] = {
    "map": (
        print_stated,
        print_doubts,
        print_classes,
        print_open,
        print_anatomy,
        print_sensitivities,
        print_events,
    ),
    "run": (print_stated, print_doubts, print_class),
    "branch": (print_stated, print_doubts, print_special, print_curves),
    "curves": (print_curves,),
    "modes": (print_modes,),
    "modes_over": (print_modes_over,),
}
"""What `info` prints of each kind of dataset."""

USUAL = "overview; of a map along one axis line"
PLOT_HELP = (  # no line breaks within paragraphs: they would be shown
    "Draw a map, a run or a branch.\n\n"
    "Pictures of a map: overview, classes, regimes, mechanisms (over two axes and a third), "
    "frequency, value (of --quantity, else velocity_rms, over two axes), line (along one axis: "
    "frequency, amplitude, regimes), shares (of random starts), raster (regime over time).\n\n"
    "Pictures of a run: overview, history, phase, friction (on the Stribeck curve), spectrum, "
    "spectrogram, animation.\n\n"
    "Pictures of a branch: overview, cycles (any number of them over the parameter), multipliers, "
    "curves (its folds and Hopf points over two parameters).\n\n"
    "Pictures of modes over a sweep: overview (lock-in over an axis, growth over two)."
)
LISTEN_HELP = (
    "Hear a run: its tip velocity as a WAV file (48 kHz, mono, 32-bit float).\n\n"
    "Full scale is a velocity, the same for every run. Levels are no sound pressure and no dB(A): "
    "what blade and screen radiate is not modelled."
)


def plot(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE.h5",
            help="A map, a run, a branch, or MAP.h5.parts of an unfinished sweep.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE.png",
            help="Picture to make: .png, .pdf, .svg; .gif or .mp4 for an animation.",
            show_default="FILE-PICTURE.png",
        ),
    ] = None,
    force: Force = False,
    picture: Annotated[
        str | None,
        typer.Option("-p", "--picture", metavar="NAME", help="Which one.", show_default=USUAL),
    ] = None,
    every: Annotated[
        bool, typer.Option("--all", help="All that FILE allows, as FILE-PICTURE.png each.")
    ] = False,
    start: Begin = None,
    stop: End = None,
    quantity: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="Variable for history, spectrum, spectrogram, value, cycles."
        ),
    ] = None,
    component: Component = None,
    seconds: Annotated[
        float | None,
        typer.Option(
            metavar="S", help=f"Animation: how long it plays ({PLAYED[0]} to {PLAYED[1]} s)."
        ),
    ] = None,
    x: Annotated[
        str | None, typer.Option("--x", metavar="AXIS", help="Map: the axis across.")
    ] = None,
    y: Annotated[str | None, typer.Option("--y", metavar="AXIS", help="Map: the axis up.")] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            metavar="AXIS=VALUE", help="Map: cut another axis here (degrees); start=up: that start."
        ),
    ] = None,
    curves: Curves = None,
    dpi: Dpi = None,
) -> None:
    if output is not None:  # whether it exists is said last: after what is wrong with the picture
        check_target(output, STILLS if every else (*STILLS, *MOVING), True, file)
    check_source(file)
    if every and picture is not None:
        raise ValueError("--all draws every picture and --picture one: give one of them")
    if curves is not None:
        check_source(curves)
    options: dict[str, Any] = {
        "start": start, "stop": stop, "quantity": quantity, "component": component,
        "seconds": seconds, "x": x, "y": y, "at": cuts(at), "curves": curves,
    }  # fmt: skip
    chosen = {name: value for name, value in options.items() if value is not None}
    from ..plots import plot_all, plot_file

    output = output or _picture_of(file, picture, every)
    if every:
        for path in plot_all(file, output, force=force, dpi=dpi, **chosen):
            print(f"picture  {path}")
        return
    plot_file(file, output, picture=picture, force=force, dpi=dpi, **chosen)
    print(f"picture  {output}")


def _picture_of(file: Path, picture: str | None, every: bool) -> Path:
    """The name of a picture where none is given: FILE-PICTURE.png; `--all` adds those itself."""
    from ..plots.files import usual_of_file

    name = "" if every else f"-{picture or usual_of_file(file)}"
    return beside(file, f"{name}{'.gif' if picture == 'animation' else '.png'}")


def listen(
    file: Annotated[Path, typer.Argument(metavar="RUN.h5", help="A run.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="RUN.wav",
            help="Sound to make.",
            show_default="RUN.wav, beside it",
        ),
    ] = None,
    force: Force = False,
    quantity: Annotated[
        str, typer.Option(metavar="NAME", help="velocity (of the tip) or normal_force.")
    ] = "velocity",
    reference: Annotated[
        float | None,
        typer.Option(
            metavar="VALUE", help="Value at full scale (m/s or N/m).", show_default="1 or 20"
        ),
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option(metavar="S", help="Repeat its settled periods for so long (s)."),
    ] = None,
    start: Begin = None,
    stop: End = None,
) -> None:
    output = output or beside(file, ".wav")
    check_target(output, SOUND_SUFFIXES, force, file)
    check_source(file)
    from ..datasets.run_dataset import pitch
    from ..noise.spectrum import HEARD
    from ..sound import sound

    run, _ = read(file, ["run"], "heard ('wiperjax simulate')")
    with told_of(file):
        heard = sound(
            run, quantity=quantity, reference=reference, start=start, stop=stop, seconds=seconds
        )
    heard.write(output, force)
    print(f"sound    {output}: {heard.describe()}")
    whose = "lip" if run.attrs.get("of_a_blade", True) else "system"
    print(f"note: motion of the {whose}, not sound pressure (no dB(A)): radiation is not modelled")
    tone, (lowest, highest) = pitch(run), HEARD
    if tone < lowest:
        lower = f"its tone, {tone:.3g} Hz, lies below {lowest:g} Hz"
        print(f"note: {lower}: nobody hears it, at most its overtones", file=sys.stderr)
    elif tone > highest:
        higher = f"its tone, {tone:.3g} Hz, lies above {highest:g} Hz"
        print(f"note: {higher}: the sound holds what lies below alone", file=sys.stderr)
    if warning := heard.warning():
        print(f"note: {warning}", file=sys.stderr)
    print_end(run)


def info(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="A map, a run, a branch, modes, or MAP.h5.parts of an unfinished sweep.",
        ),
    ],
) -> None:
    """Show what a file holds, its classes, and how it was made."""
    from ..datasets.kinds import holds, kind_of, why_none
    from ..store.levels import is_refined
    from ..store.whole import borders, open_map, sound

    checked = sound(file)
    with open_map(file) as dataset:
        if not checked and not str(dataset.attrs.get("source", "")).startswith("wiperjax"):
            print(f"note: {file} does not say that wiperjax made it", file=sys.stderr)
        kind, sizes = kind_of(dataset), (f"{n} {count}" for n, count in dataset.sizes.items())
        print(f"{holds(kind)}: {', '.join(sizes)}")
        if not kind and (why := why_none(dataset)):
            print(f"note: it is no run, for {why}", file=sys.stderr)
        _print_cut(dataset)
        print(f"checksums: {'the file is as it was written' if checked else 'none in the file'}")
        for tell in TOLD.get(kind, ()):
            tell(dataset)
        if is_refined(file):
            print_borders(borders(file))
        print_attributes(dataset)


def _print_cut(dataset: Any) -> None:
    """Where a part of a file was taken of axes that it has no more."""
    for name, value in dataset.coords.items():
        if not value.ndim:
            unit = str(value.attrs.get("units", "1"))
            text = f"{value.item():g}" if value.dtype.kind in "iuf" else value.item()
            print(f"cut at {name} {text}{f' {unit}' * (unit != '1')}")
