"""The woodpecker toy by scipy: three contacts, each with its own state, and complementarity.

Shares nothing with the engine: no switch chooses an edge, the beak is a contact like the others,
and after every event all closed contacts are solved for at once by trying what each may do.
"""

from itertools import product

import numpy as np
from scipy.integrate import solve_ivp

MASS_S, INERTIA_S, MASS_B, INERTIA_B = 0.0003, 5e-9, 0.0045, 7e-7
SPRING, GRAVITY, ARM_S, ARM_B = 0.0056, 9.81, 0.010, 0.015
MASSES = np.array(
    [
        [MASS_S + MASS_B, MASS_B * ARM_S, MASS_B * ARM_B],
        [MASS_B * ARM_S, INERTIA_S + MASS_B * ARM_S**2, MASS_B * ARM_S * ARM_B],
        [MASS_B * ARM_B, MASS_B * ARM_S * ARM_B, INERTIA_B + MASS_B * ARM_B**2],
    ]
)
INVERSE = np.linalg.inv(MASSES)
BEAK, LOWER, UPPER = 0, 1, 2
NORMAL = np.array([[0, 0, -0.02], [0, 0.0058, 0], [0, -0.0058, 0]])
ALONG = np.array([[1, ARM_S, ARM_B - 0.0201], [1, 0.0031, 0], [1, 0.0031, 0]])
PLAY = np.array([ARM_S + ARM_B - 0.0201 - 0.0025, 0.0006, 0.0006])
MU, TINY = 0.3, 1e-10


def free(q):
    """Forces without contacts."""
    twist, weight = SPRING * (q[1] - q[2]), MASS_B * GRAVITY
    own = -weight - MASS_S * GRAVITY
    return np.array([own, -twist - weight * ARM_S, twist - weight * ARM_B])


def solved(contacts, normal_rate, along_rate, given, signs, give=0.0):
    """Normal and tangential impulses (or forces) of ``contacts`` that fit complementarity.

    The rates are those without them, ``given`` the least normal impulses; ``signs`` of slip are
    prescribed where they are not 0 (else friction opposes the rate that is left). Of several that
    fit these are the least, in the sum of their squares. With ``give`` each of the contacts yields
    alike, by this share of what the beak does to the whole.
    """
    n = len(contacts)
    ways = np.concatenate([NORMAL[contacts], ALONG[contacts]])
    inertia, rates = ways @ INVERSE @ ways.T, np.concatenate([normal_rate, along_rate])
    inertia = inertia + give * inertia[0, 0] * np.eye(2 * n)
    choices = [product((True, False), (s,) if s else (0, 1, -1)) for s in signs]
    fits, digits = [], 1e-12 * (np.abs(rates).sum() + inertia[0, 0] * np.max(given))
    for modes in product(*choices):
        left, right = np.zeros((2 * n, 2 * n)), np.zeros(2 * n)
        for i, (held, slip) in enumerate(modes):
            if held:
                left[i], right[i] = inertia[i], -rates[i]
            else:
                left[i, i], right[i] = 1, given[i]
            if slip:
                left[n + i, n + i], left[n + i, i] = 1, slip * MU
            else:
                left[n + i], right[n + i] = inertia[n + i], -rates[n + i]
        found = np.linalg.lstsq(left, right, rcond=1e-10)[0]  # the least, of a family of them
        if np.abs(left @ found - right).max() > max(digits, 1e-12 * np.abs(right).max()):
            continue
        after, off = rates + inertia @ found, 0.0
        for i, (held, slip) in enumerate(modes):
            off = max(off, (given[i] - found[i]) * inertia[i, i] if held else -after[i])
            if signs[i] == 0:
                beyond = (abs(found[n + i]) - MU * found[i]) * inertia[n + i, n + i]
                off = max(off, -slip * after[n + i] if slip else beyond)
        fits.append((off, found @ found, found))
    least = min(off for off, _, _ in fits) + digits
    _, _, found = min((fit for fit in fits if fit[0] <= least), key=lambda fit: fit[1])
    return found[:n], found[n:]


def pushed(v, contacts, impulses):
    return v + INVERSE @ (NORMAL[contacts].T @ impulses[0] + ALONG[contacts].T @ impulses[1])


