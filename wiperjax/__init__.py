"""wiperjax: stick, slip and flight of a wiper lip, swept in parallel.

Importing it switches JAX to 64-bit numbers: events are located to 1e-9 and better, which 32-bit
numbers cannot express. A float32 state is an option of the sweep.
"""

import jax as _jax

_jax.config.update("jax_enable_x64", True)

from .blade.belts import SteadyBelt as SteadyBelt  # noqa: E402
from .blade.belts import TrapezoidBelt as TrapezoidBelt  # noqa: E402
from .blade.belts import WipingBelt as WipingBelt  # noqa: E402
from .blade.wiper import Wiper as Wiper  # noqa: E402
from .contact.friction import AbstractFriction as AbstractFriction  # noqa: E402
from .contact.friction import Coulomb as Coulomb  # noqa: E402
from .contact.friction import Stribeck as Stribeck  # noqa: E402
from .contact.system import AbstractSystem as AbstractSystem  # noqa: E402
from .engine.observers.totals import RegimeTotals as RegimeTotals  # noqa: E402
from .engine.solve import solve as solve  # noqa: E402
from .machine.jax_settings import configure as configure  # noqa: E402
from .maps.driver import run as sweep  # noqa: E402, F401
from .maps.verify import verify as verify  # noqa: E402
from .runs.simulate import simulate as simulate  # noqa: E402
from .specs.load import load_scene as load_scene  # noqa: E402
from .specs.load import load_sweep as load_sweep  # noqa: E402
from .store.whole import open_map as open_map  # noqa: E402
from .vocabulary.codes import Event as Event  # noqa: E402
from .vocabulary.codes import Regime as Regime  # noqa: E402
from .vocabulary.codes import Result as Result  # noqa: E402

__version__ = "0.1.0"
