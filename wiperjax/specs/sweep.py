"""The specification of a sweep."""

import hashlib
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import BaseModel, PrivateAttr, model_validator

from ..vocabulary.kinds import WIPER
from ..vocabulary.ranges import MOST_CELLS
from ..vocabulary.wording import digits
from .axis import Axis
from .errors import Fault, as_error, unknown
from .laws import law_notes
from .refine import BESIDE_AXES, Refine, check
from .sensitivities import (
    SLOPE_RTOL,
    SLOPE_SOLVER,
    Sensitivities,
    by_its_axes,
    check_sensitivities,
)
from .starts import Starts, check_starts, swept_last
from .system import System
from .tables import Classes, SweepRun, SweptModel
from .windows import check_strokes, flip_notes, settled_notes

FORMAT = 2
"""Version of the meaning of a specification; part of its digest."""


MOST_BYTES = 4 * 10**6  # of a sweep or scene file: an axis of a hundred thousand listed values


RTOL = 1e-6
"""Tolerance of the integrator unless the file has one, or asks for derivatives."""

SOLVER = {"float64": "dopri8", "float32": "tsit5"}
"""Runge-Kutta method unless the file has one, by the precision of the state.

The method of order 8 is cheaper and more accurate (docs/maps.md). In single precision rounding
takes what it gains, and more: four times the steps at 1e-5 (docs/bench/speed.md)."""

SAMPLES_A_PERIOD = 5
"""Samples of a period of the highest squeal, unless the file says how many there are."""


FEWEST_SAMPLES, MOST_UNASKED = 64, 2**16


