"""`wiperjax bench`: the measurements of `wiperjax_bench`, which nothing else here imports."""

import importlib.util
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(help="Measure speed and accuracy beside other methods (needs numba).")

Output = Annotated[
    Path, typer.Option("-o", "--output", metavar="FILE.h5", help="Dataset; text, pictures beside.")
]
Quick = Annotated[bool, typer.Option("--quick", help="A small form of it, under two minutes.")]


def _begin(output: Path, cores: int | None, suffixes=(".h5", ".nc")) -> None:
    """Check what can be checked before minutes are spent, and set XLA up."""
    if importlib.util.find_spec("numba") is None:
        raise ValueError("bench needs numba: pip install 'wiperjax[bench]'")
    if output.suffix not in suffixes:
        raise ValueError(f"{output}: must end in {' or '.join(suffixes)}")
    if not output.parent.is_dir():
        raise ValueError(f"{output.parent}: is not a directory")
    from wiperjax.launch import configure

    configure(cores=cores)


@app.command()
def chart(
    output: Output = Path("chart.h5"),
    quick: Quick = False,
    scene: Annotated[list[str] | None, typer.Option(help="Only this scene (repeatable).")] = None,
    method: Annotated[
        list[str] | None, typer.Option(help="Only methods with this in their name (repeatable).")
    ] = None,
    repeats: Annotated[int, typer.Option(min=1, help="Interleaved.")] = 3,
    clock: Annotated[str, typer.Option(help="Time that is drawn: wall or cpu.")] = "wall",
) -> None:
    """Error against cost of every method on every scene, on one core.

    Writes the dataset, its picture (.png, .svg) and the text under it (.md). A run that was stopped
    goes on where it was: give the same command again.
    """
    if clock not in ("wall", "cpu"):
        raise ValueError(f"clock must be wall or cpu, but was {clock!r}")
    _begin(output, 1)
    from wiperjax_bench import chart, pictures, report

    dataset = chart.run(output, quick=quick, only_scenes=scene, methods=method, repeats=repeats)
    png, svg = pictures.save(dataset, output.with_suffix(""), clock)
    text = output.with_suffix(".md")
    text.write_text(report.chart_text(dataset, png.name, clock))
    print(f"dataset  {output}\npicture  {png}, {svg}\ntext     {text}")


@app.command()
def failures(
    output: Output = Path("failures.h5"),
    quick: Quick = False,
    method: Annotated[
        list[str] | None, typer.Option(help="Only methods with this in their name (repeatable).")
    ] = None,
) -> None:
    """Where each method fails: all methods on hard scenes, at all their settings, on one core.

    Writes the dataset, its picture (.png, .svg) and the text under it (.md).
    """
    _begin(output, 1)
    from wiperjax_bench import failures, failures_plot, failures_report

    dataset = failures.run(quick, method, print)
    dataset.to_netcdf(output, engine="h5netcdf")
    pictures = _save(failures_plot.draw(dataset), output)
    text = output.with_suffix(".md")
    text.write_text(failures_report.failures_text(dataset, output.with_suffix(".png").name))
    print(f"dataset  {output}\npicture  {pictures}\ntext     {text}")


@app.command()
def limits(output: Output = Path("limits.h5"), quick: Quick = False) -> None:
    """Largest stable step of each method against stiffness, measured and in theory.

    Writes the dataset, its picture (.png, .svg) and the text under it (.md).
    """
    _begin(output, 1)
    from wiperjax_bench import failures_report, limits_plot, stability_limits

    dataset = stability_limits.measure(2 if quick else None, print)
    dataset.to_netcdf(output, engine="h5netcdf")
    pictures = _save(limits_plot.draw(dataset), output)
    text = output.with_suffix(".md")
    text.write_text(failures_report.limits_text(dataset, output.with_suffix(".png").name))
    print(f"dataset  {output}\npicture  {pictures}\ntext     {text}")


def _save(figure, output: Path) -> str:
    """Write a figure beside ``output`` as .png and .svg, and return their names."""
    files = [output.with_suffix(end) for end in (".png", ".svg")]
    for file in files:
        figure.savefig(file, dpi=150)
    return ", ".join(map(str, files))


