"""`wiperjax bench profile`: where a lane-turn goes, and how far it is from the processor's limit.

Parts of the engine, each larger than the one before, run in loops of their own over lanes in the
middle of their motion; the difference of two is what the larger one adds. The rest of a whole batch
(refill, samples, outcomes) is what its rounds do not account for. Operations are counted in the
traced program (additions, multiplications, divisions, roots; comparisons and selects
apart); the limits are measured loops: fused multiply-adds in registers, and a sum of two arrays.

The parts are functions inside the engine. One that is no longer there is reported as not measured.
"""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from . import measure, scenes
from .rivals import engine
from .rivals.engine import RTOL

FLOPS = {"add", "sub", "mul", "div", "sqrt", "rsqrt", "exp", "exp2", "log", "sin", "cos", "pow",
         "integer_pow", "neg", "add_any", "square", "round", "floor", "asin", "tan", "log1p",
         "expm1"}  # fmt: skip
CHOICES = {"select_n", "max", "min", "lt", "le", "gt", "ge", "eq", "ne", "and", "or", "not",
           "abs", "sign", "clamp", "is_finite"}  # fmt: skip


class Work(NamedTuple):
    """Operations of one execution of a program on its arrays, loops counted once."""

    flops: int
    choices: int
    memory: int  # bytes of all operands and results, were nothing kept in registers

    def __add__(self, other):  # type: ignore[override]
        return Work(*(a + b for a, b in zip(self, other, strict=True)))


def count(jaxpr) -> Work:
    """Return the work of a jaxpr and of everything it calls; the body of a loop counts once."""
    total = Work(0, 0, 0)
    for equation in jaxpr.eqns:
        inner = [_jaxpr(p) for v in equation.params.values() for p in _many(v)]
        inner = [p for p in inner if p is not None]
        if inner:
            for part in inner:
                total += count(part)
            continue
        out = equation.outvars[0].aval
        size = int(np.prod(getattr(out, "shape", ())))
        floating = jnp.issubdtype(getattr(out, "dtype", bool), jnp.floating)
        name = equation.primitive.name
        moved = sum(
            int(np.prod(v.aval.shape)) * v.aval.dtype.itemsize
            for v in (*equation.invars, *equation.outvars)
            if hasattr(v.aval, "shape")
        )
        total += Work(
            size * (name in FLOPS and floating), size * (name in CHOICES), moved * (size > 1)
        )
    return total


def _many(value):
    return value if isinstance(value, tuple | list) else (value,)


def _jaxpr(value):
    value = getattr(value, "jaxpr", value)
    return value if hasattr(value, "eqns") else None


def timed(call, repeats: int = 5) -> float:
    """Return the least processor time of a call [s], after one to compile."""
    call()
    costs = []
    for _ in range(repeats):
        start = time.process_time()
        call()
        costs.append(time.process_time() - start)
    return min(costs)


def peak(precision: str) -> float:
    """Return measured flop/s of one core on fused multiply-adds: the best of several loops.

    They differ in how many follow each other on a number, and over how many numbers: too few wait
    for memory, too many for each other.
    """

    def speed(n: int, chain: int) -> float:
        turns = int(1e8 / n / chain)

        @jax.jit
        def loop(x, a, b):
            def body(_, x):
                for _ in range(chain):
                    x = x * a + b
                return x

            return lax.fori_loop(0, turns, body, x)

        given = jnp.ones(n, precision), jnp.asarray(0.999, precision), jnp.asarray(1e-3, precision)
        seconds = timed(lambda: jax.block_until_ready(loop(*given)), 3)
        return 2 * n * chain * turns / seconds

    return max(speed(n, chain) for n in (1024, 4096) for chain in (8, 16, 32))


def bandwidth(size: int) -> float:
    """Return measured bytes/s of one core that adds two float64 arrays of ``size`` bytes."""
    n = size // 8

    @jax.jit
    def loop(x, y):
        return lax.fori_loop(0, turns, lambda _, p: (p[1], p[0] + p[1]), (x, y))

    turns = max(20, int(2e9 / size))
    x, y = jnp.full(n, 1e-9), jnp.full(n, 1e-9)
    return 3 * size * turns / timed(lambda: jax.block_until_ready(loop(x, y)))


