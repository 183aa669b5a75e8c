"""The table `[refine]`: where the borders of a map are to be located, and how well."""

import difflib
import math
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, ValidationError, model_validator

from ..vocabulary.ranges import MOST_VALUES
from ..vocabulary.schema import OF_CELLS_ALONE, OF_THE_WINDOW, SCHEMA, SEVERAL_STARTS
from .axis import Axis
from .errors import Fault, SpecError, sentence, show, unknown
from .tables import Pair, Table

MOST_LEVELS = 20
BESIDE_AXES = frozenset(
    (
        *("border", "axis", "kind", "level", "side_low", "side_high"),
        *("bracket_low", "bracket_high", "bracket_share"),
        *("cell", "window_factor", "computed"),  # of levels
    )
)
"""What a refined map holds beside the values of its axes, and would write over one so called."""


def _box(value: Any) -> Any:
    """A table of axes; the pairs themselves are checked by their type."""
    if not isinstance(value, Mapping):
        raise Fault("", f"must be a table of axis = [low, high], was {show(value)}")
    return dict(value)


class Refine(Table):
    """How the borders between the answers of a map are located.

    Attributes:
        on: what the borders are between: a variable of names (label, mechanism, band), or
            NAME=NUMBER for a threshold of any stored number, such as velocity_rms=0.1.
        levels: how often the spacing of the map is halved; left out: as `resolution` needs.
        resolution: bracket of a border point at most, as a share of each axis (geometric: of its
            logarithm); left out: one step of the finest level.
        box: axis -> [low, high] (edge units) to look in; left out: the whole map.
        max_cells: simulations after which it ends, whatever is left; stored points take none.
        probes: random points in cubes without a border, and as many in those with one.
        lengthen: times as long a window where the answer is not settled; 1: never. To be left out
            where `on` is counted in the window, of its end, or `settled`: a longer one has another.
        splits: how often a cube is halved whose border is not what its edges tell.
        seed: of the random points.
    """

    on: str = "label"
    levels: int | None = None
    resolution: float | None = None
    box: Annotated[dict[str, Pair], BeforeValidator(_box)] = {}
    max_cells: int = 1_000_000
    probes: int = 500
    lengthen: int = 4
    splits: int = 2
    seed: int = 0

    @model_validator(mode="after")
    def _says_how_fine(self) -> "Refine":
        if self.levels is None and self.resolution is None:
            raise Fault("levels", "must be given, or resolution; both are missing")
        self.criterion()
        return self

    def criterion(self) -> tuple[str, float | None]:
        """Variable, and its threshold if it has one. Raises: Fault for one that cannot be."""
        name, equals, text = (part.strip() for part in self.on.partition("="))
        if name in OF_CELLS_ALONE:
            raise Fault("on", f"must be of what finer points have too; {name} is of cells alone")
        lacking = (*OF_CELLS_ALONE, *SEVERAL_STARTS)
        known = [n for n, column in SCHEMA.items() if not column.along and n not in lacking]
        if name not in known:
            if near := difflib.get_close_matches(name, known, n=3):
                raise Fault("on", f"unknown name {show(name)}; did you mean {' or '.join(near)}?")
            of_words = ", ".join(n for n in known if SCHEMA[n].flags is not None)
            must = f"must be {of_words}, or NAME=NUMBER of a number that the map has"
            raise Fault("on", f"{must}; was {show(name)}")
        if not equals:
            if SCHEMA[name].flags is None:
                raise Fault("on", f"must be {name}=NUMBER, for {name} is a number; was {self.on}")
            return name, None
        try:
            threshold = float(text)
        except ValueError:
            threshold = math.nan
        if SCHEMA[name].flags is not None or not math.isfinite(threshold):
            must = "must be a variable of names, or NAME=NUMBER of one of numbers"
            raise Fault("on", f"{must}; was {show(self.on)}")
        return name, threshold

    def check_box(self, axes: Mapping[str, np.ndarray]) -> None:
        """Raises Fault for a box of other axes, or outside them; `axes` in edge units."""
        for name, (low, high) in self.box.items():
            if name not in axes:
                raise Fault(f"box.{name}", unknown(name, list(axes), elsewhere={}))
            least, most = axes[name].min(), axes[name].max()
            if not least <= low < high <= most:
                must = f"must be [low, high] inside [{least:g}, {most:g}], low < high"
                raise Fault(f"box.{name}", f"{must}; was [{low:g}, {high:g}]")

    def depth(self, axes: Mapping[str, Axis]) -> int:
        """Levels for a map of some axes. Raises: Fault if they are too many."""
        levels, counts = self._levels(axes), {name: axis.count for name, axis in axes.items()}
        key, be = ("resolution", "need") if self.levels is None else ("levels", "be")
        for name, count in counts.items():
            if (fine := values_at(count, levels)) > MOST_VALUES:
                must = f"must leave axes.{name} at most {MOST_VALUES} values"
                raise Fault(key, f"{must}, but {levels} levels make {fine} of {count}")
        if levels > (most := _most_levels(counts)):
            must = f"must {be} at most {most} levels, for points of this map to have numbers of"
            raise Fault(key, f"{must} 63 bits; was {levels}")
        return levels

    def _levels(self, axes: Mapping[str, Axis]) -> int:
        if self.levels is not None:
            return self.levels
        assert self.resolution is not None
        steps = min((a.count - 1) / a.steps().max() for a in axes.values() if a.count > 1)
        needed = max(0, math.ceil(-math.log2(self.resolution) - math.log2(steps) - 1e-9))
        if needed > MOST_LEVELS:
            must = f"must need at most {MOST_LEVELS} halvings of the map's spacing"
            raise Fault("resolution", f"{must}; {self.resolution:g} needs {needed}")
        return needed

    def bracket(self, shape: np.ndarray, largest: np.ndarray) -> np.ndarray:
        """Steps of the finest grid that are a bracket along each axis; `shape` of that grid,
        `largest` of its steps over the mean one.
        """
        if self.resolution is None:
            return np.ones(len(shape), dtype=np.int64)
        steps = np.floor(self.resolution * (shape - 1) / largest + 1e-9)
        return np.maximum(1, steps).astype(np.int64)

    def cells_of(
        self, along: Mapping[str, np.ndarray], names: tuple[str, ...], width: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """First cell of the box along each axis and the one after the last; `along` the values of
        the finest grid, `width` of its steps in a cell.
        """
        low, high = [], []
        for name in names:
            values = along[name][::width]
            ends = sorted(self.box.get(name, (values.min(), values.max())))
            if values[0] > values[-1]:
                values, ends = -values, [-ends[1], -ends[0]]
            first = int(np.searchsorted(values, ends[0], side="right")) - 1
            last = int(np.searchsorted(values, ends[1], side="left"))
            low.append(min(max(first, 0), len(values) - 2))
            high.append(min(max(last, low[-1] + 1), len(values) - 1))
        return np.array(low), np.array(high)


def values_at(count: int, level: int) -> int:
    """Values along an axis of `count` of them, each of its steps halved `level` times."""
    return (count - 1) * 2**level + 1


def _most_levels(counts: Mapping[str, int]) -> int:
    """The last level whose points, and crossings at them along each axis, 63 bits can number."""
    several = [count for count in counts.values() if count > 1]
    room = range(1, MOST_LEVELS + 1)
    sizes = [len(several) * math.prod(values_at(n, level) for n in several) for level in room]
    return sum(size < 2**63 for size in sizes)


def parse_refine(given: Mapping[str, Any], spec: Any) -> Refine:
    """What is `given`, shaped like the table, for a map of the sweep `spec`.

    Raises: SpecError, one line that names the key.
    """
    try:
        found = Refine.model_validate(dict(given))
        check(found, spec)
    except ValidationError as error:
        raise SpecError(f"refine.{sentence(Refine, error)}") from None
    except Fault as fault:
        raise SpecError(str(fault.under("refine"))) from None
    return found


def check(refine: Refine, spec: Any) -> None:
    """Raises Fault where a table does not suit the sweep that it is for."""
    if spec.starts is not None:
        raise Fault("", "must be left out with [starts]: borders are those of one start")
    axes = spec.axes_values()
    if all(len(values) == 1 for values in axes.values()):
        raise Fault("", "must be left out: no axis of the map has two values")
    if taken := sorted(BESIDE_AXES.intersection(axes)):
        must = f"must be left out: {taken[0]!r} is an axis, and a variable of borders or levels"
        raise Fault("", f"{must}; rename the parameter")
    name, _ = refine.criterion()
    if name in OF_THE_WINDOW and "lengthen" in refine.model_fields_set and refine.lengthen > 1:
        must = f"must be left out with on = {show(refine.on)}: a longer window has another {name}"
        raise Fault("lengthen", f"{must}; was {refine.lengthen}")
    refine.check_box(axes)
    refine.depth(spec.axes)
