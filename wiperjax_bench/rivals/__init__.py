"""The methods, one file each. A module lists its instances in ``RIVALS``."""

import importlib
import pkgutil

from ..interface import Rival


def every() -> list[Rival]:
    """Return all methods, in the order of their files' names."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    modules = [importlib.import_module(f"{__name__}.{name}") for name in names]
    return [rival for module in modules for rival in getattr(module, "RIVALS", ())]
