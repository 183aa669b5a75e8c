"""What a person sees while a sweep runs: cells done, cells per second, time left, counts by class
and by result.

Written to standard error, and only if that is a terminal. The rate is measured over this run alone,
without the cells of an earlier one; it leaves out the first block, whose time is mostly
compilation, as soon as there is a second.
"""

import time
from collections import Counter
from datetime import timedelta
from typing import Any

import numpy as np
from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from ..vocabulary import schema


class Report:
    """Live display of a sweep; use it in a `with` statement and call `update` after each block."""

    def __init__(
        self,
        cells: int,
        title: str = "",
        console: Console | None = None,
        show: bool = True,
    ):
        self.cells = cells
        self.done = 0
        self.title = title
        self.classes: Counter[str] = Counter()
        self.results: Counter[str] = Counter()
        self.occupancy: float | None = None
        self._console = console or Console(stderr=True)
        self._show = show and self._console.is_terminal
        self._start = time.monotonic()
        self._marks: list[tuple[float, int]] = []
        self._live = Live(
            console=self._console, get_renderable=self._draw, refresh_per_second=4
        )  # draws at once

    def __enter__(self) -> "Report":
        if self._show:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._show:
            self._live.stop()

    def update(
        self, columns: dict[str, np.ndarray], cells: int, occupancy: float | None = None
    ) -> None:
        """Counts a finished block of `cells` cells."""
        self.done += cells
        self.occupancy = occupancy
        self._marks.append((time.monotonic(), cells))
        self.count(columns)

    def count(self, columns: dict[str, np.ndarray]) -> None:
        """Counts classes and results of cells that were finished before."""
        for counter, name in ((self.classes, "label"), (self.results, "result")):
            if name in columns:
                meaning = {code: text for text, code in (schema.SCHEMA[name].flags or {}).items()}
                codes, counts = np.unique(columns[name], return_counts=True)
                counter.update(
                    {
                        meaning.get(int(c), f"code {c}"): int(n)
                        for c, n in zip(codes, counts, strict=True)
                    }
                )

    def rate(self) -> float | None:
        """Cells per second of this run, None before the first block."""
        if not self._marks:
            return None
        since, counted = (
            (self._start, self._marks)
            if len(self._marks) == 1
            else (self._marks[0][0], self._marks[1:])
        )
        return sum(cells for _, cells in counted) / max(counted[-1][0] - since, 1e-9)

    def _draw(self) -> Any:
        rate = self.rate()
        pieces = [f"{self.done:,} of {self.cells:,} cells"]
        if rate:
            waited = time.monotonic() - self._marks[-1][0]
            left = max(0.0, (self.cells - self.done) / rate - waited)
            pieces += [f"{rate:,.0f} cells/s", f"{timedelta(seconds=round(left))} left"]
        else:
            pieces.append(
                f"first block, {timedelta(seconds=round(time.monotonic() - self._start))} so far"
            )
        if self.occupancy is not None:
            pieces.append(f"occupancy {self.occupancy:.0%}")
        head = Table.grid(padding=(0, 1))
        bar = ProgressBar(total=max(1, self.cells), completed=self.done, width=32)
        head.add_row(Text(self.title[:40], style="bold"), bar, ", ".join(pieces))
        counters = {"class": self.classes, "result": self.results}
        lines = [
            Text(f"  {name}: {_listed(counter)}") for name, counter in counters.items() if counter
        ]
        return Group(head, *lines)


def _listed(counter: Counter[str]) -> str:
    return ", ".join(f"{name} {count:,}" for name, count in counter.most_common())
