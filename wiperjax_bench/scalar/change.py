"""What an event makes of the motion: an impact, a new regime, another branch of the spring."""

import math

from .compiling import part
from .model import (
    CAPTURE,
    COLLAPSE,
    FLIGHT,
    IMPACT,
    KINK,
    LIFT_OFF,
    RELEASE,
    REVERSAL,
    SLIP_NEG,
    SLIP_POS,
    STICK,
    TOUCH,
    ZENO,
    belt,
    flight_rate,
    friction,
    regime_at_rest,
    slip_rate,
    spring,
)
from .records import Memory, Tip
from .statistics import SLIP_TIME


@part
def change(p, g, zone, regime, limits, watch, tip, memory, which, t_stop):
    """Return (tip, memory, regime, zone, kind) after the event ``which``; 5: an impact."""
    t, x, phi, y, u, w, vy = tip
    h_slip, h_flight, slip_order, flight_order, kinked = memory
    before, kind = regime, 0
    if which == 5 or (regime == FLIGHT and which == 3):
        return _land(p, g, zone, limits, watch, tip, memory, t_stop)
    if which == 1 or which == -1:
        kind, kinked = KINK, which
        x = p.x_high if which == 1 else p.x_low
        zone = which if zone == 0 else 0
    elif which == 2:
        kind = COLLAPSE
    elif regime == STICK:
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
    memory = Memory(h_slip, h_flight, slip_order, flight_order, kinked)
    return Tip(t, x, phi, y, u, w, vy), memory, regime, zone, kind


@part
def _land(p, g, zone, limits, watch, tip, memory, t_stop):
    """Return what `change` does, of a tip that meets the glass."""
    kz, mz = spring(p, zone)
    t, x, phi, _, u, w, vy = tip
    h_flight, slip_order = memory.h_flight, memory.slip_order
    v, a = belt(g, t)
    kind, fall = TOUCH, 0.0
    if vy < 0.0:
        kind = IMPACT
        mu = friction(p, abs(w)) if w != 0.0 else p.mu_s
        push = -(1.0 + p.e) * vy
        w -= min(max(w, -mu * push), mu * push)
        vy = -p.e * vy
        _, pull, lift = flight_rate(p, kz, mz, x, phi, 0.0, w + v, 0.0)
        fall = -lift
        if vy > 0.0 and fall > 0.0 and p.e < 1.0 and 2.0 * vy < limits.zeno_time * fall:
            last = 2.0 * vy / fall / (1.0 - p.e)
            if t + last <= t_stop:
                kind = ZENO
                push = fall * last - vy
                s = math.copysign(1.0, w) if w != 0.0 else 0.0
                end = w + (pull - a) * last - s * mu * push
                x += last * (w + v)
                watch.total[SLIP_TIME] += last if t >= watch.mark else 0.0
                t, w, vy = t + last, (end if s * end > 0.0 else 0.0), 0.0
                v, a = belt(g, t)
    if vy > 0.0:
        regime, flight_order = FLIGHT, 1
        if fall > 0.0:  # the step of a bounce need not be searched
            h_flight = min(h_flight, 2.1 * vy / fall)
    else:
        vy, flight_order = 0.0, 2
        if w == 0.0:
            regime, slip_order = regime_at_rest(p, g, zone, t, x), 1
        elif slip_rate(p, kz, mz, 1.0, x, phi, w, v, a)[3] > 0.0:
            regime, slip_order = SLIP_POS if w > 0.0 else SLIP_NEG, 0
        else:
            regime = FLIGHT
    memory = Memory(memory.h_slip, h_flight, slip_order, flight_order, memory.kinked)
    return Tip(t, x, phi, 0.0, w + v, w, vy), memory, regime, zone, kind
