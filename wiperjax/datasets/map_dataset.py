"""How flat columns become an `xarray.Dataset`: one variable for each column of `schema.SCHEMA`.

No input or output here, and neither jax nor diffrax.
"""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from ..machine.provenance import maker
from ..vocabulary.cf import plain_attributes
from ..vocabulary.codes import LABELS
from ..vocabulary.columns import FORCES, SYSTEM, attributes_of, column_of, ordered
from ..vocabulary.kinds import MODELS, WIPER


def raster_index(samples: int, instants: int) -> list[int]:
    """Samples of the window at which the raster has its instants: evenly spaced, or nearly."""
    return [k * samples // instants for k in range(instants)]


def select(columns: Mapping[str, Any], length: int, starts: int = 0) -> dict[str, np.ndarray]:
    """`columns` in the order and types of the schema, each of shape (length,), or (length, size of
    the further dimension); of a map of several `starts`, what differs between them has the shape
    (length, starts, ...).

    Raises: `ValueError` if a column is not in the schema (it would be lost unseen), has another
    shape, or is one of integers and holds what its type cannot.
    """
    names = ordered(columns)
    if strange := sorted(set(columns) - set(names)):
        raise ValueError(f"columns must be in schema.SCHEMA, but {', '.join(strange)} are not")
    chosen = {}
    for name in names:
        column = column_of(name)
        given = np.asarray(columns[name])
        several = (starts,) if starts and column.each_start else ()
        leading = (length, *several)
        if given.shape[: len(leading)] != leading or given.ndim != len(leading) + bool(
            column.along
        ):
            shape = ", ".join([*map(str, leading), *[column.along] * bool(column.along)])
            shape = f"({shape})" if "," in shape else f"({shape},)"
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
    known = spec.parameter_table
    for name, values in spec.axes_values().items():
        entry = known.get(name)
        coords[name] = {
            "values": np.asarray(values, dtype=np.float64).tolist(),
            "attrs": {
                "units": entry.edge_unit if entry else "1",
                "long_name": entry.long_name if entry else name.replace("_", " "),
            },
        }
    further = {}
    if spec.system != WIPER:
        further["coordinate"] = {
            "values": list(spec.family.coordinates),
            "dtype": "str",
            "attrs": {"long_name": "coordinate of the system"},
        }
    if (instants := spec.run.raster) is not None:
        step = spec.run.window / spec.samples
        further["raster_time"] = {
            "values": [k * step for k in raster_index(spec.samples, instants)],
            "attrs": {"units": "s", "long_name": "time since the start of the settled window"},
        }
    if (events := spec.run.event_log) is not None:
        further["event"] = {
            "values": list(range(events)),
            "dtype": "int32",
            "attrs": {"units": "1", "long_name": "number of the event in its cell, in time"},
        }
    return {
        "shape": [int(n) for n in spec.shape],
        "coords": coords,
        "further_coords": further | _starts(spec.starts),
        "attrs": _attributes(spec),
    }


def _starts(starts: Any) -> dict[str, Any]:
    """Coordinates of a map of several starts: their names, or numbers and states of random ones."""
    if starts is None:
        return {}
    about = {"long_name": "start of the motion"}
    if starts.names is not None:
        return {"start": {"values": list(starts.names), "dtype": "str", "attrs": about}}
    found: dict[str, Any] = {
        "start": {
            "values": list(range(starts.count)),
            "dtype": "int32",
            "attrs": {"units": "1", "long_name": "number of the random start"},
        },
        "class": {
            "values": list(LABELS),
            "dtype": "str",
            "attrs": {"long_name": "noise class"},
        },
    }
    for key, values in starts.draws().items():
        if values.ndim == 2:  # of a system of one's own
            what = "coordinate" if key == "position" else "rate of coordinate"
            for number, each in enumerate(values.T):
                attrs = {"long_name": f"{what} {number} at the start"}
                name = f"start_{key}_{number}"
                found[name] = {"along": "start", "values": each.tolist(), "attrs": attrs}
            continue
        units, what = ("m/s", "velocity") if key.startswith("v") else ("m", "position")
        where = "along the glass" if key.endswith("x") else "normal to it"
        found[f"start_{key}"] = {
            "along": "start",
            "values": values.tolist(),
            "attrs": {"units": units, "long_name": f"{what} {where} at the start"},
        }
    return found


def _attributes(spec: Any) -> dict[str, Any]:
    """Attributes that follow from the specification alone."""
    meaning = json.loads(spec.canonical())
    attrs: dict[str, Any] = {
        **maker(),
        "title": spec.title or _title(meaning),
        "seed": "none: a sweep draws no random numbers",
    }
    units, known = [], spec.parameter_table
    for name, value in sorted(meaning.get("fixed", {}).items()):
        entry = known.get(name)
        attrs[name] = float(entry.to_edge(value)) if entry else value
        units.append(f"{name}: {entry.edge_unit if entry else '1'}")
    if SYSTEM in meaning:  # nobody knows those of its axes, which derivatives are by
        units += [f"{name}: {known[name].edge_unit}" for name in spec.axes]
    attrs["parameter_units"] = "; ".join(units)
    attrs["belt_kind"] = str(meaning.get("belt") or "")
    if "friction" in meaning:
        attrs["friction"] = str(meaning["friction"])
    if SYSTEM in meaning:
        attrs[SYSTEM] = str(meaning[SYSTEM])
        if spec.family.per_metre:
            attrs[FORCES] = "per metre of blade"
    else:
        attrs["model"] = str(meaning.get("model", "lip"))
        attrs |= spec.choice
    start = {key: value for key, value in (meaning.get("start") or {}).items() if value is not None}
    usual = MODELS.get(attrs.get("model", ""), "that of the system")
    attrs["start"] = json.dumps(start, sort_keys=True) if start else usual
    if (starts := spec.starts) is not None:
        attrs["start"] = "several, the dimension start"
        if starts.random is not None:
            attrs["seed"] = starts.seed
    tables = (("run", "run_"), ("classes", "class_"), ("sensitivities", "sensitivity_"))
    tables = (*tables, ("starts", "starts_"))
    for table, prefix in tables:
        for key, value in sorted((meaning.get(table) or {}).items()):
            if value is not None:
                attrs[prefix + key] = value
    # The specification three times: as it was written, as it is read again by `verify`, as it is
    # compared.
    attrs["specification_text"] = spec.text
    attrs["specification"] = json.dumps(spec.document())  # the order of the axes counts
    attrs["specification_canonical"] = spec.canonical()
    attrs["specification_digest"] = spec.digest()
    return attrs


def _title(meaning: Mapping[str, Any]) -> str:
    if SYSTEM not in meaning:
        return "stick, slip and flight of a wiper lip"
    return f"map of {str(meaning[SYSTEM]).rpartition(':')[2]}"


def assemble(
    spec: Any, columns: Mapping[str, np.ndarray], *, attributes: Mapping[str, Any] | None = None
) -> xr.Dataset:
    """Map of all cells of `spec`, its dimensions in the order of the axes.

    Arguments:

    - `spec`: the sweep.
    - `columns`: name -> values, each of shape (cells,), cells in C order.
    - `attributes`: further attributes, such as `provenance.record(...)`.

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
        name: ((entry.get("along", name),), coordinate(entry), dict(entry["attrs"]))
        for name, entry in (description["coords"] | description["further_coords"]).items()
    }
    chosen = select(columns, int(np.prod(shape)), start_count(description))
    variables = {
        name: (
            dimensions(name, description),
            values.reshape(*shape, *values.shape[1:]),
            attributes_of(name, description["attrs"]),
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
    column = column_of(name)
    several = ("start",) if column.each_start and start_count(description) else ()
    further = (column.along,) if column.along else ()
    return (*description["coords"], *several, *further)


def start_count(description: Mapping[str, Any]) -> int:
    """Number of starts of each cell in a map from the result of `describe`; 0 if it has but one."""
    return len(description["further_coords"].get("start", {}).get("values", ()))
