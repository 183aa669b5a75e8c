"""Who computes the blocks of a sweep: this process, or the workers of a cluster."""

import threading
from collections import deque
from collections.abc import Callable, Generator, Mapping
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextvars import copy_context
from functools import partial
from typing import Any

import numpy as np

from ..machine.phases import account, during
from ..vocabulary import checks
from .block import Block, Evaluate, engine, evaluate_block, made_by

AT_A_TIME = 2  # blocks of this process: one that moves, one that is named

Spans = Mapping[int, tuple[int, int]]  # number of a block -> first cell, the one after the last
Blocks = Callable[[Any, Spans], Generator[Block, None, None]]


def computing(spec, evaluate: Evaluate | None, workers) -> tuple[Blocks, dict[str, str]]:
    """What computes blocks, and what of it must not change within a map. Raises `ValueError` for
    `workers` that are none.
    """
    if not (workers is None or hasattr(workers, "blocks")):
        raise ValueError(
            "workers must be those of maps.cluster.connect(...), or left out: "
            f"configure(cores) says on how many this process works; but was {checks.shown(workers)}"
        )
    known = made_by(spec)
    if workers is not None:
        known |= workers.made_by(spec, evaluate)
        return partial(workers.blocks, evaluate=evaluate), known
    if evaluate is None:
        evaluate, described = engine()
        known |= described
    return partial(_overlapping, evaluate=evaluate), known


def _overlapping(spec: Any, spans: Spans, evaluate: Evaluate) -> Generator[Block, None, None]:
    """Blocks in their order, two at a time: one moves, on all cores or the accelerator, while the
    one before it is named, which fills few cores, and the one before that is stored.
    """
    turn, stopped = threading.Lock(), threading.Event()
    failed: list[int] = []  # behind which nothing is begun: its error is told at once

    def compute(number: int, before: threading.Event, begun: threading.Event) -> Block:
        def in_turn(*given: Any, **named: Any) -> Mapping[str, Any]:
            with during(None):
                before.wait()  # the first look of the block before this one
                turn.acquire()
            try:
                begun.set()
                if stopped.is_set() or any(number > other for other in failed):
                    raise CancelledError
                return evaluate(*given, **named)
            except BaseException:
                failed.append(number)
                raise
            finally:
                turn.release()

        try:
            with account() as spent:
                found = evaluate_block(spec, np.arange(*spans[number]), in_turn)
                phases = spent.seconds()
            return Block(number, *found, sum(phases.values()), phases)
        finally:
            begun.set()  # also where it failed before

    def computed(block: Future[Block]) -> Block:
        try:
            with during(None):  # it comes with phases of its own
                return block.result()
        finally:
            del block  # an error has this frame: no cycle that keeps what the block had

    with ThreadPoolExecutor(AT_A_TIME) as pool:
        flying: deque[Future[Block]] = deque()
        before = threading.Event()
        before.set()
        try:
            for number in spans:
                begun = threading.Event()
                context = copy_context()  # what the caller has set for itself
                flying.append(pool.submit(context.run, compute, number, before, begun))
                before = begun
                if len(flying) > AT_A_TIME:
                    yield computed(flying.popleft())
            while flying:
                yield computed(flying.popleft())
        finally:
            stopped.set()
            pool.shutdown(cancel_futures=True)
