"""A scalar event-driven loop compiled by numba: one thread, and all cores by `prange`."""

from typing import Any

import numpy as np

from wiperjax import Event, TrapezoidBelt, WipingBelt

from ..harness.interface import Answer, NotForThisScene
from ..scenes.scene import Scene

FAILED = 2  # result codes from here on are failures
ATTEMPTS = 10**7  # most steps of a cell, rejected ones too
ZENO_TIME = 1e-8  # s


def cells_of(scene: Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return (blades, motions, breaks, kinds of breaks) as `scalar.batch` wants them."""
    p = scene.parameters()
    if np.any(p["hinge_mass"]) or np.any(p["hinge_damping"]):
        raise NotForThisScene("the compiled equations are those without hinge_mass and its damping")
    length, alpha = p["lip_length"], p["attack_angle"]

    def place(angle, beyond):
        inside = np.abs(angle) < np.pi / 2
        return np.where(inside, length * np.sin(np.where(inside, angle, 0.0)), beyond)

    blades = np.stack(
        [
            p["tip_mass"],
            length,
            p["support_stiffness"],
            p["support_damping"],
            p["neck_stiffness"],
            p["shoulder_stiffness"] - p["neck_stiffness"],
            p["shoulder_angle"],
            alpha,
            p["normal_load"],
            p["restitution"],
            p["mu_static"],
            p["mu_minimum"],
            1 / p["stribeck_speed"],
            p["stribeck_shape"],
            p["viscous_slope"],
            length * np.cos(alpha),
            place(alpha + p["shoulder_angle"], 2 * length),
            place(alpha - p["shoulder_angle"], -2 * length),
            length * np.sin(p["collapse_angle"]),
            p["tip_mass"] * p["gravity"],
        ],
        axis=1,
    )
    return blades, *_motions(scene, p)


def _motions(scene: Scene, p) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the smooth pieces of V(t): their coefficients, their ends, and what the ends are."""
    belt, cells = scene.wiper.belt, scene.cells
    if not isinstance(belt, WipingBelt | TrapezoidBelt):
        motion = np.zeros((cells, 1, 6))
        motion[:, 0, 1] = p["belt_speed"]
        return motion, np.full((cells, 1), np.inf), np.zeros(1, np.int64)
    for name in ("frequency", "phase", "ramp"):
        if np.ptp(p.get(f"belt_{name}", 0.0)) > 0:
            raise NotForThisScene(f"the cells must share the belt's {name}")
    f, shift = float(p["belt_frequency"][0]), float(p["belt_phase"][0]) / (2 * np.pi)
    halves = np.arange(np.floor(2 * shift) - 1, np.ceil(2 * (f * scene.duration + shift)) + 2)
    zeros = (0.5 * halves - shift) / f
    turning, corner = int(Event.BELT_REVERSAL), int(Event.BELT_KINK)
    if isinstance(belt, WipingBelt):
        ends, kinds = zeros, np.full(zeros.shape, turning)
    else:
        ramp = float(p["belt_ramp"][0])
        ends = np.stack([zeros - 0.5 * ramp, zeros, zeros + 0.5 * ramp], axis=1).ravel()
        kinds = np.tile([corner, turning, corner], len(zeros))
    inside = (ends > 0) & (ends < scene.duration)
    ends, kinds = ends[inside], kinds[inside]
    motion = np.zeros((cells, len(ends) + 1, 6))
    edges = np.concatenate([[0.0], ends, [scene.duration]])
    for i, middle in enumerate(0.5 * (edges[1:] + edges[:-1])):
        if isinstance(belt, WipingBelt):
            motion[:, i, 3] = p["belt_amplitude"]
            motion[:, i, 4:] = 2 * np.pi * f, float(p["belt_phase"][0])
            continue
        at = np.argmin(np.abs(zeros - middle))
        rising = 1.0 if halves[at] % 2 == 0 else -1.0
        if abs(middle - zeros[at]) < 0.5 * ramp:
            motion[:, i, 0] = zeros[at]
            motion[:, i, 2] = rising * 2 * p["belt_speed"] / ramp
        else:
            motion[:, i, 1] = rising * np.sign(middle - zeros[at]) * p["belt_speed"]
    return motion, np.tile(np.concatenate([ends, [np.inf]]), (cells, 1)), np.append(kinds, 0)


def prepared(
    scene: Scene,
    rtol: float,
    threads: int | None = 1,
    *,
    events: int = 0,
    mark: float = np.inf,
    samples: int = 0,
    window: float = 0.0,
) -> Any:
    """Return a call that computes all cells of ``scene`` and returns their `scalar.batch.Record`.

    ``threads`` None: all cores; ``events``: length of each cell's log; statistics are gathered
    from ``mark`` [s] on, and x at the ends of ``samples`` parts of ``window`` [s] after it.
    """
    import numba

    from ..scalar import batch
    from ..scalar.statistics import SUMS

    n = scene.cells
    sx, sv = (np.broadcast_to(np.asarray(s, float), (n,)).copy() for s in scene.scales)
    blades, motions, breaks, kinds = cells_of(scene)
    cells = batch.Cells(blades, motions, breaks, kinds, scene.start, sx, sv, scene.sample_times)
    task = batch.Task(
        float(scene.duration), rtol, ZENO_TIME, ATTEMPTS, float(mark), window / max(samples, 1)
    )
    kernel = batch.one_by_one if threads == 1 else batch.on_all_cores
    all_threads = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]

    def call():
        record = batch.Record(
            np.zeros(n, np.int64),
            np.zeros(n, np.int64),
            np.zeros(n, np.int64),
            np.zeros(n, np.int64),
            np.zeros((n, 5)),
            np.full((n, len(scene.sample_times), 4), np.nan),
            np.full((n, events), np.nan),
            np.zeros((n, events), np.int8),
            np.zeros((n, samples + 1 if samples else 0)),
            np.zeros((n, SUMS)),
        )
        if threads != 1:
            numba.set_num_threads(threads or all_threads)
        kernel(cells, task, record)
        return record

    return call


class Compiled:
    """The scalar loop as a rival."""

    setting_name = "rtol"
    settings = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
    cells = 1 << 20

    def __init__(self, name: str, threads: int | None):
        self.name, self.threads = name, threads

    def available(self) -> str | None:
        try:
            import numba  # noqa: F401
        except ImportError:
            return "numba is not installed (pip install numba)"
        return None

    def prepare(self, scene: Scene, setting: float):
        call = prepared(scene, setting, self.threads, events=4096 if scene.cells < 1024 else 0)

        def answer() -> Answer:
            r = prepared(scene, setting, self.threads, events=4096)()
            counts = np.minimum(r.events, r.event_times.shape[1])
            return Answer(
                scene.sample_times,
                r.taken[..., :2],
                r.taken[..., 2:],
                [t[:c] for t, c in zip(r.event_times, counts, strict=True)],
                [k[:c] for k, c in zip(r.event_kinds, counts, strict=True)],
                r.result >= FAILED,
                r.attempts,
            )

        call.answer = answer
        return call


RIVALS = [Compiled("numba scalar loop", 1)]
