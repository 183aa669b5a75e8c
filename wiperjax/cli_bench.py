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
