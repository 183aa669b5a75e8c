"""How values stand in error lines: short, on one line, and never mistaken for another value."""

import difflib
import reprlib
from collections.abc import Iterable
from typing import Any

_LONGEST = 60

_repr = reprlib.Repr()
_repr.maxstring = _repr.maxother = _LONGEST
_repr.maxlong, _repr.maxlevel = 40, 3
_repr.maxlist = _repr.maxtuple = _repr.maxdict = 4


def shown(value: Any) -> str:
    """`value`, whatever it is, in at most 60 characters on one line."""
    try:
        return shorten(" ".join(_repr.repr(value).split()), _LONGEST)
    except Exception:  # an object that cannot say what it is
        return f"a {type(value).__name__}"


def shorten(text: str, length: int = 200) -> str:
    """`text` with what goes beyond a length cut off."""
    return text if len(text) <= length else text[: length - 3] + "..."


def digits(number: Any) -> str:
    """A number in few digits, or in as many as it takes not to be taken for another one."""
    try:
        short = f"{number:g}"
        return short if float(short) == number or number != number else repr(float(number))
    except OverflowError:
        return f"a whole number of {int(0.30103 * abs(number).bit_length()) + 1} digits"


def not_there(name: str, what: str, there: Iterable[str]) -> str:
    """That `what` (a map, a run) has no `name`: the nearest of the names it has, else all."""
    names = list(there)
    near = difflib.get_close_matches(name, names, n=3)
    near = near or [one for one in names if name and name in one][:3]
    hint = f"did you mean {' or '.join(near)}?" if near else f"it holds {', '.join(names)}"
    return f"{shown(name)} is not in this {what}; {hint}"
