"""Faults of sweep and scene files, worded as one line for a person.

pydantic reports a list of faults with machine-made texts; `sentence` picks the one that explains
most and says which key, what it must be and what it was.
"""

import difflib
from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from datetime import date, time
from typing import Any, get_args, get_origin

from pydantic import BaseModel, ValidationError

from ..vocabulary.parameters import PARAMETERS, Parameter
from ..vocabulary.wording import shorten, shown

AXIS_FORMS = "{ start = ..., stop = ..., num = ... } or { values = [...] }"

_EXPECTED = {
    "float_type": "a number",
    "int_type": "a whole number",
    "string_type": "a text in quotes",
    "list_type": "a list",
    "too_short": "a list that is not empty",
    "finite_number": "a finite number",
    "model_type": "a table",
    "dict_type": "a table",
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

    def under(self, table: str) -> "Fault":
        """The same, seen from the model that has the other as its `table`."""
        return Fault(f"{table}.{self.key}" if self.key else table, self.problem)


@contextmanager
def as_error():
    """Has a `Fault` of a check outside of any file raised as a `SpecError`."""
    try:
        yield
    except Fault as fault:
        raise SpecError(str(fault)) from None


_LONGEST_KEY = 40
_LONGEST_LIST = 160  # characters of a list of keys


def show(value: Any) -> str:
    """`value` as it would stand in a file, shortened to 60 characters."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, date | time):
        return value.isoformat()
    return shown(value)


def listed(numbers: Sequence[float]) -> str:
    """Numbers as a list in a file."""
    return f"[{', '.join(f'{x:g}' for x in numbers)}]"


def show_key(key: Any) -> str:
    """A key as it stands in a file, shortened to 40 printable characters."""
    key = str(key)
    return shorten(key if key.isprintable() and key else ascii(key), _LONGEST_KEY)


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
    elif isinstance(error, ValueError):
        problem = str(error)
    elif kind == "extra_forbidden" and location[:1] == ["axes"] and location[2:] == ["step"]:
        problem = f"unknown key; an axis says how many values it has: {AXIS_FORMS}"
    elif kind == "extra_forbidden":
        problem = unknown(location[-1], _keys(model, location[:-1]), model)
    elif kind == "missing":
        problem = "is missing; the table must be there" if len(location) == 1 else "is missing"
    elif kind == "literal_error":
        problem = f"must be {context['expected']}, was {show(was)}"
    elif location[:1] == ["axes"] and len(location) == 2:
        problem = f"must be {AXIS_FORMS}, was {show(was)}"
    elif kind in _EXPECTED:
        problem = f"must be {_EXPECTED[kind]}, was {show(was)}"
    else:
        problem = f"{fault['msg']}, was {show(was)}"
    where = ".".join(show_key(part) for part in location)
    return " ".join((f"{where}: {problem}" if location else problem).split())


def unknown(
    key: str,
    allowed: Sequence[str],
    model: type[BaseModel] | None = None,
    elsewhere: Mapping[str, Parameter] = PARAMETERS,
) -> str:
    """Words for an unknown key: the key that may be meant, the table it belongs in (by `elsewhere`
    or the `model` of the file), or all keys."""
    key = key[: 2 * _LONGEST_KEY]  # what is compared costs the product of the lengths
    table = elsewhere[key].table if key in elsewhere else ""
    plain = key.removeprefix(f"{table}_")  # as its own table has it: `speed` in [belt]
    if table and plain not in allowed:  # a name that is known is no slip of the pen
        named = "" if plain == key else f" as {plain!r}"
        return f"unknown key here; it belongs in [{table}]{named} or [axes]"
    if close := difflib.get_close_matches(key, allowed, n=1):
        return f"unknown key; did you mean {close[0]!r}?"
    if model is not None:
        for table, field in model.model_fields.items():
            is_table = get_origin(field.annotation) is not dict  # else its keys are names
            if is_table and key in _keys(_table(field.annotation), ()):
                return f"unknown key here; it belongs in [{table}]"
    named = ", ".join(allowed)
    if len(named) > _LONGEST_LIST:
        named = f"{named[:_LONGEST_LIST].rpartition(', ')[0]}, ... ({len(allowed)} keys)"
    return f"unknown key; must be one of {named}"


def _keys(model: type[BaseModel] | None, location: Sequence[str]) -> list[str]:
    """Keys that the table at `location` of a file described by `model` may have."""
    for part in location:
        fields = model.model_fields if model is not None else {}
        if part in fields:
            model = _table(fields[part].annotation)
        # else a key of a table of tables, whose type is that of its values
    return [] if model is None else [f.alias or name for name, f in model.model_fields.items()]


def _table(annotation: Any) -> type[BaseModel] | None:
    """The table that an annotation means: itself, `Table | None` or `dict[str, Table]`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(_table, get_args(annotation))), None)
