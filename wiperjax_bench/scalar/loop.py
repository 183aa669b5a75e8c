"""One trajectory: stretches of stick, slip and flight, and what happens between them."""

import math

from .change import change
from .compiling import inner, part
from .flight import fly
from .model import (
    BUDGET,
    COLLAPSE,
    COLLAPSED,
    FINISHED,
    FLIGHT,
    IMPACT,
    LIFT_OFF,
    SLIP_NEG,
    SLIP_POS,
    STICK,
    TOO_SMALL,
    ZENO,
    Motion,
    belt,
    lean,
    regime_at_rest,
    slip_rate,
)
from .records import Counts, Memory, Tip
from .slip import slip
from .statistics import IMPACTS, LIFTS, STICKS
from .stick import stick


@inner
def run(p, motions, breaks, break_kinds, start, limits, scales, watch, event_times, event_kinds):
    """Run one cell; return (result, events, counts, tip).

    ``watch`` and the event arrays are filled; events beyond the length of their arrays are counted.
    """
    t_end = limits.t_end
    g, piece, events = _motion(motions, 0), 0, 0
    counts = Counts(0, 0, 0, 0)
    tip, memory, regime, zone, impact = _begin(p, g, start, scales)
    while True:
        t_stop = min(t_end, breaks[piece])
        if not tip.t >= watch.mark:
            t_stop = min(t_stop, watch.mark)
        before, kind = regime, 0
        if impact:
            which, done, impact = 5, False, False
        elif regime == STICK:
            tip, memory, counts, which, done = stick(p, g, zone, watch, tip, memory, counts, t_stop)
        elif regime == FLIGHT:
            tip, memory, counts, which, done = fly(
                p, g, zone, limits, watch, tip, memory, counts, t_stop
            )
        else:
            tip, memory, counts, which, done = slip(
                p, g, zone, regime, limits, watch, tip, memory, counts, t_stop
            )
        if (which == 0 and not done) or counts.attempts > limits.budget:
            return BUDGET if counts.attempts > limits.budget else TOO_SMALL, events, counts, tip
        if which != 0:
            tip, memory, regime, zone, kind = change(
                p, g, zone, regime, limits, watch, tip, memory, which, t_stop
            )
        elif tip.t >= t_end:
            if counts.upcoming < len(watch.times):  # the end itself, by rounding
                last = watch.taken[counts.upcoming]
                last[0], last[1], last[2], last[3] = tip.x, tip.y, tip.u, tip.vy
            return FINISHED, events, counts, tip
        elif tip.t >= breaks[piece]:
            kind = break_kinds[piece]
            piece += 1
            g = _motion(motions, piece)
            if regime == STICK:
                regime = regime_at_rest(p, g, zone, tip.t, tip.x)
                memory = Memory(memory.h_slip, memory.h_flight, 1, 2, memory.kinked)
        u = tip.w + belt(g, tip.t)[0]
        tip = Tip(tip.t, tip.x, tip.phi, tip.y, u, tip.w, tip.vy)
        if kind:
            if events < len(event_times):
                event_times[events], event_kinds[events] = tip.t, kind
            events += 1
            if tip.t >= watch.mark:
                watch.total[IMPACTS] += kind == IMPACT or kind == ZENO
                watch.total[STICKS] += regime == STICK and before != STICK
                watch.total[LIFTS] += kind == LIFT_OFF
        if kind == COLLAPSE:
            return COLLAPSED, events, counts, tip


@part
def _motion(motions, piece):
    """Return the belt's motion on a smooth piece."""
    m = motions[piece]
    return Motion(m[0], m[1], m[2], m[3], m[4], m[5])


@part
def _begin(p, g, start, scales):
    """Return (tip, memory, regime, zone, whether it begins with an impact)."""
    x, y, u, vy = start[0], start[1], start[2], start[3]
    v, a = belt(g, 0.0)
    w = u - v
    phi = math.asin(lean(p, x)[0])
    zone = int(phi - p.alpha > p.phi_s) - int(phi - p.alpha < -p.phi_s)
    h = 1e-4 * min(math.sqrt(p.m * p.length / p.load), scales[0] / max(abs(v), 1e-3 * scales[1]))
    slip_order = flight_order = 0
    regime, impact = FLIGHT, False
    if y > 0.0 or vy > 0.0:
        flight_order = 1 if y == 0.0 else 0
    elif vy < 0.0:
        impact = True
    elif w != 0.0:
        regime = SLIP_POS if w > 0.0 else SLIP_NEG
        if slip_rate(p, 0.0, 0.0, 1.0, x, phi, w, v, a)[3] <= 0.0:
            regime, flight_order = FLIGHT, 2
    else:
        regime = regime_at_rest(p, g, zone, 0.0, x)
        slip_order, flight_order = 1, 2
    tip, memory = Tip(0.0, x, phi, y, u, w, vy), Memory(h, h, slip_order, flight_order, 0)
    return tip, memory, regime, zone, impact
