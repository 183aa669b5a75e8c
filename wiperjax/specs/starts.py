"""The table `[starts]` of a sweep file: each cell run from several starts."""

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from ..vocabulary.kinds import AUTO, STARTS, WAYS, WIPER
from ..vocabulary.ranges import MOST_CELLS
from .errors import Fault, show, unknown
from .tables import Pair, Table

MOST_NUMBERS = 2**16  # of a cell, in one variable
_WHOLE = 1e-6  # of a period, by which a number of them may miss a whole one
_BOX = ("x", "y", "vx", "vy")
_STATE = ("position", "velocity")


class Starts(Table):
    """Several starts for each cell: named ones, or random ones from a box.

    Attributes:
        names: some of `at_rest` (phi = alpha, touching), `steady_slip` (where there is none: at
            rest), `up` and `down` (where the motion of the neighbouring cell ended, when the axis
            `along` is swept up or down; the first cell, and one after a cell that failed or
            collapsed, begins at rest).
        along: the axis that is swept; left out: the last. It is made the last one of the map.
        kick: how far the tip is moved along the glass from steady slip and from where its neighbour
            ended, as a fraction of L: an unstable equilibrium is left by that; of another system,
            how far its first coordinate is (the other way where that leads into what it touches, or
            a stop).
        random: number of random starts, the same for every cell, in place of names.
        seed: of the random starts.
        x: box of the random starts, from and to: place along the glass [m],
        y: height above it [m],
        vx: velocity of the tip along the glass [m/s],
        vy: and normal to it [m/s].
        position: of another system than the wiper, in place of these: [from, to] of each coordinate
        velocity: and of each rate; left out: at rest.
    """

    names: Annotated[list[str], Field(min_length=1)] | None = None
    along: str | None = None
    kick: float = 1e-4
    random: int | None = None
    seed: int = 0
    x: Pair | None = None
    y: Pair = (0.0, 0.0)
    vx: Pair = (0.0, 0.0)
    vy: Pair = (0.0, 0.0)
    position: list[Pair] | None = None
    velocity: list[Pair] | None = None

    @property
    def count(self) -> int:
        """Number of starts of a cell."""
        return self.random if self.random is not None else len(self.names or ())

    @property
    def ways(self) -> tuple[str, ...]:
        """Those of `WAYS` that are asked for."""
        return tuple(name for name in self.names or () if name in WAYS)

    def draws(self) -> dict[str, np.ndarray]:
        """The random starts, empty if there are none: of the wiper x, y [m], vx, vy [m/s],
        (count,) each; of another system position and velocity, (count, coordinates) each.
        """
        if self.random is None:
            return {}
        low, high = self.box().T
        shares = np.random.default_rng(self.seed).random((self.count, len(low)))
        drawn = low + (high - low) * shares
        if self.position is None:
            return dict(zip(_BOX, drawn.T, strict=True))
        return dict(zip(_STATE, np.split(drawn, 2, axis=1), strict=True))

    def box(self) -> np.ndarray:
        """Ends (n, 2) of what random starts are drawn from: each place, then each velocity."""
        if self.position is None:
            return np.array([getattr(self, key) or (0.0, 0.0) for key in _BOX])
        rest = [(0.0, 0.0)] * len(self.position)
        return np.array([*self.position, *(self.velocity or rest)])


def swept_last(axes: Any, starts: Any) -> Any:
    """The axes of a file, not checked yet, with the one that `starts` is to sweep as the last."""
    along = starts.get("along") if isinstance(starts, Mapping) else None
    if not isinstance(axes, Mapping) or not isinstance(along, str) or along not in axes:
        return axes
    return {name: axis for name, axis in axes.items() if name != along} | {along: axes[along]}


def check_starts(spec: Any) -> None:
    """Raises Fault for starts that cannot be had in a sweep."""
    starts: Starts = spec.starts
    if spec.model == AUTO:  # a probe of single cells does not tell what motions there are
        raise Fault("model", "must be a model by name with [starts], was 'auto'")
    for table in ("start", "sensitivities"):
        if table in spec.model_fields_set and getattr(spec, table) is not None:
            raise Fault(table, "must be left out with [starts]")
    if (starts.names is None) == (starts.random is None):
        had = "none" if starts.names is None else "both"
        raise Fault("starts", f"must have one of names and random, had {had}")
    boxes = (*_BOX, *_STATE)
    for key in ("along", "kick") if starts.random is not None else ("seed", *boxes):
        if key in starts.model_fields_set:
            other = "names" if key in ("along", "kick") else "random"
            raise Fault(f"starts.{key}", f"must be left out without starts.{other}")
    _check_names(spec, starts)
    if starts.random is not None:
        _check_box(spec, starts) if spec.system == WIPER else _check_state(spec, starts)
        if not np.ptp(starts.box(), axis=1).any():
            must = "must have a [from, to] with from < to to be drawn from"
            raise Fault("starts.random", f"{must}; all {starts.count} starts would be the same")
    each = max(spec.run.raster or 0, spec.run.event_log or 0)
    if each * starts.count > MOST_NUMBERS:
        must = f"times the number of starts ({starts.count}) must be at most {MOST_NUMBERS}"
        raise Fault("run.raster" if each == spec.run.raster else "run.event_log", must)
    if spec.size * starts.count > MOST_CELLS:
        must = f"must make at most {MOST_CELLS} runs, made {spec.size * starts.count}"
        raise Fault("starts", must)


