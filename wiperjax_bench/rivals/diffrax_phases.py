"""`diffrax.diffeqsolve` with `diffrax.Event`, restarted phase by phase, under vmap or `lax.map`.

What a JAX user writes, made correct (docs: events are looked for at the ends of steps only, and the
first in the list wins, not the earliest):

- one condition: the smallest of all guards of the regime, each positive inside, so the earliest
  crossing is found and then named;
- a guard that is zero at the start of a phase is divided by the time since then, so that it neither
  fires again nor hides a true crossing;
- steps are bounded, because two crossings inside one step are not seen.

Forces come from `wiperjax.Wiper`; stepping, event detection and location are diffrax's.
"""

from functools import partial
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from wiperjax import Event, Regime

from ..harness.interface import Answer, NotForThisScene
from ..scenes.scene import Scene
from .engine import arrays

STICK, SLIP_POS, SLIP_NEG, FLIGHT = (int(r) for r in Regime)
ZENO_TIME = 1e-8
LOG = 512
MOST_PHASES, MOST_STEPS = 20_000, 100_000
# one tolerance holds for the time [s] and for the condition: this sets the two apart
FINE = 1e-4


def spring_moment(w, zone, phi):
    """Moment of the rotational spring on its branch ``zone``, continued smoothly."""
    extra = w.shoulder_stiffness - w.neck_stiffness
    theta = phi - w.attack_angle
    past = jnp.where(zone == 0, 0.0, theta - zone * w.shoulder_angle)
    return w.neck_stiffness * theta + extra * past


def free(w, zone, x, y, u, vy):
    """Return (force along x, force onto the glass, lever tau) without contact forces."""
    lean = w.lean((x, y))
    down = w.support_force((x, y), (u, vy), lean)
    push = spring_moment(w, zone, lean.angle) / (w.lip_length * lean.cos)
    return down * lean.tan - push, down + w.tip_mass * w.gravity, lean.tan


def belt(w, t):
    """Return V, V'."""
    value, slope = jax.jvp(
        lambda t: jnp.asarray(w.belt.velocity(t, w.piece), float), (t,), (jnp.ones_like(t),)
    )
    return value, slope


def sign_of(regime):
    return jnp.where(regime == SLIP_POS, 1.0, jnp.where(regime == SLIP_NEG, -1.0, 0.0))


def field(t, s, args):
    """Return the rates of (x, x' - V, y, y') in the regime of ``args``."""
    w, regime, zone = args[:3]
    x, slip, y, vy = s
    speed, pull = belt(w, t)
    u = slip + speed
    along, down, _ = free(w, zone, x, y, u, vy)
    sign = sign_of(regime)
    mu = jnp.where(regime == FLIGHT, 0.0, sign * w.law.coefficient(sign * slip))
    moving = regime != STICK
    flying = regime == FLIGHT
    return (
        u,
        jnp.where(moving, (along - mu * down) / w.tip_mass - pull, 0.0),
        jnp.where(flying, vy, 0.0),
        jnp.where(flying, -down / w.tip_mass, 0.0),
    )


def guards(t, s, args):
    """Return the five guards, positive inside: two of the regime, two shoulders, the limit."""
    w, regime, zone, since, order, scales = args
    x, slip, y, vy = s
    speed, pull = belt(w, t)
    along, down, _ = free(w, zone, x, 0.0 * y, slip + speed, 0.0 * vy)
    hold = w.tip_mass * pull - along
    sticking, flying = regime == STICK, regime == FLIGHT
    first = jnp.where(
        sticking,
        (w.mu_static * down - hold) / w.normal_load,
        jnp.where(flying, y / scales[0], sign_of(regime) * slip / scales[1]),
    )
    second = jnp.where(
        sticking,
        (w.mu_static * down + hold) / w.normal_load,
        jnp.where(flying, 1.0, down / w.normal_load),
    )
    phi = w.lean((x, y)).angle
    theta = phi - w.attack_angle
    upper = jnp.where(zone == 0, 1.0, -1.0) * (w.shoulder_angle - theta)
    lower = jnp.where(zone == 0, 1.0, -1.0) * (w.shoulder_angle + theta)
    upper = jnp.where(zone >= 0, upper, 1.0)
    lower = jnp.where(zone <= 0, lower, 1.0)
    values = jnp.stack([first, second, upper, lower, w.collapse_angle - jnp.abs(phi)])
    # a zero known at the start is divided out
    ahead = jnp.maximum(t - since, 0.0) / 1e-5
    started = ahead > 0
    divided = values / jnp.where(started, ahead, 1.0) ** order
    return jnp.where(order > 0, jnp.where(started, divided, 1.0), values)


