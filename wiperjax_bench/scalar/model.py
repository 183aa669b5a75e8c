"""The wiper of docs/model.md with a massless hinge: its codes, its parameters, its forces."""

import math
from typing import NamedTuple

from .compiling import cached

STICK, SLIP_POS, SLIP_NEG, FLIGHT = range(4)
RELEASE, CAPTURE, REVERSAL, LIFT_OFF, IMPACT, ZENO, KINK = range(1, 8)
COLLAPSE, TOUCH = 11, 12
FINISHED, COLLAPSED, TOO_SMALL, BUDGET, NON_FINITE = range(5)


class Blade(NamedTuple):
    """One cell, with what does not change along its trajectory worked out."""

    m: float
    length: float
    k: float
    c: float
    k1: float
    dk: float
    phi_s: float
    alpha: float
    load: float
    e: float
    mu_s: float
    mu_m: float
    inv_vs: float
    shape: float
    beta: float
    rest: float  # L cos(alpha)
    x_high: float  # where theta = +phi_s, -phi_s; beyond the lip if there is no such place
    x_low: float
    x_max: float
    weight: float  # of the tip mass


class Motion(NamedTuple):
    """V(t) on one smooth piece: a + b (t - t0), or the sine of the wiping belt."""

    t0: float
    a: float
    b: float
    amplitude: float
    omega: float
    phase: float


@cached
def belt(g, t):
    """Return V, V'."""
    if g.amplitude == 0.0:
        return g.a + g.b * (t - g.t0), g.b
    s = g.omega * t + g.phase
    return g.amplitude * math.sin(s), g.amplitude * g.omega * math.cos(s)


@cached
def carried(g, start, t):
    """Return the way of the belt from ``start`` to t, and V''."""
    d = t - start
    if g.amplitude == 0.0:
        return d * (g.a + g.b * (start - g.t0) + 0.5 * g.b * d), 0.0
    s, s0 = g.omega * t + g.phase, g.omega * start + g.phase
    # a difference of cosines without cancellation
    way = 2 * g.amplitude / g.omega * math.sin(0.5 * (s + s0)) * math.sin(0.5 * (s - s0))
    return way, -g.amplitude * g.omega * g.omega * math.sin(s)


@cached
def friction(p, v):
    """Return mu at the slip speed v = s v_t, continued smoothly to v < 0."""
    r = v * p.inv_vs
    if p.shape != 1.0:
        r = r**p.shape if r > 0.0 else 0.0
    return p.mu_m + (p.mu_s - p.mu_m) * math.exp(-max(r, -2.0)) + p.beta * v


@cached
def lean(p, x):
    """Return sin, 1 / cos and cos of phi; trial stages must not leave the lip."""
    s = min(max(x / p.length, -1.0 + 1e-12), 1.0 - 1e-12)
    cos = math.sqrt((1.0 - s) * (1.0 + s))
    return s, 1.0 / cos, cos


@cached
def spring(p, zone):
    """Return slope and offset of the moment on a branch of the rotational spring, in phi."""
    if zone == 0:
        return p.k1, -p.k1 * p.alpha
    k = p.k1 + p.dk
    return k, -k * p.alpha - p.dk * zone * p.phi_s


@cached
def slip_rate(p, kz, mz, sign, x, phi, w, speed, pull):
    """Return x', phi', w' and the normal force in slip."""
    s, inv, cos = lean(p, x)
    tau, u = s * inv, w + speed
    n = p.load + p.k * (p.length * cos - p.rest) - p.c * tau * u
    force = n + p.weight
    mu = friction(p, sign * w)
    turn = inv / p.length
    pushed = n * tau - sign * mu * force - (kz * phi + mz) * turn
    return u, u * turn, pushed / p.m - pull, force


@cached
def flight_rate(p, kz, mz, x, phi, y, u, vy):
    """Return phi', x'', y'' in flight."""
    s, inv, cos = lean(p, x)
    tau = s * inv
    n = p.load + p.k * (y + p.length * cos - p.rest) + p.c * (vy - tau * u)
    turn = inv / p.length
    return u * turn, (n * tau - (kz * phi + mz) * turn) / p.m, -(n + p.weight) / p.m


@cached
def cone(p, kz, mz, x, speed, pull, jerk):
    """Return the stick guards mu_s l_n - l_t, mu_s l_n + l_t, and their rates."""
    s, inv, cos = lean(p, x)
    tau, phi = s * inv, math.asin(s)
    turn = inv / p.length
    tau_x = turn * inv * inv
    n = p.load + p.k * (p.length * cos - p.rest) - p.c * tau * speed
    moment = kz * phi + mz
    l_t = p.m * pull + moment * turn - n * tau
    n_rate = -p.k * tau * speed - p.c * (tau_x * speed * speed + tau * pull)
    l_rate = p.m * jerk - n * tau_x * speed - n_rate * tau
    l_rate += speed * turn * (kz * turn + moment * tau * turn)
    force = n + p.weight
    return (
        p.mu_s * force - l_t,
        p.mu_s * force + l_t,
        p.mu_s * n_rate - l_rate,
        p.mu_s * n_rate + l_rate,
        force,
    )


@cached
def regime_at_rest(p, g, zone, t, x):
    """Return the regime of a closed contact without slip (docs/model.md, section 5)."""
    v, a = belt(g, t)
    kz, mz = spring(p, zone)
    up, down, _, _, n = cone(p, kz, mz, x, v, a, 0.0)
    if n > 0.0 and up >= 0.0 and down >= 0.0:
        return STICK
    if n <= 0.0:
        return FLIGHT
    # outside of the cone friction cannot hold it: it slips against the force that would be needed
    return SLIP_NEG if up < 0.0 else SLIP_POS
