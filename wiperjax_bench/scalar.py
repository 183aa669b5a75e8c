"""The ceiling of scalar code: one trajectory at a time, compiled by numba, written for speed.

The wiper of MODEL.md with a massless hinge, event-driven, adaptive Tsit5. What makes it fast:

- no arc sine and no power in a stage: the lean phi is integrated beside x (and set to asin(x / L)
  after every step), friction needs one exponential, the controller two square roots;
- stick is closed form: the cone is followed along x(t), nothing is integrated;
- a step is looked at for events only where end values and end slopes of a guard allow one; the
  root of its cubic is then stepped onto once, and one Newton correction puts the state on it;
- step sizes of slip and flight are remembered over events;
- arithmetic may be reassociated and contracted (``fastmath``), NaN and infinity stay what they are.

All in one file, for numba's cache of compiled code asks only whether the outermost function's own
file has changed.
"""

import math
from typing import NamedTuple

import diffrax
import numpy as np
from numba import njit, prange

FAST = {"contract", "reassoc", "nsz", "arcp", "afn"}
njit_ = njit(fastmath=FAST, error_model="numpy", cache=True)

STICK, SLIP_POS, SLIP_NEG, FLIGHT = range(4)
RELEASE, CAPTURE, REVERSAL, LIFT_OFF, IMPACT, ZENO, KINK = range(1, 8)
COLLAPSE, TOUCH = 11, 12
FINISHED, COLLAPSED, TOO_SMALL, BUDGET, NON_FINITE = range(5)
NEVER, SHRINK = 2.0, -1.0  # no root in [0, 1]; the step is too long to tell


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


@njit_
def belt(g, t):
    """Return V, V'."""
    if g.amplitude == 0.0:
        return g.a + g.b * (t - g.t0), g.b
    s = g.omega * t + g.phase
    return g.amplitude * math.sin(s), g.amplitude * g.omega * math.cos(s)


@njit_
def carried(g, start, t):
    """Return the way of the belt from ``start`` to t, and V''."""
    d = t - start
    if g.amplitude == 0.0:
        return d * (g.a + g.b * (start - g.t0) + 0.5 * g.b * d), 0.0
    s, s0 = g.omega * t + g.phase, g.omega * start + g.phase
    # a difference of cosines without cancellation
    way = 2 * g.amplitude / g.omega * math.sin(0.5 * (s + s0)) * math.sin(0.5 * (s - s0))
    return way, -g.amplitude * g.omega * g.omega * math.sin(s)


@njit_
def friction(p, v):
    """Return mu at the slip speed v = s v_t, continued smoothly to v < 0."""
    r = v * p.inv_vs
    if p.shape != 1.0:
        r = r**p.shape if r > 0.0 else 0.0
    return p.mu_m + (p.mu_s - p.mu_m) * math.exp(-max(r, -2.0)) + p.beta * v


@njit_
def lean(p, x):
    """Return sin, 1 / cos and cos of phi; trial stages must not leave the lip."""
    s = min(max(x / p.length, -1.0 + 1e-12), 1.0 - 1e-12)
    cos = math.sqrt((1.0 - s) * (1.0 + s))
    return s, 1.0 / cos, cos


@njit_
def spring(p, zone):
    """Return slope and offset of the moment on a branch of the rotational spring, in phi."""
    if zone == 0:
        return p.k1, -p.k1 * p.alpha
    k = p.k1 + p.dk
    return k, -k * p.alpha - p.dk * zone * p.phi_s


@njit_
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


@njit_
def flight_rate(p, kz, mz, x, phi, y, u, vy):
    """Return phi', x'', y'' in flight."""
    s, inv, cos = lean(p, x)
    tau = s * inv
    n = p.load + p.k * (y + p.length * cos - p.rest) + p.c * (vy - tau * u)
    turn = inv / p.length
    return u * turn, (n * tau - (kz * phi + mz) * turn) / p.m, -(n + p.weight) / p.m


@njit_
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


@njit_
def cubic_zero(g0, d0, g1, d1, high):
    """Return the zero in (0, high] of the cubic with these ends, g0 > 0 and value <= 0 at high."""
    a = 2.0 * (g0 - g1) + d0 + d1
    b = 3.0 * (g1 - g0) - 2.0 * d0 - d1
    low, z = 0.0, high * g0 / (g0 - min(g1, 0.0)) if high == 1.0 else 0.5 * high
    for _ in range(60):
        value = g0 + z * (d0 + z * (b + z * a))
        if value > 0.0:
            low = z
        else:
            high = z
        slope = d0 + z * (2.0 * b + 3.0 * a * z)
        new = z - value / slope if slope != 0.0 else -1.0
        if not (low < new < high):
            new = 0.5 * (low + high)
        if abs(new - z) < 1e-13:
            return new
        z = new
    return z


