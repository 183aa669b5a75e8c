"""Ctrl-C, heard also where Python drops it: in callbacks of weak references, and destructors."""

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator


class _Heeding:
    """A handler of Ctrl-C that remembers it."""

    def __init__(self) -> None:
        self.pressed = False

    def __call__(self, number, frame) -> None:
        self.pressed = True
        signal.default_int_handler(number, frame)

    def check(self) -> None:
        if self.pressed:
            raise KeyboardInterrupt


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
        signal.signal(signal.SIGINT, before)
