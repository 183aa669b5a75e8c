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


def _begin(output: Path, cores: int | None) -> None:
    """Check what can be checked before minutes are spent, and set XLA up."""
    if importlib.util.find_spec("numba") is None:
        raise ValueError("bench needs numba: pip install 'wiperjax[bench]'")
    if output.suffix not in (".h5", ".nc"):
        raise ValueError(f"{output}: must end in .h5 or .nc")
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
    repeats: Annotated[int | None, typer.Option(min=1, show_default="7, quick 3")] = None,
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
