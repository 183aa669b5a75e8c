"""Flight: steps of Tsit5 in x, phi, y and their speeds, each looked at for events."""

import math

from .compiling import part
from .model import FLIGHT, belt, flight_rate, lean, spring
from .records import Counts, Memory, Tip
from .statistics import gather, hermite
from .tsit5 import E1, E2, E3, E4, E5, E6, E7, Flying, flight_step, next_factor, weights
from .zeros import NEVER, SHRINK, first_zero, first_zero_of_x, place_of


@part
def fly(p, g, zone, limits, watch, tip, memory, counts, t_stop):
    """Fly until an event or ``t_stop``; return (tip, memory, counts, event, done) as `slip`."""
    kz, mz = spring(p, zone)
    t, h_flight, order, kinked = tip.t, memory.h_flight, memory.flight_order, memory.kinked
    attempts, rejected, upcoming, ticks = counts
    t_end, observed = limits.t_end, t >= watch.mark
    which, done = 0, False
    f1, u1, v1 = flight_rate(p, kz, mz, tip.x, tip.phi, tip.y, tip.u, tip.vy)
    start = Flying(tip.x, tip.phi, tip.y, tip.u, tip.vy, f1, u1, v1)
    while which == 0 and not done:
        h = h_flight
        done = t + h * (1.0 + 1e-9) >= t_stop
        if done:
            h = t_stop - t
        attempts += 1
        end, stages = flight_step(p, kz, mz, h, start)
        error = _error(start, end, stages, h, limits)
        if not error <= 1.0:
            h_flight = h * (next_factor(error) if error < 1e30 else 0.1)
            rejected, done = rejected + 1, False
            if h < 1e-15 * t_end or attempts > limits.budget:
                break
            continue
        theta, hit = first_zero(start.y, start.vy * h, end.y, end.vy * h, order), 3
        z, place = first_zero_of_x(p, zone, kinked, start.x, start.u, end.x, end.u, h)
        if z < theta:
            theta, hit = z, place
        if theta == SHRINK and h > 1e-14 * t_end:
            h_flight, done = 0.1 * h, False
            continue
        length, d = h, 0.0
        if theta < NEVER:
            which, done = hit, False
            length, d, lost, tries, end, stages = _onto(
                p, kz, mz, order, hit, h, max(theta, 0.0) * h, start, end, stages
            )
            attempts += tries
            if lost and h > 1e-14 * t_end:
                h_flight, which = 0.4 * h, 0
                continue
            h_flight = max(h_flight, h * next_factor(max(error, 0.5)))
        else:
            h_flight = h * next_factor(error)
            order = kinked = 0
        upcoming = _sample(watch, upcoming, t, length, start, end, stages)
        if observed:
            gather(
                watch.total, FLIGHT, length + d, start.u, start.du, end.u, end.du, 0.0, 0.0,
                max(start.y, end.y),
            )  # fmt: skip
            while ticks < len(watch.signal) and watch.mark + ticks * watch.interval <= t + length:
                z = (watch.mark + ticks * watch.interval - t) / max(length, 1e-300)
                watch.signal[ticks] = hermite(z, start.x, start.u * length, end.x, end.u * length)
                ticks += 1
        t = t_stop if done else t + length + d
        x, y = end.x + d * (end.u + 0.5 * d * end.du), end.y + d * (end.vy + 0.5 * d * end.dvy)
        u, vy = end.u + d * end.du, end.vy + d * end.dvy
        phi = math.asin(lean(p, x)[0])
        start = Flying(x, phi, y, u, vy, end.dphi, end.du, end.dvy)
    memory = Memory(memory.h_slip, h_flight, memory.slip_order, order, kinked)
    counts = Counts(attempts, rejected, upcoming, ticks)
    w = start.u - belt(g, t)[0]
    return Tip(t, start.x, start.phi, start.y, start.u, w, start.vy), memory, counts, which, done


@part
def _error(start, end, s, h, limits):
    """Return the step's error over the tolerance."""
    dx = E1 * start.u + E2 * s.x2 + E3 * s.x3 + E4 * s.x4 + E5 * s.x5 + E6 * s.x6 + E7 * end.u
    dy = E1 * start.vy + E2 * s.y2 + E3 * s.y3 + E4 * s.y4 + E5 * s.y5 + E6 * s.y6 + E7 * end.vy
    du = E1 * start.du + E2 * s.u2 + E3 * s.u3 + E4 * s.u4 + E5 * s.u5 + E6 * s.u6 + E7 * end.du
    dv = E1 * start.dvy + E2 * s.v2 + E3 * s.v3 + E4 * s.v4 + E5 * s.v5 + E6 * s.v6 + E7 * end.dvy
    return h * max(
        max(
            abs(dx) / (limits.atol_x + limits.rtol * max(abs(start.x), abs(end.x))),
            abs(dy) / (limits.atol_x + limits.rtol * max(abs(start.y), abs(end.y))),
        ),
        max(
            abs(du) / (limits.atol_v + limits.rtol * max(abs(start.u), abs(end.u))),
            abs(dv) / (limits.atol_v + limits.rtol * max(abs(start.vy), abs(end.vy))),
        ),
    )


@part
def _onto(p, kz, mz, order, hit, h, length, start, end, stages):
    """As `slip._onto`: step onto the zero of guard ``hit``, which is near ``length``."""
    d, lost, tries = 0.0, False, 0
    for _ in range(8):
        if length <= 0.0:
            length, end = 0.0, start
            break
        tries += 1
        end, stages = flight_step(p, kz, mz, length, start)
        if hit == 3:  # Newton with the known zero at the start divided out
            d = -end.y / (end.vy - order * end.y / length)
        else:
            d = (place_of(p, hit, end.x) - end.x) / end.u
        if abs(d) <= 1e-5 * length:
            lost = False
            break
        lost = not (0.0 < length + d <= h)
        if lost:
            break
        length += d
        d, lost = 0.0, True  # unless the next turn finds it converged
    return length, d, lost, tries, end, stages


@part
def _sample(watch, upcoming, t, length, a, b, s):
    """Write the samples of a step from a to b by its dense output; return the next sample."""
    times, taken = watch.times, watch.taken
    while upcoming < len(times) and times[upcoming] <= t + length:
        q1, q2, q3, q4, q5, q6, q7 = weights((times[upcoming] - t) / length)
        taken[upcoming, 0] = a.x + length * (
            q1 * a.u + q2 * s.x2 + q3 * s.x3 + q4 * s.x4 + q5 * s.x5 + q6 * s.x6 + q7 * b.u
        )
        taken[upcoming, 1] = a.y + length * (
            q1 * a.vy + q2 * s.y2 + q3 * s.y3 + q4 * s.y4 + q5 * s.y5 + q6 * s.y6 + q7 * b.vy
        )
        taken[upcoming, 2] = a.u + length * (
            q1 * a.du + q2 * s.u2 + q3 * s.u3 + q4 * s.u4 + q5 * s.u5 + q6 * s.u6 + q7 * b.du
        )
        taken[upcoming, 3] = a.vy + length * (
            q1 * a.dvy + q2 * s.v2 + q3 * s.v3 + q4 * s.v4 + q5 * s.v5 + q6 * s.v6 + q7 * b.dvy
        )
        upcoming += 1
    return upcoming
