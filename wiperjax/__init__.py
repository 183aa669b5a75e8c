"""wiperjax: stick, slip and flight of a wiper lip, swept in parallel.

Importing it takes no time: a name is loaded when it is first used, with no more than it needs (a
map opens without JAX).

It makes JAX's numbers 64-bit ones, for events are located to 1e-9 and better, which 32-bit numbers
cannot express; processes started from here inherit that (`JAX_ENABLE_X64`). A float32 state is an
option of the sweep.
"""

import os
import sys

import lazy_loader

__version__ = "0.1.0"

os.environ["JAX_ENABLE_X64"] = "1"  # read when jax is imported: here or in any module below
if _jax := sys.modules.get("jax"):  # it was before
    _jax.config.update("jax_enable_x64", True)

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
