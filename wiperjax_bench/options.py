"""Options that several commands of `wiperjax bench` have."""

from pathlib import Path
from typing import Annotated

import typer

Output = Annotated[
    Path, typer.Option("-o", "--output", metavar="FILE.h5", help="Dataset; text, pictures beside.")
]
Quick = Annotated[bool, typer.Option("--quick", help="A small form of it, under two minutes.")]
Isa = Annotated[
    str | None,
    typer.Option(help="avx2 or sse4_2: compiled as for machines without wider vectors (x86)."),
]
