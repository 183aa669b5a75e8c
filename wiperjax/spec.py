"""Sweep and scene files: what they mean, and one clear line when they are wrong.

`load_sweep` and `load_scene` read a TOML file into a frozen specification. Each table is checked by
itself in `spec_tables.py`; what concerns two tables at once is checked here. Every fault becomes a
`SpecError` whose text names the file, the key, what it must be and what it was. Imports no jax.
"""

import hashlib
import json
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import PrivateAttr, ValidationError, model_validator

from wiperjax import checks
from wiperjax.parameters import BELTS, PARAMETERS, longest_ramp
from wiperjax.paths import oddity
from wiperjax.ranges import MOST_CELLS
from wiperjax.spec_errors import Fault, SpecError, sentence, show, unknown
from wiperjax.spec_tables import (
    Axis,
    Belt,
    Blade,
    Classes,
    ModelName,
    SceneRun,
    Sensitivities,
    Start,
    SweepRun,
    Table,
    Title,
)
from wiperjax.wording import digits, shorten

__all__ = ["SceneSpec", "SpecError", "SweepSpec", "load_scene", "load_sweep"]
__all__ += ["parse_scene", "parse_sweep"]

FORMAT = 2
"""Version of the meaning of a specification; part of its digest."""

MOST_BYTES = 4 * 10**6  # of a sweep or scene file: an axis of a hundred thousand listed values

RTOL, SLOPE_RTOL = 1e-6, 1e-9
"""Tolerance of the integrator unless the file has one: for the motion, and for its derivatives.

At the second, derivatives that are called fine are right to 1e-3 (docs/gradients.md)."""

SAMPLES_A_PERIOD = 5
"""Samples of a period of the highest squeal, unless the file says how many there are."""

FEWEST_SAMPLES, MOST_UNASKED = 64, 2**16

FLIP = 1.5
"""Lip lengths that the glass travels until a lip that lies on its shoulder has flipped over."""


def flip_time(kind: str, speed: float, frequency: float, ramp: float, length: float) -> float:
    """Time [s] after V = 0 until the glass has travelled `FLIP` lip lengths; inf if it never does.

    **Arguments:** `kind` of belt that reverses (`BELTS`), its peak speed [m/s], frequency [Hz] and
    ramp [s] (of a trapezoid), and the lip's length [m].
    """
    way = FLIP * length
    if kind == "trapezoid":
        time = math.sqrt(way * ramp / speed)  # V = 2 V0 t/ramp up to t = ramp/2
        return time if time <= ramp / 2 else ramp / 4 + way / speed
    turn = 2 * math.pi * frequency
    return math.acos(1 - way * turn / speed) / turn if way * turn <= 2 * speed else math.inf


