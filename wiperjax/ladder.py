"""The model ladder: poorer models of the same blade, for the scenes that need no more.

    block   1 dof: the tip on a spring and dashpot, pressed on the glass by a constant force
    bar     1 dof: the lip without lift-off; its normal force is that of the constraint y = 0
    lip     2 dof: the full model (`Wiper`), with `hinge_mass` > 0 its richest form

Every rung is a system of the same engine, made from the same wiper by `on_rung`, so one scene or
sweep file runs on any of them. Their one coordinate is the tip's place x along the glass.
"""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import xarray as xr
from scipy.optimize import root_scalar

from .belts import AbstractBelt, SteadyBelt
from .friction import AbstractFriction, Stribeck
from .stability import steady_slip
from .system import AbstractSystem, Scalar
from .wiper import Wiper

MODELS = ("block", "bar", "lip")
LEAST_LOAD = 1e-6  # of N0: what presses a bar that would lift off


def on_rung(wiper: Wiper, model: str) -> AbstractSystem:
    """Return the system of ``model`` (one of `MODELS`) that stands for ``wiper``.

    Raises ValueError for another name, and for a block or bar of a wiper with hinge mass: its
    normal force depends on the acceleration, which only the full model resolves.
    """
    if model not in MODELS:
        raise ValueError(f"model must be one of {', '.join(MODELS)}, but was {model!r}")
    if model == "lip":
        return wiper
    if np.any(np.asarray(wiper.hinge_mass) != 0):
        raise ValueError(f"hinge_mass must be 0 with model {model!r}, but was {wiper.hinge_mass}")
    return Bar(wiper) if model == "bar" else block_of(wiper)


def operating_speed(belt: AbstractBelt) -> Scalar:
    """Belt speed V [m/s] at which a motion is linearised: its own if steady, else its peak."""
    return belt.speed if isinstance(belt, SteadyBelt) else belt.peak


class Bar(AbstractSystem):
    """The lip held on the glass, y = 0: MODEL.md section 3 with lambda_n = F + m g for any sign.

    m x'' = f_t + lambda_t with the moment, support force and friction of ``lip``. As long as the
    normal force stays positive this is the lip's own motion, not an approximation to it. Where the
    lip would lift off the bar is pressed by `LEAST_LOAD` of N0, that is, slides freely.
    """

    unilateral: ClassVar[bool] = False
    lip: Wiper

    @property
    def belt(self) -> AbstractBelt:
        return self.lip.belt

    @property
    def law(self) -> AbstractFriction:
        return self.lip.law

    def _free(self, t, q, v):
        """Accelerations of the lip's tip (x, y) on the glass without contact force."""
        return self.lip.free_acceleration(t, (q[0], 0.0 * q[0]), (v[0], 0.0 * v[0]))

    def free_acceleration(self, t, q, v):
        return (self._free(t, q, v)[0],)

    def directions(self, t, q):
        return (1 / self.lip.tip_mass,), (0.0,)

    def constraint_force(self, t, q, v):
        """Force [N/m] that keeps the tip on the glass; below 0 where the lip would lift off."""
        return -self.lip.tip_mass * self._free(t, q, v)[1]

    def normal_force(self, t, q, v):
        least = LEAST_LOAD * self.lip.normal_load
        return jnp.maximum(self.constraint_force(t, q, v), least)

    def slip_speed(self, t, q, v):
        return v[0]

    def rates(self, t, q, v):
        return self.lip.rates(t, q, (v[0], 0.0))[:1]

    def from_rates(self, t, q, rates):
        return self.lip.from_rates(t, q, (rates[0], 0.0))[:1]

    def switches(self, t, q, v):
        # the force's own corner is stepped onto like the shoulder
        least = LEAST_LOAD * self.lip.normal_load
        pressing = self.constraint_force(t, q, v) / self.lip.normal_load - least
        return (*self.lip.switches(t, q, v), pressing)

    def ends(self, t, q, v):
        return (*self.lip.ends(t, (q[0], 0.0), (v[0], 0.0)), False)

    def break_time(self, piece):
        return self.belt.break_time(piece)

    def first_piece(self, t):
        return self.belt.first_piece(t)

    def reverses(self, piece):
        return self.belt.reverses(piece)

    def on_piece(self, piece):
        return Bar(self.lip.on_piece(piece))

    def on_sides(self, sides):
        # the last side is that of the pressing force, which is not the lip's
        return Bar(self.lip.on_sides(sides[:-1]))

    def prepared(self):
        return Bar(self.lip.prepared())

    def default_state(self):
        (x, _), (u, _) = self.lip.default_state()
        return (x,), (u,)

    def scales(self, n):
        (length, _), (speed, _) = self.lip.scales(2)
        return (length,), (speed,)

    def output(self, t, q, v):
        return self.rates(t, q, v)[0]


