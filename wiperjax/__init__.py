"""wiperjax: stick, slip and flight of a wiper lip, swept in parallel.

Importing it takes no time: its names, and JAX under them, are loaded with the first that is used.

It makes JAX's numbers 64-bit ones, for events are located to 1e-9 and better, which 32-bit numbers
cannot express; processes started from here inherit that (`JAX_ENABLE_X64`). A float32 state is an
option of the sweep.
"""

import importlib
import importlib.util
import os
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # which would take any name for one of a module with `__getattr__`
    from .face import *  # noqa: F403


__version__ = "0.1.0"

os.environ["JAX_ENABLE_X64"] = "1"  # read when jax is imported: here or in any module below
if _jax := sys.modules.get("jax"):  # it was before
    _jax.config.update("jax_enable_x64", True)


if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        # not what Python asks any module for, nor `from . import MODULE`, which asks here first
        asked = name == "__all__" or not name.startswith("__")
        if asked and importlib.util.find_spec(f"{__name__}.{name}") is None:
            face = importlib.import_module(".face", __name__)
            if name == "__all__" or name in face.__all__:
                return getattr(face, name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*importlib.import_module(".face", __name__).__all__, "__version__"]
