"""The command that writes a run for other programs."""

from pathlib import Path
from typing import Annotated

import typer

from .options import Force, check_input, check_output


def export(
    file: Annotated[Path, typer.Argument(metavar="RUN.h5", help="A run.")],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="FILE", help="To make: .csv, .mat, .uff or .unv."),
    ],
    force: Force = False,
) -> None:
    """Write a run for other programs: CSV, MATLAB, universal file format (dataset 58)."""
    from ..exports import FORMATS
    from ..exports import export as write

    check_output(output, tuple(FORMATS), force, file)
    check_input(file)
    from ..datasets.run_dataset import is_run
    from ..machine.files import StoreError
    from ..store.whole import open_map

    with open_map(file) as dataset:
        if not is_run(dataset):
            raise StoreError(f"{file}: holds no trajectory; only a run can be exported")
        run = dataset.load()
    write(run, output, force)
    print(f"export   {output}: {run.sizes['time']} samples")
