"""All that `wiperjax.NAME` gives: what the package shows to who uses it.

Loaded with the first of these names (`wiperjax/__init__.py`), and with it JAX.
"""

from .blade.belts import SteadyBelt, TrapezoidBelt, WipingBelt
from .blade.wiper import Wiper
from .contact.friction import AbstractFriction, Coulomb, Stribeck
from .contact.system import AbstractSystem
from .engine.observers.totals import RegimeTotals
from .engine.solve import solve
from .machine.jax_settings import configure
from .maps.driver import run as sweep
from .maps.verify import verify
from .runs.simulate import simulate
from .specs.load import load_scene, load_sweep
from .store.whole import open_map
from .vocabulary.codes import Event, Regime, Result

__all__ = [
    "AbstractFriction",
    "AbstractSystem",
    "Coulomb",
    "Event",
    "Regime",
    "RegimeTotals",
    "Result",
    "SteadyBelt",
    "Stribeck",
    "TrapezoidBelt",
    "Wiper",
    "WipingBelt",
    "configure",
    "load_scene",
    "load_sweep",
    "open_map",
    "simulate",
    "solve",
    "sweep",
    "verify",
]
