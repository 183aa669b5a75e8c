"""The motion of a cell: simulated, told, and made ready to be shown."""

from collections.abc import Callable, Hashable
from functools import partial
from typing import Any

from .cells import scene_of, simulated, toml_of
from .content import PICTURES, Content, content_of
from .explored import Explored, escaped
from .numbers import COMPARED, audio, heading, table
from .worker import Worker

SECONDS = 2.0  # of sound, played again and again


def motion_of(
    explored: Explored,
    place: dict[str, int],
    start: Any = None,
    reference: float = 1.0,
    seconds: float = SECONDS,
) -> Content:
    """All that is shown of the motion of one cell, computed now: of one that ends at once no
    pictures, and no sound.
    """
    scene = scene_of(explored, place, start)
    run, told = simulated(explored, scene)
    try:
        content, heard = content_of(run), audio(run, reference, seconds)
    except ValueError as error:
        content = Content(hidden=set(PICTURES))
        heard = f'<p class="note">Too short to be drawn or heard: {escaped(error)}.</p>'
    content.texts = {
        "heading": heading(run, told, scene["title"], content.part),
        "table": table(run, told, explored.cell(place, COMPARED, start), explored.ds),
        "audio": heard,
        "scene": toml_of(scene),
    }
    return content


def wish_motion(
    worker: Worker,
    whose: Hashable,
    explored: Explored,
    place: dict[str, int],
    done: Callable[[Any], None],
    start: Any = None,
    reference: float = 1.0,
) -> None:
    """Has `motion_of` a cell computed for a window; `done` as in `Worker.wish`."""
    what = (explored, tuple(place.items()), str(start), reference)
    worker.wish(whose, what, partial(motion_of, explored, place, start, reference), done)


def wish_ahead(worker: Worker, explored: Explored) -> None:
    """Has the motion that a window shows first computed before there is one: compiling takes
    seconds, in which a browser opens. A window then waits for this one; it also tells of a failure.
    """
    if explored.spec is not None:
        wish_motion(worker, "ahead", explored, first_place(explored), lambda found: None)


def first_place(explored: Explored) -> dict[str, int]:
    """The cell that a window shows first, in the middle of each axis."""
    return {dim: explored.ds.sizes[dim] // 2 for dim in explored.dims}
