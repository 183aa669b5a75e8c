"""What a map contains: one table of columns, and how flat columns become an `xarray.Dataset`.

Everything that is stored per cell stands once, in `SCHEMA`. Columns that a caller offers beyond it
are not stored, columns of it that are missing are left out. No input or output here, and neither
jax nor diffrax.
"""

import importlib.metadata
import json
import os
import platform
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np
import xarray as xr

from .parameters import PARAMETERS
from .results import RESULTS, Event, Regime

CONVENTIONS = "CF-1.11"
LABELS = {
    "quiet": 0,
    "squeal": 1,
    "chattering": 2,
    "reversal": 3,
    "other": 4,
    "collapsed": 5,
    "failed": 6,
}
MECHANISMS = {
    "none": 0,  # quiet, or no motion to speak of
    "self_excited_slip": 1,  # slips all the time
    "stick_slip": 2,
    "flight": 3,  # leaves the glass, whether it sticks or not
    "carried": 4,  # rides on the belt for the whole window
    "reversal_pulse": 5,  # pressed hard at the reversal, without a hit
    "reversal_impulse": 6,  # hits the glass at the reversal
}
BANDS = {"none": 0, "chatter": 1, "low": 2, "squeal": 3, "high": 4}
SETTLED = {"no": 0, "yes": 1, "unknown": 2}
DEFAULT_STARTS: Mapping[str, str] = {
    "lip": "touching at the attack angle, at rest",
    "bar": "touching at the attack angle, at rest",
    "block": "at rest where the spring is relaxed",
}
NOT_COMPUTED = -1  # of an integer column, in a partly finished store only
NONE = 255  # of an unsigned column: there is no such instant, no such event
REGIMES = {regime.name.lower(): int(regime) for regime in Regime} | {"none": NONE}
EVENTS = {event.name.lower(): int(event) for event in Event if event != Event.NONE} | {"none": NONE}

RUN_ATTRIBUTES = ("command", "date_created", "host", "wall_time")
"""Attributes that say how a map came to be; two runs of one sweep agree in everything else, bit for
bit.
"""

LIBRARIES = (
    *("wiperjax", "jax", "jaxlib", "diffrax", "equinox", "optimistix"),
    *("numpy", "scipy", "xarray", "h5py", "h5netcdf"),
)


@dataclass(frozen=True)
class Column:
    """One quantity stored for each cell: its name, numpy type, unit and meaning."""

    name: str
    dtype: str
    units: str
    long_name: str
    flags: Mapping[str, int] | None = None  # meaning -> code, for categories
    comment: str = ""
    along: str = ""  # the dimension it has beside those of the map, if any

    def attributes(self) -> dict[str, Any]:
        """CF attributes of the variable; netCDF-valid types only."""
        attrs: dict[str, Any] = {"long_name": self.long_name}
        if self.flags is None:
            attrs["units"] = self.units
        else:
            attrs["flag_values"] = np.array(list(self.flags.values()), dtype=self.dtype)
            attrs["flag_meanings"] = " ".join(self.flags)
        if self.comment:
            attrs["comment"] = self.comment
        return attrs

    @property
    def missing(self) -> Any:
        """Value of a cell that is not computed (yet)."""
        if np.dtype(self.dtype).kind == "u":
            return NONE
        return np.nan if np.dtype(self.dtype).kind == "f" else NOT_COMPUTED


