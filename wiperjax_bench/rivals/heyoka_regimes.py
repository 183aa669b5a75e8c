"""The three regimes of the lip as integrators of heyoka; see `heyoka_phases`.

The lean phi is the coordinate: x = L sin(phi) has no root in it, and x' / (L cos(phi)) is its rate.
"""

import math
from collections.abc import Callable

import heyoka as hy  # pyright: ignore[reportMissingImports]

from ..scalar import model as m
from .phase_by_phase import Stage
from .scipy_tip import Tip

# heyoka misses every root of a guard in a step that begins with the guard at zero: what is zero
# there is lifted by as much, which is below the rounding of any state
LIFT = 1e-15
NAMES = (
    *("m", "length", "k", "c", "alpha", "load", "weight", "rest", "mu_s", "mu_m", "inv_vs"),
    *("shape", "beta", "kz", "mz", "sign", "t0", "a", "b", "amplitude", "omega", "phase"),
    *("lift", "high", "phi_high", "no_high", "low", "phi_low", "no_low", "phi_max"),
)
PAR = {name: hy.par[i] for i, name in enumerate(NAMES)}


class Regimes:
    """Integrators of a tolerance, compiled when a regime is first entered."""

    def __init__(self, tol: float, sine: bool):
        self.tol, self.sine = tol, sine
        self.made: dict = {}

    def stage(self, dense: bool) -> Callable[[Tip, float], Stage | None]:
        """Return what `phase_by_phase.trajectory` asks for; ``dense``: with places in between."""

        def solve(tip: Tip, stop: float) -> Stage | None:
            kind = "stick" if tip.regime == m.STICK else "flight"
            kind = kind if tip.regime in (m.STICK, m.FLIGHT) else "slip"
            key = kind, tip.blade.shape
            if key not in self.made:
                self.made[key] = _integrator(kind, tip.blade.shape, self.sine, self.tol)
            return _run(self.made[key], kind, tip, stop, dense)

        return solve


def _belt(sine: bool):
    """V and V' as expressions of time."""
    p, t = PAR, hy.time
    if not sine:
        return p["a"] + p["b"] * (t - p["t0"]), p["b"]
    s = p["omega"] * t + p["phase"]
    steady = p["a"] + p["b"] * (t - p["t0"])
    return (
        steady + p["amplitude"] * hy.sin(s),
        p["b"] + p["amplitude"] * p["omega"] * hy.cos(s),
    )


def _integrator(kind: str, shape: float, sine: bool, tol: float):
    p = PAR
    phi, w, y, u, vy = hy.make_vars("phi", "w", "y", "u", "vy")
    speed, pull = _belt(sine)
    turn = 1 / (p["length"] * hy.cos(phi))
    tau = hy.sin(phi) / hy.cos(phi)
    moment = p["kz"] * phi + p["mz"]
    sink = p["length"] * hy.cos(phi) - p["rest"]

    def load(lift, rate):
        return p["load"] + p["k"] * (lift + sink) + p["c"] * rate

    if kind == "slip":
        moves = w + speed
        n = load(0.0, -tau * moves)
        force = n + p["weight"]
        r = p["sign"] * w * p["inv_vs"]
        falling = hy.exp(-(r ** int(shape)))  # a whole number: it has a series at rest
        mu = p["mu_m"] + (p["mu_s"] - p["mu_m"]) * falling + p["beta"] * p["sign"] * w
        rate = (n * tau - p["sign"] * mu * force - moment * turn) / p["m"] - pull
        rates = [(phi, moves * turn), (w, rate)]
        guards = [p["sign"] * w + p["lift"], force]
    elif kind == "flight":
        n = load(y, vy - tau * u)
        along = (n * tau - moment * turn) / p["m"]
        rates = [(phi, u * turn), (y, vy), (u, along), (vy, -(n + p["weight"]) / p["m"])]
        guards = [y + p["lift"]]
    else:
        n = load(0.0, -tau * speed)
        held = p["m"] * pull + moment * turn - n * tau
        most = p["mu_s"] * (n + p["weight"])
        rates = [(phi, speed * turn)]
        guards = [most - held, most + held]
    guards += [
        p["high"] * (p["phi_high"] - phi) + p["no_high"],
        p["low"] * (p["phi_low"] - phi) + p["no_low"],
        p["phi_max"] ** 2 - phi**2,
    ]
    falls = hy.event_direction.negative
    return hy.taylor_adaptive(
        rates, [0.0] * len(rates), tol=tol, pars=[0.0] * len(NAMES),
        t_events=[hy.t_event(guard, direction=falls) for guard in guards],
    )  # fmt: skip


def _run(ta, kind: str, tip: Tip, stop: float, dense: bool) -> Stage | None:
    p, belt = tip.blade, tip.belt
    phi = math.asin(tip.x / p.length)
    state = {"slip": [phi, tip.w], "flight": [phi, tip.y, tip.u, tip.vy], "stick": [phi]}[kind]
    contact = 1 if kind == "flight" else 2
    sides = tip.sides()
    ta.time = tip.t
    ta.state[:] = state
    ta.pars[:] = _numbers(tip, kind, sides)
    ta.reset_cooldowns()
    outcome, _, _, steps, between, _ = ta.propagate_until(stop, c_output=dense)
    start, speed = tip.x, lambda t: m.belt(belt, t)[0]

    def place(t, s):
        x = p.length * math.sin(s[0])
        if kind == "stick":
            return start + m.carried(belt, begun, t)[0], 0.0, speed(t), 0.0
        return (x, 0.0, s[1] + speed(t), 0.0) if kind == "slip" else (x, *s[1:])

    begun, reached = tip.t, float(ta.time)
    end = place(reached, [float(s) for s in ta.state])
    hit = None
    if outcome != hy.taylor_outcome.time_limit:
        event = -int(outcome) - 1
        if event < 0 or not all(map(math.isfinite, end)):
            return None
        hit = event if event < contact else _beside(event - contact, contact, sides)
    return Stage(reached, hit, contact, end, lambda t: place(t, between(t)), int(steps))


def _beside(event: int, contact: int, sides: list[int]) -> int:
    """Return the number of a shoulder or of the collapse as `Tip.cross` counts."""
    return contact + (sides.index((1, -1)[event]) if event < 2 else len(sides))


def _numbers(tip: Tip, kind: str, sides: list[int]) -> list[float]:
    """Return the parameters of `NAMES`."""
    p, belt = tip.blade, tip.belt
    kz, mz = tip.spring()
    edges = []
    for side in (1, -1):
        place = tip.edge(side) / p.length
        if side not in sides or abs(place) >= 1.0:
            edges += [0.0, 0.0, 1.0]
        else:
            way = side if tip.zone == 0 else -side
            at_it = LIFT if tip.x == tip.edge(side) else 0.0
            edges += [float(way), math.asin(place), at_it]
    begins = tip.w == 0.0 if kind == "slip" else tip.y == 0.0
    scale = tip.cell.scales[1 if kind == "slip" else 0]
    return [
        *(p.m, p.length, p.k, p.c, p.alpha, p.load, p.weight, p.rest, p.mu_s, p.mu_m, p.inv_vs),
        *(p.shape, p.beta, kz, mz, 1.0 if tip.regime == m.SLIP_POS else -1.0),
        *(belt.t0, belt.a, belt.b, belt.amplitude, belt.omega, belt.phase),
        LIFT * scale if begins else 0.0,
        *edges,
        math.asin(min(p.x_max / p.length, 1.0)),
    ]
