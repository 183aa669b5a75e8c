"""The methods, one file each, which lists its instances in ``RIVALS``.

Read `engine` (ours), `compiled` (the scalar loop), `scipy_phases`, `heyoka_phases` and
`diffrax_phases` (solvers with events, restarted after each), `moreau_jean` and `siconos_moreau`
(time-stepping), `regularised` (smoothed contact). The others are parts of these.
"""

import importlib

from ..harness.interface import Rival

METHODS = ("compiled", "diffrax_phases", "engine", "heyoka_phases", "moreau_jean", "regularised",
           "scipy_phases", "siconos_moreau")  # fmt: skip


def every() -> list[Rival]:
    """Return all methods, file by file in the order of ``METHODS``."""
    modules = [importlib.import_module(f"{__name__}.{name}") for name in METHODS]
    return [rival for module in modules for rival in module.RIVALS]