class _System(Table):
    """What sweeps and scenes share: the blade, the belt, the start."""

    title: Title = ""
    model: ModelName = "lip"  # which rung of `wiperjax.ladder` stands for the blade
    blade: Blade = Blade()
    belt: Belt = Belt()
    start: Start = Start()

    _text: str = PrivateAttr(default="")

    @property
    def text(self) -> str:
        """Text of the file this was read from; empty if it was not read from a file."""
        return self._text

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of all parameters of the blade and of this kind of belt."""
        blade = tuple(name for name, entry in PARAMETERS.items() if entry.table == "blade")
        return blade + tuple(BELTS[self.belt.kind].values())

    def document(self) -> dict[str, Any]:
        """Plain dict that `parse_sweep` or `parse_scene` turns into an equal specification."""
        return self.model_dump(mode="json", by_alias=True, exclude_unset=True)

    def _stated(self) -> dict[str, tuple[str, float]]:
        """Parameter -> (key in the file, value in edge units), of those the file fixes."""
        keys = BELTS[self.belt.kind]
        tables = [("blade", name, name) for name in type(self.blade).model_fields]
        tables += [("belt", key, name) for key, name in keys.items()]
        stated = {
            name: (f"{table}.{key}", getattr(getattr(self, table), key))
            for table, key, name in tables
        }
        return {name: entry for name, entry in stated.items() if entry[1] is not None}

    def _fixed_si(self, axes: Mapping[str, Axis]) -> dict[str, float]:
        """Parameter -> SI value, stated or reference, of every parameter that is no axis."""
        stated = self._stated()
        fixed = {}
        for name in self.parameter_names:
            if name not in axes:
                entry = PARAMETERS[name]
                value = entry.to_si(stated[name][1]) if name in stated else entry.reference
                if value is not None:  # else it is asked for in _check_system
                    fixed[name] = float(value)
        return fixed

    def _check_system(self, axes: Mapping[str, Axis]) -> None:
        """Raises Fault for keys that are fine alone but not together."""
        kind, stated = self.belt.kind, self._stated()
        for key in sorted(self.belt.model_fields_set - {"kind"} - set(BELTS[kind])):
            owners = " and ".join(repr(other) for other, keys in BELTS.items() if key in keys)
            raise Fault(f"belt.{key}", f"must be left out with kind = {kind!r}; it is for {owners}")
        for name in axes:
            if name not in self.parameter_names:
                raise Fault(f"axes.{name}", f"must be left out with belt.kind = {kind!r}")
            if name in stated:
                key, value = stated[name]
                raise Fault(key, f"must be left out, for axes.{name} sets it; was {value:g}")
        for key, name in BELTS[kind].items():
            if name not in axes and name not in stated and PARAMETERS[name].reference is None:
                must = PARAMETERS[name].must
                raise Fault(f"belt.{key}", f"is missing; with kind = {kind!r} it {must}")

        fixed = self._fixed_si(axes)

        def values(name: str) -> np.ndarray:
            """All values of parameter `name` in this file, edge units."""
            if name in axes:
                return axes[name].values()
            return np.atleast_1d(PARAMETERS[name].to_edge(fixed[name]))

        def key_of(name: str) -> str:
            return f"axes.{name}" if name in axes else stated.get(name, (f"blade.{name}",))[0]

        collapse = values("collapse_angle").min()
        attack = values("attack_angle")
        attack = attack[np.argmax(np.abs(attack))]
        inside = f"must lie inside the collapse angle, (-{collapse:g}, {collapse:g}) degrees"
        if abs(attack) >= collapse:
            raise Fault(key_of("attack_angle"), f"{inside}, was {attack:g}")
        if self.start.angle is not None and abs(self.start.angle) >= collapse:
            raise Fault("start.angle", f"{inside}, was {self.start.angle:g}")
        if self.start.position is not None:
            x, reach = self.start.position[0], values("lip_length").min()
            if abs(x) >= reach:
                must = f"x must be shorter than the lip ({reach:g} m)"
                raise Fault("start.position", f"{must}, was {x:g}")
        if self.model != "lip":
            self._check_rung(values, key_of)
        if kind == "trapezoid":
            ramp, longest = values("belt_ramp").max(), longest_ramp(values("belt_frequency").max())
            if ramp > longest:
                must = f"must be at most half a period ({longest:g} s)"
                raise Fault(key_of("belt_ramp"), f"{must}, was {ramp:g}")

    def _check_rung(self, values, key_of) -> None:
        """Raises Fault for what a model of one coordinate (`wiperjax.ladder`) cannot have."""
        must = f"must be left out or 0 with model = {self.model!r}, which has no hinge mass"
        if (largest := values("hinge_mass").max()) > 0:
            raise Fault(key_of("hinge_mass"), f"{must}, was {largest:g}")
        for key, unit in (("position", "m"), ("velocity", "m/s")):
            pair = getattr(self.start, key)
            if pair is not None and pair[1] != 0:
                must = f"must be on the glass (y = 0) with model = {self.model!r}"
                raise Fault(f"start.{key}", f"{must}, was {pair[1]:g} {unit}")


class SweepSpec(_System):
    """A sweep: the axes of a map, what is held fixed, how cells are run and how they are named.

    Cells are numbered in C order of the axes, in the order in which the file lists them: the last
    axis varies fastest. Made by `load_sweep` or `parse_sweep`.
    """

    axes: dict[str, Axis]
    run: SweepRun
    classes: Classes = Classes()
    sensitivities: Sensitivities | None = None

    def with_sensitivities(self) -> "SweepSpec":
        """The same sweep with derivatives; as the file asks for them, else the default ones.

        Raises: SpecError, one line, where they cannot be had.
        """
        asked = self.sensitivities or Sensitivities()
        spec = self.model_copy(update={"sensitivities": asked})
        try:
            spec._check_sensitivities(asked)
        except Fault as fault:
            raise SpecError(str(fault)) from None
        return spec

    def _check_sensitivities(self, asked: Sensitivities) -> None:
        for name in asked.parameters:
            if name not in self.parameter_names:
                problem = unknown(name, list(self.parameter_names))
                raise Fault("sensitivities.parameters", f"{show(name)}: {problem}")
        if len(set(asked.parameters)) < len(asked.parameters):
            raise Fault("sensitivities.parameters", "must not name a parameter twice")
        if self.model != "lip":
            raise Fault("model", f"must be 'lip' with sensitivities, was {self.model!r}")
        if self.run.precision != "float64":
            must = "must be 'float64' with sensitivities"
            raise Fault("run.precision", f"{must}, was {self.run.precision!r}")
        if self.rtol > SLOPE_RTOL:
            must = f"must be left out or at most {SLOPE_RTOL:g} with sensitivities"
            raise Fault("run.rtol", f"{must}, was {self.rtol:g}")

    @model_validator(mode="after")
    def _is_consistent(self) -> "SweepSpec":
        if not self.axes:
            raise Fault("axes", "must name at least one blade or belt parameter, was empty")
        for name in self.axes:
            if name not in PARAMETERS:
                raise Fault(f"axes.{name}", unknown(name, list(PARAMETERS)))
        if self.size > MOST_CELLS:
            raise Fault("axes", f"must make at most {MOST_CELLS} cells, made {digits(self.size)}")
        for name, axis in self.axes.items():
            if problem := PARAMETERS[name].problem(axis.values()):
                raise Fault(f"axes.{name}", problem)
        if (instants := self.run.raster) is not None and instants > self.samples:
            must = f"must be at most the number of samples ({self.samples})"
            raise Fault("run.raster", f"{must}, was {instants}")
        self._check_system(self.axes)
        self._check_strokes()
        if self.sensitivities is not None:
            self._check_sensitivities(self.sensitivities)
        return self

    def _check_strokes(self) -> None:
        """Raises Fault where the windows around V = 0 leave nothing of the strokes between."""
        if "belt_frequency" not in BELTS[self.belt.kind].values():
            return
        axis, window = self.axes.get("belt_frequency"), self.classes.reversal_window
        highest = axis.values().max() if axis else self.fixed()["belt_frequency"]
        if window >= 0.25 / highest:
            must = f"must be below a quarter of the belt's period ({0.25 / highest:g} s)"
            raise Fault("classes.reversal_window", f"{must}, was {window:g}")

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values along each axis."""
        return tuple(axis.count for axis in self.axes.values())

    @property
    def size(self) -> int:
        """Number of cells."""
        return math.prod(self.shape)

    @property
    def rtol(self) -> float:
        """Tolerance of the integrator: that of the file, or what the map is for asks."""
        if self.run.rtol is not None:
            return self.run.rtol
        return RTOL if self.sensitivities is None else SLOPE_RTOL

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
        for (name, axis), index in zip(self.axes.items(), along, strict=True):
            known[name] = np.asarray(PARAMETERS[name].to_si(axis.values()))[index]
        return {name: known[name] for name in self.parameter_names}

    def notes(self) -> list[str]:
        """Lines on what is allowed but rarely meant, for the command line to show."""
        lines = []
        for name, axis in self.axes.items():
            reach = np.abs(axis.values()).max()
            if PARAMETERS[name].unit == "rad" and 0 < reach <= math.pi / 2:
                lines.append(f"axes.{name} reaches {reach:g} degrees only; it is not in radians")
        if self.belt.kind != "steady":
            lines += self._window_notes()
        return lines

    def _window_notes(self) -> list[str]:
        """Whether a lip flips over within the window of its reversal, in the slowest cell."""

        def values(name: str) -> np.ndarray:
            known = self.axes[name].values() if name in self.axes else self.fixed()[name]
            return np.abs(np.atleast_1d(known))

        given = {name: values(name) for name in BELTS[self.belt.kind].values()}
        time = flip_time(
            self.belt.kind,
            given["belt_speed"].min(),
            given["belt_frequency"].min(),
            given["belt_ramp"].max() if "belt_ramp" in given else 0.0,
            values("lip_length").max(),
        )
        window = self.classes.reversal_window
        if time <= 1.05 * window:
            return []
        return [
            f"classes.reversal_window is {window:g} s, but the glass needs up to {time:.2g} s "
            f"after V = 0 to carry the lip over ({FLIP:g} lip lengths); later counts as stroke"
        ]

    def canonical(self) -> str:
        """JSON of everything that determines the numbers of the map, and of nothing else.

        The same for files that differ in title, comments, order of keys (but not of axes), or in
        spelling out a default.
        """
        meaning = {
            "format": FORMAT,
            "axes": [[name, values.tolist()] for name, values in self.axes_values().items()],
            "fixed": self.fixed(),
            "belt": self.belt.kind,
            "model": self.model,
            "start": self.start.model_dump(mode="json"),
            "run": self.run.model_dump(mode="json") | {"rtol": self.rtol, "samples": self.samples},
            "classes": self.classes.model_dump(mode="json"),
        }
        if self.sensitivities is not None:
            meaning["sensitivities"] = self.sensitivities.model_dump(mode="json")
        return json.dumps(meaning, sort_keys=True, separators=(",", ":"), allow_nan=False)

    def digest(self) -> str:
        """SHA-256 of `canonical()`, 64 hexadecimal digits."""
        return hashlib.sha256(self.canonical().encode()).hexdigest()


