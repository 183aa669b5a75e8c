"""One trajectory, event by event."""

import math

from .compiling import inner
from .model import (
    BUDGET,
    CAPTURE,
    COLLAPSE,
    COLLAPSED,
    FINISHED,
    FLIGHT,
    IMPACT,
    KINK,
    LIFT_OFF,
    RELEASE,
    REVERSAL,
    SLIP_NEG,
    SLIP_POS,
    STICK,
    TOO_SMALL,
    TOUCH,
    ZENO,
    Motion,
    belt,
    carried,
    cone,
    flight_rate,
    friction,
    lean,
    regime_at_rest,
    slip_rate,
    spring,
)
from .statistics import (
    IMPACTS,
    LIFTS,
    SLIP_TIME,
    STICKS,
    gather,
    hermite,
)
from .tsit5 import (
    E1,
    E2,
    E3,
    E4,
    E5,
    E6,
    E7,
    flight_step,
    next_factor,
    slip_step,
    weights,
)
from .zeros import (
    NEVER,
    SHRINK,
    first_zero,
    first_zero_of_x,
    place_of,
)


@inner
def run(
    p, motions, breaks, break_kinds, start, t_end, rtol, scale_x, scale_v, zeno_time, budget,
    times, taken, event_times, event_kinds, mark, signal, interval, total,
):  # fmt: skip
    """Run one cell; return (result, events, attempts, time, x, y, x', y', rejected).

    ``taken`` (samples, 4), ``signal`` (x at mark + i interval), the event arrays and ``total`` are
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
                signal[ticks] = x0 + carried(g, t0, mark + ticks * interval)[0]
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
                        signal[ticks] = hermite(z, x, x1 * length, xe, x7 * length)
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
                        signal[ticks] = hermite(z, x, u * length, xe, ue * length)
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
