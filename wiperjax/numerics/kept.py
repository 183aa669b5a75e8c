"""Programs kept as tracing left them: a later process does not trace them again.

JAX keeps what it has compiled by what tracing yields, so it must trace to find it: seconds, for a
program as long as the engine's. Here what tracing yields (`jax.export`) is kept, too, by all that
it depends on: this package's source, the libraries' versions, JAX's settings, and the kinds of its
arguments.

A system of one's own is made of code that no version tells, and is traced in every process.
"""

import dataclasses
import hashlib
import logging
import os
import pickle
import re
import threading
import time
from collections.abc import Callable
from functools import cache, update_wrapper
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.core
import jax.numpy as jnp
from jax import export

from ..machine import files, jax_settings, provenance
from ..vocabulary.kinds import is_absent
from .arrays import check_settings, fields_of

log = logging.getLogger("wiperjax")

MOST_KEPT = 200  # programs in a folder, some 300 kB each: those longest out of use go first
CONFIG: Any = jax.config  # its names are known to jax alone
ADDRESS = re.compile(" at 0x[0-9a-f]+>")
EVENT = "/jax/core/compile/kept"  # so that who counts what jax compiles counts this
# A tenth of compiling a motion goes into XLA's search for simpler loops, and proofs that its passes
# are sound. In these programs, which are tested, that finds nothing; in a person's own it finds the
# numbers of a loop that nobody reads, half of a batch of `solve`: those are left alone.
NEEDLESS = ("simplify-while-loops", "hlo-verifier")
# The version of jaxlib is in the key: nothing that a program calls needs to last beyond it.
PROMISED = [export.DisabledSafetyCheck.custom_call(f"lapack_{x}ormqr_ffi") for x in "sd"]
SETTINGS = (  # of jax: by them other things are traced, or refused
    "jax_numpy_dtype_promotion",
    "jax_numpy_rank_promotion",
    "jax_default_matmul_precision",
    "jax_threefry_partitionable",
)
TRACED_WITH = ("jax", "jaxlib", "equinox", "diffrax", "optimistix", "numpy")


class Kept:
    """A function of trees of arrays, traced once for each kind of arguments.

    What is no array in them must be plain: numbers, texts, None, functions of this package. For
    systems and functions of one's own, inside other traces and where jax keeps no programs, or
    compiles none, it is `equinox.filter_jit` of the function.
    """

    def __init__(self, function: Callable[..., Any]):
        update_wrapper(self, function)
        self.function = function
        self.compiled = eqx.filter_jit(function)
        self.found: dict[Any, Callable[..., Any]] = {}
        self.lock = threading.Lock()  # of the next
        self.locks: dict[Any, threading.Lock] = {}

    def __call__(self, *args: Any) -> Any:
        check_settings()
        place = folder()
        arrays, plain = eqx.partition(args, eqx.is_array)
        leaves, tree = jax.tree.flatten(arrays)
        inside = any(isinstance(x, jax.core.Tracer) for x in leaves)
        if place is None or CONFIG.jax_disable_jit or inside:
            return self.compiled(*args)
        kinds = tuple((x.shape, x.dtype, getattr(x, "weak_type", False)) for x in leaves)
        others, shape = jax.tree.flatten(plain)
        settings = tuple(getattr(CONFIG, name) for name in SETTINGS)
        key = (settings, kinds, tree, shape, *((type(x), _told(x)) for x in others))
        if key in self.found:
            return self.found[key](*leaves)
        if not _known(args):
            return self.compiled(*args)
        with self.lock:
            lock = self.locks.setdefault(key, threading.Lock())
        with lock:  # of several threads one traces and compiles
            if key in self.found:
                return self.found[key](*leaves)
            # functions by name: those in a problem are this package's
            text = ADDRESS.sub(">", repr((_told(self.function), *key, _traced_with())))
            path = place / hashlib.sha256(text.encode()).hexdigest()
            start = time.perf_counter()
            program = _read(path) or self._traced(path, leaves, tree, plain)
            jax.monitoring.record_event_duration_secs(EVENT, time.perf_counter() - start)
            answer = program(*leaves)
            self.found[key] = program
        return answer

    def _traced(self, path: Path, leaves, tree, plain) -> Callable[..., Any]:
        """Return the program, traced now and written to `path`."""
        shapes = []

        def flat(*leaves):
            found = self.function(*eqx.combine(jax.tree.unflatten(tree, leaves), plain))
            answers, shape = jax.tree.flatten(found)
            shapes.append(shape)
            return answers

        try:
            traced = export.export(jax.jit(flat), disabled_checks=PROMISED)(*leaves)
        # what it calls cannot be written down, a callback say; or an argument is wrong
        except (NotImplementedError, ValueError) as error:
            log.debug("program not kept: %s", error)
            return lambda *leaves: self.compiled(
                *eqx.combine(jax.tree.unflatten(tree, leaves), plain)
            )
        if _source() != SOURCE:  # else it would be found later as a program of what is there now
            log.debug("program not kept: the source is no more what this process has imported")
            return _answering(traced, shapes[0])
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            files.write_bytes(path, pickle.dumps((bytes(traced.serialize()), shapes[0])))
            _clear(path.parent)
        except (files.StoreError, OSError) as error:
            log.debug("program not kept: %s", error)
        return _answering(traced, shapes[0])


