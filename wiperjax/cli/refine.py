"""The command that locates the borders of a map, and what is said of them."""

import shlex
import sys
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from .options import check_once, check_source, interrupted
from .tables import cost
from .who import Processes, Scheduler, Who, Workers, check_who

WIDEST = "widest_bracket_share_"
STATED = "as --resolution needs, or [refine] of the map's file says"
Levels = Annotated[
    int | None,
    typer.Option(min=1, help="How often the spacing of the map is halved.", show_default=STATED),
]


def refine(
    file: Annotated[Path, typer.Argument(metavar="MAP.h5", help="A finished map.")],
    levels: Levels = None,
    resolution: Annotated[
        float | None,
        typer.Option(
            metavar="SHARE",
            help="Bracket of border points, as a share of each axis (geometric: of its logarithm).",
            show_default="a step of the finest level",
        ),
    ] = None,
    on: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="label, mechanism, band, or NAME=NUMBER for a threshold.",
            show_default="label",
        ),
    ] = None,
    box: Annotated[
        list[str] | None,
        typer.Option(metavar="AXIS=LOW:HIGH", help="Only there (degrees); one for each axis."),
    ] = None,
    max_cells: Annotated[
        int | None, typer.Option(min=1, help="End after so many simulations.", show_default="1e6")
    ] = None,
    probes: Annotated[
        int | None, typer.Option(min=0, help="Random points that check it.", show_default="500")
    ] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    local_cluster: Processes = None,
) -> None:
    """Locate the borders between the classes of a map, and store them in it.

    One that was stopped goes on where it was: give the same command again.
    """
    check_source(file)
    given: dict[str, Any] = {
        "levels": levels, "resolution": resolution, "on": on, "box": boxes(box),
        "max_cells": max_cells, "probes": probes,
    }  # fmt: skip
    settings = {name: value for name, value in given.items() if value is not None}
    if levels is None and resolution is None:
        settings = _stated(file, settings)
    run(file, settings, check_who(workers, scheduler, local_cluster), sys.argv[1:])


def run(file: Path, settings: dict[str, Any], who: Who, words: list[str]) -> None:
    """Refines a map and says what was found; `words` of the command, for the file."""
    begun = time.monotonic()
    who.configure()
    from ..maps.refine.driver import refine as refine_map

    command = shlex.join(["wiperjax", *words])
    with who.connected() as others:
        try:
            found = refine_map(file, command=command, **others, **settings)
        except KeyboardInterrupt:  # the search knows the folder, not the words
            again = ["wiperjax", *words, *(["--resume"] if words[0] == "sweep" else [])]
            raise interrupted(KeyboardInterrupt(), Path(f"{file}.refine"), again) from None
    print_borders(found)
    print(f"borders  {file}: {cost(file, begun)}")


def _stated(file: Path, settings: dict[str, Any]) -> dict[str, Any]:
    """Settings that do not say how fine, with what the sweep file of the map says in [refine].

    Raises: StoreError for what is no finished map, SpecError for settings that cannot be meant,
        ValueError if that file does not say how fine.
    """
    from ..specs.refine import parse_refine
    from ..store.swept import sweep_of
    from ..store.whole import open_finished

    with open_finished(file) as ds:
        spec = sweep_of(ds, file)
    if spec.refine is None:
        parse_refine({"levels": 1, **settings}, spec)
        raise ValueError("--levels or --resolution must say how fine; the map's file does not")
    return spec.refine.model_dump(exclude_unset=True) | settings


def boxes(texts: list[str] | None) -> dict[str, tuple[float, float]] | None:
    """`AXIS=LOW:HIGH` options as a mapping. Raises ValueError for any other form, and for an axis
    that is named twice.
    """
    found: dict[str, tuple[float, float]] = {}
    for text in texts or ():
        name, _, ends = (part.strip() for part in text.partition("="))
        low, _, high = ends.partition(":")
        check_once("--box", name, found)
        try:
            found[name] = (float(low), float(high))
        except ValueError:
            raise ValueError(
                f"--box must be AXIS=LOW:HIGH, such as attack_angle=-5:5, was {text}"
            ) from None
    return found or None


def print_borders(borders: Any) -> None:
    """What a refinement found, what it took, and how far it can be believed."""
    from ..maps.refine.judge import REASONS
    from ..vocabulary.codes import CROSSINGS

    said = borders.attrs
    counts = [f"{said[f'{kind}_points']} {kind}" for kind in CROSSINGS if said[f"{kind}_points"]]
    print(
        f"borders of {said['on']}: {borders.sizes['border']} points ({', '.join(counts) or 'none'})"
    )
    print(f"bracket, as a share of the axis: {_shares(borders, 'bracket_share_')}")
    if said.get("wide_cubes"):
        reasons = [f"{said[f'wide_cubes_{why}']} {words}" for why, words in REASONS.items()
                   if said[f"wide_cubes_{why}"]]  # fmt: skip
        print(
            f"    in {said['wide_cubes']} of {said['cubes']} cubes "
            f"({said['wide_cubes_volume_share']:.2%} of the volume) the bracket is the cube: "
            f"{', '.join(reasons)}"
        )
        if said["wide_points"]:
            widest = _shares(borders, WIDEST)
            print(f"    {said['wide_points']} points have such a cube, at most {widest}")
    if "linear_points" in said:
        print(f"{said['linear_points']} points of steady slip, no simulation")
    else:
        every, full = said["simulations"] + said["map_cells"], said["full_grid_cells"]
        print(
            f"{said['simulations']} simulations beside {said['map_cells']} of the map, for a grid "
            f"of {full:.4g}: 1/{full / every:.3g}"
        )
    for name, what in (("probe", "cubes without a border"), ("border_probe", "cubes with one")):
        count, wrong = said.get(f"{name}s", 0), said.get(f"{name}s_wrong", 0)
        if count:
            bound = said[f"{name}s_wrong_share_at_most"]
            print(
                f"probes in {what}: {wrong} of {count} unlike what was expected "
                f"(at most {bound:.2%}, 95 % sure)"
            )
    if count := said.get("sure_probes", 0):
        wrong, bound = said["sure_probes_wrong"], said["sure_probes_wrong_share_at_most"]
        print(f"    {wrong} of the {count} beyond the bracket (at most {bound:.2%}, 95 % sure)")
    if said["budget_spent"]:
        print("note: the budget ended it (--max-cells); unresolved points have wider brackets")
    if said["irregular_points"]:
        print("note: at irregular points the answer changes to and fro; nothing there is a border")
    if said["unsettled_points"]:
        print(f"note: {said['unsettled_points']} points are not settled in the longest window")


def _shares(borders: Any, prefix: str) -> str:
    """Shares of the axes."""
    found = []
    for name, share in borders.attrs.items():
        if name.startswith(prefix):
            axis = name.removeprefix(prefix)
            geometric = borders[axis].attrs.get("spacing") == "geometric"
            found.append(f"{axis} 1/{1 / share:.0f}" + (" of its logarithm" if geometric else ""))
    return ", ".join(found)
