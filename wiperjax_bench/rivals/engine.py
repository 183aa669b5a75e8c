"""Our engine: its batch with refill is timed; events and samples come from its single solve."""

import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wiperjax import Result, Wiper
from wiperjax.engine.carry.problem import Integration, Recording, make_case
from wiperjax.engine.lanes import Pool, run_pool
from wiperjax.engine.solve import begin, solution
from wiperjax.engine.solve import run as run_one
from wiperjax.maps.cells.devices import dearest_first, lane_count
from wiperjax.vocabulary.parameters import PARAMETERS

from ..harness.interface import Answer
from ..scenes.scene import Scene, blade_fields

LOG = 1024  # events kept of a trajectory
RTOL = {  # of its workload, for the same accuracy in double precision
    (diffrax.Tsit5, "float64"): 1e-6,
    (diffrax.Dopri8, "float64"): 1e-5,
    (diffrax.Tsit5, "float32"): 1e-5,  # less is below its digits
}
MAX_STEPS = 50_000  # thirty times what an adaptive run takes: a blade that spends them creeps
# Python numbers: their terms are then left out of the program
PLAIN = {x.name: x.absent_at for x in PARAMETERS.values() if x.absent_at is not None}
FAILURES = [int(r) for r in Result if r not in (Result.FINISHED, Result.COLLAPSED)]


def arrays(scene: Scene, precision: str) -> tuple:
    """Return (wiper, position, velocity, scales) with the leaves that a compiled program takes.

    Attack angle, load and steady speed have one value a cell in every scene: one compilation then
    serves them all.
    """
    full = ("attack_angle", "normal_load")

    def leaf(value, spread=False):
        value = np.asarray(value, precision)
        return np.broadcast_to(value, (scene.cells,)) if spread else value

    blade: dict[str, Any] = {
        name: PLAIN[name]
        if name in PLAIN and np.all(value == PLAIN[name])
        else jax.tree.map(partial(leaf, spread=name in full), value)  # a law, or none, too
        for name, value in blade_fields(scene.wiper).items()
    }
    steady = type(scene.wiper.belt).__name__ == "SteadyBelt"
    belt = jax.tree.map(partial(leaf, spread=steady), scene.wiper.belt)
    start = scene.start.astype(precision).T
    scales = tuple(leaf(s, True) for s in scene.scales)
    return Wiper(belt=belt, **blade), (start[0], start[1]), (start[2], start[3]), scales


class Control(NamedTuple):
    """How the steps are chosen: numbers that the compiled program takes."""

    rtol: Any
    atol_share: Any  # absolute tolerances are this times rtol times the scene's scales
    max_step: Any  # s


@eqx.filter_jit
def batch(wiper, position, velocity, count, duration, control, scales, solver, precision, lanes):
    """Return (outcome, effort) of `run_pool`; ``solver``, ``precision``, ``lanes`` are static."""
    case = case_of(wiper, position, velocity, duration, control, scales, solver, precision)
    rows, _, effort = run_pool(Pool(case, count), lanes)
    return rows.tree(), effort


@eqx.filter_jit
def histories(wiper, position, velocity, duration, control, scales, times, solver, precision):
    """Return the `Solution` of every cell, with its events and its samples."""
    cells = position[0].shape[0]
    parts = (wiper, position, velocity, scales)
    varying, shared = eqx.partition(parts, lambda x: eqx.is_array(x) and x.shape == (cells,))

    def one(varying):
        wiper, position, velocity, scales = eqx.combine(varying, shared)
        case = case_of(
            wiper, position, velocity, duration, control, scales, solver, precision,
            Recording(times, max_events=LOG),
        )  # fmt: skip
        return solution(case.problem, run_one(case.problem, begin(case)))

    return jax.vmap(one)(varying)


def case_of(
    wiper, position, velocity, duration, control, scales, solver, precision, recording=None
):
    """Return the `Case` of a scene at a setting."""
    rtol = jnp.asarray(control.rtol, precision)
    share = jnp.asarray(control.atol_share, precision)
    atol = tuple((rtol * share * s,) * 2 for s in scales)
    return make_case(
        wiper,
        duration,
        (position, velocity),
        Integration(solver, rtol, atol, MAX_STEPS, control.max_step),
        recording or Recording(),
        dtype=jnp.dtype(precision),
    )


COARSE = {"float64": (1e-3, 1e-5, 1e-7, 1e-9), "float32": (1e-3, 1e-5)}  # enough for a curve
SETTINGS = {
    (diffrax.Tsit5, "float64", "scaled"): tuple(10.0**-k for k in range(3, 11)),
    (diffrax.Tsit5, "float32", "scaled"): tuple(10.0**-k for k in range(3, 7)),
    (diffrax.Tsit5, "float64", "fixed"): (1e-2, 3e-3, 1e-3, 3e-4, 1e-4),
    (diffrax.Dopri8, "float64", "scaled"): (1e-4, 1e-6, 1e-8, 1e-10),
    (diffrax.Bosh3, "float64", "scaled"): (1e-3, 1e-4, 1e-5, 1e-6),
}


