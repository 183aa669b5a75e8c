"""Problems with exact answers about the events of `systems`.

V2 to V10 are their names; every one is a closed form unless it says more.
"""

import math
from dataclasses import dataclass, field

from systems import Ball, Block, StopOscillator

import wiperjax
from wiperjax import AbstractSystem

E_ = wiperjax.Event


@dataclass(frozen=True)
class Problem:
    """A system, its start, and what is known exactly about the events of the given kinds."""

    name: str
    system: AbstractSystem
    start: tuple
    duration: float
    kinds: tuple
    times: tuple  # exact
    final: float | None = None  # exact position of the first coordinate at the end
    rtol: float = 1e-9  # promised relative error of the event times
    options: dict = field(default_factory=dict)


def stop_oscillator() -> Problem:
    """V2."""
    m, k, f, e = 1e-3, 100.0, 9.81e-3, 0.9
    w = math.sqrt(k / m)
    # from rest at q = 1: q = -f/k + (1 + f/k) cos(w t)
    times = [math.acos((f / k) / (1 + f / k)) / w]
    speed = w * (1 + f / k) * math.sin(w * times[0])
    for _ in range(4):
        speed *= e
        times.append(times[-1] + (2 / w) * math.atan((speed / w) / (f / k)))
    assert math.isclose(times[4], 4.470208524666856e-02, rel_tol=1e-13)
    return Problem(
        "V2 oscillator against a stop",
        StopOscillator(mass=m, stiffness=k, load=f, restitution=e),
        ((1.0,), (0.0,)),
        0.046,
        (E_.IMPACT,),
        tuple(times),
    )


def coulomb_oscillator() -> Problem:
    """V3."""
    t1 = 0.4324077755705378
    turns = [t1 + i * math.pi for i in range(8)]
    return Problem(
        "V3 Coulomb oscillator",
        Block(1.0, 1.0),
        ((12.0,), (6.0,)),
        30.0,
        (E_.REVERSAL, E_.CAPTURE),
        tuple(turns),
        0.6821789367236469,
    )


def block_on_belt(m, k, fs, fd, v) -> Problem:
    """V5: started at the release, where stick ends at x = Fs/k."""
    a, w = (fs - fd) / k, math.sqrt(k / m)
    slip, stick = (2 / w) * (math.pi - math.atan(w * a / v)), 2 * a / v
    lead = 0.3 * stick
    times = []
    t = lead
    for _ in range(4):
        times += [t, t + slip]
        t += slip + stick
    return Problem(
        "V5 block on a belt",
        Block(fs, fd, m, k, belt=v),
        ((fs / k - v * lead,), (v,)),
        t - 0.1 * stick,
        (E_.RELEASE, E_.CAPTURE),
        tuple(times),
        fs / k - 0.1 * stick * v,
    )


def dropped_ball(e) -> Problem:
    """V9, with the completed sequence as one event at its end."""
    height, g = 1.3, 9.81
    fall = math.sqrt(2 * height / g)
    return Problem(
        f"V9 dropped ball, e = {e}",
        Ball(g, e),
        ((height,), (0.0,)),
        fall * (1 + e) / (1 - e) + 0.5,
        (E_.ZENO,),
        (fall * (1 + e) / (1 - e),),
        0.0,
    )


CASES_V8 = [
    (2.5, 0.8, 3.0056503737490265, 0.6453521784141956, (-0.16494164 + 0.78281176j,)),
    (2.8, 0.8, None, 0.3361772699756701, (-2.95809507, -0.21635545)),
]


def periodic_impacts(w, e):
    """(psi, v-) of the orbit with one impact a forcing period."""
    period, v = 2 * math.pi / w, 1 / (1 - w * w)
    psi = math.atan(-((1 - e) / (1 + e)) * math.tan(period / 2) / w)
    if v * math.cos(psi) * math.tan(period / 2) < 0:
        psi += math.pi
    return psi, 2 * v * math.cos(psi) * math.tan(math.pi / w) / (1 + e)


EXACT = [
    stop_oscillator(),
    coulomb_oscillator(),
    block_on_belt(1.0, 1.0, 1.0, 0.5, 0.2),
    block_on_belt(1.0, 100.0, 0.4, 0.25, 0.05),
    dropped_ball(0.3),
    dropped_ball(0.5),
    dropped_ball(0.9),
]
