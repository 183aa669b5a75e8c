"""The wiper as `diffrax_phases` needs it: rates, guards and impacts for a traced regime.

Forces come from `wiperjax.Wiper`.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from wiperjax import Event, Regime

STICK, SLIP_POS, SLIP_NEG, FLIGHT = (int(r) for r in Regime)
ZENO_TIME = 1e-8
GUARDS = 5  # two of the regime, two shoulders, the limit
UPPER, LOWER, LIMIT = 2, 3, 4


class State(NamedTuple):
    """What is integrated. SI units."""

    x: Any
    slip: Any  # x' - V
    y: Any
    vy: Any


class Constants(NamedTuple):
    """What does not change within a phase: the arguments of its rates and guards."""

    wiper: Any  # on its belt's piece
    regime: Any
    zone: Any  # branch of the rotational spring: -1, 0, 1
    since: Any  # start of the phase, s
    order: Any  # (GUARDS,) of each guard's zero at that start; 0: it has none there
    scales: Any  # m, m/s


class Strike(NamedTuple):
    """What an impact makes of time and state, and which kind of event it is."""

    time: Any
    x: Any
    slip: Any
    vy: Any
    kind: Any


def spring_moment(w, zone, phi):
    """Moment of the rotational spring on its branch ``zone``, continued smoothly."""
    extra = w.shoulder_stiffness - w.neck_stiffness
    theta = phi - w.attack_angle
    past = jnp.where(zone == 0, 0.0, theta - zone * w.shoulder_angle)
    return w.neck_stiffness * theta + extra * past


def free(w, zone, x, y, u, vy):
    """Return (force along x, force onto the glass) without contact forces."""
    lean = w.lean((x, y))
    down = w.support_force((x, y), (u, vy), lean)
    push = spring_moment(w, zone, lean.angle) / (w.lip_length * lean.cos)
    return down * lean.tan - push, down + w.tip_mass * w.gravity


def belt(w, t):
    """Return V, V'."""
    value, slope = jax.jvp(
        lambda t: jnp.asarray(w.belt.velocity(t, w.piece), float), (t,), (jnp.ones_like(t),)
    )
    return value, slope


def sign_of(regime):
    return jnp.where(regime == SLIP_POS, 1.0, jnp.where(regime == SLIP_NEG, -1.0, 0.0))


def field(t, s: State, held: Constants) -> State:
    """Return the rates of the state in the regime that is held."""
    w, regime, zone = held[:3]
    x, slip, y, vy = s
    speed, pull = belt(w, t)
    u = slip + speed
    along, down = free(w, zone, x, y, u, vy)
    sign = sign_of(regime)
    mu = jnp.where(regime == FLIGHT, 0.0, sign * w.law.coefficient(sign * slip))
    moving = regime != STICK
    flying = regime == FLIGHT
    return State(
        u,
        jnp.where(moving, (along - mu * down) / w.tip_mass - pull, 0.0),
        jnp.where(flying, vy, 0.0),
        jnp.where(flying, -down / w.tip_mass, 0.0),
    )


def guards(t, s: State, held: Constants):
    """Return the guards, (GUARDS,), positive inside: the regime's two, the shoulders, the limit."""
    w, regime, zone, since, order, scales = held
    x, slip, y, vy = s
    speed, pull = belt(w, t)
    along, down = free(w, zone, x, 0.0 * y, slip + speed, 0.0 * vy)
    hold = w.tip_mass * pull - along
    sticking, flying = regime == STICK, regime == FLIGHT
    first = jnp.where(
        sticking,
        (w.mu_static * down - hold) / w.normal_load,
        jnp.where(flying, y / scales[0], sign_of(regime) * slip / scales[1]),
    )
    second = jnp.where(
        sticking,
        (w.mu_static * down + hold) / w.normal_load,
        jnp.where(flying, 1.0, down / w.normal_load),
    )
    phi = w.lean((x, y)).angle
    theta = phi - w.attack_angle
    upper = jnp.where(zone == 0, 1.0, -1.0) * (w.shoulder_angle - theta)
    lower = jnp.where(zone == 0, 1.0, -1.0) * (w.shoulder_angle + theta)
    upper = jnp.where(zone >= 0, upper, 1.0)
    lower = jnp.where(zone <= 0, lower, 1.0)
    values = jnp.stack([first, second, upper, lower, w.collapse_angle - jnp.abs(phi)])
    # a zero known at the start is divided out
    ahead = jnp.maximum(t - since, 0.0) / 1e-5
    started = ahead > 0
    divided = values / jnp.where(started, ahead, 1.0) ** order
    return jnp.where(order > 0, jnp.where(started, divided, 1.0), values)


def rest(w, zone, t, x):
    """Regime of a closed contact without slip."""
    speed, pull = belt(w, t)
    along, down = free(w, zone, x, 0.0 * x, speed, 0.0 * x)
    hold = w.tip_mass * pull - along
    slips = jnp.where(hold > 0, SLIP_NEG, SLIP_POS)
    return jnp.where(
        down <= 0, FLIGHT, jnp.where(jnp.abs(hold) <= w.mu_static * down, STICK, slips)
    )


def closed(w, zone, t, x, slip):
    """Regime of a closed contact."""
    speed, _ = belt(w, t)
    _, down = free(w, zone, x, 0.0 * x, slip + speed, 0.0 * x)
    slides = jnp.where(down > 0, jnp.where(slip > 0, SLIP_POS, SLIP_NEG), FLIGHT)
    return jnp.where(slip == 0, rest(w, zone, t, x), slides)


def impact(w, zone, t, x, slip, vy, end) -> Strike:
    """Return what an impact does, the limit of a sequence included if it lies before ``end``."""
    speed, pull = belt(w, t)
    mu = jnp.where(slip == 0, w.mu_static, w.law.coefficient(jnp.abs(slip)))
    push = -(1 + w.restitution) * vy
    slip = slip - jnp.clip(slip, -mu * push, mu * push)
    vy = -w.restitution * vy
    along, down = free(w, zone, x, 0.0 * x, slip + speed, 0.0 * x)
    fall = down / w.tip_mass
    last = 2 * vy / jnp.where(fall > 0, fall, 1.0)
    whole = last / jnp.where(w.restitution < 1, 1 - w.restitution, 1.0)
    done = (vy > 0) & (fall > 0) & (last < ZENO_TIME) & (w.restitution < 1) & (t + whole <= end)
    sign = jnp.sign(slip)
    after = slip + (along / w.tip_mass - pull) * whole - sign * mu * (fall * whole - vy)
    after = jnp.where(sign * after > 0, after, 0.0)
    return Strike(
        jnp.where(done, t + whole, t),
        jnp.where(done, x + whole * (slip + speed), x),
        jnp.where(done, after, slip),
        jnp.where(done, 0.0, vy),
        jnp.where(done, int(Event.ZENO), int(Event.IMPACT)),
    )
