"""Compiled programs kept between processes: the second map of a kind starts at once.

JAX has such a cache and leaves it off. Here it is on, in the user's cache folder, with a bound on
its size. A program holds instructions of one kind of processor, and a home may be shared by
machines, so each kind has a folder of its own.
"""

import contextlib
import hashlib
import os
import sys
from pathlib import Path

from platformdirs import user_cache_path

from .provenance import processor

MOST_BYTES = 2**29  # of all programs; the ones longest out of use go first


def folder() -> Path:
    """Where programs for this kind of processor are kept."""
    kind = hashlib.sha256(processor().encode()).hexdigest()[:12]
    return user_cache_path("wiperjax", appauthor=False) / f"compiled-{kind}"


def keep_programs() -> None:
    """Have JAX keep what it compiles; to be called before it compiles anything.

    What the environment says of JAX's cache (``JAX_COMPILATION_CACHE_DIR``,
    ``JAX_ENABLE_COMPILATION_CACHE=false``) wins. Where the folder cannot be written nothing is
    kept.
    """
    # also small programs: there are dozens, and together they cost seconds
    wanted = {"jax_persistent_cache_min_compile_time_secs": 0}
    if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
        place = folder()
        try:
            place.mkdir(parents=True, exist_ok=True)
        except OSError:
            return
        if not os.access(place, os.W_OK):
            return
        if "JAX_COMPILATION_CACHE_MAX_SIZE" not in os.environ:  # without a bound none is stamped
            _remove_unfinished(place)
        wanted |= {
            "jax_compilation_cache_dir": str(place),
            "jax_compilation_cache_max_size": MOST_BYTES,
        }
    for name, value in wanted.items():
        if name.upper() not in os.environ:
            os.environ[name.upper()] = str(value)  # for processes that this one starts, too
            if jax := sys.modules.get("jax"):  # it has read the environment already
                jax.config.update(name, value)


def _remove_unfinished(place: Path) -> None:
    """Removes programs that were cut off as they were written, by a full disk or a kill: JAX fails
    to read one, compiles it anew and keeps the old one. It stamps those that are whole. One that
    another process is writing just now may go, too, and is compiled once more.
    """
    names = set(os.listdir(place))
    for name in names:
        if name.endswith("-cache") and f"{name.removesuffix('-cache')}-atime" not in names:
            with contextlib.suppress(OSError):  # another's, or in use
                (place / name).unlink()
