"""Stick: closed form; the cone is followed along x(t), nothing is integrated."""

import math

from .compiling import part
from .model import STICK, belt, carried, cone, lean, spring
from .records import Counts, Memory, Tip
from .statistics import gather
from .zeros import NEVER, first_zero, first_zero_of_x, place_of


@part
def stick(p, g, zone, watch, tip, memory, counts, t_stop):
    """Stick until an event or ``t_stop``; return (tip, memory, counts, event, done)."""
    kz, mz = spring(p, zone)
    t, x, kinked, attempts = tip.t, tip.x, memory.kinked, counts.attempts
    observed = t >= watch.mark
    which, done = 0, False
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
            t1, x1, v1, a1, (up1, down1, up_d1, down_d1, n1) = _onto(
                p, g, kz, mz, hit, t0, x0, t, t + theta * h, h
            )
        if observed:
            gather(watch.total, STICK, t1 - t, v, a, v1, a1, n0, n1, 0.0)
        up0, down0, up_d0, down_d0, n0 = up1, down1, up_d1, down_d1, n1
        t, x, v, a, kinked = t1, x1, v1, a1, 0
    upcoming, ticks = _record(g, watch, t0, x0, t, counts)
    phi = math.asin(lean(p, x)[0])
    memory = Memory(memory.h_slip, memory.h_flight, memory.slip_order, memory.flight_order, kinked)
    counts = Counts(attempts, counts.rejected, upcoming, ticks)
    return Tip(t, x, phi, 0.0, v, 0.0, 0.0), memory, counts, which, done


@part
def _onto(p, g, kz, mz, hit, t0, x0, t, t1, h):
    """Return (t, x, V, V', cone) at the zero of guard ``hit`` near t1: Newton, exact functions."""
    for _ in range(8):
        way, jerk = carried(g, t0, t1)
        x1 = x0 + way
        v1, a1 = belt(g, t1)
        edge = cone(p, kz, mz, x1, v1, a1, jerk)
        if hit == 3:
            d = -edge[0] / edge[2]
        elif hit == 4:
            d = -edge[1] / edge[3]
        else:
            d = (place_of(p, hit, x1) - x1) / v1
        if not abs(d) < h:
            break
        t1 = max(t1 + d, t)
        if abs(d) < 1e-15 * t1 + 1e-12 * h:
            break
    v1, a1 = belt(g, t1)
    return t1, x0 + carried(g, t0, t1)[0], v1, a1, edge


@part
def _record(g, watch, t0, x0, t, counts):
    """Write samples and signal up to t; return the next places of both."""
    upcoming, ticks = counts.upcoming, counts.ticks
    times, taken, signal = watch.times, watch.taken, watch.signal
    mark, interval = watch.mark, watch.interval
    while upcoming < len(times) and times[upcoming] <= t:
        v1, _ = belt(g, times[upcoming])
        taken[upcoming, 0] = x0 + carried(g, t0, times[upcoming])[0]
        taken[upcoming, 1] = 0.0
        taken[upcoming, 2] = v1
        taken[upcoming, 3] = 0.0
        upcoming += 1
    while ticks < len(signal) and mark + ticks * interval <= t:
        signal[ticks] = x0 + carried(g, t0, mark + ticks * interval)[0]
        ticks += 1
    return upcoming, ticks