class Block(AbstractSystem):
    """Block on a belt: m x'' + damping x' + stiffness (x - centre) = lambda_t, pressed by ``load``.

    Per metre of blade. With the Stribeck law it is the squeal oscillator, with mu_minimum <
    mu_static and a tiny stribeck_speed the classic stick-slip block (VERIFICATION.md V5).
    """

    unilateral: ClassVar[bool] = False
    belt: AbstractBelt
    friction: AbstractFriction
    mass: Scalar  # kg/m
    damping: Scalar  # N s/m per m; may be negative (leading side)
    stiffness: Scalar  # N/m per m; may be negative (leading side)
    centre: Scalar  # m, where the spring is relaxed
    load: Scalar  # N/m
    reach: Scalar  # m, |x| at which the lip that it stands for lies flat: COLLAPSED
    piece: Scalar = 0

    @property
    def law(self) -> AbstractFriction:
        return self.friction

    def free_acceleration(self, t, q, v):
        speed = self.rates(t, q, v)[0]
        force = -self.damping * speed - self.stiffness * (q[0] - self.centre)
        return (force / self.mass - self.belt.motion(t, self.piece)[1],)

    def directions(self, t, q):
        return (1 / self.mass,), (0.0,)

    def normal_force(self, t, q, v):
        return self.load

    def slip_speed(self, t, q, v):
        return v[0]

    # as in the wiper, the velocity inside is x' - V
    def rates(self, t, q, v):
        return (v[0] + self.belt.motion(t, self.piece)[0],)

    def from_rates(self, t, q, rates):
        return (rates[0] - self.belt.motion(t, self.piece)[0],)

    def switches(self, t, q, v):
        return ((1 - q[0] / self.reach) * (1 + q[0] / self.reach),)

    def ends(self, t, q, v):
        return (True,)

    def break_time(self, piece):
        return self.belt.break_time(piece)

    def first_piece(self, t):
        return self.belt.first_piece(t)

    def reverses(self, piece):
        return self.belt.reverses(piece)

    def on_piece(self, piece):
        return eqx.tree_at(lambda b: b.piece, self, piece)

    def default_state(self):
        """At rest where the spring is relaxed."""
        return (self.centre,), (0.0 * self.centre,)

    def scales(self, n):
        speed = jnp.maximum(self.belt.peak, 1e-4 * jnp.sqrt(self.load * self.reach / self.mass))
        return (self.reach,), (speed,)

    def output(self, t, q, v):
        return self.rates(t, q, v)[0]


