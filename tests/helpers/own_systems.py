"""Systems of one's own as a user writes them: files name them by `own_systems:Class`."""

import jax.numpy as jnp

import wiperjax
from wiperjax import parameter


class Falling(wiperjax.AbstractFriction):
    """Leine's law, static / (1 + steepness |v|)."""

    static: float = parameter(1.0, low=0, long_name="limit at rest")
    steepness: float = parameter(3.0, "s/m", low=0)

    def coefficient(self, speed):
        return self.static / (1 + self.steepness * speed)


class Oscillator(wiperjax.AbstractBeltSystem):
    """Leine's stick-slip oscillator: a block on a spring, carried along by a belt."""

    unilateral = False
    coordinates = ("x",)
    mass: float = parameter(1.0, "kg", above=0)
    stiffness: float = parameter(1.0, "N/m", above=0, long_name="stiffness of the spring")
    load: float = parameter(1.0, "N", above=0)
    tilt: float = parameter(0.0, "rad", low=-45, high=45, long_name="tilt of the belt")
    friction: wiperjax.AbstractFriction = Falling()
    belt: wiperjax.AbstractBelt = wiperjax.SteadyBelt(0.2)

    def free_acceleration(self, t, q, v):
        return (-self.stiffness * q[0] / self.mass - 9.81 * jnp.sin(self.tilt),)

    def directions(self, t, q):
        return (1 / self.mass,), (0.0,)

    def normal_force(self, t, q, v):
        return self.load

    def default_state(self):
        return (0.0,), (0.0,)


class Damped(Oscillator):
    """The friction oscillator of bSTAB: Stribeck's law, mu = 1 at rest and 0.5 at high speed."""

    damping: float = parameter(0.05, "N s/m", low=0)
    friction: wiperjax.AbstractFriction = wiperjax.Stribeck(1.0, 0.5, 0.5)

    def free_acceleration(self, t, q, v):
        return ((-self.stiffness * q[0] - 2 * self.damping * v[0]) / self.mass,)


class Walled(Damped):
    """It runs against a wall on either side."""

    stops = (0, 1)
    wall: float = parameter(0.6, "m", above=0)

    def switches(self, t, q, v):
        return self.wall - q[0], self.wall + q[0]

    def rebound(self, stop, t, q, v, closed):
        return (-0.5 * v[0],)


class Ball(wiperjax.AbstractSystem):
    """A ball that falls on a table."""

    coordinates = ("height",)
    restitution: float = parameter(0.5, low=0, high=1)
    gravity: float = parameter(9.81, "m/s^2", above=0)

    @property
    def bounce(self):
        return self.restitution

    def free_acceleration(self, t, q, v):
        return (-self.gravity,)

    def directions(self, t, q):
        return (0.0,), (1.0,)

    def gap(self, t, q):
        return q[0]

    def output(self, t, q, v):
        return v[0]


class BallOnATable(Ball):
    """A table that stands high, or is moved up and down: the gap is a difference of numbers far
    larger than itself."""

    table: float = parameter(1.0, "m")
    amplitude: float = parameter(0.1, "m", low=0)
    rate: float = parameter(3.0, "1/s", above=0)

    def gap(self, t, q):
        return q[0] - self.table - self.amplitude * jnp.sin(self.rate * t)


class TwoBlocks(Oscillator):
    """Two blocks in a row, the first on the belt."""

    coordinates = ("x1", "x2")
    second: float = parameter(2.0, "kg", above=0, long_name="mass of the second block")
    link: float = parameter(3.0, "N/m", low=0, long_name="stiffness between the blocks")

    def free_acceleration(self, t, q, v):
        pull = self.link * (q[1] - q[0])
        return (pull - self.stiffness * q[0]) / self.mass, -pull / self.second

    def directions(self, t, q):
        return (1 / self.mass, 0.0), (0.0, 0.0)

    def default_state(self):
        return (0.0, 0.0), (0.0, 0.0)


