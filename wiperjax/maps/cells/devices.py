"""Cells dealt out to the devices, the dearest first, and gathered again in their order."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ...blade.wiper import Wiper
from ...machine.jax_settings import cores
from ...machine.phases import during
from ...numerics.arrays import cellwise
from ...numerics.kept import as_arrays
from . import compiling


def dearest_first(wiper: Wiper | None, count: int) -> np.ndarray:
    """Return the first ``count`` cells in the order to run them in, (count,); as they are where no
    wiper tells what they cost.

    A cell that takes many turns and begins late keeps its lane busy while the others are empty. The
    more load and the slower the glass, the more sticking and slipping there is: of random blades
    with load / speed^(1/3) falling, 16 a lane, 98 % of the turns are used, in any order 87 % (list
    scheduling of turns that were counted; a lane that waits for others to jump is not in it).
    """
    if wiper is None:
        return np.arange(count)
    load, speed = (cellwise(x, count) for x in (wiper.normal_load, wiper.belt.peak))
    return np.argsort(-load / np.cbrt(np.maximum(speed, 1e-30)), kind="stable")


def deal(compute, cells, order: np.ndarray):
    """Return (answers in the order of the cells, effort) of ``compute``, one call for each device.

    ``compute(cells, count)`` gets arrays with the cells as last axis and returns (answers with the
    cells as first axis, effort). ``order``: the cells to run, first to last; there may be more, so
    that every call has the same shapes.
    """
    hands, count = devices(), len(order)
    shares = len(hands)
    varying, fixed = eqx.partition(cells, eqx.is_array)

    def work(share):
        # dealt out like cards, so that the shares end together
        def pick(x):
            mine = order[share::shares]
            fill = np.full(x.shape[-1] // shares - len(mine), order[-1])
            return np.asarray(x)[..., np.concatenate([mine, fill])]

        mine = jax.tree.map(lambda x: pick(x) if x.ndim else x, varying)
        number = jnp.asarray(len(range(share, count, shares)), jnp.int32)
        mine, number = jax.device_put((mine, number), hands[share])
        *found, effort = compute(eqx.combine(mine, fixed), number)
        return jax.tree.map(np.asarray, (found, effort))

    def collect(*parts):
        whole = np.empty((count, *parts[0].shape[1:]), parts[0].dtype)
        for share, part in enumerate(parts):
            mine = order[share::shares]
            whole[mine] = part[: len(mine)]
        return whole

    with compiling.apart("engine"), during("engine"), ThreadPoolExecutor(shares) as pool:
        answers = list(pool.map(work, range(shares)))
    whole = jax.tree.map(collect, *(answer[0] for answer in answers))
    return whole, np.sum([answer[1] for answer in answers], axis=0)


def spread(function, cells):
    """Return ``function(cells)``, arrays with the cells as last axis, computed in a part for each
    device. ``cells``: arrays too, `capacity` cells or one for all; the rest is handed on as it is.
    """
    parts = len(devices())
    size = max(np.shape(x)[-1] for x in jax.tree.leaves(cells) if np.ndim(x)) // parts

    def work(part):
        def pick(x):
            return x[..., part * size : (part + 1) * size] if np.ndim(x) else x

        return jax.tree.map(np.asarray, function(jax.tree.map(pick, cells)))

    with ThreadPoolExecutor(parts) as pool:
        return jax.tree.map(lambda *x: np.concatenate(x, axis=-1), *pool.map(work, range(parts)))


def devices() -> list:
    """Return the device of each share of a block: every accelerator; or the host's, for each core
    that `configure` was told of: one compilation, and a thread for each share fills a core.
    """
    found = jax.devices()
    return found[:1] * cores(untold=1) if found[0].platform == "cpu" else found


def on_accelerator() -> bool:
    """Whether jax computes on a device of another kind than the host's processor."""
    return jax.default_backend() != "cpu"


BRIEF = 100.0  # s of motion, within a second on two cores


def is_brief(spec: Any) -> bool:
    """Return whether the program of a sweep shall rather be compiled fast than run fast
    (`Integration.brief`): where all its motion is little, and has no derivatives.

    Compiling takes two fifths less time (Dopri8), and a turn three quarters more. (With derivatives
    compiling took as long, and the run 1.6 times.)
    """
    return not on_accelerator() and spec.sensitivities is None and spec.motion <= BRIEF


FEW = (256, 4096)  # cells of a share: one with fewer is filled up to these,
SMALL = 2**22  # and its record has room for so many samples (32 MB): any small sweep fits


def capacity(cells: int, shares: int | None = None) -> int:
    """Cells a block is filled up to, so that blocks of about the same size have the same shapes,
    and share a compiled program.

    ``shares`` it is dealt out in: one for each of `devices`, unless given.
    """
    shares = shares or len(devices())
    share = -(-cells // shares)
    return next((few for few in FEW if share <= few), roomy(share)) * shares


def alike(system: Any, precision: str, capacity: int) -> Any:
    """Return ``system`` with arrays for its numbers (`as_arrays`). In a block of a `capacity` that
    is filled up they are all (capacity,), also where one number is that of all cells: sweeps over
    other parameters then share a compiled program, unless one of them lacks the terms of a number
    that is absent. (With numbers for all cells a turn is a twentieth cheaper: in larger blocks that
    is more than compiling.) Those in a tuple, a table for one, are no parameters: they stay one for
    all cells.
    """
    found = as_arrays(system, precision)
    if capacity > FEW[-1] * len(devices()):
        return found

    def each(path, x):
        listed = any(isinstance(key, jax.tree_util.SequenceKey) for key in path)
        return jnp.broadcast_to(x, (capacity,)) if eqx.is_inexact_array(x) and not listed else x

    return jax.tree_util.tree_map_with_path(each, found)


def sample_room(capacity: int, samples: int) -> int:
    """Samples that each cell of a block of a `capacity` has room for, if it takes ``samples``."""
    return max(roomy(samples), SMALL * len(devices()) // capacity)


def roomy(count: int) -> int:
    """Return ``count`` rounded up by at most a quarter: counts that are nearly the same then share
    a compiled program.
    """
    step = max(1, (1 << (count - 1).bit_length()) // 8)
    return -(-count // step) * step


# on one core, at most: what a turn touches stays near in the caches, and few lanes idle at the end
LANES = {"float64": 64, "float32": 128}


# On an accelerator, which needs many to be busy: a turn of 65,536 takes less than twice as long as
# one of 16,384, and four times as many idle for want of cells (`docs/bench/speed_h200.md`)
WIDE = 1 << 16


CASES_PER_LANE = 8  # at least: the last cases of a block leave lanes empty


def lane_count(precision: str, cases: int) -> int:
    """Return how many trajectories of ``cases`` are in flight at a time on one device."""
    most = WIDE if on_accelerator() else LANES[precision]
    lanes = min(most, cases // CASES_PER_LANE)
    return max(1, lanes - lanes % 64 if lanes > 64 else lanes)  # whole vectors