def _check_names(spec: Any, starts: Starts) -> None:
    names = starts.names or []
    for name in names:
        if name not in STARTS:
            raise Fault("starts.names", f"{show(name)}: {unknown(name, list(STARTS))}")
    if "steady_slip" in names and spec.belt_kind != "steady":
        must = f"must not have 'steady_slip' with belt.kind = {spec.belt_kind!r}"
        raise Fault("starts.names", must)
    if "steady_slip" in names and spec.system != WIPER:
        must = f"must not have 'steady_slip' with system = {spec.system!r}"
        raise Fault("starts.names", must)
    if len(set(names)) < len(names):
        raise Fault("starts.names", "must not name a start twice")
    if not starts.ways:
        if starts.along is not None:
            raise Fault("starts.along", "must be left out without the start 'up' or 'down'")
        return
    if starts.along is not None and starts.along not in spec.axes:
        raise Fault("starts.along", f"must be one of the axes, was {show(starts.along)}")
    swept, axis = list(spec.axes.items())[-1]
    if axis.count < 2:
        raise Fault("starts.along", f"must have two values or more, {swept} has one")
    if swept == "belt_phase":
        raise Fault("starts.along", "must not be belt_phase: the belt goes on where it was")
    if "belt_frequency" in spec.parameter_names:
        _check_phase(spec)


def _check_phase(spec: Any) -> None:
    """Raises Fault unless every cell ends with its belt where the next one begins."""
    frequency = spec.axes.get("belt_frequency")
    known = frequency.values() if frequency else [spec.fixed()["belt_frequency"]]
    time = spec.run.transient + spec.run.window
    periods = time * np.asarray(known)
    wrong = np.abs(periods - np.round(periods)) > _WHOLE
    if wrong.any() or (np.round(periods) < 1).any():
        first = periods[wrong][0] if wrong.any() else periods.min()
        must = "must make whole periods of the belt with run.window, for the start 'up' or 'down'"
        raise Fault("run.transient", f"{must}, made {first:g}")


def _check_state(spec: Any, starts: Starts) -> None:
    """Raises Fault for a box of another system that is none, or not one of its coordinates."""
    names = spec.family.coordinates
    for key in _BOX:
        if key in starts.model_fields_set:
            raise Fault(f"starts.{key}", f"must be left out with system = {spec.system!r}")
    if starts.position is None:
        must = f"is missing; random starts are drawn from [from, to] of each of {', '.join(names)}"
        raise Fault("starts.position", must)
    for key in _STATE:
        box = getattr(starts, key)
        if box is not None and len(box) != len(names):
            must = f"must be a list of {len(names)} pairs ({', '.join(names)}), had {len(box)}"
            raise Fault(f"starts.{key}", must)
        for low, high in box or ():
            if low > high:
                must = f"must have pairs [from, to] with from <= to, had [{low:g}, {high:g}]"
                raise Fault(f"starts.{key}", must)


def _check_box(spec: Any, starts: Starts) -> None:
    for key in _STATE:
        if key in starts.model_fields_set:
            raise Fault(f"starts.{key}", "must be left out of a wiper, which has x, y, vx and vy")
    if starts.x is None:
        raise Fault("starts.x", "is missing; random starts are drawn from [from, to] in m")
    for key in _BOX:
        low, high = getattr(starts, key)
        if low > high:
            raise Fault(f"starts.{key}", f"must be [from, to] with from <= to, was [{low}, {high}]")
    if starts.y[0] < 0:
        raise Fault("starts.y", f"must not be negative (the glass is y = 0), was {starts.y[0]:g}")
    length = spec.axes.get("lip_length")
    reach = length.values().min() if length else spec.fixed()["lip_length"]
    if (far := max(map(abs, starts.x))) >= reach:
        raise Fault("starts.x", f"must be shorter than the lip ({reach:g} m), was {far:g}")
    for key in ("y", "vy"):
        if spec.model != "lip" and getattr(starts, key) != (0.0, 0.0):
            must = f"must be left out with model = {spec.model!r}, which stays on the glass"
            raise Fault(f"starts.{key}", must)
