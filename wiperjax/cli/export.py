"""The command that writes a run for other programs."""

from pathlib import Path
from typing import Annotated

import typer

from .options import Force, check_source, check_target
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
    from ..exports import FORMATS, is_modes
    from ..exports import export as write

    check_target(output, tuple(FORMATS), force, file)
    check_source(file)
    from ..datasets.run_dataset import is_run
    from ..machine.files import StoreError
    from ..store.whole import open_map, sound

    sound(file)
    with open_map(file) as dataset:
        if not (is_run(dataset) or is_modes(dataset)):
            only = "only a run, or modes of one scene, can be exported"
            raise StoreError(f"{file}: holds no trajectory; {only}")
        run = dataset.load()
    write(run, output, force)
    count = f"{run.sizes['time']} samples" if is_run(run) else f"{run.sizes['mode']} modes"
    print(f"export   {output}: {count}")
    if is_run(run):
        print_end(run)
