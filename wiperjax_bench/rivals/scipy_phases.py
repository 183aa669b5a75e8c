"""`scipy.integrate.solve_ivp` with events, phase by phase: what most people would write.

The right-hand sides and reset maps are the compiled ones of `scalar`, which flatters scipy; the
stepping, the event detection and the location are its own.
"""

import math
from functools import partial

import numpy as np

from ..harness.interface import Answer
from ..scenes.scene import Scene
from .compiled import cells_of

MOST_EVENTS, AT_ONCE = 20_000, 20


class Phases:
    """One solve_ivp call a phase, restarted after every event."""

    setting_name = "rtol"
    settings = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
    cells = 3

    def __init__(self, method: str = "RK45"):
        self.method, self.name = method, f"scipy solve_ivp {method}"

    def available(self) -> str | None:
        try:
            import numba  # noqa: F401
        except ImportError:
            return "numba is not installed (its right-hand sides are used)"
        return None

    def prepare(self, scene: Scene, setting: float):
        from ..scalar import model

        blades, motions, breaks, kinds = cells_of(scene)
        scales = [np.broadcast_to(np.asarray(s, float), (scene.cells,)) for s in scene.scales]

        def call() -> Answer:
            runs = [
                trajectory(
                    model.Blade(*blades[i].tolist()),
                    [model.Motion(*m) for m in motions[i].tolist()],
                    breaks[i].tolist(),
                    kinds.tolist(),
                    scene.start[i].tolist(),
                    scene.duration,
                    scene.sample_times,
                    setting,
                    (float(scales[0][i]), float(scales[1][i])),
                    self.method,
                )
                for i in range(scene.cells)
            ]
            states, times, codes, stopped, steps = zip(*runs, strict=True)
            taken = np.stack(states)
            return Answer(
                scene.sample_times, taken[..., :2], taken[..., 2:],
                [np.array(t) for t in times], [np.array(k) for k in codes],
                np.array(stopped), np.array(steps),
            )  # fmt: skip

        return call


def trajectory(p, motions, breaks, break_kinds, start, end, times, rtol, scales, method):
    """Return (samples (samples, 4), event times, event kinds, stopped, evaluations)."""
    from scipy.integrate import solve_ivp

    from ..scalar import model as m

    x, y, u, vy = start
    t, piece, evaluations = 0.0, 0, 0
    motion = motions[0]
    v, a = m.belt(motion, t)
    w = u - v
    theta = math.asin(x / p.length) - p.alpha
    zone = int(theta > p.phi_s) - int(theta < -p.phi_s)
    taken = np.full((len(times), 4), np.nan)
    event_times, event_kinds = [], []

    def closed(w):
        """Regime of a closed contact."""
        if w == 0.0:
            return m.regime_at_rest(p, motion, zone, t, x)
        phi = math.asin(x / p.length)
        n = m.slip_rate(p, 0.0, 0.0, 1.0, x, phi, w, *m.belt(motion, t))[3]
        return m.FLIGHT if n <= 0 else (m.SLIP_POS if w > 0 else m.SLIP_NEG)

    regime = m.FLIGHT if (y > 0 or vy != 0) else closed(w)
    while t < end and len(event_times) < MOST_EVENTS:
        kz, mz = m.spring(p, zone)
        stop = min(end, breaks[piece])
        max_step = 0.25 * math.sqrt(p.m / ((p.k1 + p.dk) / p.length**2 + p.k + p.load / p.length))
        origin, begun = x, t
        if regime == m.STICK:
            max_step = 0.02 * p.length / max(abs(m.belt(motion, t)[0]), 1e-3)
            state = [x]
            place, rhs, guards = _stick(m, p, motion, kz, mz)
        elif regime == m.FLIGHT:
            state = [x, y, u, vy]
            place, rhs, guards = _flight(m, p, kz, mz)
        else:
            state = [x, w]
            sign = 1.0 if regime == m.SLIP_POS else -1.0
            place, rhs, guards = _slip(m, p, motion, kz, mz, sign)
        contact_guards = len(guards)
        edges = [(side, s) for side, s in ((1, 1.0), (-1, -1.0)) if zone in (0, side)]
        for side, s in edges:  # the neck ends at both shoulders, a shoulder's branch at its own
            x_edge = p.x_high if side == 1 else p.x_low
            s = s if zone == 0 else -s
            guards.append(_edge(s, x_edge))
        guards.append(lambda t, s: p.x_max - abs(s[0]))
        guards = [_terminal(g) for g in guards]
        lengths = {1: 1, 2: 2, 4: 4}[len(state)]
        atol = {1: [0], 2: [0, 1], 4: [0, 0, 1, 1]}[lengths]
        first = None
        if regime == m.FLIGHT and y == 0.0 and vy > 0.0:
            # a step longer than the flight starts and ends below: scipy then sees the zero at the
            # start only, and the tip falls through
            lift = rhs(t, state)[3]
            first = min(0.3 * vy / abs(lift), 0.5 * max_step, 0.5 * (stop - t))
        elif regime != m.STICK and w == 0.0:  # the same in slip, which may soon turn back
            first = min(1e-3 * max_step, 0.5 * (stop - t))
        found = solve_ivp(
            rhs, (t, stop), state, method=method, rtol=rtol, max_step=max_step,
            atol=[rtol * scales[i] for i in atol], events=guards, dense_output=True,
            first_step=first,
        )  # fmt: skip
        evaluations += found.nfev
        if found.status < 0:
            break
        reached = float(found.t[-1])
        due = (times > t) & (times <= reached)
        for i in np.flatnonzero(due):
            taken[i] = place(times[i], found.sol(times[i]))
        x, y, u, vy = (float(c) for c in place(reached, found.y[:, -1]))
        if regime == m.STICK:
            x = origin + m.carried(motion, begun, reached)[0]
        t = stop if found.status == 0 else reached
        v, a = m.belt(motion, t)
        w = 0.0 if regime == m.STICK else u - v
        if found.status == 0:
            if t >= end:
                break
            kind = break_kinds[piece]
            piece += 1
            motion = motions[piece]
            if regime == m.STICK:
                regime = closed(0.0)
        else:
            hit = next(i for i, e in enumerate(found.t_events) if len(e))
            if hit == len(guards) - 1:
                event_times.append(t)
                event_kinds.append(m.COLLAPSE)
                break
            if hit >= contact_guards:
                kind, side = m.KINK, edges[hit - contact_guards][0]
                x = p.x_high if side == 1 else p.x_low
                zone = side if zone == 0 else 0
            elif regime == m.STICK:
                kind, regime = m.RELEASE, (m.SLIP_NEG, m.SLIP_POS)[hit]
            elif regime == m.FLIGHT:
                kind, t, x, w, vy, regime = _impact(m, p, motion, kz, mz, t, x, w, vy, closed)
                y = 0.0
            elif hit == 0:
                w, before = 0.0, regime
                regime = closed(0.0)
                kind = {m.STICK: m.CAPTURE, m.FLIGHT: m.LIFT_OFF, before: m.TOUCH}.get(
                    regime, m.REVERSAL
                )
            else:
                kind, regime = m.LIFT_OFF, m.FLIGHT
        u = w + m.belt(motion, t)[0]
        if regime != m.FLIGHT:
            y = vy = 0.0
        event_times.append(t)
        event_kinds.append(kind)
        if len(event_times) > AT_ONCE and event_times[-AT_ONCE] == t:
            break  # the same event for ever
    collapsed = bool(event_kinds) and event_kinds[-1] == m.COLLAPSE
    stopped = t < end and not collapsed
    return taken, event_times, event_kinds, stopped, evaluations


