"""Tables of sweep and scene files, each checked by itself: types, ranges, shapes.

What concerns two tables at once is checked in `system.py`, `sweep.py`, `scene.py` and the families.
"""

import inspect
from dataclasses import fields
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)

from ..vocabulary import kinds
from ..vocabulary.kinds import BELTS
from ..vocabulary.parameters import BLADE, PARAMETERS
from ..vocabulary.ranges import FEWEST_SETTLED, SAMPLES, SETTINGS
from ..vocabulary.thresholds import LIMITS, Thresholds
from ..vocabulary.wording import digits
from .errors import Fault, show
from .imported import path_of

LONGEST_TITLE = 500
MOST_COORDINATES = 64  # small systems are what the engine is for
ALLOWED = {**SETTINGS, **LIMITS}  # range of each number by its key


def checked(name: str, value: float | None) -> float | None:
    """`value` (edge units) of parameter `name`; raises Fault outside its range."""
    if value is not None and (problem := PARAMETERS[name].problem(value)):
        raise Fault("", problem)
    return value


def _pair(value: Any) -> tuple[Any, Any]:
    """Two entries of a list as a tuple; pydantic then checks that they are numbers."""
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise Fault("", f"must be a list of two numbers, was {show(value)}")
    return value[0], value[1]


def _numbers(value: Any) -> tuple[Any, ...]:
    """Entries of a list as a tuple; pydantic then checks that they are numbers."""
    if not isinstance(value, list | tuple) or not 1 <= len(value) <= MOST_COORDINATES:
        raise Fault("", f"must be a list of numbers, one a coordinate, was {show(value)}")
    return tuple(value)


def _one_line(value: str) -> str:
    """`value`; raises Fault unless it is a short line of text: files and pictures bear it."""
    if len(value) > LONGEST_TITLE or not value.isprintable():
        must = f"must be one line of at most {LONGEST_TITLE} printable characters"
        raise Fault("", f"{must}, was {show(value)}")
    return value


Title = Annotated[str, AfterValidator(_one_line)]
Pair = Annotated[tuple[float, float], BeforeValidator(_pair)]
Numbers = Annotated[tuple[float, ...], BeforeValidator(_numbers)]
if TYPE_CHECKING:
    ModelName = SweptModel = SolverName = BeltName = str
else:
    ModelName = Literal[tuple(kinds.MODELS)]
    SweptModel = Literal[(*kinds.MODELS, kinds.AUTO)]
    SolverName = Literal[kinds.SOLVERS]
    BeltName = Literal[tuple(kinds.BELTS)]