@njit_
def first_zero(g0, d0, g1, d1, fresh):
    """Return the first zero in (0, 1] of a guard with end values g and end slopes d (per step).

    ``fresh`` is the order of its known zero at 0: that one is divided out.
    """
    if g1 > 0.0 and (d0 >= 0.0 or d1 <= 0.0 or fresh > 0):
        return NEVER
    if fresh > 0:  # g = z^n (A + B z), n the order
        b = d1 - fresh * g1
        a = g1 - b
        return -a / b if a > 0.0 and b < 0.0 else SHRINK
    if g0 <= 0.0:
        return 0.0
    if g1 <= 0.0:
        return cubic_zero(g0, d0, g1, d1, 1.0)
    # down and up again: is the bottom below zero?
    a = 2.0 * (g0 - g1) + d0 + d1
    b = 3.0 * (g1 - g0) - 2.0 * d0 - d1
    root = math.sqrt(max(b * b - 3.0 * a * d0, 0.0))
    bottom = -d0 / (b + root)
    if g0 + bottom * (d0 + bottom * (b + bottom * a)) > 0.0:
        return NEVER
    return cubic_zero(g0, d0, g1, d1, bottom)


# Tsit5, first same as last: numba takes a module's numbers as constants
_LOWER = [[float(a) for a in row] for row in diffrax.Tsit5.tableau.a_lower]
((A21,), (A31, A32), (A41, A42, A43), (A51, A52, A53, A54)) = _LOWER[:4]
(A61, A62, A63, A64, A65), (B1, B2, B3, B4, B5, B6) = _LOWER[4:]
C2, C3, C4, C5 = (float(c) for c in diffrax.Tsit5.tableau.c[:4])
E1, E2, E3, E4, E5, E6, E7 = (float(e) for e in diffrax.Tsit5.tableau.b_error)


@njit_
def weights(z):
    """Return the dense output's weights at z in [0, 1], so that y = y0 + h sum(weights k)."""
    q = z * z
    return (
        -1.0530884977290216 * z * (z - 1.3299890189751412)
        * (q - 1.4364028541716351 * z + 0.7139816917074209),
        0.1017 * q * (q - 2.1966568338249754 * z + 1.2949852507374631),
        2.490627285651252793 * q * (q - 2.38535645472061657 * z + 1.57803468208092486),
        -16.54810288924490272 * (z - 1.21712927295533244) * (z - 0.61620406037800089) * q,
        47.37952196281928122 * (z - 1.203071208372362603) * (z - 0.658047292653547382) * q,
        -34.87065786149660974 * (z - 1.2) * (z - 0.666666666666666667) * q,
        2.5 * (z - 1.0) * (z - 0.6) * q,
    )  # fmt: skip


@njit_
def slip_step(p, g, kz, mz, sign, t, h, x, f, w, x1, f1, w1):
    """Return the end of a Tsit5 step of slip, its rates and normal force, and the inner stages.

    (x1, f1, w1) are the rates at the start.
    """
    v, a = belt(g, t + C2 * h)
    d = A21 * h
    x2, f2, w2, _ = slip_rate(p, kz, mz, sign, x + d * x1, f + d * f1, w + d * w1, v, a)
    v, a = belt(g, t + C3 * h)
    x3, f3, w3, _ = slip_rate(
        p, kz, mz, sign, x + h * (A31 * x1 + A32 * x2), f + h * (A31 * f1 + A32 * f2),
        w + h * (A31 * w1 + A32 * w2), v, a,
    )  # fmt: skip
    v, a = belt(g, t + C4 * h)
    x4, f4, w4, _ = slip_rate(
        p, kz, mz, sign,
        x + h * (A41 * x1 + A42 * x2 + A43 * x3),
        f + h * (A41 * f1 + A42 * f2 + A43 * f3),
        w + h * (A41 * w1 + A42 * w2 + A43 * w3), v, a,
    )  # fmt: skip
    v, a = belt(g, t + C5 * h)
    x5, f5, w5, _ = slip_rate(
        p, kz, mz, sign,
        x + h * (A51 * x1 + A52 * x2 + A53 * x3 + A54 * x4),
        f + h * (A51 * f1 + A52 * f2 + A53 * f3 + A54 * f4),
        w + h * (A51 * w1 + A52 * w2 + A53 * w3 + A54 * w4), v, a,
    )  # fmt: skip
    v, a = belt(g, t + h)
    x6, f6, w6, _ = slip_rate(
        p, kz, mz, sign,
        x + h * (A61 * x1 + A62 * x2 + A63 * x3 + A64 * x4 + A65 * x5),
        f + h * (A61 * f1 + A62 * f2 + A63 * f3 + A64 * f4 + A65 * f5),
        w + h * (A61 * w1 + A62 * w2 + A63 * w3 + A64 * w4 + A65 * w5), v, a,
    )  # fmt: skip
    xe = x + h * (B1 * x1 + B2 * x2 + B3 * x3 + B4 * x4 + B5 * x5 + B6 * x6)
    fe = f + h * (B1 * f1 + B2 * f2 + B3 * f3 + B4 * f4 + B5 * f5 + B6 * f6)
    we = w + h * (B1 * w1 + B2 * w2 + B3 * w3 + B4 * w4 + B5 * w5 + B6 * w6)
    x7, f7, w7, n7 = slip_rate(p, kz, mz, sign, xe, fe, we, v, a)
    return xe, fe, we, x7, f7, w7, n7, x2, x3, x4, x5, x6, w2, w3, w4, w5, w6


