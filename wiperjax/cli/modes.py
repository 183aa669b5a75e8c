"""The command `modes`: complex eigenvalues of steady sliding."""

import math
import tomllib
from pathlib import Path
from typing import Annotated, Any

import typer

from ..vocabulary.pictures import STILLS
from .options import (
    MAP_SUFFIXES,
    Force,
    Model,
    check_target,
    configure,
    told_of,
)

VERDICT_WORDS = {
    "noisy": "unstable and noisy",
    "quiet": "stable and quiet",
    "over_predicted": "unstable yet quiet: the test over-predicts",
    "missed": "stable yet noisy: the test misses",
}


def modes(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Scene, sweep or finished map.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="MODES.h5",
            help="To make; of a sweep or a map with a picture.",
        ),
    ] = None,
    force: Force = False,
    model: Model = None,
) -> None:
    """Complex eigenvalues of steady sliding: of a scene, over a sweep, or beside a map."""
    if output is not None:
        check_target(output, MAP_SUFFIXES, force, file)
    configure(1)
    from ..datasets.kinds import kind_of

    found = _found(file, model)
    over = kind_of(found) == "modes_over"
    drawn = over and found["growth_rate"].size > 1
    picture = output.with_suffix(".png") if output is not None and drawn else None
    if picture is not None:
        check_target(picture, STILLS, force, file)
    (print_modes_over if over else print_modes)(found)
    if output is None:
        return
    from ..store.whole import write_dataset

    write_dataset(found, output, force)
    print(f"modes    {output}")
    if picture is not None:
        from ..plots import plot_file

        plot_file(output, picture, force=force)
        print(f"picture  {picture}")


def _found(file: Path, model: str | None) -> Any:
    """Modes of what a file is: a map, a sweep or a scene."""
    from ..modes.over import beside, modes_over
    from ..modes.table import modes as modes_at

    if file.suffix in MAP_SUFFIXES or file.is_dir():
        from ..store.swept import sweep_of
        from ..store.whole import open_finished, sound

        sound(file)
        with open_finished(file) as simulated:
            spec = sweep_of(simulated, file)  # names the file itself
            with told_of(file):
                return beside(modes_over(spec), simulated)
    from ..specs.load import load_scene, load_sweep

    if _is_sweep(file):
        spec = load_sweep(file, model)  # names the file itself
        with told_of(file):
            return modes_over(spec)
    from ..systems.build import build

    spec = load_scene(file, model)
    with told_of(file):
        return modes_at(build(spec, spec.parameters()).system)


def _is_sweep(file: Path) -> bool:
    """Whether a file has axes; what is no TOML at all is told as a scene."""
    try:
        return "axes" in tomllib.loads(file.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return False


def print_modes(found: Any) -> None:
    """The table of the modes of one system."""
    print(f"{'mode':<6}{'real part':>14}{'frequency':>14}{'damping':>11}  shape (amplitude, phase)")
    for k, number in enumerate(found["mode"].values):
        one = found.isel(mode=k)
        parts = (found["axis"].values, one["shape_amplitude"].values, one["shape_phase"].values)
        shape = ", ".join(
            f"{axis} {size:.3g} {round(math.degrees(phase)):+d} deg"
            for axis, size, phase in zip(*parts, strict=True)
        )
        real, tone, ratio = (float(one[n]) for n in ("real_part", "frequency", "damping_ratio"))
        print(f"{number:<6}{real:>10.5g} 1/s{tone:>11.5g} Hz{ratio:>11.4g}  {shape}")
    print(f"damping ratio {found.attrs['damping_convention']}")
    grows, stays = int((found["real_part"] > 0).sum()), int((found["real_part"] == 0).sum())
    if stays and not grows:
        verb = "mode neither grows nor decays" if stays == 1 else "modes neither grow nor decay"
        print(f"steady sliding is neutral: {stays} {verb}")
    else:
        verb = "mode grows" if grows == 1 else "modes grow"
        print(f"steady sliding is {'unstable' if grows else 'stable'}: {grows} {verb}")


def print_modes_over(found: Any) -> None:
    """What modes over a sweep come to, and beside its map where it is one."""
    from ..modes.over import shares

    exists = found["exists"] > 0
    count, grows = int(exists.sum()), int((found["growth_rate"] > 0).sum())
    print(f"steady sliding in {count} of {exists.size} cells, unstable in {grows}")
    flutter = int(((found["growth_rate"] > 0) & (found["frequency"].isel(mode=0) > 0)).sum())
    print(f"of these {flutter} oscillate, {grows - flutter} creep away")
    if "verdict" not in found:
        return
    part, untold = shares(found), int((found["verdict"] < 0).sum())
    for name, words in VERDICT_WORDS.items() if untold < exists.size else ():
        print(f"{words:<46}{part[name]:>8.1%}")
    if untold:
        print(f"not told: {untold} cells without steady sliding, or that failed or collapsed")
