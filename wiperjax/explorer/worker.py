"""Who computes: one thread for all windows, and of each window only the latest wish."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from ..machine.files import log

KEPT = 24  # results: going back to a cell costs nothing


class Worker:
    """Computes wishes one after another.

    A wish that a newer one of the same window has overtaken is dropped unseen, so that arrow keys
    held down do not leave a queue.
    """

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="simulation")
        self._lock = threading.Lock()
        self._latest: dict[Hashable, int] = {}
        self._kept: OrderedDict[Hashable, Any] = OrderedDict()

    def wish(
        self,
        whose: Hashable,
        what: Hashable,
        compute: Callable[[], Any],
        done: Callable[[Any], None],
    ) -> None:
        """Calls `done` with the result of `compute`, or the exception it raised, from the thread of
        this worker; unless `whose` has wished something else meanwhile. `what` names the result,
        and is kept with it: a number such as `id` would be that of another map later.
        """
        with self._lock:
            number = self._latest[whose] = self._latest.get(whose, 0) + 1
        self._pool.submit(self._work, whose, number, what, compute, done)

    def forget(self, whose: Hashable) -> None:
        """Drops the wishes of a window that is gone."""
        with self._lock:
            self._latest.pop(whose, None)

    def stop(self) -> None:
        """Waits for the wish at hand, and drops all others."""
        self._pool.shutdown(wait=True, cancel_futures=True)

    def _work(self, whose, number, what, compute, done) -> None:
        if self._overtaken(whose, number):
            return
        if what not in self._kept:
            try:
                self._kept[what] = compute()
            except Exception as error:  # shown where it was wished
                if not isinstance(error, OSError | ValueError | RuntimeError | MemoryError):
                    log.exception("a bug, of the map's system perhaps")  # its traceback is wanted
                done(error)
                return
        self._kept.move_to_end(what)
        while len(self._kept) > KEPT:
            self._kept.popitem(last=False)
        if not self._overtaken(whose, number):
            done(self._kept[what])

    def _overtaken(self, whose: Hashable, number: int) -> bool:
        with self._lock:
            return self._latest.get(whose) != number
