"""Test problems: user-defined systems of about twenty lines each, with their exact answers.

Numbers are those of VERIFICATION.md (V2 to V10); every one is a closed form unless it says more.
"""

import math
from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar

import jax
import jax.numpy as jnp

import wiperjax
from wiperjax import AbstractSystem, Coulomb


@partial(jax.jit, static_argnames=("solver", "max_events"))
def trajectory(
    system,
    duration,
    initial_state,
    rtol=1e-10,
    sample_times=None,
    solver=None,
    max_events=256,
    **options,
):
    """`wiperjax.solve`, compiled once for every class of systems."""
    return wiperjax.solve(
        system,
        duration,
        initial_state=initial_state,
        rtol=rtol,
        sample_times=sample_times,
        solver=solver,
        max_events=max_events,
        **options,
    )


def events(solution, *kinds):
    """Times of the events of the given kinds, or the list of (time, kind) of all."""
    count = min(int(solution.events.count), solution.events.time.shape[-1])
    times = [float(t) for t in solution.events.time[:count]]
    names = [wiperjax.Event(int(k)) for k in solution.events.kind[:count]]
    if kinds:
        return [t for t, k in zip(times, names, strict=True) if k in kinds]
    return list(zip(times, names, strict=True))


# ---- frictionless unilateral contacts ------------------------------------------------------------


class Ball(AbstractSystem):
    """Point mass above a floor; `slope` is the free normal acceleration -gravity + slope q + ..."""

    gravity: float = 9.81
    restitution: float = 0.5

    def free_acceleration(self, t, q, v):
        return (-self.gravity,)

    def directions(self, t, q):
        return (0.0,), (1.0,)

    def gap(self, t, q):
        return q[0]

    @property
    def bounce(self):
        return self.restitution


class StopOscillator(AbstractSystem):
    """m q'' + k q = -load + a cos(w t + psi), stop at q = 0, motion on the side `side`."""

    mass: float = 1.0
    stiffness: float = 1.0
    load: float = 0.0
    amplitude: float = 0.0
    frequency: float = 1.0
    phase: float = 0.0
    restitution: float = 0.9
    side: float = 1.0

    def free_acceleration(self, t, q, v):
        drive = self.amplitude * jnp.cos(self.frequency * t + self.phase)
        return ((drive - self.load - self.stiffness * q[0]) / self.mass,)

    def directions(self, t, q):
        return (0.0,), (self.side / self.mass,)

    def gap(self, t, q):
        return self.side * q[0]

    @property
    def bounce(self):
        return self.restitution


# ---- bilateral contacts with friction ------------------------------------------------------------


class Block(AbstractSystem):
    """m x'' + k x = a cos(b t + phase) + friction, on a surface of velocity `belt` + s cos(b t).

    Friction: `static` and `dynamic` are forces, the normal force being 1.
    """

    unilateral: ClassVar[bool] = False
    static: float
    dynamic: float
    mass: float = 1.0
    stiffness: float = 1.0
    belt: float = 0.0
    amplitude: float = 0.0
    surface: float = 0.0
    frequency: float = 1.0
    phase: float = 0.0

    def free_acceleration(self, t, q, v):
        drive = self.amplitude * jnp.cos(self.frequency * t + self.phase)
        return ((drive - self.stiffness * q[0]) / self.mass,)

    def directions(self, t, q):
        return (1 / self.mass,), (0.0,)

    def normal_force(self, t, q, v):
        return 1.0

    def slip_speed(self, t, q, v):
        return v[0] - self.belt - self.surface * jnp.cos(self.frequency * t)

    @property
    def law(self):
        return Coulomb(self.static, self.dynamic)


# ---- a unilateral contact with friction and full coupling ----------------------------------------


class Rod(AbstractSystem):
    """Painleve's rod: q = (x, y, phi) of the centre, tip at (x + s cos phi, y - s sin phi)."""

    mu: float = 5 / 3
    restitution: float = 0.0
    gravity: float = 10.0
    mass: float = 1.0
    half: float = 1.0
    inertia: float = 1 / 3

    def free_acceleration(self, t, q, v):
        return 0.0, -self.gravity, 0.0

    def directions(self, t, q):
        m, s, j = self.mass, self.half, self.inertia
        tangential = 1 / m, 0.0, -s * jnp.sin(q[2]) / j
        return tangential, (0.0, 1 / m, -s * jnp.cos(q[2]) / j)

    def gap(self, t, q):
        return q[1] - self.half * jnp.sin(q[2])

    def slip_speed(self, t, q, v):
        return v[0] - self.half * jnp.sin(q[2]) * v[2]

    @property
    def law(self):
        return Coulomb(self.mu, self.mu)

    @property
    def bounce(self):
        return self.restitution

    def start(self, angle, speed, spin=0.0):
        """Sliding at `speed` with the tip on the ground."""
        s = self.half
        position = (0.0, s * math.sin(angle), angle)
        return position, (speed + s * math.sin(angle) * spin, s * math.cos(angle) * spin, spin)


