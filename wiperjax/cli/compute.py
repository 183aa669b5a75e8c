"""Commands that compute maps: a sweep, and a sample of its cells again."""

import contextlib
import importlib
import shlex
import sys
import threading
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from ..vocabulary.pictures import STILLS
from .options import (
    MAP_SUFFIXES,
    Force,
    SweptModel,
    check_source,
    check_target,
    configure,
    interrupted,
    told_of,
)
from .tables import cost, print_map, print_phases, print_plan
from .who import Processes, Scheduler, Workers, check_who

Derivatives = Annotated[
    bool,
    typer.Option(
        "--sensitivities",
        help="Store derivatives by parameters too; which ones: \\[sensitivities] in the file.",
    ),
]
Block = Annotated[
    int | None, typer.Option(min=1, help="Cells per block that is stored.", show_default="auto")
]
Target = Annotated[
    float | None,
    typer.Option(help="Pick solver, precision and rtol for this error (of the lip's length)."),
]
Finer = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        min=1,
        help="Locate borders after it: N halvings of the spacing.",
        show_default="[refine] of the file",
    ),
]


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
    workers: Workers = None,
    scheduler: Scheduler = None,
    local_cluster: Processes = None,
    sensitivities: Derivatives = False,
    block: Block = None,
    model: SweptModel = None,
    target_error: Target = None,
    refine: Finer = None,
) -> None:
    """Compute a map: classes of noise and statistics over the axes of a sweep file."""
    from ..specs.load import load_sweep

    begun = time.monotonic()
    if force and resume:
        raise ValueError("--force starts anew and --resume continues: give one of them")
    who = check_who(workers, scheduler, local_cluster)
    who.configure()  # before the file is read: a system of one's own may start jax's device
    spec = load_sweep(file, model)
    if sensitivities:
        with told_of(file):
            spec = spec.with_sensitivities()
    if target_error is not None:
        spec = at_error(spec, target_error, file)
    if resume:
        from ..maps.auto_model import as_chosen_for

        spec = as_chosen_for(output, spec)
    finer = refinement(spec, refine, file)
    drawing = output.with_suffix(".png") if picture and spec.size > 1 else None
    redraw = check_map_and_picture(output, drawing, spec, file, force, resume)
    print_plan(spec, who.cores, finer)

    from ..maps.driver import sweep as sweep_map
    from ..store.manifest import parts_of
    from ..vocabulary.kinds import STEADY_KINDS

    later = ["wiperjax.plots.files"] if drawing is not None else []
    load_beside(later + (["scipy.signal"] if spec.belt_kind not in STEADY_KINDS else []))
    words = typed(
        file, output, sensitivities, picture, workers=workers, scheduler=scheduler,
        local_cluster=local_cluster, model=model, target_error=target_error, refine=refine,
    )  # fmt: skip
    chosen: dict[str, Any] = {} if block is None else {"block": block}
    chosen |= {"resume": resume, "force": force, "command": shlex.join(words)}
    with who.connected() as others:
        try:
            spec = chosen_model(spec, others.get("workers"))
            dataset = sweep_map(spec, output, **others, **chosen)
        except KeyboardInterrupt as stopped:
            raise interrupted(stopped, parts_of(output), [*words, "--resume"]) from None
    with dataset:
        print_map(dataset)
    print(f"map      {output}: {cost(output, begun)}")
    print_phases(dataset)
    if drawing is not None:
        make_way(drawing, spec, redraw, file)
    if finer is not None:
        from .refine import run

        run(output, finer, who, words[1:])
    if drawing is not None:
        from ..plots import plot_file

        plot_file(output, drawing, force=redraw)
        print(f"picture  {drawing}")
    elif picture:
        print("picture  none: a map of one cell has no axis to draw it over")


def chosen_model(spec: Any, workers: Any) -> Any:
    """The sweep on the model that a probe chooses if it asks for one; says which, and what that
    took, which is in no phase of the map.
    """
    from ..maps.auto_model import CHOICE, on_chosen_model

    begun, chosen = time.monotonic(), on_chosen_model(spec, workers=workers)
    if chosen.choice:
        took = "" if chosen is spec else f"; took {time.monotonic() - begun:.1f} s"
        print(f"model    {chosen.choice[CHOICE]}{took}", flush=True)
    return chosen


def load_beside(modules: list[str]) -> None:
    """Imports modules in a thread, while others compile and compute: no part of a second then, for
    who needs them later."""

    def load() -> None:
        for module in modules:
            with contextlib.suppress(ImportError):  # who needs it says so
                importlib.import_module(module)

    threading.Thread(target=load, daemon=True).start()


