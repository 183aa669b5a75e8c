"""The command that writes a run for other programs."""

from pathlib import Path
from typing import Annotated

import typer

from .options import Force, check_source, check_target, read
from .tables import print_end


def export(
    file: Annotated[Path, typer.Argument(metavar="RUN.h5", help="A run, or modes.")],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="FILE", help="To make: .csv, .mat, .uff or .unv."),
    ],
    force: Force = False,
) -> None:
    """Write a run for other programs: CSV, MATLAB, universal file (58; modes as 55)."""
    from ..exports import FORMATS
    from ..exports import export as write

    check_target(output, tuple(FORMATS["run"]), force, file)  # modes have none of their own
    check_source(file)
    found, kind = read(file, FORMATS, "exported (a map as a table: docs/maps.md)")
    write(found, output, force)
    along, words = {"run": ("time", "samples"), "modes": ("mode", "modes")}[kind]
    print(f"export   {output}: {found.sizes[along]} {words}")
    print_end(found)
