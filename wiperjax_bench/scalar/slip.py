"""Slip: steps of Tsit5 in x, phi and the slip speed w, each looked at for events."""

import math

from .compiling import part
from .model import SLIP_POS, belt, lean, slip_rate, spring
from .records import Counts, Memory, Tip
from .statistics import gather, hermite
from .tsit5 import E1, E2, E3, E4, E5, E6, E7, Slipping, next_factor, slip_step, weights
from .zeros import NEVER, SHRINK, first_zero, first_zero_of_x, place_of


@part
def slip(p, g, zone, regime, limits, watch, tip, memory, counts, t_stop):
    """Slip until an event or ``t_stop``; return (tip, memory, counts, event, done).

    Neither an event nor done: the steps are too small, or the budget is spent.
    """
    kz, mz = spring(p, zone)
    sign = 1.0 if regime == SLIP_POS else -1.0
    t, h_slip, order, kinked = tip.t, memory.h_slip, memory.slip_order, memory.kinked
    attempts, rejected, upcoming, ticks = counts
    t_end, observed = limits.t_end, t >= watch.mark
    which, done = 0, False
    v, a = belt(g, t)
    x1, f1, w1, n1 = slip_rate(p, kz, mz, sign, tip.x, tip.phi, tip.w, v, a)
    start = Slipping(tip.x, tip.phi, tip.w, x1, f1, w1, n1)
    while which == 0 and not done:
        h = h_slip
        done = t + h * (1.0 + 1e-9) >= t_stop
        if done:
            h = t_stop - t
        attempts += 1
        end, stages = slip_step(p, g, kz, mz, sign, t, h, start)
        error = _error(start, end, stages, h, limits)
        if not error <= 1.0:
            h_slip = h * (next_factor(error) if error < 1e30 else 0.1)
            rejected, done = rejected + 1, False
            if h < 1e-15 * t_end or attempts > limits.budget:
                break
            continue
        theta, hit = _first_event(p, g, zone, kinked, order, sign, t, h, start, end, a)
        if theta == SHRINK and h > 1e-14 * t_end:
            h_slip, done = 0.1 * h, False
            continue
        length, d = h, 0.0
        if theta < NEVER:
            which, done = hit, False
            length, d, lost, tries, end, stages = _onto(
                p, g, kz, mz, sign, order, hit, t, h, max(theta, 0.0) * h, start, end, stages
            )
            attempts += tries
            if lost and h > 1e-14 * t_end:  # the cubic said too little: a shorter step
                h_slip, which = 0.4 * h, 0
                continue
            h_slip = max(h_slip, h * next_factor(max(error, 0.5)))
        else:
            h_slip = h * next_factor(error)
            order = kinked = 0
        upcoming = _sample(g, watch, upcoming, t, length, start, end, stages)
        v, a_end = belt(g, t + length)
        if observed:
            gather(
                watch.total, regime, length + d, start.dx, start.dw + a, end.dx, end.dw + a_end,
                start.force, end.force, 0.0,
            )  # fmt: skip
            while ticks < len(watch.signal) and watch.mark + ticks * watch.interval <= t + length:
                z = (watch.mark + ticks * watch.interval - t) / max(length, 1e-300)
                watch.signal[ticks] = hermite(z, start.x, start.dx * length, end.x, end.dx * length)
                ticks += 1
        t = t_stop if done else t + length + d
        x = end.x + d * (end.dx + 0.5 * d * (end.dw + a_end))
        # dphi of the integrated phi: equal to rounding of the step's own error
        phi, w = math.asin(lean(p, x)[0]), end.w + d * end.dw
        start = Slipping(x, phi, w, end.dx, end.dphi, end.dw, end.force)
        a = a_end
    memory = Memory(h_slip, memory.h_flight, order, memory.flight_order, kinked)
    counts = Counts(attempts, rejected, upcoming, ticks)
    tip = Tip(t, start.x, start.phi, tip.y, start.w + v, start.w, tip.vy)
    return tip, memory, counts, which, done


@part
def _error(start, end, s, h, limits):
    """Return the step's error over the tolerance."""
    dx = E1 * start.dx + E2 * s.x2 + E3 * s.x3 + E4 * s.x4 + E5 * s.x5 + E6 * s.x6 + E7 * end.dx
    dw = E1 * start.dw + E2 * s.w2 + E3 * s.w3 + E4 * s.w4 + E5 * s.w5 + E6 * s.w6 + E7 * end.dw
    return max(
        h * abs(dx) / (limits.atol_x + limits.rtol * max(abs(start.x), abs(end.x))),
        h * abs(dw) / (limits.atol_v + limits.rtol * max(abs(start.w), abs(end.w))),
    )


@part
def _force_rate(p, at, pull):
    """Return the rate of the normal force; ``pull``: V'."""
    s, inv, _ = lean(p, at.x)
    return -p.k * s * inv * at.dx - p.c * (
        inv * inv * inv / p.length * at.dx * at.dx + s * inv * (at.dw + pull)
    )


@part
def _first_event(p, g, zone, kinked, order, sign, t, h, start, end, pull):
    """Return (share of the step, guard) of the first event; 3: w = 0, 4: no force, else in x.

    A step that could not have one passes by comparisons alone. ``pull``: V' at the start.
    """
    theta, hit = (
        first_zero(sign * start.w, sign * start.dw * h, sign * end.w, sign * end.dw * h, order),
        3,
    )
    z, place = first_zero_of_x(p, zone, kinked, start.x, start.dx, end.x, end.dx, h)
    if z < theta:
        theta, hit = z, place
    if min(start.force, end.force) < 0.3 * (p.load + abs(p.weight)):
        b = _force_rate(p, start, pull)
        c = _force_rate(p, end, belt(g, t + h)[1])
        z = first_zero(start.force, b * h, end.force, c * h, 0)
        if z < theta:
            theta, hit = z, 4
    return theta, hit


@part
def _onto(p, g, kz, mz, sign, order, hit, t, h, length, start, end, stages):
    """Step onto the zero of guard ``hit``, which is near ``length``.

    Return (length, rest of the way by the rates there, lost, attempts, end, stages).
    """
    d, lost, tries = 0.0, False, 0
    for _ in range(8):
        if length <= 0.0:
            length, end = 0.0, start
            break
        tries += 1
        end, stages = slip_step(p, g, kz, mz, sign, t, length, start)
        if hit == 3:  # Newton with the known zero at the start divided out
            d = -end.w / (end.dw - order * end.w / length)
        elif hit == 4:
            d = -end.force / _force_rate(p, end, belt(g, t + length)[1])
        else:
            d = (place_of(p, hit, end.x) - end.x) / end.dx
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
def _sample(g, watch, upcoming, t, length, start, end, s):
    """Write the samples of a step by its dense output; return the next sample."""
    times, taken = watch.times, watch.taken
    while upcoming < len(times) and times[upcoming] <= t + length:
        q1, q2, q3, q4, q5, q6, q7 = weights((times[upcoming] - t) / length)
        v, _ = belt(g, times[upcoming])
        taken[upcoming, 0] = start.x + length * (
            q1 * start.dx + q2 * s.x2 + q3 * s.x3 + q4 * s.x4 + q5 * s.x5 + q6 * s.x6 + q7 * end.dx
        )
        taken[upcoming, 1] = 0.0
        way = (
            q1 * start.dw + q2 * s.w2 + q3 * s.w3 + q4 * s.w4 + q5 * s.w5 + q6 * s.w6 + q7 * end.dw
        )
        taken[upcoming, 2] = v + start.w + length * way
        taken[upcoming, 3] = 0.0
        upcoming += 1
    return upcoming