def as_arrays(tree: Any, precision: str) -> Any:
    """Turn numbers into arrays, (cells,) where they vary and () where they do not.

    A Python number stays one where its terms are left out of the compiled program
    (`kinds.is_absent`): a power of 1, say, or any 0 or 1 of a system of one's own.
    """

    def leaf(path, value):
        if isinstance(value, int | float) and is_absent(fields_of(path), value, (0, 1)):
            return value
        return jnp.asarray(value, precision)

    return jax.tree_util.tree_map_with_path(leaf, tree)


def folder() -> Path | None:
    """Return where programs are kept, in the folder of jax's own; None: nowhere."""
    place, wanted = CONFIG.jax_compilation_cache_dir, CONFIG.jax_enable_compilation_cache
    return Path(place) / "wiperjax" if place and wanted else None  # "" is none to jax, too


def _read(path: Path) -> Callable[..., Any] | None:
    """Return the program in `path`; None if there is none."""
    try:
        traced, shape = pickle.loads(path.read_bytes())  # of the user's own cache, as jax's
        program = _answering(export.deserialize(bytearray(traced)), shape)
        os.utime(path)
    except FileNotFoundError:
        return None
    except Exception as error:  # damaged, whatever way: it is traced again
        log.debug("%s: not used: %s", path, error)
        return None
    return program


def _answering(traced: export.Exported, shape) -> Callable[..., Any]:
    call = jax.jit(traced.call, compiler_options=_options())
    return lambda *leaves: jax.tree.unflatten(shape, call(*leaves))


def _options() -> dict[str, Any]:
    """Return how XLA shall compile a program. A list that the user has set would be replaced."""
    name, ours = "xla_disable_hlo_passes", ",".join(jax_settings.SKIPPED)
    flags = os.environ.get("XLA_FLAGS", "").split()
    users = any(f"{name}=" in flag and flag != f"--{name}={ours}" for flag in flags)
    if users or jax.default_backend() != "cpu":
        return {}
    return {name: ",".join((ours, *NEEDLESS))}


def _clear(place: Path) -> None:
    """Removes the programs longest out of use."""
    kept = sorted(place.iterdir(), key=lambda path: path.stat().st_mtime)
    for path in kept[:-MOST_KEPT]:
        path.unlink(missing_ok=True)


def _source() -> str:
    """Digest of this package's source as it stands on the disk."""
    source = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        source.update(path.read_bytes())
    return source.hexdigest()


SOURCE = _source()  # what is imported now: at the first use it may have been edited, or updated


@cache
def _traced_with() -> tuple[str, ...]:
    """What tracing depends on beside the arguments."""
    versions = (f"{name} {provenance.version(name)}" for name in TRACED_WITH)
    return (
        SOURCE,
        *versions,
        jax.default_backend(),
    )


def _told(plain: Any) -> str:
    """What tells one thing that is no array from others of its type."""
    name = getattr(plain, "__qualname__", None)  # a partial function, say, has none
    if name and callable(plain) and not isinstance(plain, type):  # its repr has an address
        return f"{getattr(plain, '__module__', None)}.{name}"
    return repr(plain)


def _known(args: Any) -> bool:
    """Whether source or version of all code in `args`, modules and functions, is in the key."""
    code: set[Any] = set()

    def note(x: Any) -> bool:
        if isinstance(x, eqx.Module):
            code.add(type(x))
            for field in dataclasses.fields(x):  # a solver, say: static ones are no leaves
                if field.metadata.get("static", False):
                    jax.tree.leaves(getattr(x, field.name, None), is_leaf=note)
        elif callable(x):
            code.add(x)
        return False

    jax.tree.leaves(args, is_leaf=note)
    return all(_has_a_home(x) for x in code)


def _has_a_home(code: Any) -> bool:
    """Whether its name tells what it is: no lambda, no function of a function."""
    name = getattr(code, "__qualname__", "<")
    home = (getattr(code, "__module__", None) or "").partition(".")[0]
    return "<" not in name and home in (__name__.partition(".")[0], *TRACED_WITH)