def impact(v, contacts, restitution, give=0.0):
    """Velocities behind an impact of all ``contacts``: compression, then expansion of the beak."""
    none = np.zeros(len(contacts))
    first = solved(contacts, NORMAL[contacts] @ v, ALONG[contacts] @ v, none, none, give)
    v = pushed(v, contacts, first)
    given = np.where(np.array(contacts) == BEAK, restitution, 0.0) * first[0]
    if not given.any():
        return v
    rates = NORMAL[contacts] @ v, ALONG[contacts] @ v
    return pushed(v, contacts, solved(contacts, *rates, given, none, give))


def state_of(q, v, contact):
    """What a closed ``contact`` does next: 0 sticks, 1 or -1 slips, None opens; and its forces."""
    force = INVERSE @ free(q)
    slip = ALONG[contact] @ v
    sign = 0 if abs(slip) < TINY else int(np.sign(slip))
    normal, along = NORMAL[[contact]] @ force, ALONG[[contact]] @ force
    found = solved([contact], normal, along, np.zeros(1), [sign])
    if found[0][0] <= 0:
        return None
    if sign == 0 and abs(found[1][0]) >= MU * found[0][0] * (1 - 1e-12):
        sign = -int(np.sign(found[1][0]))
    return sign


def simulated(q, v, stop, restitution=0.5):
    """Events [(time, what)] up to ``stop``, and the state (q, v) there, from a state in which no
    more than one edge is closed."""
    now, y, events = 0.0, np.concatenate([q, v]).astype(float), []
    edge = next((c for c in (LOWER, UPPER) if PLAY[c] + NORMAL[c] @ y[:3] <= 1e-15), None)
    mode = None if edge is None else state_of(y[:3], y[3:], edge)
    edge = None if mode is None else edge
    while now < stop:

        def forces(y, edge=edge, mode=mode):
            base = INVERSE @ free(y[:3])
            if edge is None:
                return base, 0.0, 0.0
            ways = np.array([NORMAL[edge], ALONG[edge]])
            inertia, rates = ways @ INVERSE @ ways.T, ways @ base
            if mode == 0:
                n, f = np.linalg.solve(inertia, -rates)
            else:
                n = -rates[0] / (inertia[0, 0] - mode * MU * inertia[0, 1])
                f = -mode * MU * n
            return base + INVERSE @ ways.T @ np.array([n, f]), n, f

        watched = [(c, lambda t, y, c=c: PLAY[c] + NORMAL[c] @ y[:3]) for c in range(3)]
        watched = [(c, g) for c, g in watched if c != edge]
        if edge is not None and mode == 0:
            watched.append(("slides", lambda t, y, f=forces: MU * f(y)[1] - abs(f(y)[2])))
        elif edge is not None:
            watched.append(("opens", lambda t, y, f=forces: f(y)[1]))
            watched.append(("rests", lambda t, y, s=mode, e=edge: s * (ALONG[e] @ y[3:])))
        guards = [g for _, g in watched]
        for guard in guards:
            guard.terminal, guard.direction = True, -1
        done = solve_ivp(
            lambda t, y, f=forces: [*y[3:], *f(y)[0]],
            *((now, stop), y, "DOP853"),
            events=guards, rtol=1e-12, atol=1e-14, max_step=2e-3,
        )  # fmt: skip
        now, y = done.t[-1], done.y[:, -1].copy()
        if done.status != 1:
            break
        what = next(watched[i][0] for i, times in enumerate(done.t_events) if len(times))
        if what in (BEAK, LOWER, UPPER):
            closed = [what] if edge is None else [what, edge]
            y[3:] = impact(y[3:], closed, restitution)
            events.append((now, "blow" if what == BEAK else "impact"))
            if what != BEAK:
                edge = what
            if edge is not None and NORMAL[edge] @ y[3:] > TINY:
                edge = None
        else:
            events.append((now, {"slides": "release", "opens": "lift_off", "rests": ""}[what]))
            if what == "opens":
                edge = None
        if edge is not None:
            mode = state_of(y[:3], y[3:], edge)
            if what == "rests":
                events[-1] = now, "capture" if mode == 0 else "reversal"
            edge = None if mode is None else edge
    return events, y[:3], y[3:]