@app.command()
def speed(
    output: Output = Path("speed.h5"),
    quick: Quick = False,
    trajectories: Annotated[int, typer.Option(min=64, help="Of the engine, at most.")] = 100_000,
    repeats: Annotated[int, typer.Option(min=1)] = 3,
    scaling: Annotated[
        bool, typer.Option("--scaling", help="Also batches of 1e4, 1e5 and 1e6 (long).")
    ] = False,
) -> None:
    """Trajectories per second of the engine and its peers, on one core and on all.

    Writes the dataset and its table (.md): errors, occupancy, start-up, memory.
    """
    _begin(output, None)
    from wiperjax_bench import speed

    sizes = (10_000, 100_000, 1_000_000) if scaling else ()
    dataset = speed.run(
        output, quick=quick, trajectories=trajectories, repeats=repeats, scaling=sizes
    )
    text = speed.text(dataset)
    output.with_suffix(".md").write_text(text)
    print(text)


@app.command()
def profile(
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE.md", help="Text to write.")
    ] = Path("profile.md"),
    precision: Annotated[str, typer.Option(help="float64 or float32.")] = "float64",
    quick: Quick = False,
) -> None:
    """Where a lane-turn goes, and a rough roofline: operations against the processor's peak."""
    if precision not in ("float64", "float32"):
        raise ValueError(f"precision must be float64 or float32, but was {precision!r}")
    _begin(output, 1, (".md", ".txt"))
    from wiperjax_bench import profile

    text = profile.run(precision, quick)
    output.write_text(text)
    print(text)


@app.command()
def rule(
    file: Annotated[Path, typer.Argument(metavar="CHART.h5", help="A full chart.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Table.", show_default="the package's own")
    ] = None,
    clock: Annotated[str, typer.Option(help="wall or cpu.")] = "wall",
) -> None:
    """Make the table behind `sweep --target-error` from a chart."""
    import xarray as xr

    import wiperjax
    from wiperjax_bench import rule

    target = output or Path(wiperjax.__file__).with_name("accuracy_table.json")
    with xr.open_dataset(file, engine="h5netcdf") as dataset:
        rows = rule.write(dataset, target, clock)
    print(f"{'solver':<8}{'precision':<10}{'rtol':>8}{'error':>10}{'cost':>8}")
    for r in rows:
        print(
            f"{r['solver']:<8}{r['precision']:<10}{r['rtol']:>8.0e}{r['error']:>10.1e}{r['cost']:>8.3g}"
        )
    print(f"table    {target}")


@app.command()
def maps(
    output: Output = Path("maps.h5"),
    quick: Quick = False,
    cells: Annotated[int, typer.Option(min=16, help="Random cells of the reference sweep.")] = 512,
) -> None:
    """Share of cells whose class differs, and errors of map variables, by setting."""
    _begin(output, None)
    from wiperjax_bench import maps

    text = maps.text(maps.run(output, quick=quick, count=cells))
    output.with_suffix(".md").write_text(text)
    print(text)


@app.command(name="all")
def everything(
    folder: Annotated[Path, typer.Argument(help="Where the files go.")] = Path("docs/bench"),
    quick: Quick = False,
    again: Annotated[bool, typer.Option("--again", help="Also what is there already.")] = False,
) -> None:
    """Everything, one part after the other, each in a process of its own.

    A part whose dataset is there is kept: a run that was stopped goes on where it was.
    """
    import subprocess
    import sys

    folder.mkdir(parents=True, exist_ok=True)
    for name in ("chart", "failures", "limits", "maps", "speed", "profile"):
        output = folder / (f"{name}.md" if name == "profile" else f"{name}.h5")
        if output.exists() and not again:
            print(f"{name}: kept {output}")
            continue
        command = [sys.executable, "-m", "wiperjax", "bench", name, "-o", str(output)]
        status = subprocess.run([*command, *(["--quick"] if quick else [])], check=False).returncode
        if status:
            raise typer.Exit(status)