@njit_
def flight_step(p, kz, mz, h, x, f, y, u, v, f1, u1, v1):
    """Return the end of a Tsit5 step of flight, its rates, and the inner stages (f, u, v; x, y)."""
    d = A21 * h
    x2, y2 = u + d * u1, v + d * v1
    f2, u2, v2 = flight_rate(p, kz, mz, x + d * u, f + d * f1, y + d * v, x2, y2)
    x3, y3 = u + h * (A31 * u1 + A32 * u2), v + h * (A31 * v1 + A32 * v2)
    f3, u3, v3 = flight_rate(
        p, kz, mz, x + h * (A31 * u + A32 * x2), f + h * (A31 * f1 + A32 * f2),
        y + h * (A31 * v + A32 * y2), x3, y3,
    )  # fmt: skip
    x4 = u + h * (A41 * u1 + A42 * u2 + A43 * u3)
    y4 = v + h * (A41 * v1 + A42 * v2 + A43 * v3)
    f4, u4, v4 = flight_rate(
        p, kz, mz, x + h * (A41 * u + A42 * x2 + A43 * x3),
        f + h * (A41 * f1 + A42 * f2 + A43 * f3),
        y + h * (A41 * v + A42 * y2 + A43 * y3), x4, y4,
    )  # fmt: skip
    x5 = u + h * (A51 * u1 + A52 * u2 + A53 * u3 + A54 * u4)
    y5 = v + h * (A51 * v1 + A52 * v2 + A53 * v3 + A54 * v4)
    f5, u5, v5 = flight_rate(
        p, kz, mz, x + h * (A51 * u + A52 * x2 + A53 * x3 + A54 * x4),
        f + h * (A51 * f1 + A52 * f2 + A53 * f3 + A54 * f4),
        y + h * (A51 * v + A52 * y2 + A53 * y3 + A54 * y4), x5, y5,
    )  # fmt: skip
    x6 = u + h * (A61 * u1 + A62 * u2 + A63 * u3 + A64 * u4 + A65 * u5)
    y6 = v + h * (A61 * v1 + A62 * v2 + A63 * v3 + A64 * v4 + A65 * v5)
    f6, u6, v6 = flight_rate(
        p, kz, mz, x + h * (A61 * u + A62 * x2 + A63 * x3 + A64 * x4 + A65 * x5),
        f + h * (A61 * f1 + A62 * f2 + A63 * f3 + A64 * f4 + A65 * f5),
        y + h * (A61 * v + A62 * y2 + A63 * y3 + A64 * y4 + A65 * y5), x6, y6,
    )  # fmt: skip
    xe = x + h * (B1 * u + B2 * x2 + B3 * x3 + B4 * x4 + B5 * x5 + B6 * x6)
    fe = f + h * (B1 * f1 + B2 * f2 + B3 * f3 + B4 * f4 + B5 * f5 + B6 * f6)
    ye = y + h * (B1 * v + B2 * y2 + B3 * y3 + B4 * y4 + B5 * y5 + B6 * y6)
    ue = u + h * (B1 * u1 + B2 * u2 + B3 * u3 + B4 * u4 + B5 * u5 + B6 * u6)
    ve = v + h * (B1 * v1 + B2 * v2 + B3 * v3 + B4 * v4 + B5 * v5 + B6 * v6)
    f7, u7, v7 = flight_rate(p, kz, mz, xe, fe, ye, ue, ve)
    return (
        xe, fe, ye, ue, ve, f7, u7, v7,
        x2, x3, x4, x5, x6, y2, y3, y4, y5, y6, u2, u3, u4, u5, u6, v2, v3, v4, v5, v6,
    )  # fmt: skip


@njit_
def next_factor(error):
    """Return the step's change for a relative error: 0.9 error^(-1/4), by two square roots."""
    if error < 1e-4:
        return 6.0
    return min(6.0, max(0.15, 0.9 / math.sqrt(math.sqrt(error))))


@njit_
def regime_at_rest(p, g, zone, t, x):
    """Return the regime of a closed contact without slip (MODEL.md section 5)."""
    v, a = belt(g, t)
    kz, mz = spring(p, zone)
    up, down, _, _, n = cone(p, kz, mz, x, v, a, 0.0)
    if n > 0.0 and up >= 0.0 and down >= 0.0:
        return STICK
    if n <= 0.0:
        return FLIGHT
    # outside of the cone friction cannot hold it: it slips against the force that would be needed
    return SLIP_NEG if up < 0.0 else SLIP_POS


