"""An axis of a sweep."""

from typing import Annotated, Literal

import numpy as np
from pydantic import (
    Field,
    model_validator,
)

from ..vocabulary.ranges import MOST_VALUES
from ..vocabulary.wording import digits
from .errors import AXIS_FORMS, Fault, show
from .tables import Table


class Axis(Table):
    """Values of one parameter (edge units): evenly or geometrically spaced, or listed.

    Attributes:
        start: the first value.
        stop: the last one.
        num: how many.
        spacing: of the values between.
        listed: the values themselves, increasing or decreasing.
    """

    start: float | None = None
    stop: float | None = None
    num: int | None = None
    spacing: Literal["linear", "geometric"] = "linear"
    listed: Annotated[list[float] | None, Field(alias="values")] = None

    @model_validator(mode="after")
    def _is_complete_and_monotonic(self) -> "Axis":
        if self.listed is None:
            self._check_range()
        elif self.model_fields_set != {"listed"}:
            raise Fault("", f"must be {AXIS_FORMS}, not a mixture of both")
        elif not 1 <= len(self.listed) <= MOST_VALUES:
            count = len(self.listed) or "none"
            raise Fault("", f"must have at least one value and at most {MOST_VALUES}, had {count}")
        steps = np.diff(self.values())
        if not (np.all(steps > 0) or np.all(steps < 0)):
            were = show(self.listed) if self.listed is not None else "too close to tell apart"
            raise Fault("", f"values must increase or decrease, were {were}")
        return self

    def _check_range(self) -> None:
        start, stop, num = self.start, self.stop, self.num
        missing = [key for key in ("start", "stop", "num") if getattr(self, key) is None]
        if start is None or stop is None or num is None:
            raise Fault("", f"must be {AXIS_FORMS}, but {' and '.join(missing)} is missing")
        were = f"start = {digits(start)}, stop = {digits(stop)}"
        if (num == 1) != (start == stop):
            must = "start and stop must be equal if num = 1 and differ otherwise"
            raise Fault("", f"{must}, were {were}, num = {num}")
        if self.spacing == "geometric" and min(start, stop) <= 0 <= max(start, stop):
            raise Fault("", f"a geometric axis must not reach or cross zero, was {were}")

    @property
    def count(self) -> int:
        """Number of values."""
        return len(self.listed) if self.listed is not None else self.num or 0

    def steps(self) -> np.ndarray:
        """Length of each step from value to value over the mean one, (count - 1,), in the scale of
        the axis: the logarithm of a geometric one. All 1 unless values are listed unevenly.
        """
        if self.listed is None:
            return np.ones(self.count - 1)
        steps = np.abs(np.diff(self.values()))
        even = np.isclose(steps, steps.mean(), rtol=1e-9, atol=0)  # but for rounding
        return np.where(even, 1.0, steps / steps.mean())

    def values(self) -> np.ndarray:
        """All values (count,), float64, both ends exact."""
        if self.listed is not None:
            return np.asarray(self.listed, dtype=np.float64)
        assert self.start is not None and self.stop is not None and self.num is not None
        space = np.geomspace if self.spacing == "geometric" else np.linspace
        return space(self.start, self.stop, self.num, dtype=np.float64)