def typed(file: Path, output: Path, sensitivities: bool, picture: bool, **stated: Any) -> list[str]:
    """Words of the command, for the file and for who goes on with it."""
    words = ["wiperjax", "sweep", str(file), "-o", str(output)]
    words += ["--sensitivities"] if sensitivities else []
    words += [] if picture else ["--no-picture"]
    for name, value in stated.items():
        words += [] if value is None else [f"--{name.replace('_', '-')}", str(value)]
    return words


def refinement(spec: Any, levels: int | None, file: Path) -> dict[str, Any] | None:
    """Settings of the refinement that follows a sweep, None if none does."""
    stated = {} if spec.refine is None else spec.refine.model_dump(exclude_unset=True)
    if levels is not None:
        stated = {k: v for k, v in stated.items() if k != "resolution"} | {"levels": levels}
    if not stated:
        return None
    from ..specs.refine import parse_refine

    parse_refine(stated, spec)  # before hours are spent
    return stated


def check_map_and_picture(
    output: Path, drawing: Path | None, spec: Any, file: Path, force: bool, resume: bool
) -> bool:
    """Whether a picture may be replaced: with --force, now or when the sweep was begun, and where
    it shows what this very sweep would draw.

    Raises: ValueError or StoreError if map or picture cannot be made where they are wanted.
    """
    from ..store.blocks import BlockStore

    redraw = force or (resume and BlockStore.may_replace(output))
    there = resume and output.is_file()  # the driver looks whether it is this map
    if not there:
        check_target(output, MAP_SUFFIXES, redraw, file)
    if drawing is None:
        return redraw
    if resume and not redraw and drawing.is_file():
        from ..plots.files import is_usual_of

        redraw = is_usual_of(spec, drawing)
    if not there:  # else the map's own look comes first, then `make_way`
        check_target(drawing, STILLS, redraw, file)
    return redraw


def make_way(drawing: Path, spec: Any, redraw: bool, file: Path) -> None:
    """Removes a picture that may be replaced, unless it shows this sweep: a finished map, which is
    all that who goes on with a stopped refinement has, does not say that it may. Raises StoreError
    if it may not, before hours are spent on a refinement.
    """
    check_target(drawing, STILLS, redraw, file)
    from ..plots.files import is_usual_of

    if drawing.is_file() and not is_usual_of(spec, drawing):
        drawing.unlink()


def at_error(spec: Any, target: float, file: Path) -> Any:
    """Return the sweep with the settings that `accuracy.choose` picks; say which."""
    from ..maps.accuracy import choose
    from ..specs.errors import SpecError
    from ..vocabulary.kinds import WIPER

    if spec.system != WIPER:
        why = f"system = {spec.system!r}: errors were measured on lips"
        raise ValueError(f"{file}: --target-error must be left out with {why}")
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
    spec = spec.model_copy(update={"run": run})
    if spec.sensitivities is None:
        if found.precision == "float32":
            what = "in float32 a few cells have other classes, where the lip is nearly flat"
            print(f"note: {what} (docs/limits.md)", file=sys.stderr)
        return spec
    try:
        return spec.with_sensitivities()  # which ask for more than a target error may
    except SpecError as error:
        must = f"--target-error {target:g} does not go with derivatives"
        raise ValueError(f"{file}: {must}: {error}") from None


def verify(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A map.")],
    cells: Annotated[int, typer.Option(min=1, help="Cells to compute again.")] = 64,
    seed: Annotated[int, typer.Option(min=0, help="Which cells are drawn.")] = 0,
) -> None:
    """Compute a random sample of the cells of a map again and compare."""
    check_source(file)
    configure(None)
    from ..maps.verify import verify as verify_map

    report = verify_map(file, cells, seed)
    if report.passed:
        how = "identical" if report.identical else f"equal within {report.tolerance:g}"
        finer = f" and {report.points} finer points" if report.points else ""
        print(
            f"{report.cells} cells{finer} computed again, {report.columns} columns compared: {how}"
        )
    else:
        count = report.cells + report.points
        print(f"{len(report.differing)} of {count} cells differ, the first: ", end="")
        print(*report.differing[:10], sep=", ")
    for name, difference in report.largest.items():
        print(f"  {name}: largest relative difference {difference:.3g}")
    if not report.same_versions:
        print("  the map was made with other versions of the libraries; see 'wiperjax info'")
    if not report.passed:
        raise typer.Exit(1)
