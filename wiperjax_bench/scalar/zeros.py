"""First zeros of guards on a step, from their values and slopes at its ends."""

import math

from .compiling import cached

NEVER, SHRINK = 2.0, -1.0  # no root in [0, 1]; the step is too long to tell


@cached
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


@cached
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


@cached
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


@cached
def place_of(p, which, x):
    """Return where the guard ``which`` of `first_zero_of_x` has its zero."""
    if which == 1:
        return p.x_high
    return p.x_low if which == -1 else math.copysign(p.x_max, x)
