"""Faults of sweep and scene files, worded as one line for a person.

pydantic reports a list of faults with machine-made texts; `sentence` picks the one that explains
most and says which key, what it must be and what it was.
"""

import difflib
from collections.abc import Sequence
from typing import Any

from pydantic import BaseModel, ValidationError

from wiperjax.parameters import PARAMETERS

AXIS_FORMS = "{ start = ..., stop = ..., num = ... } or { values = [...] }"

_EXPECTED = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "a text in quotes",
    "list_type": "a list",
    "finite_number": "a finite number",
    "model_type": "a table",
    "dict_type": "a table",
    "greater_than": "larger than {gt:g}",
    "greater_than_equal": "at least {ge:g}",
    "less_than": "smaller than {lt:g}",
    "less_than_equal": "at most {le:g}",
}
"""What pydantic's kinds of fault ask for, in our words."""


class SpecError(ValueError):
    """A sweep or scene file that cannot be used; its text is one line for a person."""


class Fault(ValueError):
    """Raised inside a model's checks: the key, seen from that model, and what is wrong with it."""

    def __init__(self, key: str, problem: str):
        super().__init__(f"{key}: {problem}" if key else problem)
        self.key = key
        self.problem = problem


def show(value: Any) -> str:
    """`value` as it would stand in a file, shortened to 60 characters."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a table"
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def sentence(model: type[BaseModel], failed: ValidationError) -> str:
    """`key: what it must be, what it was` of one fault, an unknown key before any other."""
    faults = failed.errors(include_url=False)
    strangers = [one for one in faults if one["type"] == "extra_forbidden"]
    fault = min(strangers, key=lambda one: len(one["loc"]), default=faults[0])
    location = [str(part) for part in fault["loc"]]
    kind, was, context = fault["type"], fault["input"], fault.get("ctx", {})
    error = context.get("error")
    if isinstance(error, Fault):
        location += [error.key] if error.key else []
        problem = error.problem
    elif kind == "extra_forbidden":
        problem = unknown(location[-1], _keys(model, location[:-1]), model)
    elif kind == "missing":
        problem = "is missing; the table must be there" if len(location) == 1 else "is missing"
    elif kind == "literal_error":
        problem = f"must be {context['expected']}, was {show(was)}"
    elif location[0] == "axes" and len(location) == 2:
        problem = f"must be {AXIS_FORMS}, was {show(was)}"
    elif kind in _EXPECTED:
        problem = f"must be {_EXPECTED[kind].format(**context)}, was {show(was)}"
    else:
        problem = f"{fault['msg']}, was {show(was)}"
    line = f"{'.'.join(location)}: {problem}" if location else problem
    return " ".join(line.split())


def unknown(key: str, allowed: Sequence[str], model: type[BaseModel] | None = None) -> str:
    """Words for an unknown key: the key that may be meant, the table it belongs in, or all keys."""
    if close := difflib.get_close_matches(key, allowed, n=1):
        return f"unknown key; did you mean {close[0]!r}?"
    if key in PARAMETERS:
        return f"unknown key here; it belongs in [{PARAMETERS[key].table}] or [axes]"
    if model is not None:
        for table, field in model.model_fields.items():
            if _is_table(field.annotation) and key in _keys(model, [table]):
                return f"unknown key here; it belongs in [{table}]"
    return f"unknown key; must be one of {', '.join(allowed)}"


def _keys(model: type[BaseModel], location: Sequence[str]) -> list[str]:
    """Keys that the table at `location` of a file described by `model` may have."""
    for part in location:
        if part in model.model_fields:
            annotation: Any = model.model_fields[part].annotation
            model = annotation if _is_table(annotation) else annotation.__args__[1]  # dict[str, X]
    return [field.alias or name for name, field in model.model_fields.items()]


def _is_table(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)
