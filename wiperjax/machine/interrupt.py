"""Ctrl-C, heard also where Python drops it: in callbacks of weak references, and destructors; and
kept off modules that are being imported.
"""

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator

LATER, MOST_WAITS = 0.05, 40  # s; a module may compute, and that must end, too


class _Heeding:
    """A handler of Ctrl-C that remembers it."""

    def __init__(self) -> None:
        self.pressed = False
        self.waits = 0

    def __call__(self, number, frame) -> None:
        self.pressed = True
        ours = signal.getsignal(signal.SIGALRM) in (signal.SIG_DFL, self)
        if ours and self.waits < MOST_WAITS and _importing(frame):
            self.waits += 1
            signal.signal(signal.SIGALRM, self)
            signal.setitimer(signal.ITIMER_REAL, LATER)
            return
        signal.default_int_handler(number, frame)

    def forget(self) -> None:
        """Takes back what was put off, and only that: another's alarms are left alone."""
        if signal.getsignal(signal.SIGALRM) is self:
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, signal.SIG_DFL)

    def check(self) -> None:
        if self.pressed:
            raise KeyboardInterrupt


def _importing(frame) -> bool:
    """Whether a module is being imported: compiled ones may crash when they are interrupted, and
    the lock that importing holds may stay with it, for which other threads then wait for ever.
    """
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


@contextlib.contextmanager
def heeded() -> Iterator[Callable[[], None]]:
    """Yields what raises KeyboardInterrupt if Ctrl-C was pressed in the `with` statement, or one
    around it, and is not known yet: to be called between pieces of work. Where another handler than
    Python's own is there, which knows what to do, or in another thread than the main one, nothing
    is heard.
    """
    before, handler = signal.getsignal(signal.SIGINT), _Heeding()
    main = threading.current_thread() is threading.main_thread()
    if main and isinstance(before, _Heeding):
        yield before.check
        return
    if before is not signal.default_int_handler or not main:
        yield handler.check
        return
    try:
        signal.signal(signal.SIGINT, handler)
        yield handler.check
    finally:
        handler.forget()
        signal.signal(signal.SIGINT, before)
