"""A refined map asked: the search done again with the answers in the file, for no simulation."""

from pathlib import Path

from ...machine.files import StoreError
from ...specs.refine import Refine
from ...store.swept import sweep_of
from ...store.whole import borders, open_map
from .answers import Answers
from .bank import Bank
from .criterion import Criterion
from .grid import Grid
from .search import Search


def replay(path: str | Path) -> tuple[Search, Criterion]:
    """The finished search of a refined map.

    Raises: `StoreError` if `path` is no such map or was made otherwise, or its borders are of what
    has no simulations.
    """
    settings = Refine.model_validate_json(borders(path).attrs["refine_settings"])
    with open_map(path) as ds:
        spec = sweep_of(ds, path)
        criterion = Criterion(settings, spec.classes)
        if criterion.linear:
            raise StoreError(f"{path}: has borders of {settings.on}, of which no point is stored")
        facts = criterion.facts({name: ds[name].values.ravel() for name in criterion.needs})
    grid = Grid(spec.axes, settings.depth(spec.axes))
    bank, search = Bank.of_file(path, grid), Search(grid, settings, criterion.thresholds, facts)
    search.run(Answers(bank, criterion, settings.lengthen))  # to the end, or that of its budget
    return search, criterion