@njit_
def first_zero_of_x(p, zone, kinked, x0, u0, x1, u1, h):
    """Return (first zero, +1 or -1: shoulder of that side, 2: collapse) of the guards in x."""
    theta, which = NEVER, 0
    if zone >= 0:  # the upper shoulder bounds the neck from above, its own branch from below
        s = 1.0 if zone == 0 else -1.0
        z = first_zero(
            s * (p.x_high - x0), -s * u0 * h, s * (p.x_high - x1), -s * u1 * h, int(kinked == 1)
        )
        if z < theta:
            theta, which = z, 1
    if zone <= 0:
        s = 1.0 if zone == 0 else -1.0
        z = first_zero(
            s * (x0 - p.x_low), s * u0 * h, s * (x1 - p.x_low), s * u1 * h, int(kinked == -1)
        )
        if z < theta:
            theta, which = z, -1
    if abs(x1) >= p.x_max:
        s = math.copysign(1.0, x1)
        z = first_zero(p.x_max - s * x0, -s * u0 * h, p.x_max - s * x1, -s * u1 * h, 0)
        if z < theta:
            theta, which = z, 2
    return theta, which


@njit_
def place_of(p, which, x):
    """Return where the guard ``which`` of `first_zero_of_x` has its zero."""
    if which == 1:
        return p.x_high
    return p.x_low if which == -1 else math.copysign(p.x_max, x)


# columns of the statistics of a cell, from ``mark`` on
STICK_TIME, SLIP_TIME, FLIGHT_TIME, U, UU, FORCE, FORCE_MAX, GAP_MAX, IMPACTS, STICKS, LIFTS = (
    range(11)
)
SUMS = 11


@njit_
def gather(total, regime, h, u0, a0, u1, a1, n0, n1, y):
    """Add a stretch of motion to the statistics: integrals by the cubic with these ends."""
    total[STICK_TIME if regime == STICK else FLIGHT_TIME if regime == FLIGHT else SLIP_TIME] += h
    total[U] += h * (0.5 * (u0 + u1) + h * (a0 - a1) / 12.0)
    total[UU] += h * (0.5 * (u0 * u0 + u1 * u1) + h * (u0 * a0 - u1 * a1) / 6.0)
    total[FORCE] += 0.5 * h * (n0 + n1)
    total[FORCE_MAX] = max(total[FORCE_MAX], n0, n1)
    total[GAP_MAX] = max(total[GAP_MAX], y)


