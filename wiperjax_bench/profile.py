"""`wiperjax bench profile`: where a lane-turn goes, and how far it is from the processor's limit.

Times come from runs of the whole batch with different numbers of cheap turns a round (the slope is
the cheap turn, the rest the full one) and from loops over its parts. Operations are counted in the
traced program (additions, multiplications, divisions, roots, exponentials; comparisons and selects
apart), and the limit is a measured loop of fused multiply-adds on as many lanes.
"""

import time
from typing import NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from wiperjax.lanes import Pool, run_pool
from wiperjax.state import vector_field

from . import measure, scenes
from .rivals import engine

FLOPS = {"add", "sub", "mul", "div", "sqrt", "rsqrt", "exp", "exp2", "log", "sin", "cos", "pow",
         "integer_pow", "neg", "add_any", "square", "asin", "tan", "log1p", "expm1"}  # fmt: skip
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


def find_loops(jaxpr, found=None):
    """Return the bodies of all loops, outermost first: (depth, primitive, body)."""
    found = [] if found is None else found

    def walk(jaxpr, depth):
        for equation in jaxpr.eqns:
            name = equation.primitive.name
            for key, value in equation.params.items():
                for part in _many(value):
                    body = _jaxpr(part)
                    if body is None:
                        continue
                    is_body = (name == "while" and key == "body_jaxpr") or name == "scan"
                    if is_body:
                        found.append((depth, name, body))
                    walk(body, depth + is_body)

    walk(jaxpr, 0)
    return found


def timed(call, repeats: int = 5) -> float:
    """Return the least processor time of a call [s], after one to compile."""
    call()
    costs = []
    for _ in range(repeats):
        start = time.process_time()
        call()
        costs.append(time.process_time() - start)
    return min(costs)


def peak(precision: str, lanes: int, chain: int = 64) -> float:
    """Return measured flop/s of one core on fused multiply-adds over ``lanes`` numbers."""

    @jax.jit
    def loop(x, a, b):
        def body(_, x):
            for _ in range(chain):
                x = tuple(y * a + b for y in x)
            return x

        return lax.fori_loop(0, 2000, body, x)

    x = tuple(jnp.full(lanes, 1.0 + i, precision) for i in range(4))
    a, b = jnp.full(lanes, 0.999, precision), jnp.full(lanes, 1e-3, precision)
    seconds = timed(lambda: jax.block_until_ready(loop(x, a, b)))
    return 2 * 4 * lanes * chain * 2000 / seconds


