"""A phase by `solve_ivp`: one call, restarted after every event (`phase_by_phase`)."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from scipy.integrate import solve_ivp

from ..scalar import model as m
from .phase_by_phase import Stage
from .scipy_tip import Tip


class Phase(NamedTuple):
    """The motion in one regime, as `solve_ivp` wants it."""

    state: list[float]
    sizes: tuple[int, ...]  # of each number of the state: 0 a length, 1 a velocity
    longest: float  # step: two zeros of a guard inside one are not seen
    place: Callable  # (t, state) -> (x, y, x', y')
    rates: Callable
    guards: list[Callable]  # of the contact, positive while the regime lasts


def solve(rtol: float, method: str) -> Callable[[Tip, float], Stage | None]:
    """Return what `phase_by_phase.trajectory` asks for, by `solve_ivp`."""

    def stage(tip: Tip, stop: float) -> Stage | None:
        phase = _phase(tip)
        try:
            found = _integrated(tip, phase, stop, rtol, method)
        except ValueError:  # of brentq: an event function of its dense output has no zero
            return None
        if found.status < 0:
            return None
        reached = float(found.t[-1])
        hits = [i for i, times in enumerate(found.t_events) if len(times)]
        return Stage(
            reached, hits[0] if found.status else None, len(phase.guards),
            phase.place(reached, found.y[:, -1]), lambda t: phase.place(t, found.sol(t)),
            found.nfev,
        )  # fmt: skip

    return stage


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