# --- the engine's parts ---------------------------------------------------------------------------


def problem_of(scene: scenes.Scene, precision: str):
    """Return (problem, position, velocity, start) of a scene as `bench speed` runs it."""
    wiper, position, velocity, scales = jax.tree.map(
        lambda x: jnp.asarray(x) if isinstance(x, np.ndarray) else x,
        engine.arrays(scene, precision),
    )
    control = engine.Control(*map(jnp.asarray, (RTOL[diffrax.Tsit5, precision], 1.0, np.inf)))
    return engine._problem(
        wiper, position, velocity, scene.duration, control, scales, diffrax.Tsit5(), precision
    )


class Bench:
    """Lanes in the middle of their motion, and loops over parts of the engine on them."""

    def __init__(self, precision: str, lanes: int, rounds: int = 150):
        from wiperjax.start import initial_state
        from wiperjax.step import flow, jump

        # so long that no lane ends
        self.problem, q, v, start = problem_of(scenes.workload(lanes, 10.0), precision)
        self.lanes, self.precision = lanes, precision
        parts, self.tree = jax.tree.flatten((self.problem, q, v, start))
        self.where = [i for i, x in enumerate(parts) if isinstance(x, jax.Array)]
        self.leaves = parts
        self.given = [parts[i] for i in self.where]

        def turn(problem, state):
            for _ in range(3):
                state = flow(problem, state)
            return jump(problem, state)

        def begin(given):
            problem, q, v, start = self.rebuild(given)
            state = initial_state(problem, q, v, jnp.broadcast_to(start, (lanes,)))
            return lax.fori_loop(0, rounds, lambda _, s: turn(problem, s), state)

        self.state = jax.jit(begin)(self.given)

    def rebuild(self, given):
        full = list(self.leaves)
        for i, x in zip(self.where, given, strict=True):
            full[i] = x
        return jax.tree.unflatten(self.tree, full)

    def measure(self, part: Callable, turns: int) -> tuple[float, Work]:
        """Return (seconds, work) a lane of ``part(problem, state)``, which returns a state.

        If it returns something else, all of that is kept alive by comparisons, and the state stays.
        """

        def once(given, state):
            problem = self.rebuild(given)[0]
            found = part(problem, state)
            if isinstance(found, type(state)):
                return found
            huge = jnp.zeros(self.lanes, bool)
            for leaf in jax.tree.leaves(found):
                if getattr(leaf, "shape", ()) == (self.lanes,):
                    huge = huge | (leaf > 1e30 if leaf.dtype != bool else leaf & (huge | leaf))
            x = state.position[0]
            return state._replace(position=(jnp.where(huge, x * 1.0000001, x), *state.position[1:]))

        @jax.jit
        def loop(given, state):
            return lax.fori_loop(0, turns, lambda _, s: once(given, s), state)

        seconds = timed(lambda: jax.block_until_ready(loop(self.given, self.state)), 3)
        work = count(jax.make_jaxpr(once)(self.given, self.state).jaxpr)
        return seconds / turns / self.lanes, Work(*(v // self.lanes for v in work))


def _local(problem, state):
    return problem.system.on_piece(state.piece).on_sides(state.sides)


def right_hand_sides(problem, state):
    """Six evaluations of the vector field: what a step of Tsit5 needs."""
    from wiperjax.barrier import keep
    from wiperjax.state import vector_field

    y = (state.position, state.velocity)
    rate = state.rate
    tiny = jnp.asarray(1e-9, state.position[0].dtype)
    for _ in range(6):
        y = keep(jax.tree.map(lambda a, b: a + tiny * b.astype(a.dtype), y, rate))
        rate = keep(vector_field(state.time, y, (_local(problem, state), state.regime)))
    return rate


def stages(problem, state):
    """The Runge-Kutta step: right-hand sides and weighted sums."""
    from wiperjax.stages import rk_step
    from wiperjax.state import TERM, vector_field

    system = _local(problem, state)
    args = (system, state.regime)
    y0 = (state.position, state.velocity)
    arrive = lambda t, y: (vector_field(t, y, args), ())
    step = rk_step(problem.solver, TERM, state.time, y0, state.step, state.rate, args, arrive)
    return step.y1, step.error, step.stages, step.rate1


def control(problem, state):
    """The step, its error and the next step size."""
    from wiperjax.control import error_norm, rounding_share, step_factor
    from wiperjax.stages import rk_step
    from wiperjax.state import TERM, vector_field

    args = (_local(problem, state), state.regime)
    y0 = (state.position, state.velocity)
    arrive = lambda t, y: (vector_field(t, y, args), ())
    step = rk_step(problem.solver, TERM, state.time, y0, state.step, state.rate, args, arrive)
    share = rounding_share(problem, state, step, state.step)
    error = error_norm(problem, state, step, state.step, share)
    growth = state.step / state.last_step
    factor = step_factor(error + 1e-8, state.last_error, growth, error <= 1, 5)
    return step.y1, step.stages, step.rate1, state.step * factor


def flow(problem, state):
    """The whole flow: the same, the first event placed, the step committed, statistics."""
    from wiperjax.step import flow

    return flow(problem, state)


def jump(problem, state):
    """The event that is due: impact, reset, new regime."""
    from wiperjax.step import jump

    return jump(problem, state)


EVENTS = "events: detection, location, commit, statistics"
# name, what it contains, the part whose cost is taken off
LADDER: tuple[tuple[str, Callable, str | None], ...] = (
    ("right-hand sides (6)", right_hand_sides, None),
    ("stage sums", stages, "right-hand sides (6)"),
    ("step control", control, "stage sums"),
    (EVENTS, flow, "step control"),
    ("change of regime, a jump", jump, None),
)


def whole(precision: str, cells: int, lanes: int, flows: int) -> tuple[float, Any, Any]:
    """Return (seconds, outcome, effort) of a batch of ``cells``, 20 ms each."""
    from wiperjax.lanes import Pool, run_pool

    problem, q, v, start = problem_of(scenes.workload(cells, 0.02), precision)
    parts, tree = jax.tree.flatten((problem, q, v, start))
    where = [i for i, x in enumerate(parts) if isinstance(x, jax.Array)]

    @jax.jit
    def program(given):
        full = list(parts)
        for i, x in zip(where, given, strict=True):
            full[i] = x
        problem, q, v, start = jax.tree.unflatten(tree, full)
        pool = Pool(problem, q, v, start, jnp.asarray(cells, jnp.int32))
        outcome, _, effort = run_pool(pool, lanes, flows)
        return (outcome.steps, outcome.events), effort

    given = [parts[i] for i in where]
    seconds = timed(lambda: jax.block_until_ready(program(given)), 3)
    return seconds, *jax.tree.map(np.asarray, program(given))


def run(precision: str = "float64", quick: bool = False, say=print) -> str:
    """Return the profile as text (one core, processor time)."""
    from wiperjax.cells import LANES
    from wiperjax.lanes import flows_per_jump

    lanes = 64 if quick else LANES[precision]
    cells, turns = 64 * lanes, 200 if quick else 8000
    flows = flows_per_jump(diffrax.Tsit5())
    top = peak(precision)
    streams = {name: bandwidth(size) for name, size in (("32 kB", 1 << 15), ("512 kB", 1 << 19))}
    say(f"peak {top / 1e9:.0f} Gflop/s")
    lines, found = [], {}
    try:
        bench = Bench(precision, lanes)
    except Exception as error:  # the engine's inside has changed: the whole is still measured
        bench, lines = None, [f"Parts not measured: {_reason(error)}.", ""]
    ladder = [row for row in LADDER if not quick or row[2] is None]  # few programs
    for name, part, _ in ladder if bench else ():
        try:
            found[name] = bench.measure(part, turns)  # type: ignore[union-attr]
            say(f"{name}: {found[name][0] * 1e9:.1f} ns")
        except Exception as error:
            lines.append(f"{name}: not measured, {_reason(error)}.")
    seconds, (steps, events), effort = whole(precision, cells, lanes, flows)
    executed, useful = int(effort.executed), int(effort.useful)
    return "\n".join(
        [
            f"# Profile, {precision}, {lanes} lanes on one core of {measure.machine()}",
            "",
            f"Processor time; rtol {RTOL[diffrax.Tsit5, precision]:.0e}, Tsit5, {cells} "
            f"trajectories of 20 ms of the speed workload: {seconds / cells * 1e6:.1f} us each, "
            f"{steps.mean():.0f} trial steps and {events.mean():.1f} events each, occupancy "
            f"{useful / executed:.2f}, {seconds / executed * 1e9:.1f} ns a lane-turn, all in "
            f"all. {flows} flows a jump. Load average {measure.load():.1f}.",
            "",
            *shares(found, seconds / executed, flows),
            *roofline(found, top, streams, precision),
            *lines,
            "",
        ]
    )


def _reason(error: Exception) -> str:
    return f"{type(error).__name__}: {(str(error).splitlines() or [''])[0][:100]}"


def shares(found: dict, lane_turn: float, flows: int) -> list[str]:
    """Return the table of where a lane-turn (a flow, with its share of the rest) goes."""
    rows = ["| part, per lane-turn | ns | share |", "|---|---|---|"]
    left = lane_turn
    for name, _, less in LADDER:
        if name not in found or (less is not None and less not in found):
            continue
        cost = found[name][0] - (found[less][0] if less else 0.0)
        if name.endswith("a jump"):
            name, cost = f"{name} ({flows} flows share one)", cost / flows
        left -= cost
        rows.append(f"| {name} | {cost * 1e9:.1f} | {cost / lane_turn:.0%} |")
    rest = "bookkeeping: refill, outcomes, and the error of this sum"
    if len(found) < len(LADDER):
        rest = "everything that was not measured by itself"
    rows.append(f"| {rest} | {left * 1e9:.1f} | {left / lane_turn:.0%} |")
    rows.append(f"| all | {lane_turn * 1e9:.1f} | 100% |")
    return [*rows, ""]


TITLES = {EVENTS: "flow (the whole of it)"}


def roofline(found: dict, top: float, streams: dict[str, float], precision: str) -> list[str]:
    """Return the table of operations and bytes against the measured limits."""
    rows = [
        "| a lane's | operations | comparisons, selects | bytes | ns | Gflop/s | of peak | GB/s |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in ("right-hand sides (6)", EVENTS, "change of regime, a jump"):
        if name not in found:
            continue
        seconds, work = found[name]
        title = TITLES.get(name, name)
        rows.append(
            f"| {title} | {work.flops} | {work.choices} | {work.memory} | {seconds * 1e9:.1f} | "
            f"{work.flops / seconds / 1e9:.2f} | {work.flops / seconds / top:.1%} | "
            f"{work.memory / seconds / 1e9:.1f} |"
        )
    speeds = ", ".join(f"{name}: {v / 1e9:.0f} GB/s" for name, v in streams.items())
    rows += [
        "",
        f"Measured limits of this core: {top / 1e9:.1f} Gflop/s ({precision}, fused multiply-adds "
        f"in registers), sum of two arrays of {speeds}. A division or a root "
        "counts as one operation but costs many, and comparisons and selects use the same units "
        "uncounted: the share of peak is a lower bound on how busy they are. Bytes are all "
        "operands and results that the traced program names, were none of them kept in registers: "
        "an upper bound.",
    ]
    if EVENTS in found:
        seconds, work = found[EVENTS]
        operations = work.flops + work.choices
        least = 2 * operations / top  # a fused operation counts two in the peak
        rows.append(
            f"A flow issues {operations} vector operations a lane, which at the measured rate of "
            f"fused multiply-adds take {least * 1e9:.1f} ns; it takes {seconds * 1e9:.1f} ns: "
            f"{least / seconds:.0%} of that rate (additions and comparisons have units of their "
            "own on some processors: more than all of it is possible)."
        )
    return [*rows, ""]
