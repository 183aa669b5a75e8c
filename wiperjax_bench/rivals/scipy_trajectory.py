"""One cell by `solve_ivp`, one call a phase, restarted after every event (`scipy_tip`)."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from ..scalar import model as m
from .scipy_tip import Cell, Tip

MOST_EVENTS, AT_ONCE = 20_000, 20


class Found(NamedTuple):
    """What was found of one cell."""

    samples: np.ndarray  # (samples, 4): x, y, x', y'; NaN where it did not get to
    event_times: list[float]
    event_kinds: list[int]
    stopped: bool
    evaluations: int  # of right-hand sides


class Phase(NamedTuple):
    """The motion in one regime, as `solve_ivp` wants it."""

    state: list[float]
    sizes: tuple[int, ...]  # of each number of the state: 0 a length, 1 a velocity
    longest: float  # step: two zeros of a guard inside one are not seen
    place: Callable  # (t, state) -> (x, y, x', y')
    rates: Callable
    guards: list[Callable]  # of the contact, positive while the regime lasts


def trajectory(cell: Cell, end: float, times: np.ndarray, rtol: float, method: str) -> Found:
    """Return the trajectory of ``cell`` from t = 0 to ``end`` [s], sampled at ``times`` [s]."""
    tip, evaluations = Tip(cell), 0
    samples = np.full((len(times), 4), np.nan)
    event_times, event_kinds = [], []
    while tip.t < end and len(event_times) < MOST_EVENTS:
        phase = _phase(tip)
        stop = min(end, cell.breaks[tip.piece])
        found = _integrated(tip, phase, stop, rtol, method)
        evaluations += found.nfev
        if found.status < 0:
            break
        reached, whole = float(found.t[-1]), found.status == 0
        for i in np.flatnonzero((times > tip.t) & (times <= reached)):
            samples[i] = phase.place(times[i], found.sol(times[i]))
        tip.arrive(phase.place(reached, found.y[:, -1]), reached, stop if whole else reached)
        if whole:
            if tip.t >= end:
                break
            kind = tip.pass_break()
        else:
            hit = next(i for i, e in enumerate(found.t_events) if len(e))
            kind = tip.cross(hit, len(phase.guards))
        event_times.append(tip.t)
        event_kinds.append(kind)
        if kind == m.COLLAPSE:
            break
        if len(event_times) > AT_ONCE and event_times[-AT_ONCE] == tip.t:
            break  # the same event for ever
    collapsed = bool(event_kinds) and event_kinds[-1] == m.COLLAPSE
    return Found(samples, event_times, event_kinds, tip.t < end and not collapsed, evaluations)


def _integrated(tip: Tip, phase: Phase, stop: float, rtol: float, method: str) -> Any:
    """Return what `solve_ivp` finds of a phase that lasts until ``stop`` at most."""
    guards = [*phase.guards]
    for side in tip.sides():  # positive on the side where the branch of the spring holds
        guards.append(_edge(side if tip.zone == 0 else -side, tip.edge(side)))
    guards.append(lambda t, s: tip.blade.x_max - abs(s[0]))
    return solve_ivp(
        phase.rates, (tip.t, stop), phase.state, method=method, rtol=rtol, max_step=phase.longest,
        atol=[rtol * tip.cell.scales[i] for i in phase.sizes],
        events=[_terminal(guard) for guard in guards], dense_output=True,
        first_step=_first_step(tip, phase, stop),
    )  # fmt: skip


def _first_step(tip: Tip, phase: Phase, stop: float) -> float | None:
    """Return a first step that does not jump over the end of a phase; None: scipy's own choice."""
    if tip.regime == m.FLIGHT and tip.y == 0.0 and tip.vy > 0.0:
        # a step longer than the flight starts and ends below: scipy then sees the zero at the
        # start only, and the tip falls through
        lift = phase.rates(tip.t, phase.state)[3]
        return min(0.3 * tip.vy / abs(lift), 0.5 * phase.longest, 0.5 * (stop - tip.t))
    if tip.regime != m.STICK and tip.w == 0.0:  # the same in slip, which may soon turn back
        return min(1e-3 * phase.longest, 0.5 * (stop - tip.t))
    return None


def _phase(tip: Tip) -> Phase:
    """Return the motion in the regime that begins."""
    if tip.regime == m.STICK:
        return _stick(tip)
    p = tip.blade
    longest = 0.25 * math.sqrt(p.m / ((p.k1 + p.dk) / p.length**2 + p.k + p.load / p.length))
    return _flight(tip, longest) if tip.regime == m.FLIGHT else _slip(tip, longest)


def _stick(tip: Tip) -> Phase:
    p, belt, spring = tip.blade, tip.belt, tip.spring()
    speed = lambda t: m.belt(belt, t)[0]
    cone = lambda t, s: m.cone(p, *spring, s[0], *m.belt(belt, t), 0.0)
    return Phase(
        [tip.x],
        (0,),
        0.02 * p.length / max(abs(tip.speed()), 1e-3),
        lambda t, s: (s[0], 0.0, speed(t), 0.0),
        lambda t, s: [speed(t)],
        [lambda t, s: cone(t, s)[0], lambda t, s: cone(t, s)[1]],
    )


def _flight(tip: Tip, longest: float) -> Phase:
    p, spring = tip.blade, tip.spring()

    def rates(t, s):
        _, du, dv = m.flight_rate(p, *spring, s[0], _phi(p, s[0]), s[1], s[2], s[3])
        return [s[2], s[3], du, dv]

    state = [tip.x, tip.y, tip.u, tip.vy]
    return Phase(state, (0, 0, 1, 1), longest, lambda t, s: tuple(s), rates, [lambda t, s: s[1]])


def _slip(tip: Tip, longest: float) -> Phase:
    p, belt, spring = tip.blade, tip.belt, tip.spring()
    sign = 1.0 if tip.regime == m.SLIP_POS else -1.0

    def full(t, s):
        return m.slip_rate(p, *spring, sign, s[0], _phi(p, s[0]), s[1], *m.belt(belt, t))

    return Phase(
        [tip.x, tip.w],
        (0, 1),
        longest,
        lambda t, s: (s[0], 0.0, s[1] + m.belt(belt, t)[0], 0.0),
        lambda t, s: [*full(t, s)[0:3:2]],
        [lambda t, s: sign * s[1], lambda t, s: full(t, s)[3]],
    )


def _phi(p, x):
    """Lean at x; a trial stage may reach past the lip."""
    return math.asin(min(max(x / p.length, -1.0), 1.0))


def _edge(side, place):
    """Guard of a shoulder at x = ``place``."""
    return lambda t, s: side * (place - s[0])


def _terminal(guard):
    """Mark an event function: it ends the phase where it falls through zero."""
    guard = partial(guard)
    guard.terminal, guard.direction = True, -1  # type: ignore[attr-defined]
    return guard