class SceneSpec(_System):
    """One trajectory of one blade. Made by `load_scene` or `parse_scene`."""

    run: SceneRun
    classes: Classes = Classes()

    @model_validator(mode="after")
    def _is_consistent(self) -> "SceneSpec":
        self._check_system({})
        return self

    def parameters(self) -> dict[str, float]:
        """Every blade and belt parameter in SI units and radians."""
        return self._fixed_si({})

    def thresholds(self) -> Classes:
        """Thresholds of its noise class. Unless the file says another, the reversal window is twice
        the time in which the glass carries the lip over (`flip_time`), if that is longer than the
        default.
        """
        if self.belt.kind == "steady" or "reversal_window" in self.classes.model_fields_set:
            return self.classes
        known = self.parameters()
        frequency = known["belt_frequency"]
        time = flip_time(
            self.belt.kind,
            abs(known["belt_speed"]),
            frequency,
            known.get("belt_ramp", 0.0),
            known["lip_length"],
        )
        longest = 0.1 / frequency  # the rest is the stroke
        window = min(max(2 * time, self.classes.reversal_window), longest)
        return self.classes.model_copy(update={"reversal_window": window})


_Spec = TypeVar("_Spec", SweepSpec, SceneSpec)


def load_sweep(path: str | Path, model: str | None = None) -> SweepSpec:
    """Sweep of a TOML file, on the rung ``model`` instead of the file's own if given.

    Raises: SpecError, one line that names file and key.
    """
    return _load(SweepSpec, path, model)


