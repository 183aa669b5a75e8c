"""Commands that compute: a map, a run, a branch, a ladder of models, a map's sample again."""

import contextlib
import os
import shlex
import sys
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from .options import (
    INTERRUPTED,
    MAP_SUFFIXES,
    PICTURE_SUFFIXES,
    STILL_SUFFIXES,
    Force,
    Model,
    check_input,
    check_output,
    configure,
)
from .tables import (
    cost,
    print_classes,
    print_events,
    print_plan,
    print_sensitivities,
    print_special,
)


def sweep(
    file: Annotated[Path, typer.Argument(metavar="SWEEP.toml", help="What to sweep.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="MAP.h5", help="Map to make.")],
    force: Force = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue a sweep that was stopped.")
    ] = False,
    picture: Annotated[
        bool, typer.Option("--picture/--no-picture", help="Draw the map beside it as .png.")
    ] = True,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Cores to use.", show_default="all")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="tcp://HOST:PORT", help="Compute on this dask cluster."),
    ] = None,
    local_cluster: Annotated[
        int | None, typer.Option(min=1, help="Compute on a dask cluster of N processes here.")
    ] = None,
    sensitivities: Annotated[
        bool,
        typer.Option(
            "--sensitivities",
            help="Store derivatives by parameters too; which ones: \\[sensitivities] in the file.",
        ),
    ] = False,
    block: Annotated[
        int | None, typer.Option(min=1, help="Cells per block that is stored.", show_default="auto")
    ] = None,
    model: Model = None,
    target_error: Annotated[
        float | None,
        typer.Option(help="Pick solver, precision and rtol for this error (of the lip's length)."),
    ] = None,
) -> None:
    """Compute a map: classes of noise and statistics over the axes of a sweep file."""
    from ..specs.load import load_sweep

    begun = time.monotonic()
    if force and resume:
        raise ValueError("--force starts anew and --resume continues: give one of them")
    if sum(choice is not None for choice in (workers, scheduler, local_cluster)) > 1:
        raise ValueError("--workers, --scheduler and --local-cluster exclude each other")
    spec = load_sweep(file, model)
    if target_error is not None:
        spec = at_error(spec, target_error, file)
    if sensitivities:
        spec = spec.with_sensitivities()
    name = usual_picture(spec)
    drawing = output.with_suffix(".png") if picture and name else None
    redraw = check_map_and_picture(
        output, drawing, f"{name} of {spec.digest()}", file, force, resume
    )
    print_plan(spec, 1 if scheduler else local_cluster or workers or len(os.sched_getaffinity(0)))

    embedded = scheduler is None and local_cluster is None
    if embedded:
        configure(workers)
    from ..maps.driver import run
    from ..noise.class_counts import class_table

    command = ["wiperjax", "sweep", str(file), "-o", str(output)]
    command += ["--sensitivities"] if sensitivities else []
    command += [] if picture else ["--no-picture"]
    command += [] if workers is None else ["--workers", str(workers)]
    command += [] if scheduler is None else ["--scheduler", scheduler]
    command += [] if local_cluster is None else ["--local-cluster", str(local_cluster)]
    command += [] if model is None else ["--model", model]
    command += [] if target_error is None else ["--target-error", str(target_error)]
    chosen: dict[str, Any] = {} if block is None else {"block": block}
    try:
        with contextlib.ExitStack() as stack:
            if not embedded:
                from ..maps.cluster import connect

                chosen["workers"] = stack.enter_context(connect(scheduler, local_cluster))
            dataset = run(
                spec, output, resume=resume, force=force, command=shlex.join(command), **chosen
            )
    except KeyboardInterrupt as stopped:  # its text says what is kept and how to go on
        print(f"wiperjax: {str(stopped) or 'interrupted'}", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None
    print_classes(class_table(dataset))
    print_sensitivities(dataset)
    print_events(dataset)
    print(f"map      {output}: {cost(output, begun)}")
    if drawing is not None:
        from ..plots import plot_file

        plot_file(output, drawing, picture=name, force=redraw)
        print(f"picture  {drawing}")


def usual_picture(spec: Any) -> str | None:
    """Picture that a sweep draws of its map: one cell has none."""
    long = sum(count > 1 for count in spec.shape)
    return ("overview" if long > 1 else "line") if long else None


def check_map_and_picture(
    output: Path, drawing: Path | None, shows: str, file: Path, force: bool, resume: bool
) -> bool:
    """Whether a picture may be replaced: with --force, now or when the sweep was begun, and where
    it `shows` what this very sweep would draw.

    Raises: ValueError or StoreError if map or picture cannot be made where they are wanted.
    """
    from ..store.blocks import BlockStore

    redraw = force or (resume and BlockStore.may_replace(output))
    if not (resume and output.is_file()):  # else the driver looks whether it is this map
        check_output(output, MAP_SUFFIXES, redraw, file)
    if drawing is None:
        return redraw
    if resume and not redraw and drawing.is_file():
        from ..plots.files import subject_of

        redraw = subject_of(drawing) == shows
    check_output(drawing, STILL_SUFFIXES, redraw, file)
    return redraw


def at_error(spec: Any, target: float, file: Path) -> Any:
    """Return the sweep with the settings that `accuracy.choose` picks; say which."""
    from ..maps.accuracy import choose

    for key in ("solver", "precision", "rtol", "atol"):
        if key in spec.run.model_fields_set:
            raise ValueError(
                f"{file}: run.{key} must be left out with --target-error, which picks it"
            )
    found = choose(target)
    print(
        f"target error {target:g}: {found.solver}, {found.precision}, rtol {found.rtol:g} "
        f"(measured {found.error:.1e})"
    )
    run = spec.run.model_copy(
        update={"solver": found.solver, "precision": found.precision, "rtol": found.rtol}
    )
    return spec.model_copy(update={"run": run})


def simulate(
    file: Annotated[Path, typer.Argument(metavar="SCENE.toml", help="What to simulate.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="RUN.h5", help="Run to make.")],
    force: Force = False,
    model: Model = None,
) -> None:
    """Compute one trajectory: samples over time and every event."""
    from ..specs.load import load_scene

    spec = load_scene(file, model)
    check_output(output, MAP_SUFFIXES, force, file)

    configure(1)
    from ..runs.scene import run
    from ..store.whole import write_dataset

    try:
        dataset = run(spec)
    except KeyboardInterrupt:
        print("wiperjax: interrupted, nothing was written", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None
    write_dataset(dataset, output, force)
    print(f"run      {output}: {', '.join(f'{n} {name}' for name, n in dataset.sizes.items())}")


def follow(
    file: Annotated[Path, typer.Argument(metavar="SCENE.toml", help="A blade that makes a noise.")],
    over: Annotated[str, typer.Option(help="Parameter to vary, such as belt_speed.")],
    low: Annotated[float, typer.Option("--from", help="Its range, in the units of files.")],
    high: Annotated[float, typer.Option("--to", help="The upper end.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="BRANCH.h5", help="To make.")],
    step: Annotated[float, typer.Option(min=1e-4, max=0.5, help="Length of a step.")] = 0.03,
    simulate: Annotated[
        int | None,
        typer.Option(min=2, metavar="N", help="Simulate up and down the range too, at N values."),
    ] = None,
    force: Force = False,
) -> None:
    """Follow the limit cycle of a scene over a parameter, stable and unstable."""
    from ..specs.load import load_scene

    spec = load_scene(file)
    picture = output.with_suffix(".png")
    check_output(output, MAP_SUFFIXES, force, file)
    check_output(picture, PICTURE_SUFFIXES, force, file)

    configure(1)
    from ..cycles.branch.from_scene import run
    from ..plots import plot_file
    from ..store.whole import write_dataset

    branch = run(spec, over, low, high, step, simulate or 0)
    write_dataset(branch, output, force)
    plot_file(output, picture, force=force)
    print_special(branch)
    print(f"branch   {output}: {branch.sizes['point']} cycles")
    print(f"picture  {picture}")


def ladder(
    files: Annotated[list[Path], typer.Argument(metavar="SCENE.toml...", help="Scenes.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="TABLE.md", help="Write it here.")
    ] = None,
    force: Force = False,
) -> None:
    """Compare the models of each scene: which is the poorest that tells the same, at what cost."""
    from ..specs.load import load_scene

    for file in files:
        load_scene(file)  # wrong ones are named before any work
    if output is not None:
        check_output(output, (".md",), force, *files)
    configure(1)
    from ..runs.compare_rungs import compare, preface, summary, table

    results = []
    for file in files:
        results.append(compare(file, say=_working))
        print(table(results[-1:], head=len(results) == 1), end="", flush=True)
    if output is not None:
        text = preface() + summary(results) + "\n" + table(results)
        output.write_text(text, encoding="utf-8")
        print(f"table    {output}")


def _working(text: str) -> None:
    print(f"running {text}", file=sys.stderr, flush=True)


def verify(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A map.")],
    cells: Annotated[int, typer.Option(min=1, help="Cells to compute again.")] = 64,
    seed: Annotated[int, typer.Option(min=0, help="Which cells are drawn.")] = 0,
) -> None:
    """Compute a random sample of the cells of a map again and compare."""
    check_input(file)
    configure(None)
    from ..maps.verify import verify as verify_map

    report = verify_map(file, cells, seed)
    if report.passed:
        how = "identical" if report.identical else f"equal within {report.tolerance:g}"
        print(f"{report.cells} cells computed again, {report.columns} columns compared: {how}")
    else:
        print(f"{len(report.differing)} of {report.cells} cells differ, the first: ", end="")
        print(*report.differing[:10], sep=", ")
    for name, difference in report.largest.items():
        print(f"  {name}: largest relative difference {difference:.3g}")
    if not report.same_versions:
        print("  the map was made with other versions of the libraries; see 'wiperjax info'")
    if not report.passed:
        raise typer.Exit(1)
