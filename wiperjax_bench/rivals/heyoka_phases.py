"""heyoka: Taylor series of a compiled right-hand side, every root of a guard in a step isolated.

One integrator for each regime, compiled once: what differs between cells, zones and pieces of the
belt are its parameters. It ends at terminal events, each with its direction, and `scipy_tip` makes
the next phase of it. Its batch form stops as a whole where one of its lanes has an event, and lanes
have theirs at other times: it is not used.
"""

import importlib.util

from ..harness.interface import Answer, NotForThisScene
from ..scenes.scene import Scene
from .scipy_phases import answer, every_cell


class Taylor:
    """`taylor_adaptive`, its own order and steps for a tolerance."""

    name = "heyoka, Taylor series"
    setting_name = "tol"
    settings = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-11, 1e-13)
    cells = 64

    def available(self) -> str | None:
        for needed in ("heyoka", "numba"):  # numba: of the resets between phases
            if importlib.util.find_spec(needed) is None:
                return f"{needed} is not installed (pip install {needed})"
        return None

    def prepare(self, scene: Scene, setting: float):
        from .heyoka_regimes import Regimes
        from .phase_by_phase import trajectory

        cells = every_cell(scene)
        if any(cell.blade.shape % 1 for cell in cells):
            raise NotForThisScene("a Stribeck curve that has no Taylor series at rest")
        regimes = Regimes(setting, any(g.amplitude for cell in cells for g in cell.pieces))

        def run(times, dense: bool) -> Answer:
            found = [trajectory(c, scene.duration, times, regimes.stage(dense)) for c in cells]
            return answer(scene, found)

        def call() -> Answer:
            return run(scene.sample_times[:0], False)

        call.answer = lambda: run(scene.sample_times, True)
        return call


RIVALS = [Taylor()]
