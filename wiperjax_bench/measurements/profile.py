"""`wiperjax bench profile`: where a lane-turn goes, and how far it is from the processor's limit.

Parts of the engine, each larger than the one before, run in loops of their own over lanes in the
middle of their motion; the difference of two is what the larger one adds. The rest of a whole batch
(refill, samples, outcomes) is what its rounds do not account for. Operations are counted in the
traced program; the limits are measured loops: fused multiply-adds in registers, and a sum of two
arrays.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from wiperjax.engine.carry.start import initial_state
from wiperjax.engine.lanes import Pool, flows_per_jump, run_pool
from wiperjax.engine.step import flow, jump
from wiperjax.maps.cells.devices import LANES

from ..harness import measure
from ..rivals import engine
from ..rivals.engine import RTOL
from ..scenes.families import workload
from ..scenes.scene import Scene
from .engine_parts import LADDER
from .operations import Work, count
from .processor import bandwidth, least_time, peak


class Profile(NamedTuple):
    """One core, processor time; seconds and work are of one lane."""

    precision: str
    lanes: int
    flows: int  # a jump
    parts: dict[str, tuple[float, Work]]  # by the names of `LADDER`
    peak: float  # flop/s
    streams: dict[str, float]  # size of two arrays that are added -> bytes/s
    cells: int  # trajectories of the whole batch
    seconds: float  # of the whole batch
    steps: float  # trial steps of a trajectory
    events: float
    executed: int  # lane-turns
    useful: int  # of them not on an idle lane
    machine: str
    load: float  # average of the last minute


def case_of(scene: Scene, precision: str):
    """Return the `Case` of a scene as `bench speed` runs it."""
    wiper, position, velocity, scales = jax.tree.map(
        lambda x: jnp.asarray(x) if isinstance(x, np.ndarray) else x,
        engine.arrays(scene, precision),
    )
    control = engine.Control(*map(jnp.asarray, (RTOL[diffrax.Tsit5, precision], 1.0, np.inf)))
    return engine.case_of(
        wiper, position, velocity, scene.duration, control, scales, diffrax.Tsit5(), precision
    )


class Bench:
    """Lanes in the middle of their motion, and loops over parts of the engine on them."""

    def __init__(self, precision: str, lanes: int, rounds: int = 150):
        self.lanes = lanes
        self.case = case_of(workload(lanes, 10.0), precision)  # so long that no lane ends
        flows = flows_per_jump(self.case.problem.solver)

        def turn(problem, state):
            for _ in range(flows):
                state = flow(problem, state)
            return jump(problem, state)

        @eqx.filter_jit
        def begin(case):
            problem, q, v, start = case
            state = initial_state(problem, q, v, jnp.broadcast_to(start, (lanes,)))
            return lax.fori_loop(0, rounds, lambda _, s: turn(problem, s), state)

        self.state = begin(self.case)

    def measure(self, part: Callable, turns: int) -> tuple[float, Work]:
        """Return (seconds, work) a lane of ``part(problem, state)``, which returns a state.

        If it returns something else, all of that is kept alive by comparisons, and the state stays.
        """

        def once(problem, state):
            found = part(problem, state)
            if isinstance(found, type(state)):
                return found
            huge = jnp.zeros(self.lanes, bool)
            for leaf in jax.tree.leaves(found):
                if getattr(leaf, "shape", ()) == (self.lanes,):
                    huge = huge | (leaf > 1e30 if leaf.dtype != bool else leaf & (huge | leaf))
            x = state.position[0]
            return state._replace(position=(jnp.where(huge, x * 1.0000001, x), *state.position[1:]))

        @eqx.filter_jit
        def loop(problem, state):
            return lax.fori_loop(0, turns, lambda _, s: once(problem, s), state)

        given = self.case.problem, self.state
        seconds = least_time(lambda: jax.block_until_ready(loop(*given)), 3)
        work = count(eqx.filter_make_jaxpr(once)(*given)[0].jaxpr)
        return seconds / turns / self.lanes, Work(*(v // self.lanes for v in work))


def whole(precision: str, cells: int, lanes: int, flows: int) -> tuple[float, Any, Any]:
    """Return (seconds, outcome, effort) of a batch of ``cells``, 20 ms each."""
    case = case_of(workload(cells, 0.02), precision)

    @eqx.filter_jit
    def program(case):
        rows, _, effort = run_pool(Pool(case, jnp.asarray(cells, jnp.int32)), lanes, flows)
        outcome = rows.tree()
        return (outcome.steps, outcome.events), effort

    seconds = least_time(lambda: jax.block_until_ready(program(case)), 3)
    return seconds, *jax.tree.map(np.asarray, program(case))


def run(precision: str = "float64", quick: bool = False, say=print) -> Profile:
    """Return the profile of the engine; ``quick``: few lanes, and few of the parts."""
    lanes = 64 if quick else LANES[precision]
    cells, turns = 64 * lanes, 200 if quick else 8000
    flows = flows_per_jump(diffrax.Tsit5())
    top = peak(precision)
    streams = {name: bandwidth(size) for name, size in (("32 kB", 1 << 15), ("512 kB", 1 << 19))}
    say(f"peak {top / 1e9:.0f} Gflop/s")
    bench, parts = Bench(precision, lanes), {}
    for name, part, less in LADDER:
        if quick and less is not None:  # few programs
            continue
        parts[name] = bench.measure(part, turns)
        say(f"{name}: {parts[name][0] * 1e9:.1f} ns")
    seconds, (steps, events), effort = whole(precision, cells, lanes, flows)
    return Profile(
        precision, lanes, flows, parts, top, streams, cells, seconds, float(steps.mean()),
        float(events.mean()), int(effort.executed), int(effort.useful), measure.machine(),
        measure.load(),
    )  # fmt: skip
