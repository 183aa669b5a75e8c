"""`scipy.integrate.solve_ivp` with events, phase by phase: what most people would write.

The right-hand sides and reset maps are the compiled ones of `scalar`, which flatters scipy; the
stepping, the event detection and the location are its own (`scipy_trajectory`).
"""

import numpy as np

from ..harness.interface import Answer
from ..scenes.scene import Scene
from .compiled import cells_of


def every_cell(scene: Scene) -> list:
    """Return the `scipy_tip.Cell` of each cell."""
    from ..scalar import model
    from .scipy_tip import Cell

    blades, motions, breaks, kinds = cells_of(scene)
    scales = [np.broadcast_to(np.asarray(s, float), (scene.cells,)) for s in scene.scales]
    return [
        Cell(
            model.Blade(*blades[i].tolist()),
            [model.Motion(*piece) for piece in motions[i].tolist()],
            breaks[i].tolist(),
            kinds.tolist(),
            scene.start[i].tolist(),
            (float(scales[0][i]), float(scales[1][i])),
        )
        for i in range(scene.cells)
    ]


def answer(scene: Scene, found: list) -> Answer:
    """Return what `phase_by_phase.trajectory` found of every cell as an `Answer`."""
    samples = np.stack([f.samples for f in found])
    return Answer(
        scene.sample_times, samples[..., :2], samples[..., 2:],
        [np.array(f.event_times) for f in found],
        [np.array(f.event_kinds) for f in found],
        np.array([f.stopped for f in found]), np.array([f.steps for f in found]),
    )  # fmt: skip


class Phases:
    """One solve_ivp call a phase, restarted after every event."""

    setting_name = "rtol"
    settings = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
    cells = 3

    def __init__(self, method: str = "RK45"):
        self.method, self.name = method, f"scipy solve_ivp {method}"

    def available(self) -> str | None:
        try:
            import numba  # noqa: F401
        except ImportError:
            return "numba is not installed (its right-hand sides are used)"
        return None

    def prepare(self, scene: Scene, setting: float):
        from .phase_by_phase import trajectory
        from .scipy_trajectory import solve

        cells = every_cell(scene)

        def call() -> Answer:
            stage = solve(setting, self.method)
            found = [trajectory(c, scene.duration, scene.sample_times, stage) for c in cells]
            return answer(scene, found)

        return call


RIVALS = [Phases("RK45"), Phases("DOP853")]