class Unfinished(wiperjax.AbstractSystem):
    """It says nothing of its motion."""

    coordinates = ("x",)


class Nameless(Ball):
    """It does not name its coordinates."""

    coordinates = ()


class Rising(wiperjax.AbstractFriction):
    """A law that is larger in slip than it lets the contact hold at rest."""

    static: float = parameter(0.5)

    def coefficient(self, speed):
        return 1.2 * self.static


class Driving(wiperjax.AbstractFriction):
    """A law that drives what slips."""

    static: float = parameter(0.5)

    def coefficient(self, speed):
        return -0.2 * self.static


class Lopsided(Ball):
    """It has two coordinates, and accelerates one."""

    coordinates = ("x", "height")


class Failing(Ball):
    """Its own code is wrong."""

    def free_acceleration(self, t, q, v):
        return (q[3],)


class Listing(Ball):
    """It returns a list of a number where a number is asked."""

    def gap(self, t, q):
        return (q[0],)


class Floating(Ball):
    """Its start is a number."""

    def default_state(self):
        return 1.0


class Bodiless(Ball):
    """It may open, but does not say when."""

    gap = wiperjax.AbstractSystem.gap


class Untold(Ball):
    """A parameter without unit or default."""

    drag: float = parameter(unit="kg/s")


class Twice(Oscillator):
    """It has a parameter that its belt has, too."""

    belt_speed: float = parameter(1.0, "m/s")


NUMBER = 3


class Lifted(Oscillator):
    """A load that is taken off for a part of each period, and pulls then."""

    def normal_force(self, t, q, v):
        return 0.3 + jnp.sin(t)


class Rod(wiperjax.AbstractSystem):
    """A rod that leans and slides on the ground (Painleve); its mass, half its length, g are 1."""

    coordinates = ("x", "y", "angle")
    inertia: float = parameter(1 / 3, above=0)
    friction: wiperjax.AbstractFriction = wiperjax.Coulomb(0.3)

    def free_acceleration(self, t, q, v):
        return 0.0, -1.0, 0.0

    def directions(self, t, q):
        sin, cos = jnp.sin(q[2]), jnp.cos(q[2])
        return (1.0, 0.0, sin / self.inertia), (0.0, 1.0, -cos / self.inertia)

    def gap(self, t, q):
        return q[1] - jnp.sin(q[2])

    def slip_speed(self, t, q, v):
        return v[0] + jnp.sin(q[2]) * v[2]

    def output(self, t, q, v):
        return v[2]


class Hung(wiperjax.AbstractBeltSystem):
    """What is pressed up against a belt, and pushed off by the way in which friction moves it: its
    first coordinate leads into the belt."""

    coordinates = ("y", "x")
    height: float = parameter(0.1, "m", above=0)
    stiffness: float = parameter(100.0, "N/m", above=0)
    shared: float = parameter(0.4, low=-0.5, high=0.5, long_name="of both in the inverse inertia")
    friction: wiperjax.AbstractFriction = wiperjax.Coulomb(1.0)
    belt: wiperjax.AbstractBelt = wiperjax.SteadyBelt(0.1)

    def contact_velocity(self, t, q, v):
        return v[1]

    def free_acceleration(self, t, q, v):
        along = -self.stiffness * q[1] - v[1]
        return 10.0 + self.shared * along, 10.0 * self.shared + along

    def directions(self, t, q):
        return (self.shared, 1.0), (-1.0, -self.shared)

    def gap(self, t, q):
        return self.height - q[0]

    def default_state(self):
        return (self.height, 0.0), (0.0, 0.0)