def condition(t, y, args, **_):
    return FINE * jnp.min(guards(t, y, args))


def rest(w, zone, t, x):
    """Regime of a closed contact without slip."""
    speed, pull = belt(w, t)
    along, down, _ = free(w, zone, x, 0.0 * x, speed, 0.0 * x)
    hold = w.tip_mass * pull - along
    slips = jnp.where(hold > 0, SLIP_NEG, SLIP_POS)
    return jnp.where(
        down <= 0, FLIGHT, jnp.where(jnp.abs(hold) <= w.mu_static * down, STICK, slips)
    )


def closed(w, zone, t, x, slip):
    """Regime of a closed contact."""
    speed, _ = belt(w, t)
    _, down, _ = free(w, zone, x, 0.0 * x, slip + speed, 0.0 * x)
    slides = jnp.where(down > 0, jnp.where(slip > 0, SLIP_POS, SLIP_NEG), FLIGHT)
    return jnp.where(slip == 0, rest(w, zone, t, x), slides)


def impact(w, zone, t, x, slip, vy, end):
    """Return (time, x, slip, y', kind) after an impact, its Zeno limit included."""
    speed, pull = belt(w, t)
    mu = jnp.where(slip == 0, w.mu_static, w.law.coefficient(jnp.abs(slip)))
    push = -(1 + w.restitution) * vy
    slip = slip - jnp.clip(slip, -mu * push, mu * push)
    vy = -w.restitution * vy
    along, down, _ = free(w, zone, x, 0.0 * x, slip + speed, 0.0 * x)
    fall = down / w.tip_mass
    last = 2 * vy / jnp.where(fall > 0, fall, 1.0)
    whole = last / jnp.where(w.restitution < 1, 1 - w.restitution, 1.0)
    done = (vy > 0) & (fall > 0) & (last < ZENO_TIME) & (w.restitution < 1) & (t + whole <= end)
    sign = jnp.sign(slip)
    after = slip + (along / w.tip_mass - pull) * whole - sign * mu * (fall * whole - vy)
    after = jnp.where(sign * after > 0, after, 0.0)
    return (
        jnp.where(done, t + whole, t),
        jnp.where(done, x + whole * (slip + speed), x),
        jnp.where(done, after, slip),
        jnp.where(done, 0.0, vy),
        jnp.where(done, int(Event.ZENO), int(Event.IMPACT)),
    )