_TABLE = (
    Column("label", "int8", "", "noise class", LABELS),
    Column("mechanism", "int8", "", "what keeps the motion going", MECHANISMS),
    Column("band", "int8", "", "band of the dominant frequency", BANDS),
    Column(
        "settled", "int8", "", "whether both halves of the window tell the same", SETTLED,
        comment="no: still growing or dying, or irregular; unknown: halves that do not compare",
    ),
    Column("result", "int8", "", "how the trajectory ended", RESULTS),
    Column("stick_fraction", "float64", "1", "share of the settled window in stick"),
    Column("slip_fraction", "float64", "1", "share of the settled window in slip"),
    Column("flight_fraction", "float64", "1", "share of the settled window in flight"),
    Column("stick_fraction_stroke", "float64", "1", "share of the strokes in stick"),
    Column("flight_fraction_stroke", "float64", "1", "share of the strokes in flight"),
    Column(
        "dominant_frequency", "float64", "Hz", "frequency of the strongest line of tip velocity",
        comment="Hann window, refined between bins; NaN where all samples are equal; on a belt "
        "that reverses of the strokes, or of a tone around V = 0 if they are quiet",
    ),
    Column("velocity_rms", "float64", "m/s", "standard deviation of the tip velocity"),
    Column(
        "velocity_rms_stroke", "float64", "m/s", "the same away from reversal",
        comment="without what is slower than ten times the wiping frequency",
    ),
    Column("vibration_stroke", "float64", "m/s", "rms tip velocity of vibration away from reversal",
        comment="faster than the upper end of class_chatter_band",
    ),
    Column("vibration_reversal", "float64", "m/s", "the same, just after reversal"),
    Column("tone_time_before", "float64", "s", "longest tone before V = 0",
        comment="faster than class_chatter_band, its level (rms over 5 ms) within 6 dB",
    ),
    Column("tone_time_after", "float64", "s", "longest tone after V = 0"),
    Column("tone_frequency_before", "float64", "Hz", "frequency of the longest tone before V = 0"),
    Column("tone_frequency_after", "float64", "Hz", "frequency of the longest tone after V = 0"),
    Column("reversal_count", "int32", "1", "passages of V through zero in the settled window"),
    Column("velocity_mean", "float64", "m/s", "mean tip velocity"),
    Column("velocity_rms_reversal", "float64", "m/s", "the same, just after reversal"),
    Column("belt_speed_rms", "float64", "m/s", "root mean square of the belt speed"),
    Column("normal_force_mean", "float64", "N/m", "mean normal force"),
    Column("normal_force_max", "float64", "N/m", "largest normal force"),
    Column("normal_force_mean_stroke", "float64", "N/m", "mean normal force away from reversal"),
    Column("normal_force_max_reversal", "float64", "N/m", "largest normal force around reversal"),
    Column("gap_max", "float64", "m", "largest gap between tip and glass"),
    Column("impact_count", "int32", "1", "impacts in the settled window"),
    Column("stick_count", "int32", "1", "stick phases begun in the settled window"),
    Column("lift_off_count", "int32", "1", "lift-offs in the settled window"),
    Column("impact_impulse_max", "float64", "N s/m", "largest normal impulse of an impact"),
    Column("impact_impulse_reversal", "float64", "N s/m", "the same, around reversal"),
    Column("growth_rate", "float64", "1/s", "growth rate of steady slip, linearised"),
    Column("linear_frequency", "float64", "Hz", "frequency of steady slip, linearised"),
    Column("steps", "int32", "1", "accepted steps"),
    Column("rejected_steps", "int32", "1", "rejected steps"),
    Column("unproved_steps", "int32", "1", "steps that might hide a double crossing"),
    Column("final_time", "float64", "s", "time reached"),
    Column("final_x", "float64", "m", "tip position along the glass at the end"),
    Column("final_y", "float64", "m", "gap at the end"),
    Column("final_vx", "float64", "m/s", "tip velocity along the glass at the end"),
    Column("final_vy", "float64", "m/s", "tip velocity normal to the glass at the end"),
    Column(
        "regime_raster", "uint8", "", "regime over time in the settled window", REGIMES,
        comment="none: the cell ended before", along="raster_time",
    ),
    Column(
        "event_count", "int32", "1", "events in the settled window",
        comment="all of them, also those that the log has no room for",
    ),
    Column(
        "event_overflow", "int8", "", "whether the cell had more events than its log has room for",
        {"no": 0, "yes": 1}, comment="yes: the log has the first ones only",
    ),
    Column(
        "event_time", "float64", "s", "time of the event since the start of the settled window",
        along="event",
    ),
    Column("event_kind", "uint8", "", "kind of event", EVENTS, along="event"),
    Column("regime_before", "uint8", "", "regime before the event", REGIMES, along="event"),
    Column("regime_after", "uint8", "", "regime after the event", REGIMES, along="event"),
    Column("event_impulse", "float64", "N s/m", "normal impulse of the event", along="event"),
)  # fmt: skip

DIFFERENTIABLE = (
    *("stick_fraction", "slip_fraction", "flight_fraction", "velocity_rms", "velocity_mean"),
    *("belt_speed_rms", "normal_force_mean", "normal_force_max", "gap_max", "impact_impulse_max"),
    *("growth_rate", "linear_frequency", "final_x", "final_y", "final_vx", "final_vy"),
)
"""Outcomes that have derivatives by parameters. Labels, codes, counts and the dominant frequency (a
choice among lines) have none by nature; statistics of the reversal have none because the edges of
their window cut steps."""

VALIDITY = {
    "fine": 0,
    "near_grazing": 1,
    "sequence_changes": 2,
    "unsettled": 3,
    "not_differentiable": 4,
}
"""Whether the derivatives of a cell hold; where they do not, they are NaN."""


def sensitivity_name(outcome: str, parameter: str) -> str:
    """Name of the variable that holds d(outcome)/d(parameter)."""
    return f"d_{outcome}_d_{parameter}"


