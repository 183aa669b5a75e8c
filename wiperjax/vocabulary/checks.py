"""What a person gives to a function: checked by kind and range, and refused in one line.

Every public function checks its arguments with these, before it computes. A refusal is a
`ValueError` that reads `NAME must be ..., but was ...`. A value that JAX will know only when it
runs (inside `jax.jit`, `jax.vmap`, `jax.jvp`) passes unseen: there a result code speaks, of that
trajectory alone. Imports no jax.
"""

import os
import sys
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from .parameters import PARAMETERS, Parameter
from .ranges import Range
from .wording import digits, shown


def is_traced(value: Any) -> bool:
    """Whether JAX will know `value` only when it runs. Where nobody imported it, nothing is."""
    jax = sys.modules.get("jax")
    return jax is not None and isinstance(value, jax.core.Tracer)


def is_number(value: Any, arrays: bool = True) -> bool:
    """Whether `value` is a real number, or with `arrays` an array of them; True is none."""
    if isinstance(value, bool | np.bool_):
        return False
    if isinstance(value, int | float | np.integer | np.floating):
        return True
    kind = getattr(getattr(value, "dtype", None), "kind", "-")  # numpy's and JAX's arrays have it
    return kind in "iuf" and (arrays or np.ndim(value) == 0)


def numbers(name: str, value: Any, allowed: Range, arrays: bool = True) -> None:
    """Raises `ValueError` unless `value` is a number, or with `arrays` an array of numbers, in a
    range.
    """
    if is_traced(value):
        return
    if not is_number(value, arrays):
        raise ValueError(f"{name} {allowed.must}, but was {shown(value)}")
    if (wrong := allowed.outside(value)) is not None:
        raise ValueError(f"{name} {allowed.must}, but was {digits(wrong)}")


def array(name: str, value: Any, allowed: Range) -> np.ndarray:
    """`value`, a number, an array or a list of some, as floats: what is worked out of whole numbers
    of few bits overflows. Raises `ValueError` unless they are numbers in a range.
    """
    try:
        given = np.asarray(value) if isinstance(value, list | tuple) and value else value
    except ValueError:  # rows of several lengths
        raise ValueError(f"{name} {allowed.must}, but was {shown(value)}") from None
    numbers(name, given, allowed)
    return np.asarray(given, dtype=float)


def number(name: str, value: Any, allowed: Range) -> float:
    """`value` as a float. Raises `ValueError` unless it is one number in a range, known now."""
    if is_traced(value):
        must = "must be known outside of jax.jit, jax.vmap and derivatives"
        raise ValueError(f"{name} {must}, but was traced by one of them")
    if not is_number(value, arrays=False):
        raise ValueError(f"{name} {allowed.must}, but was {shown(value)}")
    numbers(name, value, allowed)
    return float(value)


def whole(name: str, value: Any, allowed: Range) -> int:
    """`value` as an int. Raises `ValueError` unless it is one whole number in a range."""
    return int(number(name, value, allowed))


def parameters(values: Mapping[str, Any], names: Mapping[str, str] | None = None) -> None:
    """Raises `ValueError` unless blade and belt parameters (SI units, radians) are in their ranges.

    Arguments:
        values: argument -> value, a number or an array.
        names: argument -> name in `PARAMETERS`, where it is another.
    """
    for name, value in values.items():
        parameter(name, value, PARAMETERS[(names or {}).get(name, name)])


def parameter(name: str, value: Any, entry: Parameter) -> None:
    """Raises `ValueError` unless `value` (SI units, radians) is a number in the range of a
    parameter.
    """
    if is_traced(value):
        return
    if not is_number(value):
        unit = f" of {entry.unit}" if entry.unit != "1" else ""
        raise ValueError(f"{name} must be a number{unit}, but was {shown(value)}")
    if problem := entry.argument_problem(value):
        raise ValueError(f"{name} {problem}")


def at_most(name: str, value: Any, limit: Any, words: str, itself: bool = True) -> None:
    """Raises `ValueError` where `value` is above `limit` (numbers or arrays), called `words`, or
    without `itself` just there.
    """
    if is_traced(value) or is_traced(limit):
        return
    above, most = np.broadcast_arrays(np.asarray(value), np.asarray(limit))
    wrong = (above > most) if itself else (above >= most)
    if wrong.any():
        was, most = digits(above[wrong][0]), f"{most[wrong][0]:g}"
        must = "at most" if itself else "below"
        raise ValueError(f"{name} must be {must} {words} ({most}), but was {was}")


def names(name: str, value: Any, fewest: int = 0) -> None:
    """Raises `ValueError` unless `value` is a list of texts; a text itself is one of letters."""
    fine = isinstance(value, Sequence) and not isinstance(value, str) and len(value) >= fewest
    if not fine or not all(isinstance(item, str) for item in value):
        raise ValueError(f"{name} must be a list of names, but was {shown(value)}")


def increasing(name: str, value: Any, fewest: int = 1) -> np.ndarray:
    """`value` as an array. Raises `ValueError` unless its finite numbers increase."""
    must = f"{name} must be {fewest} or more finite numbers that increase"
    try:
        values = np.asarray(value)
    except (TypeError, ValueError):
        raise ValueError(f"{must}, but was {shown(value)}") from None
    if not is_number(values) or values.ndim != 1 or values.size < fewest:
        raise ValueError(f"{must}, but was {shown(value)}")
    if not np.all(np.isfinite(values)) or not np.all(np.diff(values) > 0):
        raise ValueError(f"{must}, but was {shown(values)}")
    return values.astype(float)


def choice(name: str, value: Any, allowed: Collection[str]) -> str:
    """`value`. Raises `ValueError` unless it is one of some words."""
    if not isinstance(value, str) or value not in allowed:
        raise ValueError(f"{name} must be one of {', '.join(allowed)}, but was {shown(value)}")
    return value


def flag(name: str, value: Any) -> bool:
    """`value` as a bool. Raises `ValueError` for anything else: a text "no" would count as yes."""
    if not isinstance(value, bool | np.bool_):
        raise ValueError(f"{name} must be True or False, but was {shown(value)}")
    return bool(value)


def instance(name: str, value: Any, kind: type | tuple[type, ...], such_as: str) -> None:
    """Raises `ValueError` unless `value` is of a kind, which is put in words by `such_as`."""
    if not isinstance(value, kind):
        raise ValueError(f"{name} must be {such_as}, but was {shown(value)}")


def path(name: str, value: Any) -> None:
    """Raises `ValueError` unless `value` can name a file."""
    instance(name, value, (str, os.PathLike), "a path")


def bounds(name: str, value: Any) -> None:
    """Raises `ValueError` unless `value` is a mapping of names to (low, high), finite numbers."""
    if not isinstance(value, Mapping) or not value:
        raise ValueError(f"{name} must be a mapping of name to (low, high), but was {shown(value)}")
    for key, pair in value.items():
        fine = isinstance(pair, tuple | list) and len(pair) == 2
        if not fine or not all(is_number(end, arrays=False) for end in pair):
            raise ValueError(f"{name} of {key} must be (low, high), but was {shown(pair)}")
        low, high = (float(end) for end in pair)
        if not -np.inf < low < high < np.inf:
            raise ValueError(f"{name} of {key} must be (low, high), but were ({low:g}, {high:g})")
