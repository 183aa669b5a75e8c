"""Sweeps on more than one process: blocks of cells as tasks of `dask.distributed`.

    with cluster.connect("tcp://host:8786") as workers:  # or connect(local=4)
        wiperjax.sweep(spec, "map.h5", workers=workers)

This process keeps the store. Workers send finished blocks back, so they need no common disk; a
block whose worker dies is computed again by another. What they do is `worker`'s. dask is imported
in these two alone.
"""

import contextlib
import itertools
import logging
import math
import time
import uuid
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import CancelledError
from typing import Any

from ..machine.files import log
from ..machine.interrupt import deaf, heeded
from ..machine.phases import during
from ..vocabulary.wording import shown
from . import block, worker
from .worker import Answer, ClusterError, Own

_KEPT = "finished blocks are kept, give the same command again (a sweep with --resume)"
_DEAF = "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)"  # Ctrl-C is for the client
ALONE = 600  # s without any worker after which a sweep stops: dask would wait for one for ever
LOOK = 2  # s: how often a Ctrl-C is looked for that was put off
AHEAD = 2  # blocks in flight for each thread of the workers: one computed, one ready


@contextlib.contextmanager
def connect(scheduler: str | None = None, local: int | None = None) -> Iterator["Workers"]:
    """Workers of the scheduler at an address such as `tcp://host:8786`, or else `local` processes
    of this machine, a core each, which end with the `with` statement. Waits for the first worker:
    of a scheduler for ever, for it may have a queue; of this machine for `ALONE` seconds.

    Raises: `ClusterError` if dask is not installed, what is named is no address, no scheduler
    answers, or no worker starts here.
    """
    try:
        with heeded() as check:
            from distributed import Client
            from distributed.comm.addressing import get_address_host_port

            check()
    except ImportError:
        raise ClusterError("a cluster needs dask: pip install distributed") from None
    if scheduler is not None:  # a client of what is none waits for itself when it is left
        try:
            get_address_host_port(scheduler)
        except (TypeError, ValueError):
            must = "scheduler must be an address such as tcp://HOST:PORT"
            raise ClusterError(f"{must}, but was {shown(scheduler)}") from None
    with contextlib.ExitStack() as stack:
        address: Any = scheduler
        if scheduler is None:
            with deaf():
                address = stack.enter_context(_local(local))
        told = logging.getLogger("distributed.client")  # of a lost scheduler, in tracebacks
        stack.callback(told.setLevel, told.level)
        told.setLevel(logging.CRITICAL)
        try:
            client = stack.enter_context(Client(address, set_as_default=False))
        except (OSError, ValueError) as error:
            said = str(error).splitlines()[0]
            raise ClusterError(f"{scheduler}: no scheduler answers: {said}") from error
        if not client.nthreads():
            log.warning("%s: waiting for a worker", scheduler)
        patience = math.inf if scheduler is not None else ALONE
        try:
            client.wait_for_workers(1, None if math.isinf(patience) else patience)
        except TimeoutError as error:
            raise ClusterError(f"no worker of this machine started within {ALONE:g} s") from error
        yield Workers(client, patience)


def _local(count: int | None) -> Any:
    """A cluster of processes of this machine, to be begun `deaf`: of a Ctrl-C while it starts dask
    makes tracebacks, in each process.
    """
    from distributed import LocalCluster

    return LocalCluster(
        n_workers=count,
        threads_per_worker=1,
        memory_limit=0,  # dask would end workers for memory that XLA keeps for later
        dashboard_address="127.0.0.1:0",  # any free port: several sweeps may run here
        # what fails reaches the client as an exception; a heartbeat that meets the end of
        # the scheduler would be told as an error of a sweep that went well
        silence_logs=logging.CRITICAL,
        preload=_DEAF,
    )