def _sensitivity_columns() -> tuple[Column, ...]:
    known = {column.name: column for column in _TABLE}
    columns = [
        Column(
            "sensitivity_code", "int8", "", "whether the derivatives hold", VALIDITY,
            comment="not fine: the derivatives are NaN",
        ),
        Column(
            "grazing_margin", "float64", "1", "smallest depth or clearance of an event guard",
            comment="relative to the size of the guard; 0: an event just grazed",
        ),
        Column(
            "sensitivity_agreement", "float64", "1",
            "largest relative difference of a derivative from central differences",
            comment="NaN: not checked, or not fine",
        ),
    ]  # fmt: skip
    for name in DIFFERENTIABLE:
        for parameter in PARAMETERS.values():
            below = "" if parameter.edge_unit == "1" else f"/({parameter.edge_unit})"
            columns.append(
                Column(
                    sensitivity_name(name, parameter.name),
                    "float64",
                    f"({known[name].units}){below}",
                    f"derivative of {known[name].long_name} by {parameter.long_name}",
                )
            )
    return tuple(columns)


SCHEMA: Mapping[str, Column] = {
    column.name: column for column in (*_TABLE, *_sensitivity_columns())
}


def raster_index(samples: int, instants: int) -> list[int]:
    """Samples of the window at which the raster has its instants: evenly spaced, or nearly."""
    return [k * samples // instants for k in range(instants)]


def select(columns: Mapping[str, Any], length: int) -> dict[str, np.ndarray]:
    """Columns of the schema among `columns`, in its order and types, each of shape (length,), or
    (length, size of the further dimension).

    Raises: `ValueError` if a column has another shape, or an integer column holds what its type
    cannot.
    """
    chosen = {}
    for name, column in SCHEMA.items():
        if name not in columns:
            continue
        given = np.asarray(columns[name])
        if given.shape[:1] != (length,) or given.ndim != 1 + bool(column.along):
            shape = f"({length}, {column.along})" if column.along else f"({length},)"
            raise ValueError(f"column {name} must have the shape {shape}, but has {given.shape}")
        dtype = np.dtype(column.dtype)
        if dtype.kind == "i" and given.dtype != dtype and length:
            limits = np.iinfo(dtype)
            if not (np.all(given >= limits.min) and np.all(given <= limits.max)):
                reach = f"{given.min()} to {given.max()}"
                raise ValueError(f"column {name} must fit {dtype.name}, but reaches from {reach}")
        chosen[name] = np.ascontiguousarray(given, dtype=dtype)
    return chosen


def describe(spec: Any) -> dict[str, Any]:
    """All of a map but its numbers (shape, coordinates, attributes), as plain types for JSON."""
    coords = {}
    for name, values in spec.axes_values().items():
        entry = PARAMETERS.get(name)
        coords[name] = {
            "values": np.asarray(values, dtype=np.float64).tolist(),
            "attrs": {
                "units": entry.edge_unit if entry else "1",
                "long_name": entry.long_name if entry else name.replace("_", " "),
            },
        }
    further = {}
    if (instants := getattr(spec.run, "raster", None)) is not None:
        step = spec.run.window / spec.run.samples
        further["raster_time"] = {
            "values": [k * step for k in raster_index(spec.run.samples, instants)],
            "attrs": {"units": "s", "long_name": "time since the start of the settled window"},
        }
    if (events := getattr(spec.run, "event_log", None)) is not None:
        further["event"] = {
            "values": list(range(events)),
            "dtype": "int32",
            "attrs": {"units": "1", "long_name": "number of the event in its cell, in time"},
        }
    return {
        "shape": [int(n) for n in spec.shape],
        "coords": coords,
        "further_coords": further,
        "attrs": _attributes(spec),
    }


def _attributes(spec: Any) -> dict[str, Any]:
    """Attributes that follow from the specification alone."""
    meaning = json.loads(spec.canonical())
    attrs: dict[str, Any] = {
        "Conventions": CONVENTIONS,
        "title": spec.title or "stick, slip and flight of a wiper lip",
        "source": f"wiperjax {version('wiperjax')}",
        "seed": "none: a sweep draws no random numbers",
    }
    units = []
    for name, value in sorted(meaning.get("fixed", {}).items()):
        entry = PARAMETERS.get(name)
        attrs[name] = float(entry.to_edge(value)) if entry else value
        units.append(f"{name}: {entry.edge_unit if entry else '1'}")
    attrs["parameter_units"] = "; ".join(units)
    attrs["belt_kind"] = str(meaning.get("belt", ""))
    attrs["model"] = str(meaning.get("model", "lip"))
    start = {key: value for key, value in (meaning.get("start") or {}).items() if value is not None}
    attrs["start"] = json.dumps(start, sort_keys=True) if start else DEFAULT_STARTS[attrs["model"]]
    tables = (("run", "run_"), ("classes", "class_"), ("sensitivities", "sensitivity_"))
    for table, prefix in tables:
        for key, value in sorted((meaning.get(table) or {}).items()):
            if value is not None:
                attrs[prefix + key] = value
    # The specification three times: as it was written, as it is read again by `verify`, as it is
    # compared.
    attrs["specification_text"] = str(getattr(spec, "text", ""))
    document = getattr(spec, "document", None)
    if document is not None:
        attrs["specification"] = json.dumps(document())  # the order of the axes counts
    attrs["specification_canonical"] = spec.canonical()
    attrs["specification_digest"] = spec.digest()
    return attrs


def assemble(
    spec: Any, columns: Mapping[str, np.ndarray], *, attributes: Mapping[str, Any] | None = None
) -> xr.Dataset:
    """Map of all cells of `spec`, its dimensions in the order of the axes.

    Arguments:

    - `spec`: the sweep.
    - `columns`: name -> values, each of shape (cells,), cells in C order.
    - `attributes`: further attributes, such as `provenance(...)`.

    Raises: `ValueError` if a column has another length.
    """
    return build(describe(spec), columns, attributes)


def build(
    description: Mapping[str, Any],
    columns: Mapping[str, np.ndarray],
    attributes: Mapping[str, Any] | None = None,
) -> xr.Dataset:
    """Map from the result of `describe` and flat columns; see `assemble`."""
    shape = tuple(description["shape"])
    coords = {
        name: ((name,), coordinate(entry), dict(entry["attrs"]))
        for name, entry in (description["coords"] | description["further_coords"]).items()
    }
    chosen = select(columns, int(np.prod(shape)))
    variables = {
        name: (
            dimensions(name, description),
            values.reshape(*shape, *values.shape[1:]),
            SCHEMA[name].attributes(),
        )
        for name, values in chosen.items()
    }
    attrs = dict(description["attrs"]) | dict(attributes or {})
    return xr.Dataset(variables, coords=coords, attrs=plain_attributes(attrs))


def coordinate(entry: Mapping[str, Any]) -> np.ndarray:
    """Values of one coordinate in the result of `describe`."""
    return np.array(entry["values"], dtype=entry.get("dtype", "float64"))


def dimensions(name: str, description: Mapping[str, Any]) -> tuple[str, ...]:
    """Dimensions of the variable `name` in a map from the result of `describe`."""
    further = SCHEMA[name].along
    return (*description["coords"], further) if further else tuple(description["coords"])


def plain_attributes(attrs: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes as types that netCDF can hold: text, numbers, arrays; None is left out."""
    plain: dict[str, Any] = {}
    for name, value in attrs.items():
        if value is None:
            continue
        if isinstance(value, bool | np.bool_):
            plain[name] = np.int8(value)
        elif isinstance(value, str):
            plain[name] = value
        elif isinstance(value, int | float | np.number | np.ndarray):
            plain[name] = value
        elif (
            isinstance(value, list | tuple)
            and value
            and all(isinstance(item, int | float) for item in value)
        ):
            plain[name] = np.array(value, dtype=np.float64)
        else:
            plain[name] = json.dumps(value, sort_keys=True)
    return plain


def provenance(command: str | None, wall_time: float, host: str | None = None) -> dict[str, Any]:
    """Values of `RUN_ATTRIBUTES`; `wall_time` in seconds, summed over blocks."""
    return {
        "command": command or "",
        "date_created": datetime.now(UTC).isoformat(timespec="seconds"),
        "host": host or host_kind(),
        "wall_time": float(wall_time),
    }


def versions() -> dict[str, str]:
    """Versions of Python and of the libraries a map rests on, without importing any."""
    return {"python": platform.python_version()} | {name: version(name) for name in LIBRARIES}


def version(library: str) -> str:
    """Installed version of a library, else `none`; of wiperjax, also in a mere checkout."""
    if library == "wiperjax" and (own := getattr(sys.modules.get(library), "__version__", None)):
        return str(own)
    try:
        return importlib.metadata.version(library)
    except importlib.metadata.PackageNotFoundError:
        return "none"


def host_kind() -> str:
    """Kind of machine (processor, cores, system), not its name."""
    processor = platform.processor() or platform.machine()
    if sys.platform.startswith("linux"):
        try:
            with open("/proc/cpuinfo", encoding="utf-8") as lines:
                names = [
                    line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")
                ]
        except OSError:
            names = []
        processor = names[0] if names else processor
    return f"{processor}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}"


def flag_names(variable: xr.DataArray) -> dict[int, str]:
    """Code -> meaning of a categorical variable, from its CF attributes."""
    values = np.atleast_1d(variable.attrs["flag_values"])
    return dict(
        zip((int(v) for v in values), str(variable.attrs["flag_meanings"]).split(), strict=True)
    )
