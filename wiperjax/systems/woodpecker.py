"""The woodpecker toy: a sleeve jams on a pole, slides, falls, and the bird on its spring pecks.

R. I. Leine, Ch. Glocker, D. H. van Campen, "Nonlinear dynamics of the woodpecker toy", Proceedings
of DETC 2001, VIB-21608, with the numbers of F. Pfeiffer, Ch. Glocker, "Multibody Dynamics with
Unilateral Contacts", 1996. Angles are small: kinematics and masses are linear.

The pole is touched at three places. The sleeve's edges exclude each other and are one contact, that
of the side to which the sleeve is turned; the beak touches for an instant, and is a stop.
"""

import jax.numpy as jnp
import numpy as np

from ..contact.friction import AbstractFriction, Coulomb
from ..contact.impact import phased_impact
from ..contact.system import AbstractSystem
from ..numerics.bernstein import largest
from ..numerics.fusion_barrier import keep
from ..vocabulary import checks
from ..vocabulary.declared import parameter, set_by_the_engine

FREE, HELD = 0, 1  # normal: no more impulse than is given, or the ends stay together
STICK = 0  # tangential; else the sign of slip
ROUNDINGS = 1e3  # last digits: what differs by fewer is the same
MODES = np.array(
    [(n1, t1, n2, t2) for n1 in (0, 1) for t1 in (0, 1, -1) for n2 in (0, 1) for t2 in (0, 1, -1)]
).T  # of beak and edge, each in one of six