class Table(BaseModel):
    """Base of all tables: unknown keys, numbers in quotes, NaN and infinity are refused, and what
    lies outside the range of its key.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    @field_validator("*", mode="after")
    @classmethod
    def _is_in_range(cls, value: Any, info: ValidationInfo) -> Any:
        """`value`, a number, a pair or a list of them."""
        allowed = ALLOWED.get(info.field_name or "")
        if allowed is not None and isinstance(value, int | float | tuple | list):
            wrong = allowed.outside(value if isinstance(value, int | float) else np.asarray(value))
            if wrong is not None:
                raise Fault("", f"{allowed.must}, was {digits(wrong)}")
        return value


def limited(name: str, keys: dict[str, str]) -> type[Table]:
    """Table with one optional number per key, held to the range of the parameter it stands for."""
    numbers: dict[str, Any] = {
        key: (Annotated[float | None, AfterValidator(partial(checked, parameter))], None)
        for key, parameter in keys.items()
    }
    return create_model(name, __base__=Table, __module__=__name__, **numbers)


_BELT_KEYS = {key: name for belt in BELTS.values() for key, name in belt.items()}


class Blade(limited("_BladeKeys", {name: name for name in BLADE})):
    """Parameters of the blade that are not axes (edge units); None: the reference value.

    Attributes:
        friction: its law, one of `kinds.FRICTIONS` with the parameters given there, or the import
            path `module:Class` of one of one's own, with those that it declares; checked in
            `laws.py`.
    """

    friction: Annotated[str, BeforeValidator(path_of)] = "stribeck"


class Belt(limited("_BeltKeys", _BELT_KEYS)):
    """Motion of the glass (edge units); which keys go with which kind is checked in `system.py`."""

    kind: BeltName = "steady"


class SweepRun(Table):
    """How each cell is integrated and observed.

    Attributes:
        transient: time [s] integrated and discarded.
        window: time [s] after it, in which the statistics are gathered.
        rtol: relative tolerance of the integrator; left out: 1e-6, with sensitivities 1e-9.
        atol: absolute tolerances; left out: the solver chooses them by the blade's size and speed.
        precision: of the state.
        solver: Runge-Kutta method; left out: "dopri8", in single precision or with
            sensitivities "tsit5".
        max_steps: step budget of one cell; a cell that spends it gets that result code.
        max_step: longest step [s]; left out: as long as the motion is smooth.
        zeno_time: flight time [s] below which a bounce sequence is completed in closed form.
        samples: of the settled window, at a first look; left out: as many as the highest squeal
            needs. Cells that they cannot tell the frequency of are looked at again.
        raster: instants of the settled window at which the regime is stored; left out: it is not.
        event_log: events of the settled window, from its start on, that are stored of each cell
            (more are counted and flagged); left out: none.
    """

    transient: float
    window: float
    rtol: float | None = None
    atol: float | None = None
    precision: Literal["float64", "float32"] = "float64"
    solver: SolverName | None = None
    max_steps: int = 200_000
    max_step: float | None = None
    zeno_time: float = 1e-8
    samples: int | None = None
    raster: int | None = None
    event_log: int | None = None

    @model_validator(mode="after")
    def _precision_holds_the_tolerance(self) -> "SweepRun":
        if self.precision == "float32" and self.rtol is not None and self.rtol < 1e-6:
            must = "must be at least 1e-06 with precision = 'float32'"
            raise Fault("rtol", f"{must}, was {self.rtol:g}")
        return self


class SceneRun(Table):
    """How one trajectory is integrated and sampled.

    The keys not named here are those of `SweepRun`.

    Attributes:
        duration: time [s] that is computed.
        transient: time [s] that class, statistics and spectrum leave out; left out: half of the
            duration, on a belt that turns an eighth.
        sample_interval: time [s] between samples; left out: 1/2000 of the duration.
        rtol: relative tolerance of the integrator.
        solver: Runge-Kutta method.
        max_steps: step budget; left out: no end but that of the run.
        max_step: longest step [s]; left out: as long as the motion is smooth.
    """

    duration: float
    transient: float | None = None
    sample_interval: float | None = None
    rtol: float = 1e-8
    atol: float | None = None
    solver: SolverName = "tsit5"
    max_steps: int | None = None
    max_step: float | None = None
    zeno_time: float = 1e-8

    @model_validator(mode="after")
    def _leaves_something(self) -> "SceneRun":
        if self.sample_interval is not None and self.sample_interval > self.duration:
            must = f"must be at most run.duration, {self.duration:g} s"
            raise Fault("sample_interval", f"{must}, was {self.sample_interval:g}")
        if self.transient is None:
            return self
        if not self.transient < self.duration:
            must = f"must be below run.duration, {self.duration:g} s"
            raise Fault("transient", f"{must}, was {self.transient:g}")
        least = FEWEST_SETTLED * (self.sample_interval or self.duration / SAMPLES)
        if self.duration - self.transient < least * (1 - 1e-9):
            must = f"must leave {FEWEST_SETTLED} samples, {least:g} s, of run.duration"
            raise Fault("transient", f"{must}, was {self.transient:g}")
        return self


class Start(Table):
    """Initial state, stated in at most one of three ways; else phi = alpha, touching, at rest.

    Attributes:
        angle: lip angle phi [degrees] at which the touching tip starts at rest.
        equilibrium: offset from the steady-slip equilibrium of largest phi, as a fraction of L.
        position: of the tip, (x, y) [m]: along the glass and above it; of another system, each of
            its coordinates.
        velocity: of the tip there, (x', y') [m/s], or their rates; left out: at rest.
    """

    angle: float | None = None
    equilibrium: float | None = None
    position: Numbers | None = None
    velocity: Numbers | None = None

    @property
    def kind(self) -> Literal["default", "angle", "equilibrium", "state"]:
        """Which of the ways of stating it was used."""
        if self.position is not None:
            return "state"
        if self.equilibrium is not None:
            return "equilibrium"
        return "default" if self.angle is None else "angle"

    @model_validator(mode="after")
    def _is_one_start(self) -> "Start":
        ways = ("angle", "equilibrium", "position")
        given = [key for key in ways if getattr(self, key) is not None]
        if len(given) > 1:
            raise Fault("", f"must have one of {', '.join(ways)}; had {' and '.join(given)}")
        if self.velocity is not None and self.position is None:
            raise Fault("velocity", "must have position beside it")
        return self


def _table_of(record: type) -> Any:
    """Table with the keys and defaults of a dataclass."""
    kinds = {tuple: Pair, float: float, type(None): float | None}
    keys: dict[str, Any] = {
        field.name: (kinds[type(field.default)], field.default) for field in fields(record)
    }
    return create_model("_Keys", __base__=Table, __module__=__name__, **keys)


class Classes(_table_of(Thresholds)):
    __doc__ = f"Thresholds of the noise classes.\n\n{inspect.getdoc(Thresholds)}"

    @model_validator(mode="after")
    def _bands_are_ordered(self) -> "Classes":
        for key in ("squeal_band", "chatter_band"):
            low, high = getattr(self, key)
            if not 0 <= low < high:
                must = "must be [low, high] in Hz with 0 <= low < high"
                raise Fault(key, f"{must}, was [{low:g}, {high:g}]")
        return self

    def notes(self) -> list[str]:
        """A line where a frequency lies in the bands of two classes."""
        bands = self.squeal_band, self.chatter_band
        low, high = max(band[0] for band in bands), min(band[1] for band in bands)
        if low >= high:
            return []
        both = f"classes.squeal_band and classes.chatter_band both hold {low:g} to {high:g} Hz"
        return [f"{both}: a noise of these is squeal"]
