"""wiperjax: stick, slip and flight of a wiper lip, swept in parallel.

Importing it switches JAX to 64-bit numbers: events are located to 1e-9 and better, which 32-bit
numbers cannot express. A float32 state is an option of the sweep.
"""

import jax as _jax

_jax.config.update("jax_enable_x64", True)

from .belts import SteadyBelt as SteadyBelt  # noqa: E402
from .belts import TrapezoidBelt as TrapezoidBelt  # noqa: E402
from .belts import WipingBelt as WipingBelt  # noqa: E402
from .driver import run as sweep  # noqa: E402, F401
from .friction import AbstractFriction as AbstractFriction  # noqa: E402
from .friction import Coulomb as Coulomb  # noqa: E402
from .friction import Stribeck as Stribeck  # noqa: E402
from .launch import configure as configure  # noqa: E402
from .observers import RegimeTotals as RegimeTotals  # noqa: E402
from .results import Event as Event  # noqa: E402
from .results import Regime as Regime  # noqa: E402
from .results import Result as Result  # noqa: E402
from .solve import solve as solve  # noqa: E402
from .spec import load_scene as load_scene  # noqa: E402
from .spec import load_sweep as load_sweep  # noqa: E402
from .storage import open_map as open_map  # noqa: E402
from .system import AbstractSystem as AbstractSystem  # noqa: E402
from .trajectory import simulate as simulate  # noqa: E402
from .verification import verify as verify  # noqa: E402
from .wiper import Wiper as Wiper  # noqa: E402

__version__ = "0.1.0"
