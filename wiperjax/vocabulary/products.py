"""Kinds of datasets that the package makes: what each is called, and what one is told by."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Product(NamedTuple):
    """A kind of dataset.

    Attributes:
        words: what a file of it holds.
        maker: what makes it from Python.
        told_by: variables (of `begun` an attribute, which is 0) that all of the kind have; of two
            kinds whose variables a dataset has it is the first.
    """

    words: str
    maker: str
    told_by: tuple[str, ...]

    @property
    def such_as(self) -> str:
        """What an argument of this kind must be."""
        return f"{self.words} ({self.maker})"


PRODUCTS: Mapping[str, Product] = MappingProxyType(
    {
        "run": Product("a run", "wiperjax.simulate", ("time", "position", "velocity", "regime")),
        "map": Product("a map", "wiperjax.sweep", ("label",)),
        "begun": Product("a sweep without a computed cell", "wiperjax.sweep", ("cells_done",)),
        "curves": Product("curves", "cycles.curves_dataset", ("row_size", "end_code")),
        "branch": Product("a branch", "cycles.branch_dataset", ("special_kind",)),
        "modes": Product("modes of one system", "wiperjax.modes", ("shape_amplitude",)),
        "modes_over": Product("modes over a sweep", "wiperjax.modes_over", ("real_part", "exists")),
        "basins": Product("basins", "wiperjax.basins", ("initial_position", "final_position")),
        "remedies": Product("remedies", "remedy.sensitivities, with bounds", ("elasticity",)),
    }
)