def right_hand_side(precision: str, lanes: int) -> tuple[float, Work]:
    """Return (seconds, work per lane) of the vector field alone, in a loop."""
    scene = scenes.workload(lanes)
    wiper, position, velocity, _ = engine.arrays(scene, precision)
    wiper, position = jax.tree.map(
        lambda x: jnp.asarray(x) if isinstance(x, np.ndarray) else x, (wiper, position)
    )
    velocity = tuple(jnp.asarray(v) for v in velocity)
    wiper = wiper.prepared()
    regime = jnp.full(lanes, 1, jnp.int32)
    t = jnp.zeros(lanes)
    tiny = jnp.asarray(1e-9, precision)

    def once(y):
        rate = vector_field(t, y, (wiper, regime))
        return jax.tree.map(lambda a, b: a + tiny * b.astype(a.dtype), y, rate)

    turns = 2000
    loop = jax.jit(lambda y: lax.fori_loop(0, turns, lambda _, y: once(y), y))
    y = (position, velocity)
    seconds = timed(lambda: jax.block_until_ready(loop(y))) / turns / lanes
    work = count(jax.make_jaxpr(once)(y).jaxpr)
    return seconds, Work(*(v // lanes for v in work))


def batch(precision: str, flows: int, cells: int):
    """Return (callable, jaxpr, lanes) of a batch with ``flows`` cheap turns."""
    scene = scenes.workload(cells, 0.02)
    wiper, position, velocity, scales = jax.tree.map(
        lambda x: jnp.asarray(x) if isinstance(x, np.ndarray) else x,
        engine.arrays(scene, precision),
    )
    lanes = engine.lanes_for(precision, cells)
    number = jnp.asarray(cells, jnp.int32)
    leaves, tree = jax.tree.flatten((wiper, position, velocity, scales))
    arrays = [i for i, x in enumerate(leaves) if isinstance(x, jax.Array)]

    def program(given):
        full = list(leaves)
        for i, x in zip(arrays, given, strict=True):
            full[i] = x
        wiper, position, velocity, scales = jax.tree.unflatten(tree, full)
        problem, q, v, start = engine._problem(
            wiper, position, velocity, scene.duration, 1e-6, scales, diffrax.Tsit5(), precision
        )
        outcome, _, effort = run_pool(Pool(problem, q, v, start, number), lanes, flows)
        return outcome.steps, outcome.events, effort

    given = [leaves[i] for i in arrays]
    compiled = jax.jit(program)
    jaxpr = jax.make_jaxpr(program)(given).jaxpr
    return (lambda: jax.block_until_ready(compiled(given))), jaxpr, lanes


def run(precision: str = "float64", quick: bool = False, say=print) -> str:
    """Return the profile as text (one core, processor time)."""
    cells = 512 if quick else 4096
    lanes = engine.lanes_for(precision, cells)
    rows, per_turn = [], {}
    body = None
    for flows in (2, 4) if quick else (1, 2, 4, 6):
        call, jaxpr, lanes = batch(precision, flows, cells)
        seconds = timed(call, 2)
        steps, events, effort = jax.tree.map(np.asarray, call())
        executed, useful = int(effort.executed), int(effort.useful)
        say(f"{flows} cheap turns a round: {seconds / cells * 1e6:.1f} us a trajectory")
        # a round executes its cheap turns and one full turn, however the engine counts them
        counted = executed / lanes
        whole = flows + 1 if abs(counted % (flows + 1)) < abs(counted % flows) else flows
        rounds = counted / whole
        per_turn[flows] = seconds / rounds / lanes
        rows.append((flows, seconds / cells, useful / executed, steps.mean(), events.mean()))
        body = jaxpr
    flows = np.array(list(per_turn))
    slope, rest = np.polyfit(flows, np.array(list(per_turn.values())), 1)
    loops = find_loops(body)
    inner = max((count(b) for d, _, b in loops if d >= 1), key=lambda w: w.flops)
    outer = max((count(b) for d, _, b in loops if d == 0), key=lambda w: w.flops)
    cheap = Work(*(v // lanes for v in inner))
    full = Work(*((a - b) // lanes for a, b in zip(outer, inner, strict=True)))
    say("right-hand side alone")
    rhs_seconds, rhs = right_hand_side(precision, lanes)
    top = peak(precision, lanes)
    stages = 6  # of Tsit5, first same as last
    text = [
        f"# Profile, {precision}, {lanes} lanes on one core of {measure.machine()}",
        "",
        "Processor time; rtol 1e-6, Tsit5, 20 ms of the speed workload.",
        "",
        "| cheap turns a round | us a trajectory | occupancy | steps | events |",
        "|---|---|---|---|---|",
        *(f"| {f} | {s * 1e6:.1f} | {o:.2f} | {a:.0f} | {e:.1f} |" for f, s, o, a, e in rows),
        "",
        "| part of a round, per lane | ns | operations | comparisons | Gflop/s | of peak |",
        "|---|---|---|---|---|---|",
    ]
    for name, seconds, work in (
        ("cheap turn (one trial step)", slope, cheap),
        ("of it: right-hand sides, 6", stages * rhs_seconds, Work(*(stages * v for v in rhs))),
        ("full turn and refill (events, regimes)", rest, full),
    ):
        speed = work.flops / seconds if seconds > 0 else np.nan
        text.append(
            f"| {name} | {seconds * 1e9:.1f} | {work.flops} | {work.choices} | "
            f"{speed / 1e9:.2f} | {speed / top:.1%} |"
        )
    intensity = cheap.flops / cheap.memory if cheap.memory else np.nan
    text += [
        "",
        f"Peak: {top / 1e9:.1f} Gflop/s in a loop of fused multiply-adds over {lanes} lanes. A "
        "division, a root or an exponential counts as one operation but costs many: the share of "
        "peak is a lower bound on how busy the units are.",
        f"A cheap turn names {cheap.memory} bytes a lane of operands and results "
        f"({intensity:.2f} operations a byte, were none of them kept in registers); the state of "
        f"{lanes} lanes fits the second-level cache.",
        "",
    ]
    return "\n".join(text)
