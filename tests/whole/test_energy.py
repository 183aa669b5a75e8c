"""Energy of blades: what friction, the dashpot and impacts take of it, and nothing else."""

import jax
import numpy as np
import pytest
from blades import draw, lane
from systems import events, times

import wiperjax
from wiperjax import Event, Result, SteadyBelt, Wiper

TIMES = np.linspace(0, 0.02, 16001)


@jax.jit
def blade(values, speed, duration, rtol=1e-10):
    """A wiper of given PARAMETERS, sampled."""
    return wiperjax.solve(
        Wiper(belt=SteadyBelt(speed), **values),
        duration,
        rtol=rtol,
        max_events=128,
        sample_times=TIMES,
    )


@pytest.mark.slow
@pytest.mark.parametrize("i", range(4))
def test_energy_balance_over_smooth_phases(i):
    """E changes by the work of friction and the dashpot: quadrature between neighbouring events."""
    values, speed = (lane(x, i) for x in draw(4))
    s = blade(values, speed, TIMES[-1], 1e-11)
    assert Result(int(s.result)) == Result.FINISHED
    body = Wiper(belt=SteadyBelt(speed), **values)
    q, v = (np.asarray(x) for x in (s.samples.position, s.samples.velocity))
    energy = np.asarray(jax.vmap(lambda *z: body.energy(z[:2], z[2:]))(*q, *v))
    tau = q[0] / np.sqrt(body.lip_length**2 - q[0] ** 2)
    power = s.samples.friction_force * v[0] - body.support_damping * (v[1] - tau * v[0]) ** 2
    edges = [0.0, *times(s), TIMES[-1]]
    checked = 0
    h = TIMES[1]
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        inside = np.flatnonzero((a + 1e-9 < TIMES) & (b - 1e-9 > TIMES))
        if len(inside) < 41:
            continue
        n = (len(inside) - 1) // 4 * 4
        p = np.asarray(power)[inside[: n + 1]]
        weights = np.tile([32, 12, 32, 14], n // 4 + 1)[:n]
        work = 2 * h / 45 * (7 * p[0] + weights[:-1] @ p[1:n] + 7 * p[n])
        change = energy[inside[n]] - energy[inside[0]]
        scale = np.max(np.abs(p)) * n * h + abs(change)
        assert change == pytest.approx(work, abs=2e-7 * scale)
        checked += 1
    assert checked >= 1


@pytest.mark.long
def test_dissipation_at_impacts_is_not_negative():
    """T- - T+ + V p_t >= 0 at every bounce of a coupled blade on a moving belt."""

    @jax.jit
    def solve(duration):
        return wiperjax.solve(
            Wiper(
                belt=SteadyBelt(0.3),
                hinge_mass=4e-3,
                attack_angle=-0.6,
                support_stiffness=8000.0,
                restitution=0.7,
                mu_static=0.8,
            ),
            duration,
            initial_state=((-0.0034, 5e-4), (0.2, 0.0)),
            rtol=1e-10,
        )

    times = [t for t, k in events(solve(0.01)) if k == Event.IMPACT]
    assert len(times) >= 3
    body = Wiper(hinge_mass=4e-3, attack_angle=-0.6)
    for t in times[:6]:
        before, after = solve(t * (1 - 1e-9)), solve(t * (1 + 1e-9))
        x = float(before.final_position[0])
        along = body.directions(0.0, (x, 0.0))
        inverse = np.array([[float(a) for a in row] for row in along])
        mass = np.linalg.inv(inverse)
        v0, v1 = np.asarray(before.final_velocity), np.asarray(after.final_velocity)
        p_t = float((mass @ (v1 - v0))[0])
        lost = 0.5 * v0 @ mass @ v0 - 0.5 * v1 @ mass @ v1 + 0.3 * p_t
        assert lost >= -1e-9 * (v0 @ mass @ v0)