def trajectory(w, start, marks, mark_kinds, samples, rtol, scales, solver):
    """Return (samples (n, 4), event times, event kinds, count, stopped, steps) of one cell.

    ``marks``: times that end a phase (breaks of the belt, samples, the end last); ``mark_kinds``:
    an `Event`, or 0 for a sample.
    """
    x, y, u, vy = start
    first_piece = jnp.asarray(w.belt.first_piece(0.0), jnp.int32)
    t = jnp.zeros(())
    on = lambda piece: w.on_piece(piece)
    slip = u - belt(on(first_piece), t)[0]
    theta = w.lean((x, y)).angle - w.attack_angle
    zone = jnp.where(theta > w.shoulder_angle, 1, jnp.where(theta < -w.shoulder_angle, -1, 0))
    touching = (y <= 0) & (vy <= 0)
    regime = jnp.where(touching, closed(on(first_piece), zone, t, x, slip), FLIGHT)
    stiff = jnp.maximum(w.neck_stiffness, w.shoulder_stiffness) / w.lip_length**2
    fastest = jnp.sqrt((stiff + w.support_stiffness + w.normal_load / w.lip_length) / w.tip_mass)
    order = jnp.zeros(5).at[0].set(jnp.where((regime != STICK) & (regime != FLIGHT), 1.0, 0.0))
    order = jnp.where(slip == 0, order, 0.0)
    term = diffrax.ODETerm(field)
    # flip: it falls through zero. Detected, a bracket that rounding has spoilt in one lane would
    # raise an error that ends the whole batch, in spite of throw=False.
    event = diffrax.Event(
        condition, optx.Bisection(rtol=1e-14, atol=1e-11 * FINE, flip=True), direction=False
    )
    n = len(marks)
    atol = tuple(rtol * s for s in (scales[0], scales[1], scales[0], scales[1]))

    def phase(carry):
        (t, s, regime, zone, piece, order, at, steps_of, log, count, taken, steps, streak, bad) = (
            carry
        )
        w = on(piece)
        end = marks[at]
        speed = jnp.abs(belt(w, t)[0])
        longest = jnp.where(
            regime == STICK,
            0.02 * w.lip_length * w.lean((s[0], s[2])).cos / jnp.maximum(speed, 1e-3),
            0.25 / fastest,
        )
        slot = jnp.where(regime == STICK, 0, jnp.where(regime == FLIGHT, 2, 1))
        dt0 = jnp.minimum(jnp.minimum(steps_of[slot], longest), end - t)
        # a bounce: the step has to be shorter than the flight
        lift = free(w, zone, s[0], s[2], s[1] + belt(w, t)[0], s[3])[1] / w.tip_mass
        back = 0.5 * s[3] / jnp.maximum(jnp.abs(lift), 1e-30)
        dt0 = jnp.where((regime == FLIGHT) & (s[2] == 0) & (s[3] > 0), jnp.minimum(dt0, back), dt0)
        args = (w, regime, zone, t, order, scales)
        found = diffrax.diffeqsolve(
            term, solver, t, end, dt0, s, args,
            stepsize_controller=diffrax.PIDController(
                rtol, rtol, dtmax=longest, norm=partial(worst, atol, rtol)
            ),
            event=event, max_steps=MOST_STEPS, throw=False, adjoint=diffrax.ForwardMode(),
        )  # fmt: skip
        fired = jnp.asarray(found.event_mask)
        failed = ~diffrax.is_okay(found.result)
        times: Any = found.ts
        states: Any = found.ys
        new = jnp.where(fired, times[-1], end)
        x, slip, y, vy = (part[-1] for part in states)
        took = found.stats["num_accepted_steps"]
        typical = (new - t) / jnp.maximum(took, 1)
        steps_of = steps_of.at[slot].set(jnp.where(took > 2, typical, steps_of[slot]))
        which = jnp.argmin(guards(new, (x, slip, y, vy), args))

        sliding = (regime == SLIP_POS) | (regime == SLIP_NEG)
        flying, sticking = regime == FLIGHT, regime == STICK
        y, vy = jnp.where(flying, y, 0.0), jnp.where(flying, vy, 0.0)
        slip = jnp.where(sticking, 0.0, slip)
        hits = fired & flying & (which == 0)
        turns = fired & sliding & (which == 0)
        lifts = fired & sliding & (which == 1)
        leaves = fired & sticking & (which <= 1)
        kinks = fired & ((which == 2) | (which == 3))
        ends = fired & (which == 4)
        mark = ~fired & ~failed
        kind = jnp.where(mark, mark_kinds[at], 0)
        taken = taken.at[jnp.where(mark & (kind == 0), samples[at], n)].set(
            jnp.stack([x, y, slip + belt(w, new)[0], vy]), mode="drop"
        )
        breaks = mark & (kind != 0)
        piece = piece + breaks
        w = on(piece)

        strike = impact(w, zone, new, x, slip, vy, end)
        new, x, slip, vy = (
            jnp.where(hits, a, b) for a, b in zip(strike[:4], (new, x, slip, vy), strict=True)
        )
        y = jnp.where(hits, 0.0, y)
        slip = jnp.where(turns, 0.0, slip)
        side = jnp.where(which == 2, 1, -1)
        edge = w.lip_length * jnp.sin(w.attack_angle + side * w.shoulder_angle)
        x = jnp.where(kinks, edge, x)
        zone = jnp.where(kinks, jnp.where(zone == 0, side, 0), zone)
        shut = (hits & (vy <= 0)) | turns | (breaks & sticking)
        after = jnp.where(shut, closed(w, zone, new, x, slip), regime)
        after = jnp.where(lifts, FLIGHT, after)
        after = jnp.where(leaves, jnp.where(which == 0, SLIP_NEG, SLIP_POS), after)
        vy = jnp.where(hits & (vy <= 0), 0.0, vy)
        turned = jnp.where(
            after == STICK,
            int(Event.CAPTURE),
            jnp.where(after == FLIGHT, int(Event.LIFT_OFF), int(Event.REVERSAL)),
        )
        for condition_, name in (
            (hits, strike[4]),
            (turns, jnp.where(after == regime, int(Event.TOUCH), turned)),
            (lifts, int(Event.LIFT_OFF)),
            (leaves, int(Event.RELEASE)),
            (kinks, int(Event.KINK)),
            (ends, int(Event.COLLAPSE)),
        ):
            kind = jnp.where(condition_, name, kind)
        contact_order = jnp.where(
            after == FLIGHT,
            jnp.where(lifts, 3.0, jnp.where(vy > 0, 1.0, 2.0)),
            jnp.where(leaves, 2.0, 1.0),
        )
        fresh = (hits | turns | lifts | leaves | (breaks & sticking)) & (after != STICK)
        fresh = fresh & ((after == FLIGHT) | (slip == 0))
        order = jnp.zeros(5).at[0].set(jnp.where(fresh, contact_order, 0.0))
        order = order.at[jnp.where(kinks, which, 5)].set(1.0, mode="drop")
        happens = kind != 0
        put = jnp.where(happens, count, LOG)
        log = (
            log[0].at[put].set(new, mode="drop"),
            log[1].at[put].set(kind.astype(jnp.int32), mode="drop"),
        )
        streak = jnp.where(new > t, 0, streak + 1)
        at = at + mark
        over = (at >= n) | ends
        return (
            new, (x, slip, y, vy), after, zone, piece, order, at, steps_of, log, count + happens,
            taken, steps + found.stats["num_steps"], streak, bad | failed | (streak > 20),
        ), over  # fmt: skip

    def body(carry):
        inner, _, phases = carry
        inner, over = phase(inner)
        return inner, over | inner[-1], phases + 1

    zero = jnp.zeros((), jnp.int32)
    carry = (
        t, (x, slip, y, vy), regime.astype(jnp.int32), zone.astype(jnp.int32), first_piece, order,
        zero, jnp.full(3, 0.02 / fastest), (jnp.full(LOG, jnp.nan), jnp.zeros(LOG, jnp.int32)),
        zero, jnp.full((n, 4), jnp.nan), zero, zero, jnp.zeros((), bool),
    )  # fmt: skip
    carry = jax.tree.map(jnp.asarray, carry)
    carry, over, _ = jax.lax.while_loop(
        lambda c: ~c[1] & (c[2] < MOST_PHASES), body, (carry, jnp.zeros((), bool), zero)
    )
    log, count, taken, steps, bad = carry[8], carry[9], carry[10], carry[11], carry[13]
    return taken, log[0], log[1], count, bad | ~over, steps