@njit_
def run(
    p, motions, breaks, break_kinds, start, t_end, rtol, scale_x, scale_v, zeno_time, budget,
    times, taken, event_times, event_kinds, mark, signal, interval, total,
):  # fmt: skip
    """Run one cell; return (result, events, attempts, time, x, y, x', y', rejected).

    ``taken`` (samples, 4), ``signal`` (x' at mark + i interval), the event arrays and ``total`` are
    filled; events beyond the length of their arrays are counted.
    """
    atol_x, atol_v = rtol * scale_x, rtol * scale_v
    t, x, y, u, vy = 0.0, start[0], start[1], start[2], start[3]
    piece, events, attempts, rejected = 0, 0, 0, 0
    upcoming, ticks = 0, 0
    m0 = motions[0]
    g = Motion(m0[0], m0[1], m0[2], m0[3], m0[4], m0[5])
    v, a = belt(g, t)
    w = u - v
    phi = math.asin(lean(p, x)[0])
    zone = int(phi - p.alpha > p.phi_s) - int(phi - p.alpha < -p.phi_s)
    h_slip = h_flight = 1e-4 * min(
        math.sqrt(p.m * p.length / p.load), scale_x / max(abs(v), 1e-3 * scale_v)
    )
    slip_order = flight_order = kinked = 0
    regime, kind, impact = FLIGHT, 0, False
    if y > 0.0 or vy > 0.0:
        flight_order = 1 if y == 0.0 else 0
    elif vy < 0.0:
        impact = True
    elif w != 0.0:
        regime = SLIP_POS if w > 0.0 else SLIP_NEG
        if slip_rate(p, 0.0, 0.0, 1.0, x, phi, w, v, a)[3] <= 0.0:
            regime, flight_order = FLIGHT, 2
    else:
        regime = regime_at_rest(p, g, zone, t, x)
        slip_order, flight_order = 1, 2

    while True:
        observed = t >= mark
        t_stop = min(t_end, breaks[piece])
        if not observed:
            t_stop = min(t_stop, mark)
        kz, mz = spring(p, zone)
        which, done = 0, False
        if impact:
            pass
        elif regime == STICK:
            t0, x0 = t, x
            v, a = belt(g, t)
            jerk = carried(g, t, t)[1]
            up0, down0, up_d0, down_d0, n0 = cone(p, kz, mz, x, v, a, jerk)
            while which == 0 and not done:
                # the cone turns over a part of L cos^2(phi)
                reach = max(0.05 * (1.0 - (x / p.length) ** 2), 1e-4) * p.length
                h = t_stop - t
                if abs(v) * h > reach:
                    h = reach / abs(v)
                if abs(a) * h * h > reach:
                    h = math.sqrt(reach / abs(a))
                done = t + h >= t_stop
                t1 = t_stop if done else t + h
                h = t1 - t
                attempts += 1
                way, jerk = carried(g, t0, t1)
                x1 = x0 + way
                v1, a1 = belt(g, t1)
                up1, down1, up_d1, down_d1, n1 = cone(p, kz, mz, x1, v1, a1, jerk)
                theta, hit = first_zero_of_x(p, zone, kinked, x, v, x1, v1, h)
                z = first_zero(up0, up_d0 * h, up1, up_d1 * h, 0)
                if z < theta:
                    theta, hit = z, 3
                z = first_zero(down0, down_d0 * h, down1, down_d1 * h, 0)
                if z < theta:
                    theta, hit = z, 4
                if theta < NEVER:
                    theta = max(theta, 0.0)
                    which, done = hit, False
                    t1 = t + theta * h
                    for _ in range(8):  # Newton on the exact functions
                        way, jerk = carried(g, t0, t1)
                        x1 = x0 + way
                        v1, a1 = belt(g, t1)
                        up1, down1, up_d1, down_d1, n1 = cone(p, kz, mz, x1, v1, a1, jerk)
                        if hit == 3:
                            d = -up1 / up_d1
                        elif hit == 4:
                            d = -down1 / down_d1
                        else:
                            d = (place_of(p, hit, x1) - x1) / v1
                        if not abs(d) < h:
                            break
                        t1 = max(t1 + d, t)
                        if abs(d) < 1e-15 * t1 + 1e-12 * h:
                            break
                    x1 = x0 + carried(g, t0, t1)[0]
                    v1, a1 = belt(g, t1)
                if observed:
                    gather(total, STICK, t1 - t, v, a, v1, a1, n0, n1, 0.0)
                up0, down0, up_d0, down_d0, n0 = up1, down1, up_d1, down_d1, n1
                t, x, v, a, kinked = t1, x1, v1, a1, 0
            while upcoming < len(times) and times[upcoming] <= t:
                v1, _ = belt(g, times[upcoming])
                taken[upcoming, 0] = x0 + carried(g, t0, times[upcoming])[0]
                taken[upcoming, 1] = 0.0
                taken[upcoming, 2] = v1
                taken[upcoming, 3] = 0.0
                upcoming += 1
            while ticks < len(signal) and mark + ticks * interval <= t:
                signal[ticks] = belt(g, mark + ticks * interval)[0]
                ticks += 1
            w = y = vy = 0.0
            phi = math.asin(lean(p, x)[0])
        elif regime != FLIGHT:
            sign = 1.0 if regime == SLIP_POS else -1.0
            v, a = belt(g, t)
            x1, f1, w1, n1 = slip_rate(p, kz, mz, sign, x, phi, w, v, a)
            while which == 0 and not done:
                h = h_slip
                done = t + h * (1.0 + 1e-9) >= t_stop
                if done:
                    h = t_stop - t
                attempts += 1
                xe, fe, we, x7, f7, w7, n7, x2, x3, x4, x5, x6, w2, w3, w4, w5, w6 = slip_step(
                    p, g, kz, mz, sign, t, h, x, phi, w, x1, f1, w1
                )
                dx = E1 * x1 + E2 * x2 + E3 * x3 + E4 * x4 + E5 * x5 + E6 * x6 + E7 * x7
                dw = E1 * w1 + E2 * w2 + E3 * w3 + E4 * w4 + E5 * w5 + E6 * w6 + E7 * w7
                error = max(
                    h * abs(dx) / (atol_x + rtol * max(abs(x), abs(xe))),
                    h * abs(dw) / (atol_v + rtol * max(abs(w), abs(we))),
                )
                if not error <= 1.0:
                    h_slip = h * (next_factor(error) if error < 1e30 else 0.1)
                    rejected, done = rejected + 1, False
                    if h < 1e-15 * t_end or attempts > budget:
                        break
                    continue
                # guards; a step that could not have an event passes by comparisons alone
                theta, hit = (
                    first_zero(sign * w, sign * w1 * h, sign * we, sign * w7 * h, slip_order),
                    3,
                )
                z, place = first_zero_of_x(p, zone, kinked, x, x1, xe, x7, h)
                if z < theta:
                    theta, hit = z, place
                if min(n1, n7) < 0.3 * (p.load + abs(p.weight)):
                    s, inv, _ = lean(p, x)
                    b = -p.k * s * inv * x1 - p.c * (
                        inv * inv * inv / p.length * x1 * x1 + s * inv * (w1 + a)
                    )
                    s, inv, _ = lean(p, xe)
                    v_end, a_end = belt(g, t + h)
                    c = -p.k * s * inv * x7 - p.c * (
                        inv * inv * inv / p.length * x7 * x7 + s * inv * (w7 + a_end)
                    )
                    z = first_zero(n1, b * h, n7, c * h, 0)
                    if z < theta:
                        theta, hit = z, 4
                if theta == SHRINK and h > 1e-14 * t_end:
                    h_slip, done = 0.1 * h, False
                    continue
                length = h
                if theta < NEVER:
                    which, done = hit, False
                    theta = max(theta, 0.0)
                    length = theta * h
                    d, lost = 0.0, False
                    for _ in range(8):
                        if length <= 0.0:
                            length, xe, fe, we = 0.0, x, phi, w
                            x7, f7, w7, n7 = x1, f1, w1, n1
                            break
                        attempts += 1
                        (xe, fe, we, x7, f7, w7, n7, x2, x3, x4, x5, x6, w2, w3, w4, w5, w6) = (
                            slip_step(p, g, kz, mz, sign, t, length, x, phi, w, x1, f1, w1)
                        )
                        v_end, a_end = belt(g, t + length)
                        if hit == 3:
                            d = -we / (w7 - slip_order * we / length)
                        elif hit == 4:
                            s, inv, _ = lean(p, xe)
                            d = n7 / (
                                p.k * s * inv * x7
                                + p.c * (inv * inv * inv / p.length * x7 * x7)
                                + p.c * s * inv * (w7 + a_end)
                            )
                        else:
                            d = (place_of(p, hit, xe) - xe) / x7
                        if abs(d) <= 1e-5 * length:
                            lost = False
                            break
                        lost = not (0.0 < length + d <= h)
                        if lost:
                            break
                        length += d
                        d, lost = 0.0, True  # unless the next turn finds it converged
                    if lost and h > 1e-14 * t_end:  # the cubic said too little: a shorter step
                        h_slip, which = 0.4 * h, 0
                        continue
                    h_slip = max(h_slip, h * next_factor(max(error, 0.5)))
                else:
                    h_slip = h * next_factor(error)
                    d = 0.0
                    slip_order = kinked = 0
                while upcoming < len(times) and times[upcoming] <= t + length:
                    q1, q2, q3, q4, q5, q6, q7 = weights((times[upcoming] - t) / length)
                    v_end, _ = belt(g, times[upcoming])
                    taken[upcoming, 0] = x + length * (
                        q1 * x1 + q2 * x2 + q3 * x3 + q4 * x4 + q5 * x5 + q6 * x6 + q7 * x7
                    )
                    taken[upcoming, 1] = 0.0
                    taken[upcoming, 2] = (
                        v_end
                        + w
                        + length
                        * (q1 * w1 + q2 * w2 + q3 * w3 + q4 * w4 + q5 * w5 + q6 * w6 + q7 * w7)
                    )
                    taken[upcoming, 3] = 0.0
                    upcoming += 1
                v_end, a_end = belt(g, t + length)
                if observed:
                    gather(total, regime, length + d, x1, w1 + a, x7, w7 + a_end, n1, n7, 0.0)
                    while ticks < len(signal) and mark + ticks * interval <= t + length:
                        z = (mark + ticks * interval - t) / max(length, 1e-300)
                        signal[ticks] = hermite(z, x1, (w1 + a) * length, x7, (w7 + a_end) * length)
                        ticks += 1
                t = t_stop if done else t + length + d
                x = xe + d * (x7 + 0.5 * d * (w7 + a_end))
                w = we + d * w7
                phi = math.asin(lean(p, x)[0])
                x1, w1, n1, v, a = x7, w7, n7, v_end, a_end
                f1 = f7  # of the integrated phi: equal to rounding of the step's own error
            u = w + v
            if which == 0 and not done:  # spent
                break
        else:
            f1, u1, v1 = flight_rate(p, kz, mz, x, phi, y, u, vy)
            while which == 0 and not done:
                h = h_flight
                done = t + h * (1.0 + 1e-9) >= t_stop
                if done:
                    h = t_stop - t
                attempts += 1
                (xe, fe, ye, ue, ve, f7, u7, v7, x2, x3, x4, x5, x6, y2, y3, y4, y5, y6,
                 u2, u3, u4, u5, u6, v2, v3, v4, v5, v6) = flight_step(
                    p, kz, mz, h, x, phi, y, u, vy, f1, u1, v1
                )  # fmt: skip
                dx = E1 * u + E2 * x2 + E3 * x3 + E4 * x4 + E5 * x5 + E6 * x6 + E7 * ue
                dy = E1 * vy + E2 * y2 + E3 * y3 + E4 * y4 + E5 * y5 + E6 * y6 + E7 * ve
                du = E1 * u1 + E2 * u2 + E3 * u3 + E4 * u4 + E5 * u5 + E6 * u6 + E7 * u7
                dv = E1 * v1 + E2 * v2 + E3 * v3 + E4 * v4 + E5 * v5 + E6 * v6 + E7 * v7
                error = h * max(
                    max(
                        abs(dx) / (atol_x + rtol * max(abs(x), abs(xe))),
                        abs(dy) / (atol_x + rtol * max(abs(y), abs(ye))),
                    ),
                    max(
                        abs(du) / (atol_v + rtol * max(abs(u), abs(ue))),
                        abs(dv) / (atol_v + rtol * max(abs(vy), abs(ve))),
                    ),
                )
                if not error <= 1.0:
                    h_flight = h * (next_factor(error) if error < 1e30 else 0.1)
                    rejected, done = rejected + 1, False
                    if h < 1e-15 * t_end or attempts > budget:
                        break
                    continue
                theta, hit = first_zero(y, vy * h, ye, ve * h, flight_order), 3
                z, place = first_zero_of_x(p, zone, kinked, x, u, xe, ue, h)
                if z < theta:
                    theta, hit = z, place
                if theta == SHRINK and h > 1e-14 * t_end:
                    h_flight, done = 0.1 * h, False
                    continue
                length, d = h, 0.0
                if theta < NEVER:
                    which, done = hit, False
                    theta = max(theta, 0.0)
                    length, lost = theta * h, False
                    for _ in range(8):
                        if length <= 0.0:
                            length, xe, ye, ue, ve, u7, v7 = 0.0, x, y, u, vy, u1, v1
                            break
                        attempts += 1
                        (xe, fe, ye, ue, ve, f7, u7, v7, x2, x3, x4, x5, x6, y2, y3, y4, y5, y6,
                         u2, u3, u4, u5, u6, v2, v3, v4, v5, v6) = flight_step(
                            p, kz, mz, length, x, phi, y, u, vy, f1, u1, v1
                        )  # fmt: skip
                        # Newton with the known zero at the start divided out
                        if hit == 3:
                            d = -ye / (ve - flight_order * ye / length)
                        else:
                            d = (place_of(p, hit, xe) - xe) / ue
                        if abs(d) <= 1e-5 * length:
                            lost = False
                            break
                        lost = not (0.0 < length + d <= h)
                        if lost:
                            break
                        length += d
                        d, lost = 0.0, True  # unless the next turn finds it converged
                    if lost and h > 1e-14 * t_end:
                        h_flight, which = 0.4 * h, 0
                        continue
                    h_flight = max(h_flight, h * next_factor(max(error, 0.5)))
                else:
                    h_flight = h * next_factor(error)
                    flight_order = kinked = 0
                while upcoming < len(times) and times[upcoming] <= t + length:
                    q1, q2, q3, q4, q5, q6, q7 = weights((times[upcoming] - t) / length)
                    taken[upcoming, 0] = x + length * (
                        q1 * u + q2 * x2 + q3 * x3 + q4 * x4 + q5 * x5 + q6 * x6 + q7 * ue
                    )
                    taken[upcoming, 1] = y + length * (
                        q1 * vy + q2 * y2 + q3 * y3 + q4 * y4 + q5 * y5 + q6 * y6 + q7 * ve
                    )
                    taken[upcoming, 2] = u + length * (
                        q1 * u1 + q2 * u2 + q3 * u3 + q4 * u4 + q5 * u5 + q6 * u6 + q7 * u7
                    )
                    taken[upcoming, 3] = vy + length * (
                        q1 * v1 + q2 * v2 + q3 * v3 + q4 * v4 + q5 * v5 + q6 * v6 + q7 * v7
                    )
                    upcoming += 1
                if observed:
                    gather(total, FLIGHT, length + d, u, u1, ue, u7, 0.0, 0.0, max(y, ye))
                    while ticks < len(signal) and mark + ticks * interval <= t + length:
                        z = (mark + ticks * interval - t) / max(length, 1e-300)
                        signal[ticks] = hermite(z, u, u1 * length, ue, u7 * length)
                        ticks += 1
                t = t_stop if done else t + length + d
                x, y = xe + d * (ue + 0.5 * d * u7), ye + d * (ve + 0.5 * d * v7)
                u, vy = ue + d * u7, ve + d * v7
                phi = math.asin(lean(p, x)[0])
                f1, u1, v1 = f7, u7, v7
            if which == 0 and not done:
                break
            v, a = belt(g, t)
            w = u - v

        # what happened
        if attempts > budget:
            break
        before, kind = regime, 0
        if impact or (regime == FLIGHT and which == 3):
            impact = False
            y = 0.0
            v, a = belt(g, t)
            kind = IMPACT if vy < 0.0 else TOUCH
            ratio, fall = p.e, 0.0
            if vy < 0.0:
                mu = friction(p, abs(w)) if w != 0.0 else p.mu_s
                push = -(1.0 + p.e) * vy
                w -= min(max(w, -mu * push), mu * push)
                vy = -p.e * vy
                fall = -flight_rate(p, kz, mz, x, phi, 0.0, w + v, 0.0)[2]
                if vy > 0.0 and fall > 0.0 and ratio < 1.0 and 2.0 * vy < zeno_time * fall:
                    last = 2.0 * vy / fall / (1.0 - ratio)
                    if t + last <= t_stop:
                        kind = ZENO
                        pull = flight_rate(p, kz, mz, x, phi, 0.0, w + v, 0.0)[1] - a
                        push = fall * last - vy
                        s = math.copysign(1.0, w) if w != 0.0 else 0.0
                        end = w + pull * last - s * mu * push
                        x += last * (w + v)
                        total[SLIP_TIME] += last if t >= mark else 0.0
                        t, w, vy = t + last, (end if s * end > 0.0 else 0.0), 0.0
                        v, a = belt(g, t)
            u = w + v
            if vy > 0.0:
                regime, flight_order = FLIGHT, 1
                if fall > 0.0:  # the step of a bounce need not be searched
                    h_flight = min(h_flight, 2.1 * vy / fall)
            else:
                vy = 0.0
                if w == 0.0:
                    regime, slip_order = regime_at_rest(p, g, zone, t, x), 1
                elif slip_rate(p, kz, mz, 1.0, x, phi, w, v, a)[3] > 0.0:
                    regime, slip_order = SLIP_POS if w > 0.0 else SLIP_NEG, 0
                else:
                    regime = FLIGHT
                flight_order = 2
        elif which == 1 or which == -1:
            kind, kinked = KINK, which
            x = p.x_high if which == 1 else p.x_low
            zone = which if zone == 0 else 0
        elif which == 2:
            kind = COLLAPSE
        elif which != 0 and regime == STICK:
            kind, slip_order = RELEASE, 2
            regime = SLIP_NEG if which == 3 else SLIP_POS
        elif which == 3:
            w, slip_order, flight_order = 0.0, 1, 2
            regime = regime_at_rest(p, g, zone, t, x)
            kind = CAPTURE if regime == STICK else LIFT_OFF if regime == FLIGHT else REVERSAL
            if regime == before:
                kind = TOUCH
        elif which == 4:
            kind, regime, flight_order = LIFT_OFF, FLIGHT, 3
            y = vy = 0.0
        elif done and t >= t_end:
            if upcoming < len(times):  # the end itself, by rounding
                taken[upcoming, 0], taken[upcoming, 1], taken[upcoming, 2] = x, y, u
                taken[upcoming, 3] = vy
            return FINISHED, events, attempts, t, x, y, (w + v), vy, rejected
        elif t >= breaks[piece]:
            kind = break_kinds[piece]
            piece += 1
            m0 = motions[piece]
            g = Motion(m0[0], m0[1], m0[2], m0[3], m0[4], m0[5])
            if regime == STICK:
                regime, slip_order, flight_order = regime_at_rest(p, g, zone, t, x), 1, 2
        u = w + belt(g, t)[0]
        if kind:
            if events < len(event_times):
                event_times[events], event_kinds[events] = t, kind
            events += 1
            if t >= mark:
                total[IMPACTS] += kind == IMPACT or kind == ZENO
                total[STICKS] += regime == STICK and before != STICK
                total[LIFTS] += kind == LIFT_OFF
        if kind == COLLAPSE:
            return COLLAPSED, events, attempts, t, x, y, u, vy, rejected
    code = BUDGET if attempts > budget else TOO_SMALL
    return code, events, attempts, t, x, y, u, vy, rejected