def _phi(p, x):
    """Lean at x; a trial stage may reach past the lip."""
    return math.asin(min(max(x / p.length, -1.0), 1.0))


def _stick(m, p, motion, kz, mz):
    """Return (motion from the state (x,), right-hand side, guards) of stick."""
    speed = lambda t: m.belt(motion, t)[0]
    cone = lambda t, s: m.cone(p, kz, mz, s[0], *m.belt(motion, t), 0.0)
    return (
        lambda t, s: (s[0], 0.0, speed(t), 0.0),
        lambda t, s: [speed(t)],
        [lambda t, s: cone(t, s)[0], lambda t, s: cone(t, s)[1]],
    )


def _flight(m, p, kz, mz):
    """The same of flight; the state is (x, y, x', y')."""

    def rhs(t, s):
        _, du, dv = m.flight_rate(p, kz, mz, s[0], _phi(p, s[0]), s[1], s[2], s[3])
        return [s[2], s[3], du, dv]

    return lambda t, s: tuple(s), rhs, [lambda t, s: s[1]]


def _slip(m, p, motion, kz, mz, sign):
    """The same of slip; the state is (x, x' - V)."""

    def rates(t, s):
        return m.slip_rate(p, kz, mz, sign, s[0], _phi(p, s[0]), s[1], *m.belt(motion, t))

    return (
        lambda t, s: (s[0], 0.0, s[1] + m.belt(motion, t)[0], 0.0),
        lambda t, s: [*rates(t, s)[0:3:2]],
        [lambda t, s: sign * s[1], lambda t, s: rates(t, s)[3]],
    )


def _edge(side, place):
    """Guard of a shoulder at x = ``place``, positive on the side where the branch holds."""
    return lambda t, s: side * (place - s[0])


def _terminal(guard):
    """Mark an event function: it ends the phase where it falls through zero."""
    guard = partial(guard)
    guard.terminal, guard.direction = True, -1  # type: ignore[attr-defined]
    return guard


def _impact(m, p, motion, kz, mz, t, x, w, vy, closed):
    """Return (kind, t, x, w, y', regime) after an impact, its Zeno limit included."""
    v, a = m.belt(motion, t)
    phi = math.asin(x / p.length)
    mu = m.friction(p, abs(w)) if w != 0.0 else p.mu_s
    push = -(1 + p.e) * vy
    w -= min(max(w, -mu * push), mu * push)
    vy = -p.e * vy
    _, free, lift = m.flight_rate(p, kz, mz, x, phi, 0.0, w + v, 0.0)
    if vy > 0 and not (lift < 0 and p.e < 1 and 2 * vy < 1e-8 * -lift):
        return m.IMPACT, t, x, w, vy, m.FLIGHT
    kind = m.IMPACT
    if vy > 0:
        kind, last = m.ZENO, 2 * vy / -lift / (1 - p.e)
        s = math.copysign(1.0, w) if w != 0.0 else 0.0
        after = w + (free - a) * last - s * mu * (-lift * last - vy)
        t, x, w = t + last, x + last * (w + v), after if s * after > 0 else 0.0
    return kind, t, x, w, 0.0, closed(w)


RIVALS = [Phases("RK45"), Phases("DOP853")]
