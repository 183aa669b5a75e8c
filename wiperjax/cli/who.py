"""Who computes cells: options of the commands that do, and the workers that they name."""

import contextlib
from typing import Annotated, NamedTuple

import typer

from ..machine.cores import available
from .options import configure

Workers = Annotated[int | None, typer.Option(min=1, help="Cores to use.", show_default="all")]
Scheduler = Annotated[
    str | None, typer.Option(metavar="tcp://HOST:PORT", help="Compute on this dask cluster.")
]
Processes = Annotated[
    int | None, typer.Option(min=1, help="Compute on a dask cluster of N processes here.")
]


class Who(NamedTuple):
    """What `check_who` made of the three options, of which one at most is given."""

    workers: int | None
    scheduler: str | None
    processes: int | None

    @property
    def cores(self) -> int:
        """On how many cores cells will be computed; 1 where a cluster alone knows."""
        if self.scheduler:
            return 1
        return self.processes or self.workers or available()

    @property
    def embedded(self) -> bool:
        """Whether this process computes itself."""
        return self.scheduler is None and self.processes is None

    def configure(self) -> None:
        """Settings of this process, if it computes; before the first `import jax`."""
        if self.embedded:
            configure(self.workers)

    @contextlib.contextmanager
    def connected(self):
        """The `workers` of `driver.sweep` while they are connected; none where it computes
        itself.
        """
        if self.embedded:
            yield {}
            return
        from ..maps.cluster import connect

        with connect(self.scheduler, self.processes) as workers:
            yield {"workers": workers}


def check_who(workers: int | None, scheduler: str | None, processes: int | None) -> Who:
    """Who computes. Raises ValueError if more than one option says so."""
    who = Who(workers, scheduler, processes)
    if sum(choice is not None for choice in who) > 1:
        raise ValueError("--workers, --scheduler and --local-cluster exclude each other")
    return who
