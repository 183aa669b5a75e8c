"""`wiperjax bench`: files out and short tables; what is measured stands in `measurements`.

`wiperjax` finds ``app`` by an entry point. What is heavy is imported inside the commands, after
`configure`, as in `wiperjax.cli`: `--help` stays fast, and the settings of XLA precede jax.
"""

import importlib.util
from pathlib import Path
from typing import Annotated

import typer

from wiperjax.cli.options import configure

app = typer.Typer(help="Measure speed and accuracy beside other methods (needs numba).")

Output = Annotated[
    Path, typer.Option("-o", "--output", metavar="FILE.h5", help="Dataset; text, pictures beside.")
]
Quick = Annotated[bool, typer.Option("--quick", help="A small form of it, under two minutes.")]


def _begin(output: Path, cores: int | None, suffixes=(".h5", ".nc")) -> None:
    """Check what can be checked before minutes are spent, and set XLA up."""
    if importlib.util.find_spec("numba") is None:
        raise ValueError("bench needs numba: pip install numba")
    if output.suffix not in suffixes:
        raise ValueError(f"{output}: must end in {' or '.join(suffixes)}")
    if not output.parent.is_dir():
        raise ValueError(f"{output.parent}: is not a directory")
    configure(cores, keep=False)  # compilations are measured


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
    from .measurements import chart
    from .reports import chart_plot, chart_text

    dataset = chart.run(output, quick=quick, only_scenes=scene, methods=method, repeats=repeats)
    files = chart_plot.save(dataset, output.with_suffix(""), clock)
    text = output.with_suffix(".md")
    text.write_text(chart_text.chart_text(dataset, files[0].name, clock, files[2].name))
    print(f"dataset  {output}\npicture  {', '.join(map(str, files))}\ntext     {text}")


@app.command()
def borders(
    output: Output = Path("borders.h5"),
    quick: Quick = False,
    points: Annotated[int, typer.Option(min=16, help="Random, each simulated.")] = 2000,
) -> None:
    """How well borders are known for so many simulations: refined map, octree, full grid.

    Writes the dataset, its picture (.png, .svg) and the text under it (.md). Maps are kept in
    OUTPUT.maps, so that a run that was stopped goes on where it was.
    """
    _begin(output, None)
    from .measurements import borders
    from .reports import borders_page
    from .reports.words import save

    dataset = borders.run(output, quick=quick, count=points)
    pictures = save(borders_page.draw(dataset), output)
    text = output.with_suffix(".md")
    text.write_text(borders_page.text(dataset, output.with_suffix(".png").name))
    print(f"dataset  {output}\npicture  {', '.join(map(str, pictures))}\ntext     {text}")


@app.command()
def failures(
    output: Output = Path("failures.h5"),
    quick: Quick = False,
    method: Annotated[
        list[str] | None, typer.Option(help="Only methods with this in their name (repeatable).")
    ] = None,
) -> None:
    """Where each method fails: all methods on hard scenes, at all their settings, on one core.

    Writes the dataset, its picture (.png, .svg; a narrow one beside) and the text under it (.md).
    A run that was stopped goes on where it was.
    """
    _begin(output, 1)
    from .harness.keep import Parts
    from .measurements import failures
    from .reports import failures_plot, failures_text
    from .reports.words import save

    parts = Parts(output, {"quick": quick})
    dataset = failures.run(quick, method, print, parts)
    dataset.to_netcdf(output, engine="h5netcdf")
    parts.clear()
    pictures = save(failures_plot.draw(dataset), output)
    pictures += save(failures_plot.short(dataset), output.with_stem(output.stem + "_short"))
    text = output.with_suffix(".md")
    text.write_text(failures_text.failures_text(dataset, output.with_suffix(".png").name))
    print(f"dataset  {output}\npicture  {', '.join(map(str, pictures))}\ntext     {text}")


@app.command()
def limits(output: Output = Path("limits.h5"), quick: Quick = False) -> None:
    """Largest stable step of each method against stiffness, measured and in theory.

    Writes the dataset, its picture (.png, .svg; a narrow one beside) and the text under it (.md).
    A run that was stopped goes on where it was.
    """
    _begin(output, 1)
    from .measurements import stability_limits
    from .reports import limits_plot, limits_text
    from .reports.words import save

    only = ("Tsit5", "Moreau-Jean") if quick else ("",)
    dataset = stability_limits.measure(1 if quick else None, print, only)
    dataset.to_netcdf(output, engine="h5netcdf")
    pictures = save(limits_plot.draw(dataset), output)
    text = output.with_suffix(".md")
    text.write_text(limits_text.limits_text(dataset, output.with_suffix(".png").name))
    print(f"dataset  {output}\npicture  {', '.join(map(str, pictures))}\ntext     {text}")


