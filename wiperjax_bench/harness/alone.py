"""A call in a process of its own that has one core.

XLA's threads belong to the process: one that computes on two cores has two, and spreads a single
program over both, for less than the speed of one (measured: 1250 trajectories a second instead of
1600).
"""

import multiprocessing
import time
from collections.abc import Callable
from typing import Any


def _serve(connection, make: Callable[[], Any], reduce: Callable[[Any], Any]) -> None:
    """Answer ``warm`` and ``run`` until the other end closes."""
    from wiperjax.machine.jax_settings import configure

    configure(1, keep=False)
    call = make()
    connection.send((0.0, None))  # ready
    while True:
        try:
            asked = connection.recv()
        except EOFError:
            return
        before = time.process_time()
        found = reduce(call()) if asked == "run" else call.warm()
        connection.send((time.process_time() - before, found if asked == "run" else None))


class Alone:
    """The call that ``make()`` returns there; a call gives ``reduce`` of its result.

    ``make`` and ``reduce`` must be picklable. ``elsewhere``: processor time [s] of the last call,
    which this process's clock does not see. Raises RuntimeError when that process has ended.
    """

    def __init__(self, make: Callable[[], Any], reduce: Callable[[Any], Any]):
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, make, reduce), daemon=True)
        self._process.start()
        theirs.close()  # or the end of the other process would not be noticed here
        self._answer()

    def _answer(self) -> Any:
        try:
            self.elsewhere, found = self._connection.recv()
        except EOFError:
            raise RuntimeError("the process of its own has ended; it says why above") from None
        return found

    def warm(self) -> None:
        """Compile; compute hardly anything."""
        self._connection.send("warm")
        self._answer()

    def __call__(self) -> Any:
        self._connection.send("run")
        return self._answer()
