"""Runs of the engine and of the reference, event by event."""

import jax
import numpy as np
from reference.blade import REFERENCE, Steady, Wiping

import wiperjax
from wiperjax import Event, SteadyBelt, TrapezoidBelt, Wiper, WipingBelt

NAMES = {
    Event.RELEASE: "release",
    Event.CAPTURE: "capture",
    Event.REVERSAL: "reversal",
    Event.LIFT_OFF: "lift_off",
    Event.IMPACT: "impact",
    Event.ZENO: "zeno",
    Event.KINK: "kink",
    Event.BELT_REVERSAL: "belt",
    Event.BELT_KINK: "belt",
    Event.JAM: "jam",
    Event.COLLAPSE: "collapse",
    Event.TOUCH: "touch",
    Event.BLOW: "blow",
}


# without hinge mass, which makes another program
MASSLESS = ("hinge_mass", "hinge_damping", "gravity", "stribeck_shape", "belt_speed")
BLADE = {key: value for key, value in REFERENCE.items() if key not in MASSLESS}


@jax.jit
def _solved(blade, belt, start, duration, rtol, zeno_time, max_steps):
    state = ((start[0], start[1]), (start[2], start[3]))
    options = {"zeno_time": zeno_time, "max_steps": max_steps, "max_events": 512}
    return wiperjax.solve(
        Wiper(belt=belt, **blade), duration, initial_state=state, rtol=rtol, **options
    )


def engine(blade, belt, start, duration, rtol=1e-10, zeno_time=1e-8, max_steps=1_000_000):
    """Solution for a blade given by `BLADE` and what differs, with hinge mass or without: one
    program serves all that are on one kind of belt (arguments left out would make another)."""
    given = doubles((blade, belt, tuple(start), duration, rtol, zeno_time))
    return _solved(*given, max_steps)


@jax.jit
def _together(blades, belts, starts, duration, max_steps):
    alone = lambda *given: engine(*given[:3], duration, max_steps=given[3])
    return jax.vmap(alone)(blades, belts, starts, max_steps)


def engines(blades, belts, starts, duration, max_steps=1_000_000):
    """`engine` of many blades side by side: one program for those who ask for as many of them."""
    budgets = np.broadcast_to(max_steps, len(starts))
    return _together(*doubles((blades, belts, starts, duration)), budgets)


def doubles(numbers):
    """The same numbers, all of one kind for jax: a Python float beside NumPy's, or a whole number,
    would make another program."""
    kept = jax.Array, bool
    return jax.tree.map(lambda x: x if isinstance(x, kept) else np.float64(x), numbers)


def twin(belt):
    """The engine's belt that moves like the reference's."""
    if isinstance(belt, Steady):
        return SteadyBelt(belt.speed)
    if isinstance(belt, Wiping):
        return WipingBelt(belt.speed, belt.frequency, belt.phase)
    return TrapezoidBelt(belt.speed, belt.frequency, belt.ramp, belt.phase)


def logged(solution):
    """Events of the engine as (time, name, before, after)."""
    log, count = solution.events, int(solution.events.count)
    assert not solution.event_overflow
    columns = (np.asarray(x)[:count] for x in (log.time, log.kind, log.before, log.after))
    return [
        (float(t), NAMES[Event(k)], int(b), int(a)) for t, k, b, a in zip(*columns, strict=True)
    ]


def listed(run):
    """Events of the reference; an impact and the completion that follows it are one event."""
    events = []
    for event in run.events:
        if event.kind == "zeno" and events and events[-1][1] == "impact":
            events.append((event.time, "zeno", events.pop()[2], event.after))
        else:
            events.append((event.time, event.kind, event.before, event.after))
    return events


def common(a, b):
    """Number of leading events of the same kind and regimes."""
    n = 0
    while n < min(len(a), len(b)) and a[n][1:] == b[n][1:]:
        n += 1
    return n


def largest_shift(a, b):
    """Largest difference of the times of two equally long lists of events."""
    return max((abs(x[0] - y[0]) for x, y in zip(a, b, strict=True)), default=0.0)