class Engine:
    """The engine with one Runge-Kutta scheme in one precision, and one way to choose steps.

    ``control``: ``scaled``, the default (absolute tolerances rtol times the scene's scales);
    ``relative``, absolute tolerances a hundredth of that, so that small values count by their own
    size; ``fixed``, steps of a set share of the duration, cut short by events only.
    """

    def __init__(
        self, solver: type, precision: str = "float64", cores: int = 1, control: str = "scaled"
    ):
        self.solver, self.precision, self.cores = solver(), precision, cores
        self.control = control
        self.cells = 1 << 20 if control == "scaled" else 512  # the others are slow
        self.name = f"engine {solver.__name__}"
        self.name += f" {precision}" * (precision != "float64")
        self.name += {"scaled": "", "relative": ", relative control", "fixed": ", fixed steps"}[
            control
        ]
        self.name += f", {cores} cores" * (cores > 1)
        self.setting_name = "step / duration" if control == "fixed" else "rtol"
        self.settings = SETTINGS.get((type(self.solver), precision, control), COARSE[precision])

    @property
    def variant(self) -> tuple[type, str]:
        """Scheme and precision."""
        return type(self.solver), self.precision

    def available(self) -> str | None:
        return None

    def _control(self, duration: float, setting: float) -> Control:
        if self.control == "fixed":  # no error is too large
            numbers = 1e9, 1.0, setting * duration
        else:
            numbers = setting, 0.01 if self.control == "relative" else 1.0, np.inf
        return Control(*map(jnp.asarray, numbers))

    def compile(self, scene: Scene) -> float:
        """Compile what `prepare` of this scene would, at any setting; return the seconds."""
        started = time.perf_counter()
        self.prepare(scene, self.settings[0]).warm()
        return time.perf_counter() - started

    def prepare(self, scene: Scene, setting: float):
        """Return a call whose result is [(outcome, effort) of each core]; see ``answer``."""
        given = arrays(scene, self.precision)
        varying, shared = eqx.partition(
            given, lambda x: isinstance(x, np.ndarray) and x.shape == (scene.cells,)
        )
        shared = jax.tree.map(lambda x: jnp.asarray(x) if isinstance(x, np.ndarray) else x, shared)
        duration, control = jnp.asarray(scene.duration), self._control(scene.duration, setting)
        order = dearest_first(given[0], scene.cells)

        def share(i: int):
            """Cells of one core, dealt like cards; a program for one device, run by each thread."""
            mine = jax.tree.map(lambda x: jnp.asarray(x[order[i :: self.cores]]), varying)
            wiper, position, velocity, scales = eqx.combine(mine, shared)
            count = position[0].shape[0]
            lanes = lane_count(self.precision, count)
            fixed = (duration, control, scales, self.solver, self.precision, lanes)
            return lambda most: jax.block_until_ready(
                batch(wiper, position, velocity, jnp.asarray(most, jnp.int32), *fixed)
            )

        shares = [share(i) for i in range(self.cores)]

        def call():
            if len(shares) == 1:
                return [shares[0](scene.cells)]
            sizes = [len(range(i, scene.cells, self.cores)) for i in range(self.cores)]
            with ThreadPoolExecutor(len(shares)) as pool:
                return list(pool.map(lambda one, most: one(most), shares, sizes))

        def answer() -> Answer:
            wiper, position, velocity, scales = eqx.combine(
                jax.tree.map(jnp.asarray, varying), shared
            )
            found = jax.tree.map(
                np.asarray,
                histories(
                    wiper, position, velocity, duration, control, scales,
                    jnp.asarray(scene.sample_times), self.solver, self.precision,
                ),
            )  # fmt: skip
            counts = np.minimum(found.events.count, LOG)
            cut = lambda rows: [row[:n] for row, n in zip(rows, counts, strict=True)]
            return Answer(
                scene.sample_times,
                np.stack(found.samples.position, -1).astype(float),
                np.stack(found.samples.velocity, -1).astype(float),
                cut(found.events.time),
                cut(found.events.kind),
                np.isin(found.result, FAILURES),
                found.steps,
            )

        call.answer = answer
        call.warm = lambda: shares[0](1)  # compiles; computes hardly anything
        return call


SOLVERS = (diffrax.Tsit5, diffrax.Dopri5, diffrax.Dopri8, diffrax.Bosh3)
RIVALS = [
    *(Engine(s, p) for p in ("float64", "float32") for s in SOLVERS),
    *(Engine(diffrax.Tsit5, control=control) for control in ("relative", "fixed")),
]
