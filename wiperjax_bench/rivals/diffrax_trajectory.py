"""One cell by `diffrax.diffeqsolve` with `diffrax.Event`, one call a phase, all of it traced."""

from functools import partial
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import optimistix as optx

from .diffrax_changes import Ending, changed, ending_of, kind_of, orders_of
from .diffrax_records import Cell, Found, Marks, Motion, Records, Solved
from .diffrax_wiper import (
    FLIGHT,
    GUARDS,
    STICK,
    Constants,
    State,
    belt,
    closed,
    field,
    free,
    guards,
)

LOG = 512
MOST_PHASES, MOST_STEPS = 20_000, 100_000
AT_ONCE = 20  # phases without length
# one tolerance holds for the time [s] and for the condition: this sets the two apart
FINE = 1e-4


def trajectory(w, start, marks: Marks, rtol, scales, solver) -> Found:
    """Return the trajectory of one cell that starts at (x, y, x', y')."""
    stiff = jnp.maximum(w.neck_stiffness, w.shoulder_stiffness) / w.lip_length**2
    fastest = jnp.sqrt((stiff + w.support_stiffness + w.normal_load / w.lip_length) / w.tip_mass)
    cell = Cell(w, marks, scales, rtol, solver, fastest)
    motion = jax.lax.while_loop(
        lambda m: ~(m.over | m.bad) & (m.phases < MOST_PHASES),
        partial(_advance, cell),
        jax.tree.map(jnp.asarray, _begin(cell, start)),
    )
    return Found(motion.records, motion.bad | ~motion.over, motion.steps)


def _begin(cell: Cell, start) -> Motion:
    w, n = cell.wiper, len(cell.marks.times)
    x, y, u, vy = start
    t, piece = jnp.zeros(()), jnp.asarray(w.belt.first_piece(0.0), jnp.int32)
    slip = u - belt(w.on_piece(piece), t)[0]
    theta = w.lean((x, y)).angle - w.attack_angle
    zone = jnp.where(theta > w.shoulder_angle, 1, jnp.where(theta < -w.shoulder_angle, -1, 0))
    touching = (y <= 0) & (vy <= 0)
    regime = jnp.where(touching, closed(w.on_piece(piece), zone, t, x, slip), FLIGHT)
    sliding = (regime != STICK) & (regime != FLIGHT)
    order = jnp.zeros(GUARDS).at[0].set(jnp.where(sliding, 1.0, 0.0))
    zero, false = jnp.zeros((), jnp.int32), jnp.zeros((), bool)
    return Motion(
        t, State(x, slip, y, vy), regime.astype(jnp.int32), zone.astype(jnp.int32), piece,
        jnp.where(slip == 0, order, 0.0), zero, jnp.full(3, 0.02 / cell.fastest),
        Records(jnp.full((n, 4), jnp.nan), jnp.full(LOG, jnp.nan), jnp.zeros(LOG, jnp.int32), zero),
        steps=zero, streak=zero, bad=false, over=false, phases=zero,
    )  # fmt: skip


def _advance(cell: Cell, motion: Motion) -> Motion:
    """Return the motion after one more phase."""
    w, end = cell.wiper.on_piece(motion.piece), cell.marks.times[motion.mark]
    held = Constants(w, motion.regime, motion.zone, motion.time, motion.order, cell.scales)
    slot = jnp.where(motion.regime == STICK, 0, jnp.where(motion.regime == FLIGHT, 2, 1))
    found = _integrated(cell, motion, held, motion.usual_steps[slot], end)
    usual = (found.time - motion.time) / jnp.maximum(found.accepted, 1)
    usual = jnp.where(found.accepted > 2, usual, motion.usual_steps[slot])

    marked = ~found.fired & ~found.failed
    kind = jnp.where(marked, cell.marks.kinds[motion.mark], 0)
    ending = ending_of(found, motion.regime, marked, kind)
    after, strike = changed(cell, motion, found, ending, end)
    kind = kind_of(ending, strike, kind, motion.regime, after.regime)
    mark = motion.mark + marked
    streak = jnp.where(after.time > motion.time, 0, motion.streak + 1)
    return after._replace(
        order=orders_of(ending, found.guard, motion.regime, after),
        mark=mark,
        usual_steps=motion.usual_steps.at[slot].set(usual),
        records=_recorded(cell, motion, found, ending, after.time, kind),
        steps=motion.steps + found.steps,
        streak=streak,
        bad=motion.bad | found.failed | (streak > AT_ONCE),
        over=(mark >= len(cell.marks.times)) | ending.limit,
        phases=motion.phases + 1,
    )


