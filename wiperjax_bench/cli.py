"""`wiperjax bench`: files out and short tables; what is measured stands in `measurements`.

`wiperjax` finds ``app`` by an entry point. What is heavy is imported inside the commands, after
`begin`, as in `wiperjax.cli`: `--help` stays fast, and the settings of XLA precede jax.
"""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from .everything import everything
from .files import begin, finish, say
from .options import Isa, Output, Quick

app = typer.Typer(help="Measure speed and accuracy beside other methods (needs numba).")


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
    isa: Isa = None,
) -> None:
    """Error against cost of every method on every scene, on one core.

    Writes the dataset, its picture (.png, .svg) and the text under it (.md). A run that was stopped
    goes on where it was: give the same command again.
    """
    if clock not in ("wall", "cpu"):
        raise ValueError(f"clock must be wall or cpu, but was {clock!r}")
    begin(output, 1, isa=isa)
    from .measurements import chart
    from .reports import chart_plot, chart_text

    dataset = chart.run(output, quick=quick, only_scenes=scene, methods=method, repeats=repeats)
    files = chart_plot.save(dataset, output.with_suffix(""), clock)
    text = output.with_suffix(".md")
    words = chart_text.chart_text(dataset, files[0].name, clock, files[2].name)
    text.write_text(words, encoding="utf-8")
    print(f"dataset  {output}\npicture  {', '.join(map(str, files))}\ntext     {text}")


@app.command()
def borders(
    output: Output = Path("borders.h5"),
    quick: Quick = False,
    points: Annotated[int, typer.Option(min=16, help="Random, each simulated.")] = 2000,
) -> None:
    """How well borders are known for so many simulations: refined map, octree, full grid.

    Writes dataset, picture (.png, .svg) and text (.md). Its maps stay in OUTPUT.maps, for a run
    that was stopped.
    """
    begin(output, None)
    from .measurements import borders
    from .reports import borders_page

    dataset = borders.run(output, quick=quick, count=points)
    finish(output, dataset, borders_page.draw, borders_page.text)


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
    begin(output, 1)
    from .harness.keep import Parts
    from .measurements import failures
    from .reports import failures_plot, failures_text
    from .reports.words import save

    parts = Parts(output, {"quick": quick})
    dataset = failures.run(quick, method, print, parts)
    dataset.to_netcdf(output, engine="h5netcdf")
    parts.clear()
    short = save(failures_plot.short(dataset), output.with_stem(output.stem + "_short"))
    finish(output, dataset, failures_plot.draw, failures_text.failures_text, short)


@app.command()
def limits(output: Output = Path("limits.h5"), quick: Quick = False) -> None:
    """Largest stable step of each method against stiffness, measured and in theory.

    Writes the dataset, its picture (.png, .svg) and the text under it (.md). Of a run that was
    stopped nothing is kept.
    """
    begin(output, 1)
    from .measurements import stability_limits
    from .reports import limits_plot, limits_text

    only = ("Tsit5", "Moreau-Jean") if quick else ("",)
    dataset = stability_limits.measure(1 if quick else None, print, only)
    dataset.to_netcdf(output, engine="h5netcdf")
    finish(output, dataset, limits_plot.draw, limits_text.limits_text)


@app.command()
def smoothing(output: Output = Path("smoothing.h5"), quick: Quick = False) -> None:
    """Error and cost of smoothed friction and contact over a grid of widths and stiffnesses.

    Writes the dataset, its picture (.png, .svg) and the text under it (.md).
    """
    begin(output, 1)
    from .measurements import smoothing
    from .reports import smoothing_page

    dataset = smoothing.run(output, quick=quick)
    finish(output, dataset, smoothing_page.draw, smoothing_page.text)


