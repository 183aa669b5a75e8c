"""Command line: files in, files and short tables out; no physics.

What can be wrong with paths and files is checked before anything is computed. Heavy modules (jax,
xarray, matplotlib) are imported inside the commands, after `launch.configure`, for two reasons:
`--help` stays fast, and the settings of XLA have to precede `import jax`.
"""

import contextlib
import importlib.metadata
import os
import shlex
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

MAP_SUFFIXES = (".h5", ".hdf5", ".nc")
PICTURE_SUFFIXES = (".png", ".pdf", ".svg")
INTERRUPTED = 130  # what a shell reports for a command ended by Ctrl-C

app = typer.Typer(
    name="wiperjax",
    help="Noise maps of windscreen wipers: stick, slip and flight of a blade lip.",
    add_completion=False,
    pretty_exceptions_enable=False,
)

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
) -> None:
    """Compute a map: classes of noise and statistics over the axes of a sweep file."""
    from wiperjax.spec import load_sweep

    if force and resume:
        raise ValueError("--force starts anew and --resume continues: give one of them")
    if sum(choice is not None for choice in (workers, scheduler, local_cluster)) > 1:
        raise ValueError("--workers, --scheduler and --local-cluster exclude each other")
    spec = load_sweep(file)
    if sensitivities:
        spec = spec.with_sensitivities()
    _check_output(output, MAP_SUFFIXES, force or resume, file)
    drawing = output.with_suffix(".png") if picture else None
    if drawing is not None:
        _check_output(drawing, PICTURE_SUFFIXES, force or resume, file)
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
    print(f"map      {output}")
    if drawing is not None:
        from wiperjax.plots import plot_file

        plot_file(output, drawing, force=force or resume)
        print(f"picture  {drawing}")


@app.command()
def simulate(
    file: Annotated[Path, typer.Argument(metavar="SCENE.toml", help="What to simulate.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="RUN.h5", help="Run to make.")],
    force: Force = False,
) -> None:
    """Compute one trajectory: samples over time and every event."""
    from wiperjax.spec import load_scene

    spec = load_scene(file)
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
def plot(
    file: Annotated[Path, typer.Argument(metavar="FILE.h5", help="A map or a run.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE.png", help="Picture to make.")
    ],
    force: Force = False,
) -> None:
    """Draw a map or a run."""
    _check_output(output, PICTURE_SUFFIXES, force, file)
    _check_input(file)
    from wiperjax.plots import plot_file

    plot_file(file, output, force=force)
    print(f"picture  {output}")


@app.command()
def info(file: Annotated[Path, typer.Argument(metavar="FILE", help="A map or a run.")]) -> None:
    """Show what a file holds, how it was made, and the classes of a map."""
    from wiperjax.labels import class_table
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


@app.command()
def verify(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A map.")],
    cells: Annotated[int, typer.Option(min=1, help="Cells to compute again.")] = 64,
    seed: Annotated[int, typer.Option(min=0, help="Which cells are drawn.")] = 0,
) -> None:
    """Compute a random sample of the cells of a map again and compare."""
    _check_input(file)
    _configure(None)
    from wiperjax.driver import verify as verify_map

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
    """Raises OSError if `path` cannot be opened for reading."""
    with path.open("rb"):
        pass


def _check_output(path: Path, suffixes: Sequence[str], force: bool, source: Path) -> None:
    """Raises ValueError or StoreError if `path` is no place for a new file made from `source`."""
    if path.suffix not in suffixes:
        raise ValueError(f"{path}: must end in {' or '.join(suffixes)}")
    if path.exists() and source.exists() and path.samefile(source):
        raise ValueError(f"{path}: must be another file than the input")
    from wiperjax.storage import check_output

    check_output(path, force)


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
        print(f"{name:<12}{count:>9}{share:>9.1%}")
