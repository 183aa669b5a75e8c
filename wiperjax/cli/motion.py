"""Commands that compute single motions: a run, a branch of cycles, a ladder of models."""

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from ..vocabulary.pictures import STILLS
from .options import (
    INTERRUPTED,
    MAP_SUFFIXES,
    Force,
    Model,
    Said,
    beside,
    check_target,
    command_line,
    configure,
    told_of,
)
from .tables import print_curves, print_end, print_notes, print_special


def simulate(
    file: Annotated[Path, typer.Argument(metavar="SCENE.toml", help="What to simulate.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="RUN.h5", help="Run to make.")],
    force: Force = False,
    model: Model = None,
) -> None:
    """Compute one trajectory: samples over time and every event."""
    from ..specs.load import load_scene

    configure(1)  # before the file is read: a system of one's own may start jax's device
    spec = load_scene(file, model)
    check_target(output, MAP_SUFFIXES, force, file)
    print_notes(spec)

    from ..runs.scene import run_scene
    from ..store.whole import write_dataset

    try:
        with told_of(file):
            dataset = run_scene(spec)
    except KeyboardInterrupt:
        print("wiperjax: interrupted, nothing was written", file=sys.stderr)
        raise typer.Exit(Said(INTERRUPTED)) from None
    write_dataset(dataset.assign_attrs(command=command_line()), output, force)
    print(f"run      {output}: {', '.join(f'{n} {name}' for name, n in dataset.sizes.items())}")
    print_end(dataset)


def follow(
    file: Annotated[Path, typer.Argument(metavar="SCENE.toml", help="A blade that makes a noise.")],
    over: Annotated[str, typer.Option(help="Parameter to vary, such as belt_speed.")],
    low: Annotated[float, typer.Option("--from", help="Its range, in the units of files.")],
    high: Annotated[float, typer.Option("--to", help="The upper end.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="BRANCH.h5", help="To make.")],
    step: Annotated[
        float | None,
        typer.Option(
            min=1e-4,
            max=0.5,
            show_default="0.03, of curves 0.05",
            help="Longest step of branch and curves: 1 is a range, or the cycle's size or period.",
        ),
    ] = None,
    simulate: Annotated[
        int | None,
        typer.Option(min=2, metavar="N", help="Simulate up and down the range too, at N values."),
    ] = None,
    second: Annotated[
        str | None,
        typer.Option(help="Follow its folds and Hopf points over this parameter too: curves."),
    ] = None,
    second_low: Annotated[
        float | None, typer.Option("--second-from", help="Its range, in the units of files.")
    ] = None,
    second_high: Annotated[float | None, typer.Option("--second-to", help="The upper end.")] = None,
    force: Force = False,
) -> None:
    """Follow the limit cycle of a scene over a parameter, stable and unstable."""
    from ..specs.load import load_scene

    configure(1)
    spec = load_scene(file)
    if (second is None, second_low is None, second_high is None) not in ((True,) * 3, (False,) * 3):
        raise ValueError("--second, --second-from and --second-to belong together: give all three")
    plane = None if second is None else (second, second_low, second_high)
    pictures = {"overview": output.with_suffix(".png")}
    if plane is not None:
        pictures["curves"] = beside(output, "-curves.png")
    check_target(output, MAP_SUFFIXES, force, file)
    for path in pictures.values():
        check_target(path, STILLS, force, file)

    from ..cycles.branch.from_scene import follow_scene
    from ..plots import plot_file
    from ..store.whole import write_dataset

    kept = ""

    def keep(branch: Any, lacks: str = "") -> None:
        nonlocal kept
        write_dataset(branch.assign_attrs(command=command_line()), output, force or bool(kept))
        kept = f"note: {output} holds the branch, without its {lacks}" if lacks else ""

    try:
        branch = follow_scene(spec, over, low, high, step, simulate or 0, plane, keep=keep)  # type: ignore[arg-type]
        keep(branch)
    except BaseException:
        if kept:
            print(kept, file=sys.stderr)
        raise
    print_special(branch)
    print_curves(branch)
    print(f"branch   {output}: {branch.sizes['point']} cycles")
    for picture, path in pictures.items():
        if picture == "curves" and not branch.sizes.get("curve_point"):
            print(f"note: no fold and no Hopf point to follow over {second}", file=sys.stderr)
            continue
        plot_file(output, path, picture=picture, force=force)
        print(f"picture  {path}")


def ladder(
    files: Annotated[list[Path], typer.Argument(metavar="SCENE.toml...", help="Scenes.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="TABLE.md", help="Write it here.")
    ] = None,
    force: Force = False,
) -> None:
    """Compare the models of each scene: which is the poorest that tells the same, at what cost."""
    configure(1)
    from ..maps.compare_rungs import check_scene, compare, preface, summary, table

    for file in files:
        check_scene(file)  # named before any work
    if output is not None:
        check_target(output, (".md",), force, *files)
    results = []
    for file in files:
        results.append(compare(file, say=_working))
        print(table(results[-1:], head=len(results) == 1), end="", flush=True)
    if output is not None:
        from ..machine.files import write_bytes

        text = preface(command_line()) + summary(results) + "\n" + table(results)
        write_bytes(output, text.encode(errors="backslashreplace"), force)
        print(f"table    {output}")


def _working(text: str) -> None:
    print(f"running {text}", file=sys.stderr, flush=True)