@app.command()
def speed(
    output: Output = Path("speed.h5"),
    quick: Quick = False,
    trajectories: Annotated[int, typer.Option(min=64, help="Of the engine.")] = 50_000,
    repeats: Annotated[int, typer.Option(min=1, help="Interleaved.")] = 3,
    device: Annotated[
        str | None, typer.Option(help="gpu or cpu: the engine alone, on one of these.")
    ] = None,
    isa: Isa = None,
) -> None:
    """Trajectories per second of the engine and its peers, on one core and on all.

    Writes the dataset and its text (.md): what was asked and what was measured, errors, occupancy,
    cost over the size of the batch, start-up, memory; and, where chart.h5 and maps.h5 lie beside,
    the precision of every variant. A run that was stopped goes on where it was.
    """
    begin(output, None if device is None else 1, isa=isa)
    if device is not None:
        from .measurements import device as one
        from .reports import device_text

        rates = one.run(output, device, quick=quick, repeats=repeats)
        return say(output.with_suffix(".md"), device_text.text(rates))
    from .measurements import speed
    from .reports import speed_text

    dataset = speed.run(output, quick=quick, trajectories=trajectories, repeats=repeats)
    say(output.with_suffix(".md"), speed_text.text(dataset, output.parent))


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
    begin(output, 1, (".md", ".txt"))
    from .measurements import profile
    from .reports import profile_text

    text = "\n".join(profile_text.text(profile.run(name, quick)) for name in wanted)
    say(output, text)


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
        numbers = f"{r['rtol']:>8.0e}{r['error']:>10.1e}{r['cost']:>8.3g}"
        print(f"{r['solver']:<8}{r['precision']:<10}{numbers}")
    print(f"table    {target}")


@app.command()
def maps(
    output: Output = Path("maps.h5"),
    quick: Quick = False,
    cells: Annotated[int, typer.Option(min=16, help="Random cells of the reference sweep.")] = 2048,
) -> None:
    """Share of cells whose class differs, errors of map variables, and their cost, by setting.

    Writes the dataset, its picture and text; where borders.h5 lies beside, the picture has what a
    plane's classes cost by full grid and refined. A run that was stopped goes on where it was.
    """
    begin(output, None)
    from .measurements import maps
    from .reports import maps_plot, maps_text

    dataset = maps.run(output, quick=quick, count=cells)
    draw = partial(maps_plot.draw, beside=output.with_name("borders.h5"))
    finish(output, dataset, draw, maps_text.text)


@app.command()
def sweep(
    output: Output = Path("sweep.h5"),
    quick: Quick = False,
    cells: Annotated[
        list[int] | None,
        typer.Option(help="Of the sweep: 1000, 10000, 100000 or 1000000 (repeatable; all)."),
    ] = None,
    repeats: Annotated[int, typer.Option(min=1, help="Interleaved.")] = 3,
) -> None:
    """What a sweep costs from the command line, beside the bare engine and the scalar loop.

    Writes the dataset and its text (.md). A run that was stopped goes on where it was.
    """
    for size in cells or ():
        if size not in (1000, 10_000, 100_000, 1_000_000):
            raise ValueError(f"cells must be 1000, 10000, 100000 or 1000000, but was {size}")
    begin(output, None)
    from .measurements import sweep
    from .reports import sweep_text

    sizes = tuple(cells or ((1000, 10_000) if quick else sweep.GRIDS))
    found = sweep.run(output, sizes=sizes, repeats=1 if quick else repeats)
    say(output.with_suffix(".md"), sweep_text.text(found))


@app.command()
def random(
    output: Output = Path("random.h5"),
    quick: Quick = False,
    count: Annotated[int, typer.Option(min=1, help="Blades; rounded up to chunks.")] = 100_000,
    every: Annotated[int, typer.Option(min=1, help="One in so many is judged.")] = 50,
    reference: Annotated[
        Path | None, typer.Option(help="Folder of the tests' reference: tests/helpers/reference.")
    ] = None,
) -> None:
    """What becomes of blades drawn wide at default settings, 20 ms each; are their events right?

    Writes the dataset and its text (.md). What is done stays in OUTPUT.parts: a run that was
    stopped goes on, and so does one that is given a larger --count.
    """
    begin(output, 1)
    from .measurements import random_blades
    from .reports import random_text

    sizes = (1, 400) if quick else (count, every)
    dataset = random_blades.run(output, *sizes, reference)
    say(output.with_suffix(".md"), random_text.text(dataset))


app.command(name="all")(everything)
