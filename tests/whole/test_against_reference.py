"""The engine against the independent reference on randomly drawn blades: events, order and times.

Every blade is also computed by the reference from a start moved by 1e-12: sequences are compared up
to the time at which that changes the order of events (beyond it the motion itself does not know).
"""

import math

import jax
import numpy as np
import pytest
from matching import BLADE, common, engine, engines, largest_shift, listed, logged, twin
from reference.blade import Steady, Trapezoid, Wiping, simulate

from wiperjax import Result, SteadyBelt

LENGTH, DURATION = BLADE["lip_length"], 0.02


def draw(rng, kind, hinge):
    """(parameters, belt of the reference, start) of a random blade."""

    def decades(low, high):
        return float(np.exp(rng.uniform(math.log(low), math.log(high))))

    blade = dict(
        attack_angle=float(rng.uniform(-0.75, 0.75)),
        normal_load=decades(2, 40),
        restitution=float(rng.uniform(0, 0.9)),
        mu_static=float(rng.uniform(0.2, 1.5)),
        mu_minimum=float(rng.uniform(0.05, 0.6)),
        stribeck_speed=decades(0.01, 0.5),
        viscous_slope=float(rng.uniform(0, 0.1)),
        support_stiffness=decades(500, 10000),
        support_damping=decades(0.1, 5),
        neck_stiffness=decades(0.02, 0.5),
        shoulder_stiffness=decades(0.5, 8),
        shoulder_angle=float(rng.uniform(0.2, 0.8)),
    )
    blade["mu_minimum"] = min(blade["mu_minimum"], blade["mu_static"])
    if hinge:
        blade.update(
            hinge_mass=decades(1e-4, 2e-2), hinge_damping=decades(1e-7, 1e-4), gravity=9.81
        )
    speed, frequency = decades(0.01, 2), decades(5, 300)
    phase = float(rng.uniform(0, 2 * math.pi))
    if kind == "steady":
        belt = Steady(speed if rng.random() < 0.8 else -speed)
    elif kind == "wiping":
        belt = Wiping(speed, frequency, phase)
    else:
        belt = Trapezoid(speed, frequency, phase, float(rng.uniform(0.05, 1)) * 0.5 / frequency)
    if rng.random() < 0.5:
        angle = blade["attack_angle"] + rng.uniform(-0.3, 0.3)
        height = 0.0 if rng.random() < 0.5 else float(rng.uniform(0, 1e-3))
        rises = height > 0 or rng.random() < 0.5
        velocity = float(rng.uniform(-0.5, 0.5)), float(rng.uniform(-0.5, 0.5)) if rises else 0.0
        return blade, belt, (LENGTH * math.sin(angle), height, *velocity)
    return blade, belt, (LENGTH * math.sin(blade["attack_angle"]), 0.0, 0.0, 0.0)


GROUPS = [
    pytest.param("steady", False, 80, marks=pytest.mark.long),
    pytest.param("wiping", False, 45, marks=pytest.mark.long),
    ("trapezoid", False, 45),
    pytest.param("steady", True, 30, marks=pytest.mark.long),
    ("wiping", True, 20),
]


@pytest.mark.slow
@pytest.mark.parametrize("kind, hinge, count", GROUPS)
def test_random_blades(kind, hinge, count, record_property, capsys):
    rng = np.random.default_rng(20261121)
    compared = total = 0
    worst_time = worst_place = 0.0
    disagreements = []
    for i in range(count):
        blade, belt, start = draw(rng, kind, hinge)
        run = simulate(blade, belt, DURATION, start)
        # not y: a contact that is closed has to stay closed
        shifted = (start[0] * (1 + 1e-12), start[1], start[2] * (1 + 1e-12), start[3])
        truth = listed(run)
        moved = listed(simulate(blade, belt, DURATION, shifted))
        stable = common(truth, moved)
        # what 1e-12 does to the times tells what the engine's tolerance of 1e-10 may do
        drift = largest_shift(moved[:stable], truth[:stable])
        solution = engine({**BLADE, **blade}, twin(belt), start, DURATION)
        found = logged(solution)
        same = common(found, truth)
        good = {"finished": Result.FINISHED, "collapsed": Result.COLLAPSED}
        if run.flags:
            good["finished"] = Result.PAINLEVE_INDETERMINATE
        ended = Result(int(solution.result)) == good[run.result]
        total += stable
        compared += min(same, stable)
        n = min(same, stable)
        error = largest_shift(found[:n], truth[:n])
        worst_time = max(worst_time, error / DURATION)
        whole = stable == len(truth)
        late = error > 1e-8 * DURATION + 1e3 * drift
        if same < stable or (whole and not (ended and len(found) == len(truth))) or late:
            disagreements.append((i, same, stable, len(found), len(truth), error, drift, blade))
        elif whole:
            place = np.max(np.abs(run.position - np.asarray(solution.final_position)))
            worst_place = max(worst_place, float(place) / LENGTH)
    line = (
        f"{kind}{' with hinge mass' if hinge else ''}: {count} blades, "
        f"{compared} of {total} events agree, "
        f"times to {worst_time:.1e} of the duration, "
        f"final positions to {worst_place:.1e} of the lip"
    )
    record_property("agreement", line)
    with capsys.disabled():
        print("\n  " + line)
    assert not disagreements, disagreements[:3]
    assert worst_place < 1e-7


@pytest.mark.long
def test_a_batch_gives_the_same_as_the_scalar_engine():
    """Sixteen blades at once under `jax.vmap`, every event."""
    rng = np.random.default_rng(5)
    drawn = [draw(rng, "steady", False) for _ in range(16)]
    starts = np.array([d[2] for d in drawn])
    blades = [{**BLADE, **blade} for blade, _, _ in drawn]
    blades = {key: np.array([blade[key] for blade in blades]) for key in blades[0]}
    belts = SteadyBelt(np.array([d[1].speed for d in drawn]))
    together = engines(blades, belts, starts, DURATION)
    for i, (blade, belt, start) in enumerate(drawn):
        alone = logged(engine({**BLADE, **blade}, twin(belt), start, DURATION))
        lane = logged(jax.tree.map(lambda x, i=i: x[i], together))
        assert [e[1:] for e in alone] == [e[1:] for e in lane]
        np.testing.assert_allclose([e[0] for e in alone], [e[0] for e in lane], rtol=0, atol=1e-10)
