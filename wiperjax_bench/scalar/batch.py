"""Many trajectories: on this thread, or on all of numba's."""

import hashlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numba import njit, prange

from .compiling import FAST, cached, inner
from .loop import run
from .model import Blade


class Record(NamedTuple):
    """What `sweep` fills, cells first."""

    result: np.ndarray
    events: np.ndarray
    attempts: np.ndarray
    rejected: np.ndarray
    final: np.ndarray  # (cells, 5): t, x, y, x', y'
    taken: np.ndarray  # (cells, samples, 4)
    event_times: np.ndarray
    event_kinds: np.ndarray
    signal: np.ndarray
    total: np.ndarray


@inner
def _cell(
    i, blades, motions, breaks, kinds, start, end, rtol, sx, sv, zeno, budget, times, mark, dt, r
):
    b = blades[i]
    p = Blade(
        b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7], b[8], b[9], b[10], b[11], b[12], b[13],
        b[14], b[15], b[16], b[17], b[18], b[19],
    )  # fmt: skip
    code, events, attempts, t, x, y, u, vy, rejected = run(
        p, motions[i], breaks[i], kinds, start[i], end, rtol, sx[i], sv[i], zeno, budget, times,
        r.taken[i], r.event_times[i], r.event_kinds[i], mark, r.signal[i], dt, r.total[i],
    )  # fmt: skip
    r.result[i], r.events[i], r.attempts[i], r.rejected[i] = code, events, attempts, rejected
    r.final[i, 0], r.final[i, 1], r.final[i, 2], r.final[i, 3] = t, x, y, u
    r.final[i, 4] = vy


def _kernels(digest: str):
    """Return (one_by_one, on_all_cores).

    ``digest`` of all source files: numba's cache looks at what a function closes over, and so
    compiles anew when any of them has changed.
    """

    @cached
    def one_by_one(
        blades, motions, breaks, kinds, start, end, rtol, sx, sv, zeno, budget, times, mark, dt, r
    ):
        """Run all cells on this thread."""
        assert digest
        for i in range(len(blades)):
            _cell(
                i, blades, motions, breaks, kinds, start, end, rtol, sx, sv, zeno, budget, times,
                mark, dt, r,
            )  # fmt: skip

    @njit(fastmath=FAST, error_model="numpy", cache=True, parallel=True)
    def on_all_cores(
        blades, motions, breaks, kinds, start, end, rtol, sx, sv, zeno, budget, times, mark, dt, r
    ):
        """Run all cells on numba's threads."""
        assert digest
        for i in prange(len(blades)):
            _cell(
                i, blades, motions, breaks, kinds, start, end, rtol, sx, sv, zeno, budget, times,
                mark, dt, r,
            )  # fmt: skip

    return one_by_one, on_all_cores


_SOURCES = sorted(Path(__file__).parent.glob("*.py"))
one_by_one, on_all_cores = _kernels(
    hashlib.sha256(b"".join(file.read_bytes() for file in _SOURCES)).hexdigest()
)
