"""Names that maps use themselves: no parameter of a system or law of one's own can have them."""

from collections.abc import Iterable

from ..machine.provenance import RUN_ATTRIBUTES
from ..vocabulary.columns import FORCES, SYSTEM, derivative
from ..vocabulary.schema import SCHEMA
from .errors import Fault
from .sensitivities import Sensitivities
from .starts import Starts
from .tables import Classes, SweepRun

_DIMENSIONS = ("start", *(column.along for column in SCHEMA.values() if column.along))
_TABLES = {"run": SweepRun, "class": Classes, "sensitivity": Sensitivities, "starts": Starts}
_ATTRIBUTES = frozenset(
    (
        *("Conventions", "title", "source", "seed", "start", SYSTEM, FORCES, "friction", "model"),
        *("belt_kind", "parameter_units", "identity", "versions", "cells", "block_cells"),
        *("specification", "specification_text", "specification_canonical"),
        *("specification_digest", *RUN_ATTRIBUTES),
        *(f"{prefix}_{key}" for prefix, table in _TABLES.items() for key in table.model_fields),
    )
)


def check_names(key: str, owner: str, names: Iterable[str]) -> None:
    """Raises Fault, of the key, for a parameter of an `owner` that has a name of a map's own: it
    would be lost under it, or the map could not be written, when all is computed."""
    for name in names:
        what = None
        if name in _DIMENSIONS:
            what = "a dimension"
        elif name in SCHEMA or derivative(name) is not None:
            what = "a variable"
        elif name in _ATTRIBUTES:
            what = "an attribute"
        if what is not None:
            must = f"{owner} must not have a parameter of the name {name!r}"
            raise Fault(key, f"{must}, which is that of {what} of maps")
