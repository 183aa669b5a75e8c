"""Many trajectories: on this thread, or on all of numba's."""

import hashlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numba import njit, prange

from .compiling import FAST, cached, inner
from .loop import run
from .model import Blade
from .records import Limits, Watch


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


class Cells(NamedTuple):
    """What `rivals.compiled` hands over, cells first."""

    blades: np.ndarray  # (cells, 20), the fields of `Blade`
    motions: np.ndarray  # (cells, pieces, 6), those of `Motion`
    breaks: np.ndarray  # (cells, pieces) s, ends of the pieces
    kinds: np.ndarray  # (pieces,) events at these ends
    start: np.ndarray  # (cells, 4)
    scale_x: np.ndarray  # (cells,) m
    scale_v: np.ndarray  # (cells,) m/s
    times: np.ndarray  # (samples,) s


class Task(NamedTuple):
    """What is asked of all cells."""

    end: float  # s
    rtol: float
    zeno_time: float  # s
    budget: int
    mark: float  # s
    interval: float  # s


@inner
def _cell(i, cells, task, r):
    b = cells.blades[i]
    p = Blade(
        b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7], b[8], b[9], b[10], b[11], b[12], b[13],
        b[14], b[15], b[16], b[17], b[18], b[19],
    )  # fmt: skip
    sx, sv = cells.scale_x[i], cells.scale_v[i]
    limits = Limits(
        task.end, task.rtol, task.rtol * sx, task.rtol * sv, task.zeno_time, task.budget
    )
    watch = Watch(cells.times, r.taken[i], task.mark, r.signal[i], task.interval, r.total[i])
    code, events, counts, tip = run(
        p, cells.motions[i], cells.breaks[i], cells.kinds, cells.start[i], limits, (sx, sv), watch,
        r.event_times[i], r.event_kinds[i],
    )  # fmt: skip
    r.result[i], r.events[i] = code, events
    r.attempts[i], r.rejected[i] = counts.attempts, counts.rejected
    final = r.final[i]
    final[0], final[1], final[2], final[3], final[4] = tip.t, tip.x, tip.y, tip.u, tip.vy


def _kernels(digest: str):
    """Return (one_by_one, on_all_cores).

    ``digest`` of all source files: numba's cache looks at what a function closes over, and so
    compiles anew when any of them has changed.
    """

    @cached
    def one_by_one(cells, task, r):
        """Run all cells on this thread."""
        assert digest
        for i in range(len(cells.blades)):
            _cell(i, cells, task, r)

    @njit(fastmath=FAST, error_model="numpy", cache=True, parallel=True)
    def on_all_cores(cells, task, r):
        """Run all cells on numba's threads."""
        assert digest
        for i in prange(len(cells.blades)):
            _cell(i, cells, task, r)

    return one_by_one, on_all_cores


_SOURCES = sorted(Path(__file__).parent.glob("*.py"))
one_by_one, on_all_cores = _kernels(
    hashlib.sha256(b"".join(file.read_bytes() for file in _SOURCES)).hexdigest()
)
