"""A system as a table for a notebook: its parameters with their units."""

import dataclasses
import html
from collections.abc import Iterator, Mapping
from typing import Any

import equinox as eqx
import numpy as np

from ..vocabulary.declared import SET_BY_THE_ENGINE, marked
from ..vocabulary.parameters import PARAMETERS, Parameter

Row = tuple[str, Any, str, str]  # name, value, unit, words


def card(system: Any, known: Mapping[str, Parameter]) -> str:
    """HTML of the parameters of a system, of its law and of its belt, or of one of these; `known`:
    what is known of those that it does not declare itself, by name.
    """
    rows = "".join(
        f"<tr><td style='text-align:left'><code>{html.escape(name)}</code></td>"
        f"<td>{html.escape(_shown(value))}</td><td style='text-align:left'>{html.escape(unit)}</td>"
        f"<td style='text-align:left'>{html.escape(words)}</td></tr>"
        for name, value, unit, words in _rows(system, known, "")
    )
    return f"<table><caption><b>{html.escape(type(system).__name__)}</b></caption>{rows}</table>"


def kind_parameters(names: Mapping[str, str]) -> dict[str, Parameter]:
    """What is known of the keys of a kind of belt or law, each of another name in `PARAMETERS`."""
    return {key: PARAMETERS[name] for key, name in names.items()}


def _rows(module: Any, known: Mapping[str, Parameter], prefix: str) -> Iterator[Row]:
    declared = marked(module)
    for field in dataclasses.fields(module):
        if field.name in SET_BY_THE_ENGINE or field.name in getattr(module, "idle", ()):
            continue
        name, value = prefix + field.name, getattr(module, field.name)
        if isinstance(value, eqx.Module):
            yield name, type(value).__name__, "", ""
            yield from _rows(value, known, f"{name}.")
            continue
        usual = {"belt.amplitude": "belt_speed"}.get(name, name.replace(".", "_"))
        entry = declared.get(field.name) or known.get(usual) or known.get(field.name)
        unit = "" if entry is None or entry.unit == "1" else entry.unit
        words = field.name.replace("_", " ") if entry is None else entry.long_name
        if value is not None:
            yield name, value, unit, words


def _shown(value: Any) -> str:
    """A number in six digits; of several what they reach."""
    if isinstance(value, str | bool):
        return str(value)
    try:
        numbers = np.asarray(value, dtype=float)
    except (TypeError, ValueError):  # also what is traced: it has no value yet
        return type(value).__name__
    if numbers.size == 1:
        return f"{numbers.item():.6g}"
    return f"{numbers.min():.4g} ... {numbers.max():.4g} {numbers.shape}"
