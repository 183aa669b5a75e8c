"""User-defined systems of about twenty lines each, and their trajectories by `wiperjax.solve`."""

import math
from functools import partial
from typing import ClassVar

import jax
import jax.numpy as jnp
from matching import doubles

import wiperjax
from wiperjax import AbstractSystem, Coulomb, Stribeck

# of `wiperjax.solve`, as it has them by itself
NUMBERS = {"max_steps": 1_000_000, "max_step": math.inf, "zeno_time": 1e-8}


@partial(jax.jit, static_argnames=("solver", "max_events"))
def _trajectory(system, duration, initial_state, rtol, **options):
    return wiperjax.solve(system, duration, initial_state=initial_state, rtol=rtol, **options)


def trajectory(system, duration, initial_state, rtol=1e-10, *, max_events=256, **options):
    """`wiperjax.solve`, compiled once for every class of systems, whatever numbers are given."""
    given = doubles((system, duration, initial_state, rtol))
    return _trajectory(*given, max_events=max_events, **(NUMBERS | options))


def events(solution, *kinds):
    """Times of the events of the given kinds, or the list of (time, kind) of all."""
    count = min(int(solution.events.count), solution.events.time.shape[-1])
    times = [float(t) for t in solution.events.time[:count]]
    names = [wiperjax.Event(int(k)) for k in solution.events.kind[:count]]
    if kinds:
        return [t for t, k in zip(times, names, strict=True) if k in kinds]
    return list(zip(times, names, strict=True))


def times(solution):
    """Times of all events."""
    return [time for time, _ in events(solution)]


class Ball(AbstractSystem):
    """Point mass above a floor."""

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


class FirstOnBelt(AbstractSystem):
    """Two coordinates, the first of them on a belt, pressed onto it by 1."""

    unilateral: ClassVar[bool] = False
    belt: float = 1.0

    def directions(self, t, q):
        return (1.0, 0.0), (0.0, 0.0)

    def normal_force(self, t, q, v):
        return 1.0

    def slip_speed(self, t, q, v):
        return v[0] - self.belt


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
        return Coulomb(self.mu)

    @property
    def bounce(self):
        return self.restitution

    def start(self, angle, speed, spin=0.0):
        """Sliding at `speed` with the tip on the ground."""
        s = self.half
        position = (0.0, s * math.sin(angle), angle)
        return position, (speed + s * math.sin(angle) * spin, s * math.cos(angle) * spin, spin)


class Puck(AbstractSystem):
    """Point mass over a moving floor, q = (x, y), free acceleration (push, -g + lift sin(w t)).

    W is diagonal: the smallest scene with impacts and friction.
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
        return Coulomb(self.mu)

    @property
    def bounce(self):
        return self.restitution


class Ring(AbstractSystem):
    """x'' + (a + b r^2 + c r^4) x' + x = drive cos(w t), r^2 = x^2 + x'^2.

    Without a drive its cycles are circles: a + b r^2 + c r^4 = 0, period 2 pi, multiplier
    exp(-2 pi r^2 (b + 2 c r^2)) by Liouville's formula. b = -1, c = 1: a subcritical Hopf point at
    a = 0 and a fold of cycles at a = 1/4, r^2 = 1/2.
    """

    unilateral: ClassVar[bool] = False
    a: float = 0.1
    b: float = -1.0
    c: float = 1.0
    drive: float = 0.0
    frequency: float = 1.7

    def free_acceleration(self, t, q, v):
        r2 = q[0] ** 2 + v[0] ** 2
        damping = self.a + self.b * r2 + self.c * r2**2
        return (self.drive * jnp.cos(self.frequency * t) - damping * v[0] - q[0],)

    def directions(self, t, q):
        return (0.0,), (0.0,)

    def normal_force(self, t, q, v):
        return 1.0

    def output(self, t, q, v):
        return v[0]


STRIBECK_FOLD, STRIBECK_HOPF = 0.271789042763, 0.190616072954


class StribeckOscillator(AbstractSystem):
    """m x'' + c x' + k x = friction of a belt, unit normal force.

    Its stick-slip cycle meets, where stick ends, the unstable slip cycle on which stick begins
    (belt at ``STRIBECK_FOLD``); that one comes out of steady slip at ``STRIBECK_HOPF``. Both to all
    digits by an independent code.
    """

    unilateral: ClassVar[bool] = False
    belt: float = 0.2
    mass: float = 0.538
    damping: float = 5.746
    stiffness: float = 6957.0

    def free_acceleration(self, t, q, v):
        return ((-self.damping * v[0] - self.stiffness * q[0]) / self.mass,)

    def directions(self, t, q):
        return (1 / self.mass,), (0.0,)

    def normal_force(self, t, q, v):
        return 1.0

    def slip_speed(self, t, q, v):
        return v[0] - self.belt

    @property
    def law(self):
        return Stribeck(6.0, 2.0, 0.1, 1.0, 0.2)


def turn(system):
    """Period of what drives a system."""
    return 2 * jnp.pi / system.frequency


class Far(AbstractSystem):
    """Motion so far above its ground that nothing happens but at its switches."""

    push: ClassVar[float] = 0.0

    def free_acceleration(self, t, q, v):
        return (self.push + 0.0 * t,)

    def directions(self, t, q):
        return (0.0,), (1.0,)

    def gap(self, t, q):
        return 1e3 + q[0]