class Workers:
    """What `driver.sweep` asks of a cluster: who computes, and blocks as they are finished."""

    def __init__(self, client: Any, patience: float = math.inf):
        """`client` of dask; `patience` [s] with which the first task waits for a worker."""
        self._client = client
        self._patience = patience
        self._made_by: dict[str, str] = {}
        self._hosts: set[str] = set()

    @property
    def count(self) -> int:
        """Workers there are now, the next one if there is none: they come and go. Each computes one
        block at a time.
        """
        return max(1, len(self._result(lambda seconds: self._client.nthreads(), "workers")))

    @property
    def host(self) -> str:
        """Kinds of the machines that computed blocks."""
        return "; ".join(sorted(self._hosts))

    def made_by(self, spec: Any, evaluate: block.Evaluate | None = None) -> dict[str, str]:
        """What must agree between blocks of one map, as the workers have it.

        Raises: `ClusterError` if it is not what this process has.
        """
        future = self._client.submit(worker.made_by, spec, Own.of(spec), evaluate, pure=False)
        theirs = self._result(future.result, "the first task", self._patience)
        mine = block.made_by(spec)
        _compare({name: theirs.get(name, "none") for name in mine}, mine)
        self._made_by = theirs
        return theirs

    def blocks(
        self,
        spec: Any,
        spans: Mapping[int, tuple[int, int]],
        evaluate: block.Evaluate | None = None,
    ) -> Generator[block.Block, None, None]:
        """Blocks `spans` (number -> first cell, the one after the last), in any order."""
        from distributed import wait

        waiting = iter(spans.items())
        own, run = Own.of(spec), uuid.uuid4().hex  # dask takes tasks of one name for one task
        flying: dict[Any, int] = {}

        def ready(seconds: float) -> Any:
            with self._client.as_current():
                waited: Any = wait(list(flying), seconds, return_when="FIRST_COMPLETED")
            return waited.done.pop()

        def submit() -> None:
            threads = sum(self._client.nthreads().values())
            room = max(2, AHEAD * threads) - len(flying)
            for number, (start, stop) in itertools.islice(waiting, max(0, room)):
                key = f"wiperjax-{run}-{number}"
                future = self._client.submit(
                    worker.compute, spec, own, start, stop, evaluate, key=key
                )
                flying[future] = number

        try:
            submit()
            while flying:
                with during(None):  # others compute meanwhile: their phases come with the block
                    future = self._result(ready, "a block")
                    number = flying.pop(future)
                    # dask counts it as lost too where one beside it has ended their worker
                    what = f"block {number}, or one that waited for the same worker,"
                    answer: Answer = self._result(future.result, what)
                future.release()
                _compare(answer.made_by, self._made_by)
                self._hosts.add(answer.host)
                submit()
                share = {name: x / self.count for name, x in answer.phases.items()}
                yield block.Block(number, answer.columns, answer.occupancy, answer.seconds, share)
        finally:
            with contextlib.suppress(Exception):  # of a cluster that is gone
                self._client.cancel(list(flying), force=True)

    def _result(self, attempt: Callable[[float], Any], what: str, alone: float = ALONE) -> Any:
        """Return ``attempt(seconds)``, tried again until there was no worker for ``alone`` s."""
        from distributed import KilledWorker

        seen = time.monotonic()
        with heeded() as check:
            while True:
                check()
                try:
                    try:
                        return attempt(min(LOOK, alone))
                    except TimeoutError:  # of the attempt: what it waits for goes on
                        deserted = not self._client.nthreads()
                except KilledWorker as error:
                    times = error.allowed_failures + 1
                    message = f"{what} was lost with its worker {times} times; {_KEPT}"
                    raise ClusterError(message) from error
                except (CancelledError, OSError) as error:
                    why = type(error).__name__
                    raise ClusterError(f"the scheduler was lost ({why}); {_KEPT}") from error
                seen = seen if deserted else time.monotonic()
                if time.monotonic() - seen > alone:
                    raise ClusterError(f"no worker was left for {alone:g} s; {_KEPT}")


def _compare(theirs: Mapping[str, str], expected: Mapping[str, str]) -> None:
    """Raises `ClusterError` that says what differs, if anything does."""
    names = sorted(theirs.keys() | expected.keys())
    pairs = [(name, theirs.get(name, "none"), expected.get(name, "none")) for name in names]
    said = [f"{name} is {there}, not {here}" for name, there, here in pairs if there != here]
    if said:
        raise ClusterError(f"a worker differs, its blocks would not belong: {'; '.join(said)}")