def worst(atol, rtol, scaled):
    """Largest component: the controller's norm."""
    return jnp.max(jnp.abs(jnp.stack(jax.tree.leaves(scaled))))


@partial(jax.jit, static_argnames=("solver", "mapped"))
def run(varying, shared, marks, kinds, samples, rtol, solver, mapped):
    """Return what `trajectory` returns, for every cell."""
    import equinox as eqx

    def one(varying):
        wiper, start, scales = eqx.combine(varying, shared)
        return trajectory(wiper, start, marks, kinds, samples, rtol, scales, solver)

    return jax.lax.map(one, varying) if mapped else jax.vmap(one)(varying)


class PerPhase:
    """diffeqsolve and Event per phase; ``mapped``: one cell after the other, else vmap."""

    setting_name = "rtol"
    settings = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)

    def __init__(self, mapped: bool, solver: type = diffrax.Tsit5, cells: int | None = None):
        self.mapped, self.solver = mapped, solver()
        self.name = f"diffrax Event per phase, {'lax.map' if mapped else 'vmap'}"
        self.name += f", {solver.__name__}" * (solver is not diffrax.Tsit5)
        self.cells = cells or (32 if mapped else 64)

    def available(self) -> str | None:
        return None

    def prepare(self, scene: Scene, setting: float):
        import equinox as eqx

        wiper, position, velocity, scales = arrays(scene, "float64")
        if np.any(scene.parameters()["hinge_mass"]):
            raise NotForThisScene("written for hinge_mass = 0")
        parts = jax.tree.map(
            lambda x: jnp.asarray(x) if isinstance(x, np.ndarray) else x,
            (wiper, (*position, *velocity), scales),
        )
        varying, shared = eqx.partition(
            parts, lambda x: eqx.is_array(x) and x.shape == (scene.cells,)
        )
        from .compiled import cells_of

        _, _, breaks, kinds = cells_of(scene)
        times = np.concatenate([breaks[0][:-1], scene.sample_times])
        kinds = np.concatenate([kinds[:-1], np.zeros(len(scene.sample_times), int)])
        order = np.argsort(times, kind="stable")
        index = np.concatenate(
            [np.full(len(breaks[0]) - 1, -1), np.arange(len(scene.sample_times))]
        )
        marks, kinds, index = (jnp.asarray(a[order]) for a in (times, kinds, index))
        rtol = jnp.asarray(setting)

        def call() -> Answer:
            found = run(varying, shared, marks, kinds, index, rtol, self.solver, self.mapped)
            taken, at, codes, counts, stopped, steps = (np.asarray(a) for a in found)
            counts = np.minimum(counts, LOG)
            taken = taken[:, : len(scene.sample_times)]
            return Answer(
                scene.sample_times, taken[..., :2], taken[..., 2:],
                [a[:c] for a, c in zip(at, counts, strict=True)],
                [k[:c] for k, c in zip(codes, counts, strict=True)],
                stopped, steps,
            )  # fmt: skip

        return call


RIVALS = [PerPhase(mapped=True), PerPhase(mapped=False)]