class Pendulum(wiperjax.AbstractBeltSystem):
    """Froude's: on a shaft that turns, whose rim is the contact; its angle is in radians."""

    unilateral = False
    coordinates = ("angle",)
    inertia: float = parameter(0.02, "kg m^2", above=0)
    moment: float = parameter(0.5, "N m", above=0)
    radius: float = parameter(0.05, "m", above=0)
    clamp: float = parameter(8.0, "N", above=0)
    lean: float = parameter(0.2, "rad", low=-180, high=180)
    friction: wiperjax.AbstractFriction = wiperjax.Stribeck(0.7, 0.3, 0.1)
    belt: wiperjax.AbstractBelt = wiperjax.SteadyBelt(0.1)

    def contact_velocity(self, t, q, v):
        return self.radius * v[0]

    def free_acceleration(self, t, q, v):
        return (-self.moment * jnp.sin(q[0] - self.lean) / self.inertia,)

    def directions(self, t, q):
        return (self.radius / self.inertia,), (0.0,)

    def normal_force(self, t, q, v):
        return self.clamp

    def default_state(self):
        return (0.0,), (0.0,)


class Pulled(wiperjax.AbstractSystem):
    """A mass drags a block to and fro over the ground by a spring: no belt, and the block, whose
    contact it is, is the second coordinate."""

    unilateral = False
    coordinates = ("mass", "block")
    stiffness: float = parameter(4.0, "N/m", above=0)
    force: float = parameter(3.0, "N", low=0)
    friction: wiperjax.AbstractFriction = wiperjax.Coulomb(1.0)

    def free_acceleration(self, t, q, v):
        pull = self.stiffness * (q[1] - q[0])
        return pull + self.force * jnp.sin(t) - v[0], -pull

    def directions(self, t, q):
        return (0.0, 1.0), (0.0, 0.0)

    def normal_force(self, t, q, v):
        return 1.0

    def slip_speed(self, t, q, v):
        return v[1]

    def output(self, t, q, v):
        return v[0]

    def default_state(self):
        return (0.0, 0.0), (0.0, 0.0)


class Unsaid(wiperjax.TrapezoidBelt):
    """A belt that turns and says no more than a belt must: neither when nor how often."""

    kind = ""
    since_reversal = wiperjax.AbstractBelt.since_reversal
    wiping_frequency = wiperjax.AbstractBelt.wiping_frequency


class OnePiece(wiperjax.AbstractBelt):
    """A belt that is no `SteadyBelt`, of one piece, that never turns."""

    def break_time(self, piece):
        return jnp.inf

    def first_piece(self, time):
        return 0

    def reverses(self, piece):
        return False


class RunsBack(OnePiece):
    """A belt that moves at -0.3 m/s."""

    def velocity(self, time, piece):
        return -0.3

    @property
    def peak(self):
        return 0.3

    @property
    def rms(self):
        return 0.3


class DrivenBetweenWalls(wiperjax.AbstractSystem):
    """Den Hartog's block, driven on a floor at rest, between two walls."""

    unilateral = False
    coordinates = ("x",)
    stops = (0, 1)
    drive_frequency: float = parameter(3.0, "Hz", above=0)
    play: float = parameter(0.03, "m", above=0, long_name="from the middle to a wall")
    restitution: float = parameter(0.6, low=0, high=1)
    friction: wiperjax.AbstractFriction = wiperjax.Coulomb(0.3)

    @property
    def drive_period(self):
        return 1 / self.drive_frequency

    def free_acceleration(self, t, q, v):
        return (40 * jnp.cos(2 * jnp.pi * self.drive_frequency * t) - 1000 * q[0],)

    def directions(self, t, q):
        return (1.0,), (0.0,)

    def normal_force(self, t, q, v):
        return 20.0

    def slip_speed(self, t, q, v):
        return v[0]

    def switches(self, t, q, v):
        return self.play - q[0], self.play + q[0]

    def rebound(self, stop, t, q, v, closed):
        return (-self.restitution * v[0],)

    def output(self, t, q, v):
        return v[0]

    def default_state(self):
        return (0.0,), (0.0,)

    def scales(self, n):
        return (0.01,), (0.3,)
