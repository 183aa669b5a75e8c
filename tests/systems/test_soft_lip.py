"""The lip on a glass that yields, against its equations of motion in another form."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import wiperjax
from wiperjax import Coulomb, Event, SteadyBelt
from wiperjax.blade.bar import Bar
from wiperjax.blade.block import block_of
from wiperjax.systems.soft_lip import SoftLip

SPEED, STATIC = 0.3, 0.8


def held(lip: SoftLip, t: float, z) -> tuple[float, float, float]:
    """y'', friction and load [N/m] of a tip at z = (x, y, y') that rides on the belt: Lagrange's
    equations of tip and hinge, whose height is y + L cos phi."""
    x, y, speed = z
    lean = np.arcsin(x / lip.lip_length)
    tan, arm = np.tan(lean), lip.lip_length * np.cos(lean)
    theta = lean - lip.attack_angle
    past = max(abs(theta) - lip.shoulder_angle, 0.0) * np.sign(theta)
    extra = lip.shoulder_stiffness - lip.neck_stiffness
    moment = lip.neck_stiffness * theta + extra * past
    sink = y + arm - lip.lip_length * np.cos(lip.attack_angle)
    drop = speed - tan * SPEED
    down = lip.normal_load + lip.support_stiffness * sink + lip.support_damping * drop
    m, h, g = lip.tip_mass, lip.hinge_mass, lip.gravity
    load = -lip.contact_stiffness * y
    # the hinge's height: eta'' = y'' - x'^2 / (L cos^3 phi), at x'' = 0
    bend = SPEED**2 * (lip.lip_length / arm) ** 2 / arm
    up = (load - down - (m + h) * g + h * bend) / (m + h)
    friction = moment / arm - (down + h * g) * tan - h * tan * (up - bend)
    return up, friction, load


@pytest.mark.long
@pytest.mark.parametrize("hinge_mass", [0.0, 1e-3])
def test_stick_holds_the_hinge_too(hinge_mass):
    """The load pushes the hinge up, and so the tip along: friction in stick was -3.2 for -4.0."""
    lip = SoftLip(
        belt=SteadyBelt(SPEED),
        friction=Coulomb(STATIC),
        attack_angle=0.35,
        contact_stiffness=2e4,
        hinge_mass=hinge_mass,
        gravity=9.81,
    )
    start = lip.lip_length * np.sin(0.35) - 1e-3, -lip.normal_load / lip.contact_stiffness

    def motion(t, z):
        return SPEED, z[2], held(lip, t, z)[0]

    def cone(t, z):
        _, friction, load = held(lip, t, z)
        return STATIC * load - abs(friction)

    cone.terminal = True
    asked = {"rtol": 1e-11, "atol": 1e-14, "max_step": 1e-4, "dense_output": True}
    exact = solve_ivp(motion, (0, 0.1), (*start, 0.0), "DOP853", events=cone, **asked)
    assert exact.status == 1
    run = wiperjax.simulate(
        lip,
        exact.t[-1],
        initial_state=(start, (SPEED, 0.0)),
        rtol=1e-10,
        sample_interval=exact.t[-1] / 50,
    )
    for i in range(50):
        _, friction, load = held(lip, 0.0, exact.sol(float(run.time[i])))
        assert float(run.friction_force[i]) == pytest.approx(friction, abs=1e-6)
        assert float(run.normal_force[i]) == pytest.approx(load, abs=1e-6)
    run = wiperjax.simulate(lip, 0.1, initial_state=(start, (SPEED, 0.0)), rtol=1e-10)
    releases = run.event_time[run.event_kind == Event.RELEASE]
    assert float(releases[0]) == pytest.approx(exact.t[-1], abs=1e-8)
    assert int(run.result) == 0


@pytest.mark.long
def test_what_nothing_takes_stays_energy():
    """Bounces on the glass's spring without friction or dashpot: the spring was not in it."""
    lip = SoftLip(
        belt=SteadyBelt(SPEED), friction=Coulomb(0.0), support_damping=0.0, attack_angle=0.1
    )
    depth = 1.5 * lip.normal_load / lip.contact_stiffness
    start = (lip.lip_length * np.sin(0.15), -depth), (0.0, 0.0)
    before, stored = float(lip.energy(*start)), 0.5 * lip.contact_stiffness * depth**2
    for duration in (1e-3, 2e-3, 4e-3):
        run = wiperjax.solve(lip, duration, initial_state=start, rtol=1e-11)
        after = lip.energy(run.final_position, run.final_velocity)
        assert float(after) == pytest.approx(before, abs=1e-10 * stored)


@pytest.mark.parametrize("asked", [wiperjax.steady_slip, block_of, Bar])
def test_what_is_of_the_rigid_lip_alone_is_refused(asked):
    """It was answered for the rigid lip: no steady slip, where `modes` finds one."""
    said = r"must be on glass that does not yield \(of others see `modes`\), but was a SoftLip$"
    with pytest.raises(ValueError, match=said):
        asked(SoftLip(belt=SteadyBelt(SPEED)))