class Puck(AbstractSystem):
    """Point mass over a moving floor, q = (x, y), free acceleration (a_t + p sin(w t), -g).

    W is diagonal unless `coupling` is given: the smallest scene with impacts and friction.
    """

    mu: float = 0.3
    restitution: float = 0.0
    gravity: float = 10.0
    push: float = 0.0
    lift: float = 0.0
    frequency: float = 1.0
    belt: float = 0.0
    belt_acceleration: float = 0.0

    def free_acceleration(self, t, q, v):
        return self.push + 0 * t, -self.gravity + self.lift * jnp.sin(self.frequency * t)

    def directions(self, t, q):
        return (1.0, 0.0), (0.0, 1.0)

    def gap(self, t, q):
        return q[1]

    def slip_speed(self, t, q, v):
        return v[0] - self.belt - self.belt_acceleration * t

    @property
    def law(self):
        return Coulomb(self.mu, self.mu)

    @property
    def bounce(self):
        return self.restitution


# ---- problems with exact answers -----------------------------------------------------------------


@dataclass(frozen=True)
class Problem:
    """A system, its start, and what is known exactly about the events of the given kinds."""

    name: str
    system: AbstractSystem
    start: tuple
    duration: float
    kinds: tuple
    times: tuple  # exact
    final: float | None = None  # exact position of the first coordinate at the end
    rtol: float = 1e-9  # promised relative error of the event times
    options: dict = field(default_factory=dict)


E_ = wiperjax.Event


def stop_oscillator() -> Problem:
    """V2."""
    m, k, f, e = 1e-3, 100.0, 9.81e-3, 0.9
    w = math.sqrt(k / m)
    # from rest at q = 1: q = -f/k + (1 + f/k) cos(w t)
    times = [math.acos((f / k) / (1 + f / k)) / w]
    speed = w * (1 + f / k) * math.sin(w * times[0])
    for _ in range(4):
        speed *= e
        times.append(times[-1] + (2 / w) * math.atan((speed / w) / (f / k)))
    assert math.isclose(times[4], 4.470208524666856e-02, rel_tol=1e-13)
    return Problem(
        "V2 oscillator against a stop",
        StopOscillator(mass=m, stiffness=k, load=f, restitution=e),
        ((1.0,), (0.0,)),
        0.046,
        (E_.IMPACT,),
        tuple(times),
    )


def coulomb_oscillator() -> Problem:
    """V3."""
    t1 = 0.4324077755705378
    turns = [t1 + i * math.pi for i in range(8)]
    return Problem(
        "V3 Coulomb oscillator",
        Block(1.0, 1.0),
        ((12.0,), (6.0,)),
        30.0,
        (E_.REVERSAL, E_.CAPTURE),
        tuple(turns),
        0.6821789367236469,
    )


def block_on_belt(m, k, fs, fd, v) -> Problem:
    """V5: started at the release, where stick ends at x = Fs/k."""
    a, w = (fs - fd) / k, math.sqrt(k / m)
    slip, stick = (2 / w) * (math.pi - math.atan(w * a / v)), 2 * a / v
    lead = 0.3 * stick
    times = []
    t = lead
    for _ in range(4):
        times += [t, t + slip]
        t += slip + stick
    return Problem(
        "V5 block on a belt",
        Block(fs, fd, m, k, belt=v),
        ((fs / k - v * lead,), (v,)),
        t - 0.1 * stick,
        (E_.RELEASE, E_.CAPTURE),
        tuple(times),
        fs / k - 0.1 * stick * v,
    )


def dropped_ball(e) -> Problem:
    """V9, with the completed sequence as one event at its end."""
    height, g = 1.3, 9.81
    fall = math.sqrt(2 * height / g)
    return Problem(
        f"V9 dropped ball, e = {e}",
        Ball(g, e),
        ((height,), (0.0,)),
        fall * (1 + e) / (1 - e) + 0.5,
        (E_.ZENO,),
        (fall * (1 + e) / (1 - e),),
        0.0,
    )


EXACT = [
    stop_oscillator(),
    coulomb_oscillator(),
    block_on_belt(1.0, 1.0, 1.0, 0.5, 0.2),
    block_on_belt(1.0, 100.0, 0.4, 0.25, 0.05),
    dropped_ball(0.3),
    dropped_ball(0.5),
    dropped_ball(0.9),
]
