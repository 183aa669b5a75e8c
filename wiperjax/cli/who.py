"""Who computes cells: options of the commands that do, and the workers that they name."""

import contextlib
import os
from typing import Annotated

import typer

Workers = Annotated[int | None, typer.Option(min=1, help="Cores to use.", show_default="all")]
Scheduler = Annotated[
    str | None, typer.Option(metavar="tcp://HOST:PORT", help="Compute on this dask cluster.")
]
Processes = Annotated[
    int | None, typer.Option(min=1, help="Compute on a dask cluster of N processes here.")
]


def check_who(workers: int | None, scheduler: str | None, processes: int | None) -> None:
    """Raises ValueError if more than one says who computes."""
    if sum(choice is not None for choice in (workers, scheduler, processes)) > 1:
        raise ValueError("--workers, --scheduler and --local-cluster exclude each other")


def cores(workers: int | None, scheduler: str | None, processes: int | None) -> int:
    """On how many cores cells will be computed; 1 where a cluster alone knows."""
    return 1 if scheduler else processes or workers or len(os.sched_getaffinity(0))


@contextlib.contextmanager
def who_computes(embedded: bool, scheduler: str | None, processes: int | None):
    """The `workers` of `driver.sweep` while they are connected; none where it computes itself."""
    if embedded:
        yield {}
        return
    from ..maps.cluster import connect

    with connect(scheduler, processes) as workers:
        yield {"workers": workers}
