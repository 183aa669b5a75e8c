"""Parameters of a system of one's own, declared once beside its fields.

    mass: float = wiperjax.parameter(0.5, "kg", above=0, long_name="mass of the block")

A sweep or scene file, a map and a picture take name, unit, range and default from here. Imports no
jax: `parameters_of` reads any dataclass.
"""

import dataclasses
import math
from collections.abc import Collection, Mapping
from functools import lru_cache
from typing import Any

from . import checks
from .parameters import PARAMETERS, Parameter
from .ranges import FINITE, Range

KEY = "wiperjax_parameter"  # in the metadata of a field
SET_BY_THE_ENGINE = ("piece", "sides", "constants")


def parameter(
    default: float | None = None,
    unit: str = "1",
    *,
    low: float = -math.inf,
    high: float = math.inf,
    above: float | None = None,
    below: float | None = None,
    long_name: str = "",
) -> Any:
    """Field of a system that is one of its parameters.

    Arguments:
        default: its value unless a file has another, in code units; None: a file must state it.
        unit: in code (SI; "rad" is degrees in files, maps and pictures), "1" without dimension.
        low, high: ends of its range, allowed themselves, in the units of files.
        above, below: ends that are not allowed themselves, in place of those.
        long_name: what it is, in words; the field's own name if left out.

    Raises: ValueError for a default outside the range, and for two ends on one side.
    """
    checks.instance("unit", unit, str, "a text such as 'kg'")
    checks.instance("long_name", long_name, str, "a text")
    for end, other, names in ((low, above, ("low", "above")), (high, below, ("high", "below"))):
        if other is not None and end not in (-math.inf, math.inf):
            raise ValueError(f"{names[1]} must be left out with {names[0]}, but was {other:g}")
    ends = Range(infinite=True)
    low, high = checks.number("low", low, ends), checks.number("high", high, ends)
    if above is not None:
        low = checks.number("above", above, FINITE)
    if below is not None:
        high = checks.number("below", below, FINITE)
    reach = Range(low, high, low_open=above is not None, high_open=below is not None)
    found = Parameter("", "parameters", "", unit, reach, long_name, None, exact=True)
    if default is None:
        return dataclasses.field(kw_only=True, metadata={KEY: found})
    default = checks.number("default", default, FINITE)
    if problem := found.argument_problem(default):
        if unit == "rad":  # either of the two may have been meant in the unit of the other
            was = f"{default:g} rad ({math.degrees(default):.4g} degrees)"
            problem = f"{found.must}, but was {was}"
        raise ValueError(f"default {problem}")
    found = dataclasses.replace(found, reference=default)
    return dataclasses.field(default=default, metadata={KEY: found})


def set_by_the_engine(default: Any = None) -> Any:
    """Field of a shipped system that nobody passes: one of `SET_BY_THE_ENGINE`."""
    return dataclasses.field(init=False, repr=False, default_factory=lambda: default)


def marked(system: Any) -> Mapping[str, Parameter]:
    """Name -> `Parameter` of the fields that were made by `parameter`, of any dataclass."""
    found = {}
    for field in dataclasses.fields(system):
        if (entry := field.metadata.get(KEY)) is not None:
            long_name = entry.long_name or field.name.replace("_", " ")
            found[field.name] = dataclasses.replace(entry, name=field.name, long_name=long_name)
    return found


def check(system: Any) -> None:
    """Raises `ValueError` unless the parameters that a system or law declares are numbers in their
    ranges; what is traced passes (`checks`). A name of `SET_BY_THE_ENGINE` is none of theirs.
    """
    _check_annotated(type(system))
    for name, entry in marked(system).items():
        if name in SET_BY_THE_ENGINE:
            raise ValueError(f"parameter must have another name, for the engine sets {name!r}")
        checks.parameter(name, getattr(system, name), entry)


@lru_cache(maxsize=256)  # a class passes once: systems are made in loops
def _check_annotated(kind: type) -> None:
    """Raises `ValueError` for a field that a class gives another default without an annotation:
    to Python that is no field, and the default of the class it inherits from would stay.
    """
    for field in dataclasses.fields(kind):
        owner = next((each for each in kind.__mro__ if field.name in vars(each)), kind)
        given = vars(owner).get(field.name)
        # with an annotation it is that of the field, whose default stands in its class, too
        stated = field.name in vars(owner)  # None too: `friction = None` would leave the law
        if stated and given is not field.default and not hasattr(given, "__get__"):
            was = f"{field.name} = {checks.shown(given)}"
            must = f"must be annotated, as in '{field.name}: float = ...', else it is not used"
            raise ValueError(f"{owner.__name__}.{field.name} {must}; was {was}")


def parameters_of(system: Any, besides: Collection[str] = ()) -> Mapping[str, Parameter]:
    """Name -> `Parameter` of every number that a system, or its class, declares: of its fields made
    by `parameter`, and of plain fields whose default is a number (without unit or range, unless
    the wiper has a parameter of that name). Plain fields `besides` are left out.

    Raises: ValueError where it is no dataclass, or has a field that is neither one of these nor has
        a default.
    """
    if not dataclasses.is_dataclass(system):
        such_as = "a system or the class of one"
        raise ValueError(f"system must be {such_as}, but was {checks.shown(system)}")
    found, known = {}, marked(system)
    for field in dataclasses.fields(system):
        name, default = field.name, field.default
        if not field.init or name in SET_BY_THE_ENGINE or (name in besides and name not in known):
            continue
        if name in known:
            found[name] = known[name]
        elif checks.is_number(default, arrays=False):
            words, usual = name.replace("_", " "), float(default)  # type: ignore[arg-type]
            plain = Parameter(name, "parameters", "", "1", FINITE, words, usual)
            entry = PARAMETERS.get(name, plain)  # its unit and range, but the default is its own
            found[name] = dataclasses.replace(entry, table="parameters", reference=usual)
        elif (field.default, field.default_factory) == (dataclasses.MISSING, dataclasses.MISSING):
            must = "must be declared by wiperjax.parameter, or have a default"
            raise ValueError(f"field {field.name!r} {must}")
    return found
