"""Steps of Tsit5 in slip and in flight, written out; dense output; the controller."""

import math
from typing import NamedTuple

import diffrax

from .compiling import inner
from .model import belt, flight_rate, slip_rate

# Tsit5, first same as last: numba takes a module's numbers as constants
_LOWER = [[float(a) for a in row] for row in diffrax.Tsit5.tableau.a_lower]
((A21,), (A31, A32), (A41, A42, A43), (A51, A52, A53, A54)) = _LOWER[:4]
(A61, A62, A63, A64, A65), (B1, B2, B3, B4, B5, B6) = _LOWER[4:]
C2, C3, C4, C5 = (float(c) for c in diffrax.Tsit5.tableau.c[:4])
E1, E2, E3, E4, E5, E6, E7 = (float(e) for e in diffrax.Tsit5.tableau.b_error)


class Slipping(NamedTuple):
    """A point of a slip: its state, its rates and the normal force."""

    x: float
    phi: float
    w: float  # slip speed
    dx: float
    dphi: float
    dw: float
    force: float


class SlipStages(NamedTuple):
    """Rates of x and w at the inner stages of a step."""

    x2: float
    x3: float
    x4: float
    x5: float
    x6: float
    w2: float
    w3: float
    w4: float
    w5: float
    w6: float


class Flying(NamedTuple):
    """A point of a flight: its state and its rates; x' is u and y' is vy."""

    x: float
    phi: float
    y: float
    u: float
    vy: float
    dphi: float
    du: float
    dvy: float


class FlightStages(NamedTuple):
    """Rates of x, y, u and vy at the inner stages of a step."""

    x2: float
    x3: float
    x4: float
    x5: float
    x6: float
    y2: float
    y3: float
    y4: float
    y5: float
    y6: float
    u2: float
    u3: float
    u4: float
    u5: float
    u6: float
    v2: float
    v3: float
    v4: float
    v5: float
    v6: float


@inner
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


@inner
def slip_step(p, g, kz, mz, sign, t, h, start):
    """Return the end of a Tsit5 step of slip from ``start`` (a `Slipping`), and its stages."""
    x, f, w, x1, f1, w1, _ = start
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
    stages = SlipStages(x2, x3, x4, x5, x6, w2, w3, w4, w5, w6)
    return Slipping(xe, fe, we, x7, f7, w7, n7), stages


@inner
def flight_step(p, kz, mz, h, start):
    """Return the end of a Tsit5 step of flight from ``start`` (a `Flying`), and its stages."""
    x, f, y, u, v, f1, u1, v1 = start
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
    stages = FlightStages(
        x2, x3, x4, x5, x6, y2, y3, y4, y5, y6, u2, u3, u4, u5, u6, v2, v3, v4, v5, v6
    )
    return Flying(xe, fe, ye, ue, ve, f7, u7, v7), stages


@inner
def next_factor(error):
    """Return the step's change for a relative error: 0.9 error^(-1/4), by two square roots."""
    if error < 1e-4:
        return 6.0
    return min(6.0, max(0.15, 0.9 / math.sqrt(math.sqrt(error))))