def _integrated(cell: Cell, motion: Motion, held: Constants, usual, end) -> Solved:
    """Return what diffrax finds until ``end`` or the first guard."""
    t, s, w, regime = motion.time, motion.state, held.wiper, held.regime
    longest = jnp.where(
        regime == STICK,
        0.02 * w.lip_length * w.lean((s.x, s.y)).cos / jnp.maximum(jnp.abs(belt(w, t)[0]), 1e-3),
        0.25 / cell.fastest,
    )
    first = jnp.minimum(jnp.minimum(usual, longest), end - t)
    # a bounce: the step has to be shorter than the flight
    lift = free(w, held.zone, s.x, s.y, s.slip + belt(w, t)[0], s.vy)[1] / w.tip_mass
    back = 0.5 * s.vy / jnp.maximum(jnp.abs(lift), 1e-30)
    bounces = (regime == FLIGHT) & (s.y == 0) & (s.vy > 0)
    first = jnp.where(bounces, jnp.minimum(first, back), first)
    # flip: it falls through zero. Detected, a bracket that rounding has spoilt in one lane would
    # raise an error that ends the whole batch, in spite of throw=False.
    event = diffrax.Event(
        _condition, optx.Bisection(rtol=1e-14, atol=1e-11 * FINE, flip=True), direction=False
    )
    found = diffrax.diffeqsolve(
        diffrax.ODETerm(field), cell.solver, t, end, first, s, held,
        stepsize_controller=diffrax.PIDController(
            cell.rtol, cell.rtol, dtmax=longest, norm=_largest
        ),
        event=event, max_steps=MOST_STEPS, throw=False, adjoint=diffrax.ForwardMode(),
    )  # fmt: skip
    times: Any = found.ts
    states: Any = found.ys
    fired = jnp.asarray(found.event_mask)
    time = jnp.where(fired, times[-1], end)
    state = State(*(part[-1] for part in states))
    guard = jnp.argmin(guards(time, state, held))
    flying = regime == FLIGHT
    state = State(
        state.x,
        jnp.where(regime == STICK, 0.0, state.slip),
        jnp.where(flying, state.y, 0.0),
        jnp.where(flying, state.vy, 0.0),
    )
    failed = ~diffrax.is_okay(found.result)
    stats = found.stats
    return Solved(
        time, state, guard, fired, failed, stats["num_accepted_steps"], stats["num_steps"]
    )


def _condition(t, y, args, **_):
    return FINE * jnp.min(guards(t, y, args))


def _largest(scaled):
    """Largest component: the controller's norm."""
    return jnp.max(jnp.abs(jnp.stack(jax.tree.leaves(scaled))))


def _recorded(cell: Cell, motion: Motion, found: Solved, ending: Ending, time, kind) -> Records:
    """Return the records with the sample or the event that ended the phase."""
    kept, s, n = motion.records, found.state, len(cell.marks.times)
    along = s.slip + belt(cell.wiper.on_piece(motion.piece), found.time)[0]
    row = jnp.where(ending.sampled, cell.marks.samples[motion.mark], n)
    happens = kind != 0
    put = jnp.where(happens, kept.count, LOG)
    return Records(
        kept.samples.at[row].set(jnp.stack([s.x, s.y, along, s.vy]), mode="drop"),
        kept.times.at[put].set(time, mode="drop"),
        kept.kinds.at[put].set(kind.astype(jnp.int32), mode="drop"),
        kept.count + happens,
    )
