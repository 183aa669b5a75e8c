"""Solver, precision and tolerance for an error that is asked for: enough, and no more.

The rule: of the settings in the stored table, the one of least cost whose measured error is at most
the target. The table (`accuracy_table.json`) is made by `wiperjax bench rule` from a chart. Its
error is the largest, over the chart's scenes, of the position error that 90 % of the blades stay
below, as a fraction of the lip's length, up to the time at which a change of 1e-10 in the start has
grown to 1e-6 (beyond it no tolerance helps).
"""

import json
from pathlib import Path
from typing import NamedTuple


class Choice(NamedTuple):
    """A row of the table."""

    solver: str  # name in sweep files
    precision: str
    rtol: float
    error: float  # measured, of the lip's length
    cost: float  # measured, relative to the cheapest row


def table() -> list[Choice]:
    """Return all measured settings, cheapest first."""
    text = Path(__file__).with_name("accuracy_table.json").read_text(encoding="utf-8")
    rows = [Choice(**row) for row in json.loads(text)["rows"]]
    return sorted(rows, key=lambda row: row.cost)


def choose(target_error: float) -> Choice:
    """Return the cheapest setting whose measured error is at most ``target_error``.

    ``target_error``: position error over the lip's length that 90 % of the blades stay below.

    Raises ValueError for a number that is not between the table's best error and 1.
    """
    rows = table()
    best = min(row.error for row in rows)
    if not best <= target_error < 1:
        raise ValueError(
            f"target_error must be at least {best:.1e} (the best that was measured) and below 1, "
            f"but was {target_error:g}"
        )
    return next(row for row in rows if row.error <= target_error)
