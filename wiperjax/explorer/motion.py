"""The motion of a cell: simulated, told, and made ready to be shown."""

from typing import Any

from .cells import scene_of, simulated, toml_of
from .content import Content, content_of
from .explored import Explored
from .numbers import COMPARED, SECONDS, audio, heading, table


def motion_of(
    explored: Explored,
    place: dict[str, int],
    start: Any = None,
    reference: float = 1.0,
    seconds: float = SECONDS,
) -> Content:
    """All that is shown of the motion of one cell, computed now."""
    scene = scene_of(explored, place, start)
    run, told = simulated(scene, explored.spec.run.transient)
    content = content_of(run)
    content.texts = {
        "heading": heading(run, told, scene["title"]),
        "table": table(run, told, explored.cell(place, COMPARED, start), explored.ds),
        "audio": audio(run, reference, seconds),
        "scene": toml_of(scene),
    }
    return content