@njit_
def hermite(z, f0, s0, f1, s1):
    """Return the cubic with values f and slopes s (per unit z) at 0 and 1."""
    rise = f1 - f0
    return f0 + z * (rise + (1.0 - z) * ((s0 - rise) * (1.0 - z) - (s1 - rise) * z))


class Record(NamedTuple):
    """What `sweep` fills, cells first."""

    result: np.ndarray
    events: np.ndarray
    attempts: np.ndarray
    rejected: np.ndarray
    final: np.ndarray  # (cells, 5): t, x, y, x', y'
    taken: np.ndarray  # (cells, samples, 4)
    event_times: np.ndarray
    event_kinds: np.ndarray
    signal: np.ndarray
    total: np.ndarray


@njit_
def _cell(
    i, blades, motions, breaks, kinds, start, end, rtol, sx, sv, zeno, budget, times, mark, dt, r
):
    b = blades[i]
    p = Blade(
        b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7], b[8], b[9], b[10], b[11], b[12], b[13],
        b[14], b[15], b[16], b[17], b[18], b[19],
    )  # fmt: skip
    code, events, attempts, t, x, y, u, vy, rejected = run(
        p, motions[i], breaks[i], kinds, start[i], end, rtol, sx[i], sv[i], zeno, budget, times,
        r.taken[i], r.event_times[i], r.event_kinds[i], mark, r.signal[i], dt, r.total[i],
    )  # fmt: skip
    r.result[i], r.events[i], r.attempts[i], r.rejected[i] = code, events, attempts, rejected
    r.final[i, 0], r.final[i, 1], r.final[i, 2], r.final[i, 3] = t, x, y, u
    r.final[i, 4] = vy


@njit_
def one_by_one(
    blades, motions, breaks, kinds, start, end, rtol, sx, sv, zeno, budget, times, mark, dt, r
):
    """Run all cells on this thread."""
    for i in range(len(blades)):
        _cell(
            i,
            blades,
            motions,
            breaks,
            kinds,
            start,
            end,
            rtol,
            sx,
            sv,
            zeno,
            budget,
            times,
            mark,
            dt,
            r,
        )


@njit(fastmath=FAST, error_model="numpy", cache=True, parallel=True)
def on_all_cores(
    blades, motions, breaks, kinds, start, end, rtol, sx, sv, zeno, budget, times, mark, dt, r
):
    """Run all cells on numba's threads."""
    for i in prange(len(blades)):
        _cell(
            i,
            blades,
            motions,
            breaks,
            kinds,
            start,
            end,
            rtol,
            sx,
            sv,
            zeno,
            budget,
            times,
            mark,
            dt,
            r,
        )
