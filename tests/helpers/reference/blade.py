"""Event-driven reference of the lip of docs/model.md, phase by phase, independent of the engine.

Every smooth phase is integrated by DOP853 at rtol 1e-12; the guards are tested on fine samples of
the dense output (with a search for double roots), the earliest root is located with brentq, the
step is integrated again up to that root, and one Newton correction puts the state on the guard.
Section numbers below are those of docs/model.md.

The independent variable inside a phase is sigma with dt/dsigma = 1 in STICK and FLIGHT and
dt/dsigma = D/D0 in slip (D0 = D without friction): for M_h = 0 that is t itself, for M_h > 0 it
removes the pole of lambda_n at D = 0 (section 7), so that a jam is an ordinary transversal root.
The time is therefore a component of the state.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq, minimize_scalar

STICK, SLIP_POS, SLIP_NEG, FLIGHT = range(4)

REFERENCE = dict(  # section 9
    tip_mass=2.4e-3,
    lip_length=6e-3,
    support_stiffness=2000.0,
    support_damping=1.0,
    neck_stiffness=0.05,
    shoulder_stiffness=2.0,
    shoulder_angle=0.6,
    attack_angle=0.0,
    normal_load=15.0,
    restitution=0.3,
    mu_static=1.0,
    mu_minimum=0.3,
    stribeck_speed=0.1,
    stribeck_shape=1.0,
    viscous_slope=0.02,
    hinge_mass=0.0,
    hinge_damping=0.0,
    gravity=0.0,
    collapse_angle=math.radians(89.0),
    belt_speed=0.3,
)


# ---- belts (section 8)
@dataclass(frozen=True)
class Steady:
    """V(t) = speed."""

    speed: float = 0.3

    def known_times(self, start, stop):
        """Zeros and kinks of V strictly inside (start, stop)."""
        return []

    def piece(self, middle):
        """(V, V') as smooth functions of t, valid on the smooth piece that contains `middle`."""
        return (lambda t: self.speed), (lambda t: 0.0)


@dataclass(frozen=True)
class Wiping:
    """V(t) = speed sin(2 pi frequency t + phase)."""

    speed: float
    frequency: float
    phase: float = 0.0

    def known_times(self, start, stop):
        return _times_of([0.0, 0.5], self, start, stop)

    def piece(self, middle):
        w = 2.0 * math.pi * self.frequency
        return (
            lambda t: self.speed * math.sin(w * t + self.phase),
            lambda t: self.speed * w * math.cos(w * t + self.phase),
        )


@dataclass(frozen=True)
class Trapezoid:
    """Plateaus +-speed joined by linear ramps of duration `ramp`; rises through 0 at integer s = f
    t + phase/(2 pi).
    """

    speed: float
    frequency: float
    phase: float
    ramp: float

    def known_times(self, start, stop):
        half = 0.5 * self.frequency * self.ramp
        return _times_of([0.0, half, 0.5 - half, 0.5, 0.5 + half, 1.0 - half], self, start, stop)

    def piece(self, middle):
        f, shift = self.frequency, self.phase / (2.0 * math.pi)
        half, s = 0.5 * f * self.ramp, f * middle + shift
        nearest = math.floor(2.0 * s + 0.5) / 2.0  # the zero of V next to `middle`, in units of s
        sign = 1.0 if round(2.0 * nearest) % 2 == 0 else -1.0  # rising or falling there
        if abs(s - nearest) < half:
            slope, zero = sign * 2.0 * self.speed / self.ramp, (nearest - shift) / f
            return (lambda t: slope * (t - zero)), (lambda t: slope)
        plateau = math.copysign(self.speed, sign * (s - nearest) * self.speed)
        return (lambda t: plateau), (lambda t: 0.0)


def _times_of(fractions, belt, start, stop):
    """All t in (start, stop) at which s = f t + phase/(2 pi) has one of the fractional parts
    given, without repeats.
    """
    f, shift, times = belt.frequency, belt.phase / (2.0 * math.pi), []
    for n in range(math.floor(f * start + shift) - 1, math.ceil(f * stop + shift) + 2):
        times += [(n + q - shift) / f for q in fractions]
    tiny = 1e-14 / f
    kept = []
    for t in sorted(times):
        if start + tiny < t < stop - tiny and (not kept or t - kept[-1] > tiny):
            kept.append(t)
    return kept


# ---- mechanics (sections 2-6)
class Mechanics:
    """Forces of sections 2 to 4 in math floats; `zone` is the branch of the rotational spring (-1,
    0, +1).
    """

    def __init__(self, parameters):
        unknown = set(parameters) - set(REFERENCE)
        if unknown:
            raise KeyError(f"unknown parameters {sorted(unknown)}")
        p = self.p = SimpleNamespace(**{**REFERENCE, **parameters})
        self.x_max = p.lip_length * math.sin(p.collapse_angle)
        self.x_shoulder = {}
        for side in (+1, -1):  # where theta = +-phi_s; absent if it lies beyond 90 degrees
            angle = p.attack_angle + side * p.shoulder_angle
            if abs(angle) < 0.5 * math.pi:
                self.x_shoulder[side] = p.lip_length * math.sin(angle)

    def zone(self, x):
        theta = math.asin(x / self.p.lip_length) - self.p.attack_angle
        return (theta > self.p.shoulder_angle) - (theta < -self.p.shoulder_angle)

    def mu(self, v):
        """Friction coefficient at v = s v_t >= 0; v < 0 (trial points past the event) continues it
        smoothly.
        """
        p = self.p
        r = v / p.stribeck_speed
        if p.stribeck_shape == 1.0:
            r = max(r, -5.0)
        else:
            r = r**p.stribeck_shape if r > 0.0 else 0.0
        return p.mu_minimum + (p.mu_static - p.mu_minimum) * math.exp(-r) + p.viscous_slope * v

    def loads(self, x, y, vx, vy, zone):
        """tau, and the right side f - h of A q'' = f - h + lambda (section 3)."""
        p = self.p
        length = p.lip_length
        sine = min(
            max(x / length, -1.0 + 1e-12), 1.0 - 1e-12
        )  # trial stages must not leave |phi| < 90 degrees
        cosine = math.sqrt((1.0 - sine) * (1.0 + sine))
        tau = sine / cosine
        theta = math.asin(sine) - p.attack_angle
        moment = p.neck_stiffness * theta
        if zone:
            moment += (p.shoulder_stiffness - p.neck_stiffness) * (theta - zone * p.shoulder_angle)
        lever = length * cosine
        moment += p.hinge_damping * vx / lever
        support = (
            p.normal_load
            + p.support_stiffness * (y + lever - length * math.cos(p.attack_angle))
            + p.support_damping * (vy - tau * vx)
        )
        inertial = p.hinge_mass * vx * vx / (lever * cosine * cosine)  # M_h tau_x x'^2
        r_t = -moment / lever + (support + p.hinge_mass * p.gravity) * tau - inertial * tau
        r_n = -support - (p.tip_mass + p.hinge_mass) * p.gravity + inertial
        return tau, r_t, r_n

    def inverse_mass(self, x):
        """W_tt, W_tn, W_nn."""
        m, hinge, s = self.p.tip_mass, self.p.hinge_mass, x / self.p.lip_length
        cos2 = 1.0 - s * s
        tau = s / math.sqrt(cos2)
        det = m * (m + hinge / cos2)
        return (m + hinge) / det, hinge * tau / det, (m + hinge * tau * tau) / det

    def stick_forces(self, x, v, dv, zone):
        """(lambda_t, lambda_n) that hold x' = V, x'' = V', y = 0."""
        tau, r_t, r_n = self.loads(x, 0.0, v, 0.0, zone)
        m, hinge = self.p.tip_mass, self.p.hinge_mass
        return (m + hinge * tau * tau) * dv - r_t, -r_n - hinge * tau * dv

    def slip_terms(self, x, w, v, s, zone):
        """(D0, Dhat, numerator, G): x'' = numerator/Dhat, lambda_n = G/Dhat, Dhat = D det A, G =
        -b_n det A.

        From the two rows of section 3 with y'' = 0 and lambda_t = -s mu lambda_n.
        """
        tau, r_t, r_n = self.loads(x, 0.0, w + v, 0.0, zone)
        hinge, mu = self.p.hinge_mass, self.mu(s * w)
        d0 = self.p.tip_mass + hinge * tau * tau
        return d0, d0 - s * mu * hinge * tau, r_t + s * mu * r_n, -d0 * r_n - hinge * tau * r_t

    def free_acceleration(self, x, y, vx, vy, zone):
        tau, r_t, r_n = self.loads(x, y, vx, vy, zone)
        m, hinge = self.p.tip_mass, self.p.hinge_mass
        det = m * (m + hinge * (1.0 + tau * tau))
        return (
            ((m + hinge) * r_t + hinge * tau * r_n) / det,
            (hinge * tau * r_t + (m + hinge * tau * tau) * r_n) / det,
        )


def energy(parameters, q, v):
    """E of section 3, from the tip position q = (x, y) and velocity v = (x', y')."""
    p = SimpleNamespace(**{**REFERENCE, **parameters})
    phi = math.asin(q[0] / p.lip_length)
    eta = q[1] + p.lip_length * math.cos(phi)
    eta_rate = v[1] - math.tan(phi) * v[0]
    theta = phi - p.attack_angle
    beyond = max(abs(theta) - p.shoulder_angle, 0.0)
    return (
        0.5 * p.tip_mass * (v[0] ** 2 + v[1] ** 2)
        + 0.5 * p.hinge_mass * eta_rate**2
        + 0.5 * p.neck_stiffness * theta**2
        + 0.5 * (p.shoulder_stiffness - p.neck_stiffness) * beyond**2
        + p.normal_load * eta
        + 0.5 * p.support_stiffness * (eta - p.lip_length * math.cos(p.attack_angle)) ** 2
        + p.gravity * (p.tip_mass * q[1] + p.hinge_mass * eta)
    )


def poisson_impact(w_tt, w_tn, w_nn, mu, e, v_t, v_n, jam=False):
    """Section 6 piece by piece: (v_t+, v_n+, p_t, p_n). Takes v_n <= 0; `jam`: D = 0 reached in
    slip, so that the first slip piece may not end the compression (there dv_n/dp_n is zero up to
    round-off).
    """
    p_t = p_n = p_c = 0.0
    compressing = True
    for _ in range(6):  # at most slip, stick or reversed slip, in each of compression and expansion
        if v_t != 0.0:
            s = math.copysign(1.0, v_t)
        elif abs(w_tn) <= mu * w_tt:
            s = 0.0
        else:
            s = math.copysign(1.0, w_tn)
        ratio = -s * mu if s else -w_tn / w_tt  # dp_t/dp_n
        rate_t = w_tn + w_tt * ratio if s else 0.0
        rate_n = w_nn + w_tn * ratio
        if jam and v_t != 0.0:
            rate_n = min(rate_n, 0.0)
        to_stop = -v_t / rate_t if v_t * rate_t < 0.0 else math.inf
        if compressing:
            to_end = -v_n / rate_n if rate_n > 0.0 else math.inf
        else:
            to_end = (1.0 + e) * p_c - p_n
        piece = min(to_stop, to_end)
        if not math.isfinite(piece):
            raise ArithmeticError("impact does not end: W is not positive definite")
        v_t = 0.0 if piece == to_stop else v_t + rate_t * piece
        v_n = 0.0 if compressing and piece == to_end else v_n + rate_n * piece
        p_t, p_n = p_t + ratio * piece, p_n + piece
        if piece == to_end:
            if not compressing:
                return v_t, v_n, p_t, p_n
            compressing, p_c = False, p_n
            if e == 0.0:
                return v_t, 0.0, p_t, p_n
    raise ArithmeticError("impact needs more pieces than the theory allows")


# ---- one smooth phase
_FIRST = np.concatenate(
    [10.0 ** np.arange(-5.0, -1.0), np.linspace(0.1, 1.0, 10)]
)  # zeros at the start: look close
_LATER = np.linspace(0.0, 1.0, 9)[1:]


def _double_root(fun, a, b, ga, gb, slope_a, slope_b):
    """A point of (a, b) where fun <= 0 although fun(a), fun(b) > 0, or None (derivative test, then
    minimisation).
    """
    if not (slope_a < 0.0 < slope_b):
        return None
    vertex = a - slope_a * (b - a) / (slope_b - slope_a)
    if min(ga + 0.5 * slope_a * (vertex - a), gb + 0.5 * slope_b * (vertex - b)) > 0.5 * min(
        ga, gb
    ):
        return None  # far from zero at the estimated minimum
    best = minimize_scalar(fun, bounds=(a, b), method="bounded", options={"xatol": 1e-9 * (b - a)})
    return best.x if best.fun <= 0.0 else None


def _slopes(points, values):
    """Derivative at every sample, from the parabola through it and its neighbours (at an end: the
    nearest three).
    """
    h = [b - a for a, b in pairwise(points)]
    d = [(b - a) / c for (a, b), c in zip(pairwise(values), h, strict=True)]
    inner = [(d[i] * h[i + 1] + d[i + 1] * h[i]) / (h[i] + h[i + 1]) for i in range(len(d) - 1)]
    return [2.0 * d[0] - inner[0], *inner, 2.0 * d[-1] - inner[-1]]


def _earliest_root(fun, points, values, fresh):
    """Earliest root of fun on the sampled step, or None. values[0] belongs to the start of the
    step; `fresh`: fun is zero there and positive just after it, so neither that value nor a slope
    at it may be used.
    """
    slopes = [0.0] + _slopes(points[1:], values[1:]) if fresh else _slopes(points, values)
    for i in range(1, len(points)):
        if values[i] <= 0.0:
            if fresh and i == 1:
                return points[0]  # re-tested at once
            return brentq(fun, points[i - 1], points[i], xtol=1e-22, rtol=1e-14)
        if fresh and i == 1:
            continue
        low = _double_root(
            fun, points[i - 1], points[i], values[i - 1], values[i], slopes[i - 1], slopes[i]
        )
        if low is not None:
            return brentq(fun, points[i - 1], low, xtol=1e-22, rtol=1e-14)
    return None


def _integrate_phase(rhs, guards, fresh, u, first_step, max_step, rtol, atol, on_step):
    """Integrate u' = rhs(sigma, u) until the first of `guards` (name -> function of u, positive
    inside) vanishes.

    Returns (name, u at the event). `fresh` names the guards that are zero at the start and
    positive after it.
    """
    for name, guard in guards.items():
        if name not in fresh and guard(u) <= 0.0:
            return name, list(u)  # tie: fires at this very instant
    solver = DOP853(
        rhs, 0.0, u, math.inf, max_step=max_step, rtol=rtol, atol=atol, first_step=first_step
    )
    first = True
    start_values = {name: guard(u) for name, guard in guards.items()}
    while True:
        old, u_old = float(solver.t), solver.y.tolist()
        message = solver.step()
        if solver.status == "failed":
            raise ArithmeticError(f"integration failed: {message}")
        dense, size = solver.dense_output(), solver.t - old
        points = old + size * (_FIRST if first else _LATER)
        columns, points = dense(points).T.tolist(), [old, *points.tolist()]
        hit_name, hit = None, math.inf
        for name, guard in guards.items():
            values = [start_values[name]] + [guard(c) for c in columns]
            if not first and min(values) > 4.0 * (max(values) - min(values)):
                start_values[name] = values[-1]  # its parabolas too stay far from zero
                continue
            root = _earliest_root(
                lambda z, g=guard, d=dense: g(d(z).tolist()),
                points,
                values,
                first and name in fresh,
            )
            start_values[name] = values[-1]
            if root is not None and root < hit:
                hit_name, hit = name, float(root)
        if hit_name is None:
            on_step(dense, old, u_old, solver.y.tolist())
            first = False
            continue
        u_hit = u_old
        if hit > old:
            again = DOP853(
                rhs, old, u_old, hit, max_step=max_step, rtol=rtol, atol=atol, first_step=hit - old
            )
            while again.status == "running":
                again.step()
            if again.status == "failed":
                raise ArithmeticError("integration to the event failed")
            u_hit = _newton(rhs, guards[hit_name], again.y.tolist(), float(size))
        on_step(dense, old, u_old, u_hit)
        return hit_name, u_hit


def _newton(rhs, guard, u, size):
    """Move u along the flow onto guard = 0 (two corrections; none where the guard is tangent to
    the flow).
    """
    for _ in range(2):
        slope, eps = rhs(0.0, np.array(u)), 1e-5 * size
        ahead = guard([a + eps * b for a, b in zip(u, slope, strict=True)])
        behind = guard([a - eps * b for a, b in zip(u, slope, strict=True)])
        rate = (ahead - behind) / (2.0 * eps)
        shift = -guard(u) / rate if rate != 0.0 else 0.0
        if abs(shift) > 1e-4 * size:
            break
        u = [a + shift * b for a, b in zip(u, slope, strict=True)]
    return u


# ---- the run
class Event(NamedTuple):
    time: float
    kind: str  # release, capture, reversal, lift_off, impact, zeno, kink, belt, collapse, jam
    before: int
    after: int
    impulse: float  # p_n (impact, zeno, jam), else 0


@dataclass
class Run:
    final_time: float
    position: np.ndarray
    velocity: np.ndarray
    regime: int
    events: list
    result: str  # finished, collapsed, max_events
    regime_time: np.ndarray = field(default_factory=lambda: np.zeros(4))
    flags: list = field(
        default_factory=list
    )  # (time, "indeterminate"): section 7, the flight branch was taken
    samples: dict = field(
        default_factory=dict
    )  # t, x, y, vx, vy, regime, lambda_n, lambda_t at sample_times

    def times(self, kind):
        return np.array([event.time for event in self.events if event.kind == kind])

    def counts(self):
        kinds = [event.kind for event in self.events]
        return {kind: kinds.count(kind) for kind in sorted(set(kinds))}


def simulate(
    parameters,
    belt=None,
    duration=0.05,
    initial_state=None,
    rtol=1e-12,
    atol=None,
    max_events=100000,
    sample_times=(),
    zeno_time=1e-8,
    max_step=None,
):
    """Reference trajectory of the wiper from t = 0.

    initial_state: (x, y, x', y'), default phi = alpha, touching, at rest. A start with y = 0 is
    decided at acceleration level (y' = 0), flies (y' > 0) or strikes (y' < 0). atol: one number
    per component or one for all, default far below rtol times the natural size. A sample that
    falls on an event shows the state before it.
    """
    return _Simulation(
        parameters, belt, duration, rtol, atol, sample_times, zeno_time, max_step
    ).run(initial_state, max_events)


class _Simulation:
    def __init__(self, parameters, belt, duration, rtol, atol, sample_times, zeno_time, max_step):
        self.mech = Mechanics(parameters)
        p = self.p = self.mech.p
        self.belt = belt if belt is not None else Steady(p.belt_speed)
        self.ends = self.belt.known_times(0.0, duration) + [duration]
        self.rtol, self.atol, self.zeno_time = rtol, atol, zeno_time
        fastest = math.sqrt(
            (
                max(p.neck_stiffness, p.shoulder_stiffness) / p.lip_length**2
                + p.support_stiffness
                + p.normal_load / p.lip_length
            )
            / p.tip_mass
        )
        self.max_step = max_step if max_step is not None else min(0.25 / fastest, duration)
        self.events, self.flags, self.regime_time = [], [], np.zeros(4)
        self.wanted, self.rows = list(sample_times), []

    # -- bookkeeping
    def note(self, kind, after, impulse=0.0):
        self.events.append(Event(self.t, kind, self.regime, after, impulse))
        self.regime = after

    def next_piece(self):
        """Belt functions of the smooth piece that starts now."""
        self.t_end = self.ends[self.segment]
        start = self.ends[self.segment - 1] if self.segment else 0.0
        self.v_of, self.dv_of = self.belt.piece(0.5 * (start + self.t_end))

    # -- section 5: regime at acceleration level (y = y' = 0)
    def decide(self):
        """Regime after an event at rest on the glass; resolves an inconsistent slip by an impact
        without collision.
        """
        mech, v, dv = self.mech, self.v_of(self.t), self.dv_of(self.t)
        self.y = self.vy = 0.0
        if self.w == 0.0:
            l_t, l_n = mech.stick_forces(self.x, v, dv, self.zone)
            if l_n > 0.0 and abs(l_t) <= self.p.mu_static * l_n:
                return STICK, 0.0
            load = 0.0
            for s, regime in ((1.0, SLIP_POS), (-1.0, SLIP_NEG)):
                _, d, numerator, load = mech.slip_terms(self.x, 0.0, v, s, self.zone)
                if d > 0.0 and load > 0.0 and s * (numerator / d - dv) > 0.0:
                    return regime, 0.0
            if load > 0.0:  # on the edge of the cone up to round-off
                return (SLIP_NEG if l_t > 0.0 else SLIP_POS), 0.0
            return FLIGHT, 0.0
        s = math.copysign(1.0, self.w)
        _, d, _, load = mech.slip_terms(self.x, self.w, v, s, self.zone)
        if d <= 0.0 and load > 0.0:
            return self.strike(jam=True)
        if d <= 0.0:
            self.flags.append((self.t, "indeterminate"))
        return (FLIGHT if d <= 0.0 or load <= 0.0 else SLIP_POS if s > 0.0 else SLIP_NEG), 0.0

    # -- section 6
    def strike(self, jam=False):
        """Impact (or impact without collision): sets w, vy and returns (next regime, normal
        impulse).
        """
        w_matrix = self.mech.inverse_mass(self.x)
        closing = 0.0 if jam else min(self.vy, 0.0)
        self.w, self.vy, _, impulse = poisson_impact(
            *w_matrix, self.mech.mu(abs(self.w)), self.p.restitution, self.w, closing, jam
        )
        self.y = 0.0
        self.ratio = self.vy / -closing if closing < 0.0 else math.inf
        begun = (e.time for e in reversed(self.events) if e.before != FLIGHT or e.kind == "impact")
        self.flown = self.t - next(begun, 0.0)
        if self.vy > 0.0:
            return FLIGHT, impulse
        regime, more = self.decide()
        return regime, impulse + more

    def zeno(self):
        """Replace an accumulating bounce sequence by its limit; true if that was done. First order
        in its duration: the belt goes on, b_t acts in the short flights, and lambda_n acts with
        the friction ratio of its mode.
        """
        x, v, dv = self.x, self.v_of(self.t), self.dv_of(self.t)
        b_t, b_n = self.mech.free_acceleration(x, 0.0, self.w + v, 0.0, self.zone)
        # what loses less than a 200th a bounce is ended by convention (docs/limits.md)
        flight = 2.0 * self.vy / -b_n if b_n < 0.0 else math.inf
        endless = 0.995 < self.ratio <= 1.0 + 1e-9
        if self.ratio > 1.0 + 1e-9:  # the impact gained: did flight and impact together?
            endless = 0.995 * self.flown < flight <= (1.0 + 1e-9) * self.flown
        shortest = self.zeno_time * (10.0 if endless else 1.0)
        if not (
            self.vy > 0.0
            and b_n < 0.0
            and (self.ratio < 1.0 or endless)
            and 2.0 * self.vy < shortest * -b_n
        ):
            return False
        duration = 2.0 * self.vy / -b_n / (1.0 if endless else 1.0 - self.ratio)
        if self.t + duration >= self.t_end and duration > 1e-15:
            return False  # the belt changes, or the run ends, before the sequence does
        w_tt, w_tn, w_nn = self.mech.inverse_mass(x)
        mu, push = (
            self.mech.mu(abs(self.w)),
            -b_n * duration - self.vy,
        )  # normal velocity the impulses must supply
        free = self.w + (b_t - dv) * duration
        s = math.copysign(1.0, self.w) if self.w else 0.0
        if s:
            impulse = push / (w_nn - s * mu * w_tn)
            after = free + (w_tn - s * mu * w_tt) * impulse
        if not s or s * after <= 0.0:  # sticking impacts, or slip used up on the way: clipped at 0
            impulse, after = push / (w_nn - w_tn * w_tn / w_tt), 0.0
        self.x = x + (v + 0.5 * (self.w + after)) * duration
        self.w, self.t = after, self.t + duration
        self.regime_time[FLIGHT] += duration
        regime, more = self.decide()
        self.note("zeno", regime, impulse + more)
        return True

    # -- one phase: right-hand side, guards, tolerances
    def phase(self):
        mech, p, zone = self.mech, self.p, self.zone
        v_of, dv_of, t_end = self.v_of, self.dv_of, self.t_end
        guards = {}
        max_step = self.max_step
        first = 1e-3 * max_step
        tol_x, tol_v, tol_t = (
            1e-2 * self.rtol * p.lip_length,
            1e-3 * self.rtol,
            self.rtol * max_step,
        )
        if self.regime == STICK:
            u, scales = [self.x, self.t], [tol_x, tol_t]
            max_step = first = min(
                0.01 * p.lip_length / max(abs(self.belt.speed), 1e-9), 0.1 * self.ends[-1]
            )

            def rhs(_, u):
                return v_of(float(u[1])), 1.0

            def cone(side):
                def guard(u):
                    l_t, l_n = mech.stick_forces(u[0], v_of(u[1]), dv_of(u[1]), zone)
                    return p.mu_static * l_n - side * l_t

                return guard

            guards["cone+"], guards["cone-"] = cone(1.0), cone(-1.0)
        elif self.regime == FLIGHT:
            u = [self.x, self.y, self.w + v_of(self.t), self.vy, self.t]
            scales = [tol_x, 1e-4 * tol_x, tol_v, tol_v, tol_t]
            if self.vy > 0.0:
                b_n = mech.free_acceleration(self.x, self.y, u[2], self.vy, zone)[1]
                if b_n < 0.0:  # a short hop must not be stepped over
                    first = min(first, 0.25 * self.vy / -b_n)

            def rhs(_, u):
                x, y, vx, vy, _ = u.tolist()
                a_t, a_n = mech.free_acceleration(x, y, vx, vy, zone)
                return vx, vy, a_t, a_n, 1.0

            guards["gap"] = lambda u: u[1]
        else:
            s = 1.0 if self.regime == SLIP_POS else -1.0
            u, scales = [self.x, self.w, self.t], [tol_x, tol_v, tol_t]

            def rhs(_, u):
                x, w, t = u.tolist()
                v = v_of(t)
                d0, d, numerator, _ = mech.slip_terms(x, w, v, s, zone)
                pace = d / d0
                return (w + v) * pace, numerator / d0 - dv_of(t) * pace, pace

            guards["slip"] = lambda u: s * u[1]
            guards["load"] = lambda u: mech.slip_terms(u[0], u[1], v_of(u[2]), s, zone)[3]
            if p.hinge_mass > 0.0:
                guards["jam"] = lambda u: mech.slip_terms(u[0], u[1], v_of(u[2]), s, zone)[1]
        for side, place in mech.x_shoulder.items():
            if zone in (0, side):  # neck: both ends; shoulder: the way back
                sign = side if zone == 0 else -side
                guards[f"shoulder{side:+d}"] = lambda u, sign=sign, place=place: (
                    sign * (place - u[0])
                )
        guards["right"], guards["left"] = (
            (lambda u: mech.x_max - u[0]),
            (lambda u: u[0] + mech.x_max),
        )
        guards["time"] = lambda u: t_end - u[-1]
        atol = scales if self.atol is None else self.atol
        name, u = _integrate_phase(
            rhs, guards, self.fresh, u, first, max_step, self.rtol, atol, self.sample
        )
        self.regime_time[self.regime] += u[-1] - self.t
        self.take(u)
        return name

    def take(self, u):
        """Copy the integrator's state of the present regime into x, y, w, vy, t."""
        self.x, self.t = u[0], u[-1]
        v = self.v_of(self.t)
        if self.regime == FLIGHT:
            self.y, self.w, self.vy = u[1], u[2] - v, u[3]
        else:
            self.y, self.vy, self.w = 0.0, 0.0, (0.0 if self.regime == STICK else u[1])

    def sample(self, dense, start, u_start, u_stop):
        """Fill the wanted samples of the step whose time interval ends with u_stop."""
        while len(self.rows) < len(self.wanted) and self.wanted[len(self.rows)] <= u_stop[-1]:
            time = self.wanted[len(self.rows)]
            ahead = time - u_start[-1]
            if time == u_stop[-1]:
                u = u_stop
            elif ahead <= 0.0:
                u = u_start
            elif self.regime in (STICK, FLIGHT) or self.p.hinge_mass == 0.0:
                u = dense(start + ahead).tolist()
            else:
                u = dense(
                    brentq(lambda z, t=time: dense(z)[-1] - t, start, dense.t_max, xtol=1e-18)
                ).tolist()
            self.rows.append(self.observe(u, time))

    def observe(self, u, time):
        v, dv = self.v_of(time), self.dv_of(time)
        if self.regime == FLIGHT:
            return time, u[0], u[1], u[2], u[3], FLIGHT, 0.0, 0.0
        if self.regime == STICK:
            l_t, l_n = self.mech.stick_forces(u[0], v, dv, self.zone)
            return time, u[0], 0.0, v, 0.0, STICK, l_n, l_t
        s = 1.0 if self.regime == SLIP_POS else -1.0
        _, d, _, load = self.mech.slip_terms(u[0], u[1], v, s, self.zone)
        return (
            time,
            u[0],
            0.0,
            u[1] + v,
            0.0,
            self.regime,
            load / d,
            -s * self.mech.mu(s * u[1]) * load / d,
        )

    # -- section 5: transitions
    def cross(self, name):
        """Act on the guard that fired; returns the result of the run if it ends it, else None."""
        before, self.fresh = self.regime, frozenset()
        if name == "time":
            self.t = self.t_end
            if self.segment == len(self.ends) - 1:
                return "finished"
            self.segment += 1
            self.next_piece()
            if before == STICK:
                after, impulse = self.decide()
                self.begin("belt", after, impulse)
            else:
                self.note("belt", before)
        elif name.startswith("shoulder"):
            side = int(name[-2:])
            self.x, self.zone = self.mech.x_shoulder[side], (side if self.zone == 0 else 0)
            self.note("kink", before)
            self.fresh = frozenset([name])
        elif name in ("left", "right"):
            self.x = math.copysign(self.mech.x_max, self.x)
            self.note("collapse", before)
            return "collapsed"
        elif name.startswith("cone"):
            s, regime = (-1.0, SLIP_NEG) if name == "cone+" else (1.0, SLIP_POS)
            if self.mech.slip_terms(self.x, 0.0, self.v_of(self.t), s, self.zone)[1] <= 0.0:
                self.flags.append(
                    (self.t, "indeterminate")
                )  # on the cone D and lambda_n D agree in sign: b_n > 0
                regime = FLIGHT
            self.begin("release", regime)
        elif name == "slip":
            self.w = 0.0
            after, impulse = self.decide()
            self.begin(
                "capture" if after == STICK else "lift_off" if after == FLIGHT else "reversal",
                after,
                impulse,
            )
        elif name == "load":
            self.begin("lift_off", FLIGHT)
        elif name == "jam":
            after, impulse = self.strike(jam=True)
            self.begin("jam", after, impulse)
        elif name == "gap":
            after, impulse = self.strike()
            self.begin("impact", after, impulse)
        return None

    def begin(self, kind, after, impulse=0.0):
        """Record the event and say which guards of the new phase are zero at its start."""
        struck = kind in ("impact", "jam")
        self.note(kind, after, impulse)
        if after == FLIGHT and struck:
            self.zeno()  # may change the regime again
        self.set_fresh()

    def set_fresh(self):
        if self.regime == FLIGHT:
            self.fresh = frozenset(["gap"]) if self.y == 0.0 else frozenset()
        else:
            self.fresh = (
                frozenset(["slip"]) if self.regime != STICK and self.w == 0.0 else frozenset()
            )

    def run(self, initial_state, max_events):
        p = self.p
        if initial_state is None:
            initial_state = (p.lip_length * math.sin(p.attack_angle), 0.0, 0.0, 0.0)
        self.t, self.segment, self.ratio, self.flown = 0.0, 0, math.inf, 0.0
        self.next_piece()
        self.x, self.y, vx, self.vy = (float(c) for c in initial_state)
        self.w, self.zone, self.regime = vx - self.v_of(0.0), self.mech.zone(self.x), FLIGHT
        if abs(self.x) >= self.mech.x_max:
            result = "collapsed"
        else:
            result = None
            if self.y == 0.0 and self.vy < 0.0:
                after, impulse = self.strike()
                self.begin("impact", after, impulse)
            elif self.y == 0.0 and self.vy == 0.0:
                self.regime, impulse = self.decide()
                if impulse:
                    self.events.append(Event(0.0, "jam", self.regime, self.regime, impulse))
            self.set_fresh()
        while result is None:
            result = self.cross(self.phase())
            if result is None and len(self.events) >= max_events:
                result = "max_events"
        names = ("t", "x", "y", "vx", "vy", "regime", "lambda_n", "lambda_t")
        samples = dict(zip(names, np.array(self.rows).T, strict=True)) if self.rows else {}
        return Run(
            self.t,
            np.array([self.x, self.y]),
            np.array([self.w + self.v_of(self.t), self.vy]),
            self.regime,
            self.events,
            result,
            self.regime_time,
            self.flags,
            samples,
        )
