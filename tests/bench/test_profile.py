"""`bench profile` measures parts of the engine on lanes that are on their way."""

import numpy as np
import pytest

pytest.importorskip("numba", reason="bench needs numba")

from wiperjax.vocabulary.codes import RUNNING  # noqa: E402
from wiperjax_bench.measurements import profile  # noqa: E402
from wiperjax_bench.measurements.operations import Work  # noqa: E402


@pytest.mark.long
def test_work_is_that_of_one_lane_on_its_way():
    bench = profile.Bench("float64", 16, rounds=20)
    assert np.all(bench.state.result == RUNNING) and np.all(bench.state.time > 0)

    def part(problem, state):
        x, y = state.position
        return state._replace(position=(x * y + y, y))

    seconds, work = bench.measure(part, 10)
    assert seconds > 0
    number = 8  # bytes
    assert work == Work(flops=2, choices=0, memory=2 * 3 * number)
