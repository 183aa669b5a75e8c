"""How long jax compiled, as it tells itself: traced, lowered, compiled or taken from its cache."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import jax

from ...machine.phases import add, is_open

EVENT = "/jax/core/compile/"

_spans: list[tuple[float, float]] = []  # start and stop of each, in any thread


@contextmanager
def apart(phase: str) -> Iterator[None]:
    """Books what is compiled in this block, by any thread, on a phase of its own instead, if an
    account is open in this thread."""
    if not is_open():
        yield
        return
    _listen()
    begun = time.perf_counter()
    _taken(begun)
    try:
        yield
    finally:
        seconds = _taken(begun)
        add("compiling", seconds)
        add(phase, -seconds)


@cache
def _listen() -> None:
    """Notes from now on when jax compiles."""

    def note(event: str, duration_secs: float, **_: str | int) -> None:
        if event.startswith(EVENT):
            stop = time.perf_counter()
            _spans.append((stop - duration_secs, stop))

    jax.monitoring.register_event_duration_secs_listener(note)


def _taken(reached: float) -> float:
    """Seconds after `reached` in which some thread compiled, of what ended since the last call."""
    spans, _spans[:] = sorted(_spans), []
    total = 0.0
    for start, stop in spans:
        total += max(stop - max(start, reached), 0.0)
        reached = max(reached, stop)
    return total
