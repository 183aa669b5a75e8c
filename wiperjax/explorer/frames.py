"""The lip of a run frame by frame, as numbers: what is drawn of it in slow motion."""

from typing import Any

import numpy as np
import xarray as xr

from ..plots.runs.animation import has_lip, lip_scene, slow_part
from ..plots.runs.portrait import orbit
from ..plots.style.palette import REGIMES, UNKNOWN, readable

FRAMES = 150
PERIODS = 6  # that are shown, of a motion that has some


def lip_frames(
    run: xr.Dataset, scale: float, unit: str
) -> tuple[dict[str, Any], dict[str, tuple[float, float]]] | None:
    """Columns of the frames, and the ends of the axes; None of what has no lip. Times are `scale`
    times those of the run, in `unit`.
    """
    if not has_lip(run):
        return None
    part = slow_part(run, PERIODS)
    scene = lip_scene(part)
    count = min(FRAMES, scene.time.size)
    k = np.linspace(0, scene.time.size - 1, count).round().astype(int)
    push = scene.push[k]
    (x, y), (place, speed) = scene.tip[k].T, orbit(part, 0)
    columns = {
        "x": x, "y": y, "hinge": scene.hinge[k], "travel": scene.travel[k],
        "px": x + push[:, 0], "py": y + push[:, 1], "t": scale * scene.time[k],
        "when": [f"{scale * time:.2f} {unit}" for time in scene.time[k]],
        "v": speed[k], "at": place[k],
        "colour": [REGIMES.get(scene.regimes[i], UNKNOWN) for i in k],
        "regime": [readable(scene.regimes[i]) for i in k],
        "length": np.full(count, scene.length),
    }  # fmt: skip
    reach, low = scene.reach, -0.2 * scene.length
    return columns, {"along": (-reach, reach), "height": (low, 2 * reach * 0.62 + low)}