@app.command()
def smoothing(output: Output = Path("smoothing.h5"), quick: Quick = False) -> None:
    """Error and cost of smoothed friction and contact over a grid of widths and stiffnesses.

    Writes the dataset, its picture (.png, .svg) and the text under it (.md).
    """
    _begin(output, 1)
    from .measurements import smoothing
    from .reports import smoothing_page
    from .reports.words import save

    dataset = smoothing.run(output, quick=quick)
    pictures = save(smoothing_page.draw(dataset), output)
    text = output.with_suffix(".md")
    text.write_text(smoothing_page.text(dataset, output.with_suffix(".png").name))
    print(f"dataset  {output}\npicture  {', '.join(map(str, pictures))}\ntext     {text}")


@app.command()
def speed(
    output: Output = Path("speed.h5"),
    quick: Quick = False,
    trajectories: Annotated[int, typer.Option(min=64, help="Of the engine.")] = 50_000,
    repeats: Annotated[int, typer.Option(min=1, help="Interleaved.")] = 3,
) -> None:
    """Trajectories per second of the engine and its peers, on one core and on all.

    Writes the dataset and its text (.md): what was asked and what was measured, errors, occupancy,
    cost over the size of the batch, start-up, memory; and, where chart.h5 and maps.h5 lie beside,
    the precision of every variant. A run that was stopped goes on where it was.
    """
    _begin(output, None)
    from .measurements import speed
    from .reports import speed_text

    dataset = speed.run(output, quick=quick, trajectories=trajectories, repeats=repeats)
    text = speed_text.text(dataset, output.parent)
    output.with_suffix(".md").write_text(text)
    print(text)


@app.command()
def profile(
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE.md", help="Text to write.")
    ] = Path("profile.md"),
    precision: Annotated[
        list[str] | None, typer.Option(help="float64 or float32 (repeatable; default: both).")
    ] = None,
    quick: Quick = False,
) -> None:
    """Where a lane-turn goes, and a roofline: operations and bytes against measured limits."""
    wanted = precision or (["float64"] if quick else ["float64", "float32"])
    for name in wanted:
        if name not in ("float64", "float32"):
            raise ValueError(f"precision must be float64 or float32, but was {name!r}")
    _begin(output, 1, (".md", ".txt"))
    from .measurements import profile
    from .reports import profile_text

    text = "\n".join(profile_text.text(profile.run(name, quick)) for name in wanted)
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

    from .reports import rule

    target = output or rule.OWN_TABLE
    if not file.is_file():
        raise ValueError(f"{file}: does not exist (`wiperjax bench chart` makes it)")
    with xr.open_dataset(file, engine="h5netcdf") as dataset:
        if output is None:
            rule.check(dataset)
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
    cells: Annotated[int, typer.Option(min=16, help="Random cells of the reference sweep.")] = 2048,
) -> None:
    """Share of cells whose class differs, and errors of map variables, by setting.

    Writes the dataset and its text (.md). A run that was stopped goes on where it was.
    """
    _begin(output, None)
    from .measurements import maps
    from .reports import maps_text

    text = maps_text.text(maps.run(output, quick=quick, count=cells))
    output.with_suffix(".md").write_text(text)
    print(text)


@app.command(name="all")
def everything(
    folder: Annotated[Path, typer.Argument(help="Where the files go.")] = Path("docs/bench"),
    quick: Quick = False,
    again: Annotated[bool, typer.Option("--again", help="Also what is there already.")] = False,
) -> None:
    """Everything, one part after the other, each in a process of its own.

    A part whose text is there is kept: a run that was stopped goes on where it was.
    """
    import os
    import resource
    import subprocess
    import sys
    import tempfile
    import time

    folder.mkdir(parents=True, exist_ok=True)
    begun = time.perf_counter()
    environment = os.environ | {"PYTHONUNBUFFERED": "1"}
    # compilations are measured, and none may come from a cache; only the quick run saves its time
    environment.pop("JAX_COMPILATION_CACHE_DIR", None)
    cache = tempfile.TemporaryDirectory()
    if quick:
        environment["JAX_COMPILATION_CACHE_DIR"] = cache.name
    for name in ("chart", "failures", "limits", "smoothing", "maps", "speed", "profile"):
        text = folder / f"{name}.md"
        if text.exists() and not again:
            print(f"{name}: kept {text}", flush=True)
            continue
        output = text if name == "profile" else text.with_suffix(".h5")
        command = [sys.executable, "-m", "wiperjax", "bench", name, "-o", str(output)]
        command += ["--quick"] if quick else []
        started, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        print(f"--- {name}", flush=True)
        status = subprocess.run(command, check=False, env=environment).returncode
        if status:
            raise typer.Exit(status)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
        print(
            f"--- {name}: {time.perf_counter() - started:.0f} s, {spent:.0f} s of processor time",
            flush=True,
        )
    cache.cleanup()
    print(f"everything in {folder}: {(time.perf_counter() - begun) / 60:.1f} minutes")
    print(f"next: wiperjax bench rule {folder / 'chart.h5'}")