def block_of(wiper: Wiper) -> Block:
    """Return the block that equals ``wiper`` to first order about its steady slip.

    With phi the angle of steady slip at V (`operating_speed`; the branch that leans farthest along
    the belt's motion), tau = tan(phi), s = sign(V), N the normal force there and mu = mu(|V|),
    VERIFICATION.md V11 gives the tip m xi'' + (c_b + mu'(V) N) xi' + k_b xi = 0 with

        c_b = c tau (tau + s mu) + c_phi/(L cos phi)^2
        k_b = M'(theta)/(L cos phi)^2 + k tau (tau + s mu) + N (s mu tau - 1)/(L cos phi)

    so m, c_b, k_b, the load N, the wiper's own friction law and the centre x - s mu N/k_b make a
    block with that steady slip and that linearisation. NaN where there is no steady slip. The load
    is that of one branch: on a belt that reverses, the block stays on the branch of V > 0.
    """
    speed = operating_speed(wiper.belt)
    slip = steady_slip(wiper, speed)
    law, sign = wiper.law, jnp.sign(speed)
    mu, tau = law.coefficient(jnp.abs(speed)), jnp.tan(slip.phi)
    arm = wiper.lip_length * jnp.cos(slip.phi)
    return Block(
        belt=wiper.belt,
        friction=law,
        mass=wiper.tip_mass,
        damping=wiper.support_damping * tau * (tau + sign * mu) + wiper.hinge_damping / arm**2,
        stiffness=slip.k_eff,
        centre=slip.x - sign * mu * slip.normal_force / slip.k_eff,
        load=slip.normal_force,
        reach=wiper.lip_length * jnp.sin(wiper.collapse_angle),
    )


def unstable_speeds(block: Block) -> tuple[float, float]:
    """Belt speeds (low, high) [m/s] between which steady slip of ``block`` is unstable.

    Lyapunov's first method: m xi'' + (c_b + mu'(V) N) xi' + k_b xi = 0 grows where mu'(V) is below
    -c_b/N. The Stribeck curve is steepest at v_s ((delta - 1)/delta)^(1/delta), so that
    the speeds form one interval; for delta = 1 it begins at rest and ends at
    v_s ln((mu_s - mu_m) N/(v_s (c_b + beta N))). (nan, nan) if no speed is unstable; high is inf if
    none is stable. The load is held at its value, as the block does.
    """
    law = block.friction
    if not isinstance(law, Stribeck):
        raise ValueError(f"block must have Stribeck friction, but had {type(law).__name__}")
    scale, shape = float(law.stribeck_speed), float(law.shape)
    fall = float(law.static - law.minimum) / scale
    allowed = float(law.viscous_slope + block.damping / block.load)

    def excess(u):  # -mu' of the falling part, less what damping and viscosity allow; u = V/v_s
        return fall * shape * u ** (shape - 1) * np.exp(-(u**shape)) - allowed

    top = ((shape - 1) / shape) ** (1 / shape)
    if not excess(top) > 0:
        return np.nan, np.nan
    low = 0.0 if excess(0.0) > 0 else root_scalar(excess, bracket=(0.0, top), xtol=1e-15).root
    if allowed <= 0:
        return scale * low, np.inf
    far = top + 1.0
    while excess(far) > 0:
        far *= 2
    high = root_scalar(excess, bracket=(top, far), xtol=1e-15).root
    return scale * low, scale * high


def start_on_rung(system: AbstractSystem, start, kind: str):
    """Return ((x, ...), (x', ...)) of a lip's start ((x, y), (x', y')) for ``system``.

    ``kind`` is that of a `spec_tables.Start`. The default start is phi = alpha for lip and bar. A
    block has no such place (its spring is that of the steadily leaning lip, far from there, and
    would throw it off): it starts at rest where its spring is relaxed.

    Raises ValueError for a start in the air on a rung that cannot leave the glass.
    """
    if isinstance(system, Wiper):
        return start
    if isinstance(system, Block) and kind == "default":
        return system.default_state()
    if any(np.any(np.asarray(part[1]) != 0) for part in start):
        raise ValueError("start must touch the glass at rest along y with model 'block' or 'bar'")
    return tuple(part[:1] for part in start)


def as_lip(run: xr.Dataset) -> xr.Dataset:
    """Return a run of a block or bar with the lip's two coordinates, y = 0 and y' = 0 added."""
    if run.sizes.get("axis") != 1:
        return run
    both = run.reindex(axis=[*run.axis.values, "y"], fill_value=0.0)
    return both.assign_coords(axis=("axis", ["x", "y"], run.axis.attrs))
