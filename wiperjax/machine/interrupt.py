"""Ctrl-C, heard also where Python drops it: in callbacks of weak references, and destructors."""

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator


@contextlib.contextmanager
def heeded() -> Iterator[Callable[[], None]]:
    """Yields what raises KeyboardInterrupt if Ctrl-C was pressed in the `with` statement and is not
    known yet: to be called between pieces of work. Where another handler than Python's own is
    there, which knows what to do, or in another thread than the main one, nothing is heard.
    """
    pressed: list[int] = []

    def check() -> None:
        if pressed:
            raise KeyboardInterrupt

    before = signal.getsignal(signal.SIGINT)
    if (
        before is not signal.default_int_handler
        or threading.current_thread() is not threading.main_thread()
    ):
        yield check
        return

    def note(number, frame) -> None:
        pressed.append(number)
        signal.default_int_handler(number, frame)

    try:
        signal.signal(signal.SIGINT, note)
        yield check
    finally:
        signal.signal(signal.SIGINT, before)
