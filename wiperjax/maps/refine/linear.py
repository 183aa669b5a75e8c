"""Points whose answer is that of steady slip alone: its stability, for no simulation."""

import time
from collections.abc import Generator
from typing import Any

import numpy as np

from ...machine.phases import during
from ..block import Block


def linear_blocks(spec: Any, spans: Any) -> Generator[Block, None, None]:
    """As the blocks of `computing.computing`, with the columns `OF_STEADY_SLIP` alone."""
    from ..cells.linear import linear  # jax, where something is computed

    for number, (start, stop) in spans.items():
        begun = time.perf_counter()
        with during("naming"):
            columns = linear(spec, np.arange(start, stop))
        yield Block(number, columns, None, time.perf_counter() - begun)
