"""Systems of one's own with something about them that a file has to keep, or to refuse."""

import equinox as eqx
import jax
import jax.numpy as jnp
import own_systems

import wiperjax
from wiperjax import parameter


class Pendant(own_systems.Ball):
    """Plain numbers by names that the wiper has too, each with another default."""

    gravity: float = 9.81
    restitution: float = 0.8
    support_damping: float = 0.05


class Softer(wiperjax.Coulomb):
    """Coulomb's law with a coefficient that falls, and a number more."""

    softening: float = parameter(0.0, "s/m", low=0)

    def __init__(self, static, dynamic=None, softening=2.0):
        super().__init__(static, dynamic)
        self.softening = softening

    def coefficient(self, speed):
        return self.dynamic / (1 + self.softening * speed)


class OnSofter(own_systems.Oscillator):
    friction: wiperjax.AbstractFriction = Softer(0.9, 0.6, softening=3.0)


class Switched(wiperjax.AbstractFriction):
    """A law with more than numbers."""

    static: float = parameter(1.0, low=0)
    falls: bool = False
    weights: tuple = (1.0, 2.0)

    def coefficient(self, speed):
        return self.static * (self.weights[0] if self.falls else self.weights[1]) / 2


class OnSwitched(own_systems.Oscillator):
    friction: wiperjax.AbstractFriction = Switched(0.7, falls=True, weights=(0.5, 1.5))


class OnWiping(own_systems.Oscillator):
    """A belt that turns, by default."""

    belt: wiperjax.AbstractBelt = wiperjax.WipingBelt(0.5, 0.05)


class LipOnWiping(OnWiping):
    """A lip that is carried over, on a belt that turns by default."""

    lip_length: float = wiperjax.parameter(0.006, "m", above=0)


class LipInTheAir(own_systems.Ball):
    """A lip, and no belt that could carry it over."""

    lip_length: float = wiperjax.parameter(0.006, "m", above=0)


class Running(wiperjax.SteadyBelt):
    """A belt of one's own, made of one of the package."""

    def velocity(self, time, piece):
        return self.speed * (1 - jnp.exp(-time))


class OnRunning(own_systems.Oscillator):
    belt: wiperjax.AbstractBelt = Running(0.5)


class Pulsed(own_systems.Oscillator):
    """A parameter that has the name of an attribute of runs."""

    duration: float = parameter(3.0, "s", above=0)


class Struck(own_systems.Oscillator):
    """Held by the belt for long, on a soft spring, but for a push of some tenths of a second."""

    stiffness: float = parameter(1e-3, "N/m", above=0)

    def push(self, t):
        return 3.0 * jnp.exp(-(((t - 33.0) / 0.2) ** 2))

    def free_acceleration(self, t, q, v):
        return ((self.push(t) - self.stiffness * q[0]) / self.mass,)

    def default_state(self):
        return (0.0,), (0.2,)


class Spelled(own_systems.Oscillator):
    """Parameters that have the names of variables of branches and of modes."""

    period: float = parameter(1.0, "s", above=0)
    amplitude: float = parameter(1.0, "N", above=0)
    frequency: float = parameter(1.0, "Hz", above=0)


class Overdriven(own_systems.Oscillator):
    """A parameter that has the name of an attribute of branches."""

    over: float = parameter(1.0, "N", above=0)


class Undefined(own_systems.Oscillator):
    """Its acceleration is no number from the start on."""

    def free_acceleration(self, t, q, v):
        return (jnp.log(-1.0 - q[0] ** 2),)


class Tabled(wiperjax.AbstractFriction):
    """A law of a table of five points."""

    static: float = parameter(1.0, low=0)
    speeds: jax.Array = eqx.field(default_factory=lambda: jnp.linspace(0.0, 2.0, 5))

    def coefficient(self, speed):
        return jnp.interp(speed, self.speeds, jnp.exp(-self.speeds))


class OnTable(own_systems.Oscillator):
    friction: wiperjax.AbstractFriction = Tabled()


class Named(own_systems.Oscillator):
    mode: str = "soft"


class Driven(own_systems.Oscillator):
    """A force of a table over time."""

    times: tuple = (0.0, 1.0, 2.5)
    forces: tuple = (1.0, 3.0, 1.5)

    def free_acceleration(self, t, q, v):
        force = jnp.interp(t, jnp.asarray(self.times), jnp.asarray(self.forces))
        return ((force - self.stiffness * q[0]) / self.mass,)
