"""Ctrl-C, heard also where Python drops it: in callbacks of weak references, and destructors; and
put off while a module is being imported, or where it would leave a heap of tracebacks. What else
ends a process can be heard as one.
"""

import contextlib
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from multiprocessing import resource_tracker


class _Heeding:
    """A handler of Ctrl-C that remembers it."""

    def __init__(self, insists: bool) -> None:
        self.pressed = self.waits = False
        self.insists, self.hook = insists, sys.unraisablehook

    def __call__(self, number, frame) -> None:
        again, self.pressed = self.pressed, True
        if again or not (self.waits or _importing(frame)):
            signal.default_int_handler(number, frame)
        if self.insists and not self.waits:
            sys.setprofile(_soon)

    def dropped(self, told) -> None:
        """In place of `sys.unraisablehook`, which would print a traceback of a Ctrl-C that Python
        drops: it is known, and raised by `check`, or at once.
        """
        if not isinstance(told.exc_value, KeyboardInterrupt):
            self.hook(told)
        elif self.insists:
            sys.setprofile(_soon)

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


def _soon(frame, event: str, argument) -> None:
    """As a profiler: raises KeyboardInterrupt as soon as no module is being imported any more."""
    if frame.f_code is _Heeding.dropped.__code__:  # from which it would be dropped again
        return
    if not _importing(frame.f_back if event == "return" else frame):
        sys.setprofile(None)
        raise KeyboardInterrupt


@contextlib.contextmanager
def heeded(insists: bool = False) -> Iterator[Callable[[], None]]:
    """Yields what raises KeyboardInterrupt if Ctrl-C was pressed in the `with` statement, or one
    around it, and is not known yet: to be called between pieces of work. During an import nothing
    else hears it, unless it is pressed again, or the outermost statement `insists`: that hears it
    when the import is done, and at once one that Python drops. Where another handler than Python's
    own is there, which knows what to do, or in another thread than the main one, nothing is heard.
    """
    before, handler = signal.getsignal(signal.SIGINT), _Heeding(insists)
    main = threading.current_thread() is threading.main_thread()
    if main and isinstance(before, _Heeding):
        yield before.check
        return
    if before is not signal.default_int_handler or not main:
        yield handler.check
        return
    try:
        signal.signal(signal.SIGINT, handler)
        sys.unraisablehook = handler.dropped
        yield handler.check
    finally:
        signal.signal(signal.SIGINT, before)
        sys.unraisablehook = handler.hook


class _Ending:
    """A handler of what ends a process, which remembers what did."""

    def __init__(self) -> None:
        self.number = 0

    def __call__(self, number, frame) -> None:
        self.number = number
        signal.signal(number, signal.SIG_DFL)  # another one ends the process at once
        heard = signal.getsignal(signal.SIGINT)
        # ignored in what a shell runs in the background, where this one is not
        (heard if callable(heard) else signal.default_int_handler)(signal.SIGINT, frame)


def end_as_by_ctrl_c() -> Callable[[int], int]:
    """Has SIGTERM (of `kill`, and of batch systems) and SIGHUP (of a terminal that is closed) heard
    as a Ctrl-C is, for the rest of the process: else files that are being written would stay under
    their temporary names, and nothing would be said. Like a Ctrl-C the first waits for what XLA
    compiles or computes in one call; a second one does not. What is ignored, or heeded otherwise,
    stays so. Returns what makes of an exit status that which shells report of the one that was
    heard, if one was and the work is not done.
    """
    handler = _Ending()
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)  # Windows has no SIGHUP
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, handler)
    return lambda status: 128 + handler.number if status and handler.number else status


@contextlib.contextmanager
def deaf() -> Iterator[None]:
    """Has a Ctrl-C wait for the end of the `with` statement, unless it is pressed again. Threads
    that are begun in it, and processes that these begin, never hear one (but on Windows): it is for
    who has begun them.
    """
    with heeded() as check:
        handler = signal.getsignal(signal.SIGINT)
        main = threading.current_thread() is threading.main_thread()
        waiting = handler if main and isinstance(handler, _Heeding) else None
        if sys.platform != "win32":
            resource_tracker.ensure_running()  # the thread that begins it hears Ctrl-C from then on
            before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        if waiting:  # another thread may be given the signal, and have Python heed it in this one
            waiting.waits = True
        try:
            yield
        finally:
            if sys.platform != "win32":
                signal.pthread_sigmask(signal.SIG_SETMASK, before)
            if waiting:
                waiting.waits = False
        check()
