"""Where the time of a long task goes, by the name of what it does.

    with account() as spent:
        with during("storing"):
            ...

Phases may lie in each other: the time of an inner one does not count for the outer one, so that all
of one thread together are no more than the time that has passed; with those of others they may be.
"""

import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar

from . import cores


class Account:
    """Seconds of each phase, since it was opened, of the thread that opened it."""

    def __init__(self) -> None:
        self._seconds: defaultdict[str, float] = defaultdict(float)
        self._begun, self._busy = time.perf_counter(), time.process_time()
        self._phase: str | None = None
        self._since = self._begun
        self._others = 0.0

    def enter(self, phase: str | None) -> str | None:
        """Goes on in `phase`; returns the one before."""
        now, before = time.perf_counter(), self._phase
        if before is not None:
            self._seconds[before] += now - self._since
        self._phase, self._since = phase, now
        return before

    def add(self, phase: str, seconds: float) -> None:
        """Books `seconds` on a phase, or takes them off it: those of other processes or threads."""
        self._seconds[phase] += seconds

    def take(self, phases: Mapping[str, float], elsewhere: bool) -> None:
        """Books what another thread did on its phases; or, `elsewhere`, what other processes did,
        each second shared by all of them."""
        for phase, seconds in phases.items():
            self.add(phase, seconds)
        if elsewhere:
            self._others += sum(phases.values())

    def seconds(self) -> dict[str, float]:
        """Seconds of each phase up to now."""
        self.enter(self._phase)
        return dict(self._seconds)

    def idle(self) -> float:
        """Seconds that all cores of this process together had nothing to do for it; where other
        processes worked, that those had nothing.
        """
        busy = self._others or (time.process_time() - self._busy) / cores.available()
        return max(self.elapsed() - busy, 0.0)

    def elapsed(self) -> float:
        """Seconds since it was opened."""
        return time.perf_counter() - self._begun


_open: ContextVar[Account | None] = ContextVar("account", default=None)


@contextmanager
def account() -> Iterator[Account]:
    """A new account for all phases in this block of this thread; one that is open rests."""
    opened = Account()
    token = _open.set(opened)
    try:
        yield opened
    finally:
        _open.reset(token)


def is_open() -> bool:
    """Whether an account is open in this thread."""
    return _open.get() is not None


@contextmanager
def during(phase: str | None) -> Iterator[None]:
    """Books the time of this block on `phase`, if an account is open in this thread; on none where
    it is None, such as that of waiting.
    """
    spent = _open.get()
    if spent is None:
        yield
        return
    before = spent.enter(phase)
    try:
        yield
    finally:
        spent.enter(before)


def add(phase: str, seconds: float) -> None:
    """`Account.add` to the account that is open in this thread, if one is."""
    if (spent := _open.get()) is not None:
        spent.add(phase, seconds)
