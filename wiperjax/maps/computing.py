"""Who computes the blocks of a sweep: this process, or the workers of a cluster."""

import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from ..vocabulary import checks
from .block import Block, Evaluate, engine, evaluate_block, made_by

Spans = Mapping[int, tuple[int, int]]  # number of a block -> first cell, the one after the last
Blocks = Callable[[Any, Spans], Iterator[Block]]


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
    return partial(_one_by_one, evaluate=evaluate), known


def _one_by_one(spec: Any, spans: Spans, evaluate: Evaluate) -> Iterator[Block]:
    for number, (start, stop) in spans.items():
        begun = time.perf_counter()
        columns, occupancy = evaluate_block(spec, np.arange(start, stop), evaluate)
        yield Block(number, columns, occupancy, time.perf_counter() - begun)
