"""Command line: files in, files and short tables out; no physics.

What can be wrong with paths and files is checked before anything is computed. Heavy modules (jax,
xarray, matplotlib) are imported inside the commands, after `launch.configure`, for two reasons:
`--help` stays fast, and the settings of XLA have to precede `import jax`.
"""

import contextlib
import importlib.metadata
import os
import resource
import shlex
import sys
import time
import traceback
from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path
from typing import Annotated, Any

import typer

from wiperjax.cli_bench import app as bench

MAP_SUFFIXES = (".h5", ".hdf5", ".nc")
STILL_SUFFIXES = (".png", ".pdf", ".svg")
PICTURE_SUFFIXES = (*STILL_SUFFIXES, ".gif", ".mp4")
SOUND_SUFFIXES = (".wav",)
PLOT_HELP = (  # no line breaks within paragraphs: they would be shown
    "Draw a map, a run or a branch.\n\n"
    "Pictures of a map: overview, classes, regimes, mechanisms (over two axes and a third), "
    "frequency, value (over two axes), line (along one axis: frequency, amplitude, regimes), "
    "raster (regime over time).\n\n"
    "Pictures of a run: overview, history, phase, friction (on the Stribeck curve), spectrum, "
    "spectrogram, animation.\n\n"
    "Pictures of a branch: overview, cycles (any number of them over the parameter), multipliers."
)
LISTEN_HELP = (
    "Hear a run: its tip velocity as a WAV file (48 kHz, mono, 32-bit float).\n\n"
    "Full scale is a velocity, the same for every run. Levels are no sound pressure and no dB(A): "
    "what blade and screen radiate is not modelled."
)
INTERRUPTED = 130  # what a shell reports for a command ended by Ctrl-C

app = typer.Typer(
    name="wiperjax",
    help="Noise maps of windscreen wipers: stick, slip and flight of a blade lip.",
    add_completion=False,
    pretty_exceptions_enable=False,
)

app.add_typer(bench, name="bench")

