"""What is gathered along the motion."""

from .compiling import cached
from .model import FLIGHT, STICK

# columns of the statistics of a cell, from ``mark`` on
STICK_TIME, SLIP_TIME, FLIGHT_TIME, U, UU, FORCE, FORCE_MAX, GAP_MAX, IMPACTS, STICKS, LIFTS = (
    range(11)
)
SUMS = 11


@cached
def gather(total, regime, h, u0, a0, u1, a1, n0, n1, y):
    """Add a stretch of motion to the statistics: integrals by the cubic with these ends."""
    total[STICK_TIME if regime == STICK else FLIGHT_TIME if regime == FLIGHT else SLIP_TIME] += h
    total[U] += h * (0.5 * (u0 + u1) + h * (a0 - a1) / 12.0)
    total[UU] += h * (0.5 * (u0 * u0 + u1 * u1) + h * (u0 * a0 - u1 * a1) / 6.0)
    total[FORCE] += 0.5 * h * (n0 + n1)
    total[FORCE_MAX] = max(total[FORCE_MAX], n0, n1)
    total[GAP_MAX] = max(total[GAP_MAX], y)


@cached
def hermite(z, f0, s0, f1, s1):
    """Return the cubic with values f and slopes s (per unit z) at 0 and 1."""
    rise = f1 - f0
    return f0 + z * (rise + (1.0 - z) * ((s0 - rise) * (1.0 - z) - (s1 - rise) * z))
