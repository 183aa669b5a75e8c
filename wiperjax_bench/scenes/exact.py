"""Exact motion of the block on a belt: sinusoids about +-f between the zeros of v_t.

x'' + x = -sign(x' - V) f, belt at constant V > 0, mu_static = mu_minimum = f, unit mass, stiffness
and load. Started at rest at x0 > 0 it slips back and forth over the belt, is captured, carried to
x = f and released there, where the slip speed leaves zero with its rate zero too.
"""

import math

import numpy as np

from wiperjax import Event


def block(start: float, speed: float, friction: float, times) -> tuple:
    """Return (position, velocity) at ``times`` and (event times, kinds) up to the last of them.

    Everything is closed form; the last time must come before the slip speed touches zero again,
    2 pi after the release.
    """
    times = np.asarray(times)
    x, v = np.full(times.shape, np.nan), np.full(times.shape, np.nan)
    at, kinds = [], []
    t, q, rate, side = 0.0, start, 0.0, -1.0
    while True:
        # x = c + a cos(s) + rate sin(s), c = -side f, s the time since t
        c = -side * friction
        a = q - c
        # x' = -a sin s + rate cos s meets V: R cos(s + p) = V
        reach, phase = math.hypot(a, rate), math.atan2(a, rate)
        turn = math.acos(min(1.0, speed / reach))
        zeros = [z - phase + 2 * math.pi * k for z in (turn, -turn) for k in range(-1, 3)]
        length = min(z for z in zeros if z > 1e-9)
        here = (times > t) & (times <= t + length)
        s = times[here] - t
        x[here] = c + a * np.cos(s) + rate * np.sin(s)
        v[here] = -a * np.sin(s) + rate * np.cos(s)
        if t + length > times[-1]:
            break
        q = c + a * math.cos(length) + rate * math.sin(length)
        t, rate = t + length, speed
        at.append(t)
        if abs(q) > friction:
            kinds.append(int(Event.REVERSAL))
            side = -math.copysign(1.0, q)
            continue
        kinds.append(int(Event.CAPTURE))
        release = t + (friction - q) / speed
        here = (times > t) & (times <= release)
        x[here], v[here] = q + speed * (times[here] - t), speed
        if release > times[-1]:
            break
        at.append(release)
        kinds.append(int(Event.RELEASE))
        here = times > release
        s = times[here] - release
        if s.size and s[-1] >= 2 * math.pi:
            raise ValueError("the last time must come less than 2 pi after the release")
        x[here], v[here] = friction + speed * np.sin(s), speed * np.cos(s)
        break
    return x, v, np.array(at), np.array(kinds)