def load_scene(path: str | Path, model: str | None = None) -> SceneSpec:
    """Scene of a TOML file, on the rung ``model`` instead of the file's own if given.

    Raises: SpecError, one line that names file and key.
    """
    return _load(SceneSpec, path, model)


def parse_sweep(data: Mapping[str, Any], source: str = "sweep") -> SweepSpec:
    """Sweep of a mapping shaped like a sweep file. Raises: SpecError that begins with `source`."""
    return _parse(SweepSpec, data, source)


def parse_scene(data: Mapping[str, Any], source: str = "scene") -> SceneSpec:
    """Scene of a mapping shaped like a scene file. Raises: SpecError that begins with `source`."""
    return _parse(SceneSpec, data, source)


def _load(kind: type[_Spec], path: str | Path, model: str | None) -> _Spec:
    checks.path("path", path)
    text = _read(Path(path))
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SpecError(f"{path}: is not valid TOML: {shorten(str(error))}") from None
    except (RecursionError, ValueError):  # of its parser: tables in tables, numbers without end
        must = "must be written with fewer brackets within brackets, and shorter numbers"
        raise SpecError(f"{path}: {must}") from None
    if kind is SceneSpec and "axes" in data:
        raise SpecError(f"{path}: has [axes], so it is a sweep; what is needed here is a scene")
    if model is not None:
        data["model"] = model
    spec = _parse(kind, data, str(path))
    spec._text = text
    return spec


def _read(path: Path) -> str:
    """Text of a file of a bearable size. Raises: SpecError."""
    try:
        odd, size = oddity(path), path.stat().st_size
        text = "" if odd or size > MOST_BYTES else path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise SpecError(f"{path}: is not a text file (UTF-8)") from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        why = getattr(error, "strerror", None) or error
        raise SpecError(f"{path}: cannot be read: {why}") from None
    if odd:
        raise SpecError(f"{path}: cannot be read: it is {odd}, and no regular file")
    if size > MOST_BYTES:
        most, was = MOST_BYTES / 1e6, size / 1e6
        raise SpecError(f"{path}: must have at most {most:g} MB, had {was:.3g} MB")
    return text


def _parse(model: type[_Spec], data: Mapping[str, Any], source: str) -> _Spec:
    if not isinstance(data, Mapping):
        raise SpecError(f"{source}: must be a mapping shaped like a file, was {show(data)}")
    try:
        return model.model_validate(dict(data))
    except ValidationError as error:
        raise SpecError(f"{source}: {sentence(model, error)}") from None