Model = Annotated[
    str | None,
    typer.Option(
        metavar="block|bar|lip",
        help="Model instead of the file's: a block on a belt, the lip held on the glass, or all.",
        show_default="the file's, or lip",
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Replace existing output.")]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; every error of a user becomes one line on stderr.

    Arguments:
        arguments: words after the program's name; those of the process if None.

    Returns: exit status, 0 if all went well, 2 for a wrong command line, 130 after Ctrl-C, else 1.
    """
    words = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    try:
        status = app(words, prog_name="wiperjax", standalone_mode=False)
        return status if isinstance(status, int) else 0
    except (KeyboardInterrupt, typer.Abort):  # outside of a long command
        return _complain("interrupted", INTERRUPTED)
    except Exception as error:
        usage = getattr(error, "format_message", None)  # only errors of the command line have it
        if usage is not None:
            return _complain(f"{usage().rstrip('.')}; try 'wiperjax --help'", 2)
        if not isinstance(error, OSError | ValueError | RuntimeError):
            raise  # a bug: its traceback is wanted
        if "WIPERJAX_TRACEBACK" in os.environ:
            traceback.print_exc()
        return _complain(_one_line(error), 1)


def _complain(text: str, status: int) -> int:
    print(f"wiperjax: {' '.join(text.split())}", file=sys.stderr)
    return status


def _one_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__


def _version(wanted: bool) -> None:
    if wanted:
        try:
            print(f"wiperjax {importlib.metadata.version('wiperjax')}")
        except importlib.metadata.PackageNotFoundError:
            print("wiperjax (not installed)")
        raise typer.Exit


@app.callback(epilog="WIPERJAX_TRACEBACK=1 in the environment shows where an error came from.")
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass


@app.command()
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
            help="Store derivatives by parameters too; which ones: [sensitivities] in the file.",
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
    from wiperjax.spec import load_sweep

    begun = time.monotonic()
    if force and resume:
        raise ValueError("--force starts anew and --resume continues: give one of them")
    if sum(choice is not None for choice in (workers, scheduler, local_cluster)) > 1:
        raise ValueError("--workers, --scheduler and --local-cluster exclude each other")
    spec = load_sweep(file, model)
    if target_error is not None:
        spec = _at_error(spec, target_error, file)
    if sensitivities:
        spec = spec.with_sensitivities()
    _check_output(output, MAP_SUFFIXES, force or resume, file)
    drawing = output.with_suffix(".png") if picture else None
    if drawing is not None:
        _check_output(drawing, STILL_SUFFIXES, force or resume, file)
    _print_plan(spec)

    embedded = scheduler is None and local_cluster is None
    if embedded:
        _configure(workers)
    from wiperjax.driver import run
    from wiperjax.labels import class_table

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
                from wiperjax.cluster import connect

                chosen["workers"] = stack.enter_context(connect(scheduler, local_cluster))
            dataset = run(
                spec, output, resume=resume, force=force, command=shlex.join(command), **chosen
            )
    except KeyboardInterrupt as stopped:  # its text says what is kept and how to go on
        print(f"wiperjax: {str(stopped) or 'interrupted'}", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None
    _print_classes(class_table(dataset))
    _print_sensitivities(dataset)
    _print_events(dataset)
    print(f"map      {output}: {_cost(output, begun)}")
    if drawing is not None:
        from wiperjax.plots import plot_file

        plot_file(output, drawing, force=force or resume)
        print(f"picture  {drawing}")


@app.command()
def simulate(
    file: Annotated[Path, typer.Argument(metavar="SCENE.toml", help="What to simulate.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="RUN.h5", help="Run to make.")],
    force: Force = False,
    model: Model = None,
) -> None:
    """Compute one trajectory: samples over time and every event."""
    from wiperjax.spec import load_scene

    spec = load_scene(file, model)
    _check_output(output, MAP_SUFFIXES, force, file)

    _configure(1)
    from wiperjax.scene import run
    from wiperjax.storage import write_dataset

    try:
        dataset = run(spec)
    except KeyboardInterrupt:
        print("wiperjax: interrupted, nothing was written", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None
    write_dataset(dataset, output, force)
    print(f"run      {output}: {', '.join(f'{n} {name}' for name, n in dataset.sizes.items())}")


@app.command()
def follow(
    file: Annotated[Path, typer.Argument(metavar="SCENE.toml", help="A blade that makes a noise.")],
    over: Annotated[str, typer.Option(help="Parameter to vary, such as belt_speed.")],
    low: Annotated[float, typer.Option("--from", help="Its range, in the units of files.")],
    high: Annotated[float, typer.Option("--to", help="The upper end.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="BRANCH.h5", help="To make.")],
    step: Annotated[float, typer.Option(min=1e-4, max=0.5, help="Length of a step.")] = 0.03,
    simulate: Annotated[
        int,
        typer.Option(min=2, metavar="N", help="Simulate up and down the range too, at N values."),
    ] = 0,
    force: Force = False,
) -> None:
    """Follow the limit cycle of a scene over a parameter, stable and unstable."""
    from wiperjax.spec import load_scene

    spec = load_scene(file)
    picture = output.with_suffix(".png")
    _check_output(output, MAP_SUFFIXES, force, file)
    _check_output(picture, PICTURE_SUFFIXES, force, file)

    _configure(1)
    from wiperjax.branch_run import run
    from wiperjax.plots import plot_file
    from wiperjax.storage import write_dataset

    branch = run(spec, over, low, high, step, simulate)
    write_dataset(branch, output, force)
    plot_file(output, picture, force=force)
    _print_special(branch)
    print(f"branch   {output}: {branch.sizes['point']} cycles")
    print(f"picture  {picture}")


@app.command(help=PLOT_HELP)
def plot(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE.h5",
            help="A map, a run, a branch, or MAP.h5.parts of an unfinished sweep.",
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE.png",
            help="Picture to make: .png, .pdf, .svg; .gif or .mp4 for an animation.",
        ),
    ],
    force: Force = False,
    picture: Annotated[
        str | None,
        typer.Option("-p", "--picture", metavar="NAME", help="Which one.", show_default="overview"),
    ] = None,
    every: Annotated[
        bool, typer.Option("--all", help="All that FILE allows, as FILE-NAME.png each.")
    ] = False,
    start: Annotated[
        float | None, typer.Option("--from", metavar="S", help="Run: begin here (s).")
    ] = None,
    stop: Annotated[
        float | None, typer.Option("--to", metavar="S", help="Run: end here (s).")
    ] = None,
    quantity: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Variable for history, spectrum, spectrogram, value."),
    ] = None,
    component: Annotated[
        int | None,
        typer.Option(min=0, help="Run: 0 along the glass, 1 normal to it.", show_default="0"),
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option(metavar="S", min=0.1, max=120, help="Animation: how long it plays (s)."),
    ] = None,
    x: Annotated[
        str | None, typer.Option("--x", metavar="AXIS", help="Map: the axis across.")
    ] = None,
    y: Annotated[str | None, typer.Option("--y", metavar="AXIS", help="Map: the axis up.")] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            metavar="AXIS=VALUE", help="Map: cut another axis here (degrees), not in the middle."
        ),
    ] = None,
    dpi: Annotated[int, typer.Option(min=20, max=1200, help="Dots per inch.")] = 150,
) -> None:
    _check_output(output, STILL_SUFFIXES if every else PICTURE_SUFFIXES, force or every, file)
    _check_input(file)
    if every and picture is not None:
        raise ValueError("--all draws every picture and --picture one: give one of them")
    options = {
        "start": start,
        "stop": stop,
        "quantity": quantity,
        "component": component,
        "seconds": seconds,
        "x": x,
        "y": y,
        "at": _cuts(at),
    }
    chosen = {name: value for name, value in options.items() if value is not None}
    from wiperjax.plots import plot_all, plot_file

    if every:
        for path in plot_all(file, output, force=force, dpi=dpi, **chosen):
            print(f"picture  {path}")
        return
    plot_file(file, output, picture=picture, force=force, dpi=dpi, **chosen)
    print(f"picture  {output}")


@app.command(help=LISTEN_HELP)
def listen(
    file: Annotated[Path, typer.Argument(metavar="RUN.h5", help="A run.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="RUN.wav", help="Sound to make.")
    ],
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
    start: Annotated[
        float | None, typer.Option("--from", metavar="S", help="Begin here (s).")
    ] = None,
    stop: Annotated[float | None, typer.Option("--to", metavar="S", help="End here (s).")] = None,
) -> None:
    _check_output(output, SOUND_SUFFIXES, force, file)
    _check_input(file)
    from wiperjax.runs import is_run
    from wiperjax.sound import sound
    from wiperjax.storage import StoreError, open_map

    with open_map(file) as dataset:
        if not is_run(dataset):
            what = "is a map" if "label" in dataset else "holds no trajectory"
            raise StoreError(f"{file}: {what}; only a run can be heard ('wiperjax simulate')")
        heard = sound(
            dataset.load(),
            quantity=quantity,
            reference=reference,
            start=start,
            stop=stop,
            seconds=seconds,
        )
    heard.write(output, force)
    print(f"sound    {output}: {heard.describe()}")
    print("note: motion of the lip, not sound pressure (no dB(A)): radiation is not modelled")
    if warning := heard.warning():
        print(f"note: {warning}", file=sys.stderr)


@app.command()
def info(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="A map, a run, a branch, or MAP.h5.parts of an unfinished sweep."
        ),
    ],
) -> None:
    """Show what a file holds, how it was made, and the classes of a map."""
    from wiperjax.labels import anatomy, class_table, unsettled
    from wiperjax.storage import open_map

    with open_map(file) as dataset:
        print(", ".join(f"{name} {count}" for name, count in dataset.sizes.items()))
        for name, value in dataset.attrs.items():
            if name in ("specification", "specification_canonical"):  # for machines
                continue
            lines = str(value).splitlines()
            if len(lines) > 1:
                print(f"{name}:", *(f"    {line}" for line in lines), sep="\n")
            else:
                print(f"{name}: {value}")
        if "label" in dataset:
            _print_classes(class_table(dataset))
            if lost := unsettled(dataset):
                print(f"not settled  {lost} cells: growing, dying or irregular (docs/classes.md)")
            if "mechanism" in dataset:
                for mechanism, band, count in anatomy(dataset):
                    print(f"other: {count} cells of {mechanism}, band {band}")
        elif "cells_done" in dataset.attrs:
            print("no cell is computed yet")
        elif "special_kind" in dataset:
            _print_special(dataset)
        elif "belt_kind" in dataset.attrs:
            from wiperjax.assess import assess, words

            found = assess(dataset)
            for name, word in words(found).items():
                print(f"{name:<12}{word}")
            print(f"{'frequency':<12}{float(found['dominant_frequency']):.1f} Hz")
        _print_events(dataset)


@app.command()
def ladder(
    files: Annotated[list[Path], typer.Argument(metavar="SCENE.toml...", help="Scenes.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="TABLE.md", help="Write it here.")
    ] = None,
    force: Force = False,
) -> None:
    """Compare the models of each scene: which is the poorest that tells the same, at what cost."""
    from wiperjax.spec import load_scene

    for file in files:
        load_scene(file)  # wrong ones are named before any work
    if output is not None:
        _check_output(output, (".md",), force, files[0])
    _configure(1)
    from wiperjax.compare import compare, preface, summary, table

    results = []
    for file in files:
        results.append(compare(file))
        print(table(results[-1:], head=len(results) == 1), end="", flush=True)
    if output is not None:
        text = preface() + summary(results) + "\n" + table(results)
        output.write_text(text, encoding="utf-8")
        print(f"table    {output}")


@app.command()
def verify(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A map.")],
    cells: Annotated[int, typer.Option(min=1, help="Cells to compute again.")] = 64,
    seed: Annotated[int, typer.Option(min=0, help="Which cells are drawn.")] = 0,
) -> None:
    """Compute a random sample of the cells of a map again and compare."""
    _check_input(file)
    _configure(None)
    from wiperjax.verification import verify as verify_map

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


# --- checks before any work -----------------------------------------------------------------------


def _check_input(path: Path) -> None:
    """Raises OSError or StoreError if `path` can be neither read nor is an unfinished sweep."""
    if path.is_dir():
        return
    if not path.exists():
        from wiperjax.storage import StoreError, parts_of

        if (parts := parts_of(path)).is_dir():
            raise StoreError(f"{path}: is not finished; name {parts} to look at what there is")
    with path.open("rb"):
        pass


def _cuts(texts: Sequence[str] | None) -> dict[str, float] | None:
    """`AXIS=VALUE` options as a mapping. Raises ValueError for any other form."""
    cuts = {}
    for text in texts or ():
        name, _, value = text.partition("=")
        try:
            cuts[name.strip()] = float(value)
        except ValueError:
            raise ValueError(
                f"--at must be AXIS=NUMBER, such as normal_load=15, was {text}"
            ) from None
    return cuts or None


def _check_output(path: Path, suffixes: Sequence[str], force: bool, source: Path) -> None:
    """Raises ValueError or StoreError if `path` is no place for a new file made from `source`."""
    if path.suffix not in suffixes:
        raise ValueError(f"{path}: must end in {' or '.join(suffixes)}")
    if path.exists() and source.exists() and path.samefile(source):
        raise ValueError(f"{path}: must be another file than the input")
    from wiperjax.storage import check_output

    check_output(path, force)


def _at_error(spec: Any, target: float, file: Path) -> Any:
    """Return the sweep with the settings that `accuracy.choose` picks; say which."""
    from wiperjax.accuracy import choose

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


def _configure(cores: int | None) -> None:
    """Settings of XLA, which must precede the first `import jax`."""
    from wiperjax.launch import configure

    configure(cores=cores)


# --- output ---------------------------------------------------------------------------------------


def _print_plan(spec: Any) -> None:
    """Axes with their units, so that a wrong unit is seen before hours are spent on it."""
    from wiperjax.parameters import PARAMETERS

    for name, values in spec.axes_values().items():
        unit = PARAMETERS[name].edge_unit
        print(f"{name:<17} {values[0]:g} ... {values[-1]:g} {unit} ({values.size} values)")
    for note in spec.notes():
        print(f"note: {note}", file=sys.stderr)


def _print_special(branch: Any) -> None:
    """Special points of a branch of cycles, and why it ends."""
    over = branch.attrs["over"]
    unit = branch[over].attrs["units"]
    for kind, value, detail in zip(
        *(branch[f"special_{key}"].values for key in ("kind", "parameter", "detail")), strict=True
    ):
        print(f"{over} {value:.6g} {unit}: {str(kind).replace('_', ' ')} ({detail})")
    stable = branch["stable"].values.astype(bool)
    print(f"cycles   {stable.sum()} stable, {(~stable).sum()} unstable")
    print(f"ends     {branch.attrs['ends']}")


def _print_sensitivities(dataset: Any) -> None:
    """Where derivatives hold, and how those that were checked agree with central differences."""
    if "sensitivity_code" not in dataset:
        return
    import numpy as np

    from wiperjax.dataset import flag_names

    codes = dataset["sensitivity_code"]
    for code, name in flag_names(codes).items():
        count = int((codes == code).sum())
        print(f"derivatives {name:<20}{count:>9}{count / codes.size:>9.1%}")
    found = dataset["sensitivity_agreement"].values
    found = found[np.isfinite(found)]
    if found.size:
        print(
            f"checked by differences: {found.size} cells; the worst derivative of each differs by "
            f"{np.median(found):.1e} (median), {found.max():.1e} (largest)"
        )


def _print_classes(table: Sequence[tuple[str, int, float]]) -> None:
    print(f"{'class':<12}{'cells':>9}{'share':>9}")
    for name, count, share in table:
        if name == "not_computed":  # of an unfinished sweep: has no share
            continue
        print(f"{name:<12}{count:>9}{share:>9.1%}")


def _cost(output: Path, begun: float) -> str:
    """What a file took: its size, the time since `begun`, and the most memory of this process."""
    unit = 1 if sys.platform == "darwin" else 1024  # of the system's own number
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
    elapsed = timedelta(seconds=round(time.monotonic() - begun))
    return f"{output.stat().st_size / 1e6:.3g} MB, {elapsed}, {memory / 1e9:.2f} GB of memory"


def _print_events(dataset: Any) -> None:
    """What the event log of a map holds and what it had no room for."""
    if "event_count" not in dataset:
        return
    count, room = dataset["event_count"].values, dataset.sizes["event"]
    count = count[count >= 0]  # cells that are computed
    if not count.size:
        return
    cut = int((dataset["event_overflow"].values == 1).sum())
    print(f"events: {count.sum(dtype=int)} in the settled windows, {count.max()} in the fullest;")
    print(f"    the log has room for {room} of a cell, {cut} of {count.size} cells had more")
