"""Times of events: they converge with the tolerance, and with the order of the solver."""

import diffrax
import numpy as np
import pytest
from problems import stop_oscillator
from systems import events, trajectory

from wiperjax import Event


@pytest.mark.slow
@pytest.mark.parametrize(
    "solver, order",
    [(diffrax.Tsit5(), 5), (diffrax.Dopri5(), 5), (diffrax.Bosh3(), 3), (diffrax.Dopri8(), 8)],
    ids=lambda x: getattr(type(x), "__name__", ""),
)
def test_event_times_converge_with_the_tolerance(solver, order):
    problem = stop_oscillator()
    tolerances = np.array([1e-4, 1e-6, 1e-8, 1e-10]) if order > 3 else np.array([1e-4, 1e-6, 1e-8])
    errors = []
    for rtol in tolerances:
        s = trajectory(problem.system, problem.duration, problem.start, rtol, solver=solver)
        found = events(s, Event.IMPACT)
        assert len(found) == len(problem.times)
        errors.append(np.max(np.abs(np.array(found) / problem.times - 1)))
    slope = np.polyfit(np.log(tolerances), np.log(np.maximum(errors, 1e-15)), 1)[0]
    assert slope > 0.8 and errors[-1] < 20 * tolerances[-1]


@pytest.mark.slow
def test_event_times_have_the_order_of_the_solver_with_fixed_steps():
    """The located state is a full Runge-Kutta result: halving the step gains 2^5."""
    problem = stop_oscillator()
    errors = []
    for parts in (8, 16, 32):
        s = trajectory(
            problem.system,
            0.016,
            problem.start,
            1e30,
            atol=1e30,
            max_step=problem.times[0] / (parts + 0.3),
        )
        errors.append(abs(events(s, Event.IMPACT)[1] / problem.times[1] - 1))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 4.5), (errors, orders)
