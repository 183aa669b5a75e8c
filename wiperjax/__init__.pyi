# What the package shows to who uses it: `wiperjax.NAME` loads the module that it comes from
# (`__init__.py` reads this file), and what that one needs.

from .blade.steady_slip import steady_slip
from .blade.wiper import Wiper
from .contact.belts import AbstractBelt, SteadyBelt, TrapezoidBelt, WipingBelt
from .contact.friction import AbstractFriction, Coulomb, Stribeck
from .contact.on_belt import AbstractBeltSystem
from .contact.system import AbstractSystem
from .engine.observers.base import AbstractObserver
from .engine.observers.totals import RegimeTotals
from .engine.solve import solve
from .explorer.notebook import explore
from .exports import export
from .machine.jax_settings import configure
from .maps.basins import basins
from .maps.driver import sweep
from .maps.refine.driver import refine
from .maps.verify import verify
from .modes.over import modes_over
from .modes.table import modes
from .noise.class_counts import class_table, share_error
from .noise.run_class import assess
from .plots.preview import load_ipython_extension as load_ipython_extension
from .plots.preview import preview
from .plots.preview import unload_ipython_extension as unload_ipython_extension
from .runs.scene import run_scene
from .runs.simulate import simulate
from .specs.load import load_scene, load_sweep, parse_scene, parse_sweep
from .store.whole import borders, open_map
from .vocabulary.codes import Event, Regime, Result
from .vocabulary.declared import parameter, parameters_of

__version__: str

__all__ = [
    "__version__",
    "AbstractBelt",
    "AbstractBeltSystem",
    "AbstractFriction",
    "AbstractObserver",
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
    "assess",
    "basins",
    "borders",
    "class_table",
    "configure",
    "explore",
    "export",
    "load_scene",
    "load_sweep",
    "modes",
    "modes_over",
    "open_map",
    "parameter",
    "parameters_of",
    "parse_scene",
    "parse_sweep",
    "preview",
    "refine",
    "run_scene",
    "share_error",
    "simulate",
    "solve",
    "steady_slip",
    "sweep",
    "verify",
]