class SweepSpec(System):
    """A sweep: the axes of a map, what is held fixed, how cells are run and how they are named.

    Cells are numbered in C order of the axes, in the order in which the file lists them: the last
    axis varies fastest (`[starts] along` is made the last). Made by `load_sweep` or `parse_sweep`.
    """

    model: SweptModel = "lip"
    axes: dict[str, Axis]
    run: SweepRun
    classes: Classes = Classes()
    sensitivities: Sensitivities | None = None
    starts: Starts | None = None
    refine: Refine | None = None

    _choice: dict[str, Any] = PrivateAttr(default_factory=dict)

    @property
    def choice(self) -> Mapping[str, Any]:
        """Attributes that say why this model was chosen; none where a person named it."""
        return self._choice

    def on(self, model: str, choice: Mapping[str, Any] | None = None) -> "SweepSpec":
        """The same sweep on another rung, and the `choice` of it.

        Raises: SpecError, one line, where that model cannot stand for its blades.
        """
        spec = self.model_copy(update={"model": model})
        spec._choice = dict(choice or {})
        with as_error():
            spec._check_system(spec.axes)
        return spec

    @model_validator(mode="before")
    @classmethod
    def _depends_on_other_tables(cls, data: Any) -> Any:
        """Axes in the order of `[starts]`; derivatives of another system, by its axes."""
        if not isinstance(data, Mapping):
            return data
        if "starts" in data:
            data = {**data, "axes": swept_last(data.get("axes"), data["starts"])}
        return by_its_axes(data)

    def with_sensitivities(self) -> "SweepSpec":
        """The same sweep with derivatives; as the file asks for them, else the default ones (of
        another system than the wiper, by its axes).

        Raises: SpecError, one line, where they cannot be had.
        """
        own: dict[str, Any] = {} if self.system == WIPER else {"parameters": list(self.axes)}
        asked = self.sensitivities or Sensitivities(**own)
        spec = self.model_copy(update={"sensitivities": asked})
        with as_error():
            check_sensitivities(spec, asked)
        return spec

    @model_validator(mode="after")
    def _is_consistent(self) -> "SweepSpec":
        if not self.axes:
            raise Fault("axes", "must name at least one blade or belt parameter, was empty")
        sweepable = self.family.sweepable(self)
        for name in self.axes:
            if name not in sweepable:
                problem = unknown(name, list(sweepable), elsewhere=self.family.elsewhere)
                raise Fault(f"axes.{name}", problem)
        if self.size > MOST_CELLS:
            raise Fault("axes", f"must make at most {MOST_CELLS} cells, made {digits(self.size)}")
        for name, axis in self.axes.items():
            if problem := sweepable[name].problem(axis.values()):
                raise Fault(f"axes.{name}", problem)
        if (instants := self.run.raster) is not None and instants > self.samples:
            must = f"must be at most the number of samples ({self.samples})"
            raise Fault("run.raster", f"{must}, was {instants}")
        self._check_system(self.axes)
        self._check_strokes()
        if self.sensitivities is not None:
            check_sensitivities(self, self.sensitivities)
        if self.starts is not None:
            check_starts(self)
        if self.refine is not None:
            self._check_refine(self.refine)
        return self

    def _check_refine(self, refine: Refine) -> None:
        try:
            check(refine, self)
        except Fault as fault:
            raise fault.under("refine") from None

    def _check_strokes(self) -> None:
        """Raises Fault as `check_strokes`."""
        if "belt_frequency" not in self.parameter_names:
            return
        axis, window = self.axes.get("belt_frequency"), self.classes.reversal_window
        check_strokes(window, axis.values().max() if axis else self.fixed()["belt_frequency"])

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values along each axis."""
        return tuple(axis.count for axis in self.axes.values())

    @property
    def size(self) -> int:
        """Number of cells."""
        return math.prod(self.shape)

    @property
    def motion(self) -> float:
        """Motion of all cells [s], each from one start."""
        return self.size * (self.run.transient + self.run.window)

    @property
    def rtol(self) -> float:
        """Tolerance of the integrator: that of the file, or what the map is for asks."""
        if self.run.rtol is not None:
            return self.run.rtol
        return RTOL if self.sensitivities is None else SLOPE_RTOL

    @property
    def settings(self) -> SweepRun:
        """The table `run` as it is computed: with a tolerance, a solver and a number of samples."""
        usual = SOLVER[self.run.precision] if self.sensitivities is None else SLOPE_SOLVER
        solver = self.run.solver or usual
        found = {"rtol": self.rtol, "solver": solver, "samples": self.samples}
        return self.run.model_copy(update=found)

    @property
    def samples(self) -> int:
        """Samples of the settled window: those of the file, or `SAMPLES_A_PERIOD` of the highest
        squeal, rounded up to a whole number of `FEWEST_SAMPLES`.
        """
        if self.run.samples is not None:
            return self.run.samples
        needed = SAMPLES_A_PERIOD * self.classes.squeal_band[1] * self.run.window
        return min(max(1, math.ceil(needed / FEWEST_SAMPLES)) * FEWEST_SAMPLES, MOST_UNASKED)

    def axes_values(self) -> dict[str, np.ndarray]:
        """Coordinates of the map: axis -> values (count,) in edge units (angles in degrees)."""
        return {name: axis.values() for name, axis in self.axes.items()}

    def fixed(self) -> dict[str, float]:
        """Every parameter that is not an axis, in SI units and radians."""
        return self._fixed_si(self.axes)

    def cells(self, flat_index: np.ndarray) -> dict[str, Any]:
        """All parameters of some cells, in SI units and radians.

        Arguments:
            flat_index: numbers of the cells, any shape, each in [0, size).

        Returns: name -> float for a fixed parameter, for an axis a float64 array shaped as
            `flat_index`; names and order as `parameter_names`.

        Raises: IndexError for a number outside the map.
        """
        flat_index = np.asarray(flat_index)
        if flat_index.size and not 0 <= flat_index.min() <= flat_index.max() < self.size:
            raise IndexError(f"cell numbers must lie in [0, {self.size})")
        along = np.unravel_index(flat_index, self.shape)
        known: dict[str, Any] = self.fixed()
        table = self.parameter_table
        for (name, axis), index in zip(self.axes.items(), along, strict=True):
            known[name] = np.asarray(table[name].to_si(axis.values()))[index]
        return {name: known[name] for name in table}

    def notes(self) -> list[str]:
        """Lines on what is allowed but rarely meant, for a person to see."""
        lines = []
        for name, axis in self.axes.items():
            if name in BESIDE_AXES:
                what = "is called as a variable of borders or levels: the map cannot be refined"
                lines.append(f"axes.{name} {what}")
            reach = np.abs(axis.values()).max()
            if self.parameter_table[name].unit == "rad" and 0 < reach <= math.pi / 2:
                lines.append(f"axes.{name} reaches {reach:g} degrees only; it is not in radians")
        known = {name: np.atleast_1d(value) for name, value in self.fixed().items()}
        table = self.parameter_table
        known |= {name: table[name].to_si(axis.values()) for name, axis in self.axes.items()}
        window, around = self.run.window, self.classes.reversal_window
        lines += settled_notes(self.run.transient, window, "run.window", self.classes, known)
        if "belt_frequency" in known and (interval := window / self.samples) > around:
            what = f"classes.reversal_window is {around:g} s, less than a sample ({interval:.3g} s)"
            lines.append(f"{what}: a cell with no sample so soon after a turn is called failed")
        lines += [*self.classes.notes(), *law_notes(self.family.law(self), known)]
        return lines + flip_notes(self.belt_kind, known, around)

    def canonical(self) -> str:
        """JSON of everything that determines the numbers of the map, and of nothing else.

        The same for files that differ in title, comments, order of keys (but not of axes), or in
        spelling out a default.
        """
        meaning = {
            "format": FORMAT,
            "axes": [[name, values.tolist()] for name, values in self.axes_values().items()],
            "fixed": self.fixed(),
            "belt": self.belt_kind,
            **self.family.meaning(self),
            "start": self.start.model_dump(mode="json"),
            "run": self.settings.model_dump(mode="json"),
            "classes": self.classes.model_dump(mode="json", exclude=_unless_given(self.classes)),
        }
        for name in ("sensitivities", "starts"):
            if (table := getattr(self, name)) is not None:
                meaning[name] = table.model_dump(mode="json", exclude=_unless_given(table))
        return json.dumps(meaning, sort_keys=True, separators=(",", ":"), allow_nan=False)

    def digest(self) -> str:
        """SHA-256 of `canonical()`, 64 hexadecimal digits."""
        return hashlib.sha256(self.canonical().encode()).hexdigest()


def _unless_given(table: BaseModel) -> set[str]:
    """Keys of a table that count only where they are given: most files have no use for them."""
    seldom = {"quiet_velocity", "position", "velocity"}
    return {key for key in seldom if getattr(table, key, None) is None}
