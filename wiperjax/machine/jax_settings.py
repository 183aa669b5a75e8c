"""Settings that must be made before JAX starts its first device.

A library cannot impose them on a process that already computes, so they are one documented call:
``wiperjax.configure()`` before the first computation. The command line makes it itself.
"""

import importlib.util
import os
import sys

from ..vocabulary import checks
from ..vocabulary.ranges import Range
from . import provenance
from .compiled import keep_programs
from .cores import available
from .files import log

# XLA's own options of its CPU compiler, as name=value pairs:
COMPILER = {
    # a loop of any size becomes one function: run kernel by kernel, each of about four operations,
    # a third of a turn of the lanes went into starting the next of a thousand
    "xla_cpu_small_while_loop_byte_threshold": str(2**50),
    # its inner loops over lanes stay loops: unrolled, the function outgrows the instruction cache
    "xla_cpu_disable_loop_unrolling": "true",
}

# What is the same in every turn of a loop is found by LLVM too, in the one function that the loop
# becomes: XLA's own search is a twentieth of compiling, for not a bit and not a microsecond.
# Not on an accelerator: a turn of a loop whose end is not known costs a question to the device.
SKIPPED = ("while-loop-invariant-code-motion", "while-loop-trip-count-annotator")

# On a GPU loops run on the device, as graphs: else every turn waits until the host has read whether
# it is the last, a seventh of its time (`docs/bench/speed_h200.md`).
GRAPHS = "+WHILE,+CONDITIONAL"

MOST_CORES = 1024  # more is a slip

OURS = "WIPERJAX_NPROC"  # what `configure` has made NPROC, for processes that this one starts

_configured: int | None = None  # cores that this process was told to use


def cores(untold: int | None = None) -> int:
    """Return how many cores this process may use: what `configure` was told, else ``untold``, else
    all it has."""
    return _configured or untold or os.cpu_count() or 1


def accelerators() -> bool:
    """Whether a plugin of JAX's for an accelerator is installed. JAX is not loaded for it."""
    return importlib.util.find_spec("jax_plugins") is not None


def mask_registers() -> bool:
    """Whether the processor, as far as XLA may use it, has registers for masks: all with 512-bit
    vectors have them, and no other."""
    flags = os.environ.get("XLA_FLAGS", "")
    limited = "xla_cpu_max_isa=" in flags and "xla_cpu_max_isa=AVX512" not in flags
    return provenance.vector_bits() == 512 and not limited


def configure(cores: int | None = None, *, keep: bool = True) -> int:
    """Set JAX up for batches on this machine; return the number of cores.

    ``cores`` to use, a thread each (default: those this process may run on), for XLA's default pool
    burns two cores for the speed of one on work as small as a block of lanes; 512-bit vectors,
    which XLA avoids unless told; a whole loop in one compiled function (`COMPILER`), compiled
    without what it gains nothing by (`SKIPPED`); with `accelerators`, loops that run there
    (`GRAPHS`). ``keep``: what is compiled is kept for later processes (`compiled.keep_programs`).
    Settings already made by the user win. Those of JAX that are new have no effect once it has
    started a device (any computation does, at the import of a file too): then it logs a warning.
    Raises ValueError unless ``cores`` is None or a whole number from 1 to `MOST_CORES`, or if
    ``JAX_PLATFORMS`` asks for an accelerator and no plugin for one is installed.
    """
    global _configured
    keep = checks.flag("keep", keep)
    asked = os.environ.get("JAX_PLATFORMS", "")
    if asked and "cpu" not in asked.split(",") and not accelerators():
        # JAX itself fails by an assertion, much later
        raise ValueError(
            "JAX_PLATFORMS must be cpu where no plugin of JAX for an accelerator is installed, "
            f"but was {checks.shown(asked)}"
        )
    if cores is None:
        count = available()
    else:
        count = checks.whole("cores", cores, Range(1, MOST_CORES, whole=True))
    _configured = count
    wanted = {
        "--xla_cpu_prefer_vector_width": "512",
        "--xla_backend_extra_options": ",".join(f"{k}={v}" for k, v in COMPILER.items()),
    }
    if accelerators():
        wanted["--xla_gpu_enable_command_buffer"] = GRAPHS
    else:
        wanted["--xla_disable_hlo_passes"] = ",".join(SKIPPED)
    if provenance.version("jaxlib").startswith("0.10."):  # later ones end who names what is gone
        # its emitters of fusions have a scatter of their own, which has no place in the function
        # that a loop becomes (`COMPILER`): what keeps a log, such as a few blades under `vmap`, ran
        # kernel by kernel, four to ten times slower
        wanted["--xla_cpu_use_fusion_emitters"] = "false"
    flags = os.environ.get("XLA_FLAGS", "")
    new = [f"{name}={value}" for name, value in wanted.items() if name not in flags]
    if new and _has_started():
        must = "must come before the first computation, but JAX had started a device"
        log.warning("configure %s: settings of it have no effect in this process", must)
    os.environ["XLA_FLAGS"] = " ".join([flags, *new]).strip()
    _set_threads(count)
    if keep:
        keep_programs()
    return count


def _has_started() -> bool:
    """Whether JAX has started a device: it has read its settings. JAX says it in private only."""
    return getattr(sys.modules.get("jax._src.xla_bridge"), "backends_are_initialized", bool)()


def _set_threads(count: int) -> None:
    """Set the threads of XLA's pool, which each program hands parts of its work to: with fewer than
    programs they would wait for each other. (A device for each core would have them, too, but JAX's
    cache of programs tells processes by their number of devices.) What a process that started this
    one has set for itself is not the user's.
    """
    if os.environ.get("NPROC") == os.environ.get(OURS):
        os.environ["NPROC"] = os.environ[OURS] = str(count)
