"""What a method has to offer to be measured, and what it answers."""

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from ..scenes.scene import Scene


class Answer(NamedTuple):
    """Motion of the cells of a scene as one method sees it; NaN where it did not get to."""

    times: np.ndarray  # (samples,) s: `Scene.sample_times`
    position: np.ndarray  # (cells, samples, 2) tip (x, y), m
    velocity: np.ndarray  # (cells, samples, 2) (x', y'), m/s
    event_times: list | None  # per cell, located event times; None: the method has no events
    event_kinds: list | None  # `wiperjax.Event` codes
    stopped: np.ndarray  # (cells,) bool: the method itself reported failure
    steps: np.ndarray  # (cells,)


class NotForThisScene(Exception):
    """The method cannot express the scene; its text says why in one line."""


class Rival(Protocol):
    """A method. One file each in `rivals/`, listed there in ``RIVALS``."""

    name: str
    settings: tuple[float, ...]  # its own tolerance, step or width, coarse to fine
    setting_name: str  # "rtol", "step [s]", "width [m/s]" ...
    cells: int  # most cells it is run on (a slow method needs not run them all)

    def available(self) -> str | None:
        """Return None, or in one line why the method cannot run here."""
        ...

    def prepare(self, scene: Scene, setting: float) -> Callable[[], Answer]:
        """Return a call that computes the scene; it is called once before it is timed.

        A method whose fast path keeps no history (final states, counts) may give the callable an
        attribute ``answer``: a second callable, not timed, that returns the full `Answer` of the
        same arithmetic. Raises `NotForThisScene`.
        """
        ...