class Woodpecker(AbstractSystem):
    """Sleeve and bird on a pole: height of the sleeve [m], angles of sleeve and bird [rad].

    ``friction`` is that of the sleeve's edges on the pole.
    """

    coordinates = ("height", "sleeve", "bird")
    stops = (1,)
    valid_where = "the beak is outside the pole"
    sleeve_mass: float = parameter(0.0003, "kg", above=0)
    sleeve_inertia: float = parameter(5e-9, "kg m^2", above=0)
    bird_mass: float = parameter(0.0045, "kg", above=0)
    bird_inertia: float = parameter(7e-7, "kg m^2", above=0)
    stiffness: float = parameter(0.0056, "N m/rad", above=0, long_name="stiffness of the spring")
    gravity: float = parameter(9.81, "m/s^2", above=0)
    pole_radius: float = parameter(0.0025, "m", above=0)
    sleeve_radius: float = parameter(0.0031, "m", above=0)
    sleeve_height: float = parameter(0.0058, "m", above=0, long_name="half height of the sleeve")
    spring_arm: float = parameter(0.010, "m", above=0, long_name="from the sleeve to the spring")
    bird_arm: float = parameter(0.015, "m", above=0, long_name="from the spring to the bird")
    beak_height: float = parameter(0.020, "m", above=0, long_name="height of the beak on the bird")
    beak_length: float = parameter(0.0201, "m", above=0, long_name="from the bird to its beak")
    beak_restitution: float = parameter(0.5, low=0, high=1)
    beak_friction: float = parameter(0.3, low=0)
    friction: AbstractFriction = Coulomb(0.3)
    sides: tuple | None = set_by_the_engine()  # signs of the switches

    def __check_init__(self):
        super().__check_init__()  # equinox calls it too, but after this one
        limit = self.sleeve_radius, "sleeve_radius"
        checks.at_most("pole_radius", self.pole_radius, *limit, itself=False)

    @property
    def _turn(self):
        """Angle of the sleeve at which an edge meets the pole."""
        return (self.sleeve_radius - self.pole_radius) / self.sleeve_height

    def _inverse(self):
        """Rows of the inverse of the mass matrix, by its cofactors."""
        m, a, b = self.bird_mass, self.spring_arm, self.bird_arm
        xx, xs, xb = m + self.sleeve_mass, m * a, m * b
        ss, sb, bb = self.sleeve_inertia + m * a * a, m * a * b, self.bird_inertia + m * b * b
        top = ss * bb - sb * sb, xb * sb - xs * bb, xs * sb - xb * ss
        scale = 1 / (xx * top[0] + xs * top[1] + xb * top[2])
        middle = top[1], xx * bb - xb * xb, xb * xs - xx * sb
        return tuple(
            tuple(x * scale for x in row)
            for row in (top, middle, (top[2], middle[2], xx * ss - xs * xs))
        )

    def _moved(self, force):
        """Accelerations by a generalised force."""
        return tuple(_dot(row, force) for row in self._inverse())

    def _side(self, q):
        """+1 where the sleeve is turned to its upper edge, -1 to its lower one."""
        return jnp.where(q[1] < 0, -1.0, 1.0) if self.sides is None else self.sides[0]

    def _edge(self, q):
        """Directions of the edge's normal and tangential speeds."""
        normal = (0.0, -self.sleeve_height * self._side(q), 0.0)
        return normal, (1.0, self.sleeve_radius, 0.0)

    def _beak(self):
        """The same of the beak."""
        along = (1.0, self.spring_arm, self.bird_arm - self.beak_length)
        return (0.0, 0.0, -self.beak_height), along

    def free_acceleration(self, t, q, v):
        weight, twist = self.bird_mass * self.gravity, self.stiffness * (q[1] - q[2])
        return self._moved(
            (
                -weight - self.sleeve_mass * self.gravity,
                -twist - weight * self.spring_arm,
                twist - weight * self.bird_arm,
            )
        )

    def directions(self, t, q):
        normal, tangential = self._edge(q)
        return self._moved(tangential), self._moved(normal)

    def gap(self, t, q):
        play = self.sleeve_radius - self.pole_radius
        return play - self.sleeve_height * self._side(q) * q[1]

    def slip_speed(self, t, q, v):
        return v[0] + self.sleeve_radius * v[1]

    def switches(self, t, q, v):
        reach = self.spring_arm + self.bird_arm - self.beak_length - self.pole_radius
        return q[1], reach - self.beak_height * q[2]

    def impact(self, w_tt, w_tn, w_nn, mu, slip_speed, normal_speed, jam):
        return phased_impact(w_tt, w_tn, w_nn, mu, self.bounce, slip_speed, normal_speed, jam)

    def rebound(self, stop, t, q, v, closed):
        """An impact of the beak and, if it is closed, of the sleeve's edge: Poisson's law in two
        phases and Coulomb's in each, with the impulses of both (Pfeiffer and Glocker)."""
        ways = (*self._beak(), *self._edge(q))
        moved = [self._moved(way) for way in ways]
        inertia = [[_dot(way, m) for m in moved] for way in ways]
        mu = [self.beak_friction, self._edge_friction(_dot(ways[3], v))]
        # four ways and three coordinates: these impulses together move nothing
        (_, _, beak), (_, arm, lever), (_, edge, _), (_, radius, _) = ways
        idle = [-lever / beak, 1.0, (radius - arm) / edge, -1.0]

        def phase(v, given):
            speeds = [_dot(way, v) for way in ways]
            impulses = _impulses(inertia, idle, speeds, mu, given, closed)
            pushes = [[x * p for x in m] for m, p in zip(moved, impulses, strict=True)]
            return tuple(x + sum(d) for x, *d in zip(v, *pushes, strict=True)), impulses

        none = 0.0 * v[0]
        v, compression = phase(v, (none, none))
        return phase(v, (self.beak_restitution * compression[0], none))[0]

    def _edge_friction(self, slip_speed):
        """Coefficient at a closed edge: the static one where it slips by rounding only."""
        speed = jnp.abs(slip_speed)
        least = ROUNDINGS * float(jnp.finfo(speed.dtype).eps) * self.scales(3)[1][0]
        return jnp.where(speed > least, self.friction.coefficient(speed), self.friction.static)

    def default_state(self):
        """As Glocker's simulation begins: sliding on its lower edge, the bird swings back."""
        return (0.0, -self._turn, -0.2788), (-0.3411, 0.0, -7.4583)

    def scales(self, n):
        fall = jnp.sqrt(self.gravity * self.bird_arm)
        return (self.bird_arm, self._turn, 1.0), (
            fall,
            fall / self.sleeve_height,
            fall / self.bird_arm,
        )

    def output(self, t, q, v):
        return v[0]


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _impulses(inertia, idle, speeds, mu, given, closed):
    """Return the impulses of a phase, (normal, tangential) of the beak and of the edge.

    At each the normal impulse is as large as ``given`` and the ends part, or larger and they stay
    together; the tangential one holds, or is the limit of friction against the slip that is left.
    Every combination is solved for. Of those that fit the least impulses are taken (the sum of
    their squares): where all is held, any share of ``idle`` may be added to them. Where not
    ``closed`` the edge has no part.
    """
    n1, t1, n2, t2 = (mode.reshape((-1,) + (1,) * jnp.ndim(speeds[0])) for mode in MODES)
    rows = []
    for i, (held, slip) in enumerate(((n1, t1), (n2, t2))):
        normal, along = 2 * i, 2 * i + 1
        unit = [1.0 * (k == normal) for k in range(4)], [1.0 * (k == along) for k in range(4)]
        left = [jnp.where(held == HELD, inertia[normal][k], unit[0][k]) for k in range(4)]
        rows.append([*left, jnp.where(held == HELD, -speeds[normal], given[i])])
        limit = [unit[1][k] + slip * mu[i] * unit[0][k] for k in range(4)]
        left = [jnp.where(slip == STICK, inertia[along][k], limit[k]) for k in range(4)]
        rows.append([*left, jnp.where(slip == STICK, -speeds[along], 0.0)])
    # what holds all but the last way holds it, too; instead: the least impulses
    all_held = (n1 == HELD) & (t1 == STICK) & (n2 == HELD) & (t2 == STICK)
    rows[3] = [jnp.where(all_held, x, y) for x, y in zip((*idle, 0.0), rows[3], strict=True)]
    found, solved = _solved(rows)
    after = [
        s + sum(w * x for w, x in zip(row, found, strict=True))
        for s, row in zip(speeds, inertia, strict=True)
    ]
    off = []
    for i, (held, slip) in enumerate(((n1, t1), (n2, t2))):
        normal, along = 2 * i, 2 * i + 1
        lack = inertia[normal][normal] * (given[i] - found[normal])
        beyond = inertia[along][along] * (jnp.abs(found[along]) - mu[i] * found[normal])
        misfit = jnp.maximum(
            jnp.where(held == HELD, lack, -after[normal]),
            jnp.where(slip == STICK, beyond, -slip * after[along]),
        )
        off.append(jnp.maximum(misfit, 0.0))
    absent = jnp.where((n2 == FREE) & (t2 == 1), 0.0, jnp.inf)
    worst = jnp.maximum(off[0], jnp.where(closed, off[1], absent))
    worst, found = keep((jnp.where(solved & jnp.isfinite(worst), worst, jnp.inf), found))
    scale = sum(jnp.abs(s) for s in speeds) + inertia[0][0] * given[0]
    same = ROUNDINGS * float(jnp.finfo(worst.dtype).eps) * scale
    fits = worst <= jnp.min(worst, axis=0) + same
    size = jnp.where(fits, sum(x * x for x in found), jnp.inf)
    best = jnp.arange(MODES.shape[1]).reshape(n1.shape) == jnp.argmin(size, axis=0)
    return [jnp.sum(jnp.where(best, x, 0.0), axis=0) for x in found]


def _solved(rows):
    """Solve four equations, the right-hand side last in each, by elimination; and whether they
    have one solution, as far as their digits tell."""
    rows, one = [list(row) for row in rows], True
    sizes = [largest(tuple(jnp.abs(x) for x in row[:4])) for row in rows]
    for k in range(4):
        pivot = rows[k][k]
        least = ROUNDINGS * float(jnp.finfo(pivot.dtype).eps) * sizes[k]
        flat = jnp.abs(pivot) <= least
        one = one & ~flat
        pivot = jnp.where(flat, 1.0, pivot)
        rows[k] = [x / pivot for x in rows[k]]
        for i in range(4):
            if i != k:
                rows[i] = [x - rows[i][k] * y for x, y in zip(rows[i], rows[k], strict=True)]
        rows = keep(rows)  # else it is worked out anew for each of its uses
    return [row[4] for row in rows], one
