"""The curve of grazing-sliding folds where places and cycles change fast along it."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.integrate
import scipy.optimize
from rows import Row

from wiperjax.cycles import find_cycle, follow, follow_curves
from wiperjax.cycles.curve.equations import Facts, solve
from wiperjax.cycles.curve.plane import Plane
from wiperjax.cycles.curve.touch import AWAY, STEEP, Touch
from wiperjax.cycles.cycle import Cycle
from wiperjax.cycles.return_map import Found
from wiperjax.vocabulary.codes import CurveEnd


def exact(link, second, rate, period, belt):
    """Return (belt, period) at which a cycle of slip comes to rest on the belt and leaves it: there
    its force is what friction holds, and no more. The other numbers are near it."""

    def unclosed(z):
        second, rate, period, belt = z
        first = (link * second + 0.2 * (rate - belt) - 0.3 * belt + 1) / (1 + link)

        def rates(t, y):
            pull = link * (y[1] - y[0]) + 0.2 * (y[3] - y[2])
            friction = 1 / (1 + 3 * abs(y[2] - belt))
            return [y[2], y[3], pull - y[0] - 0.3 * y[2] + friction, -pull / 2.0]

        start, fine = [first, second, belt, rate], {"rtol": 1e-11, "atol": 1e-12}
        run = scipy.integrate.solve_ivp(rates, (0, period), start, method="DOP853", **fine)
        return run.y[:, -1] - start

    z = scipy.optimize.fsolve(unclosed, [second, rate, period, belt], xtol=1e-11)
    assert np.max(np.abs(unclosed(z))) < 1e-9
    return z[3], z[2]


@pytest.mark.long
def test_places_are_those_of_an_independent_code_all_along_the_curve():
    """Where the way to rest led along the curve the limit was guessed from a tenth of a range
    away, 1e-3 beside it, and the curve ran back over itself and ended at a link of 7.09."""
    row = Row(belt=0.3, damping=0.3)
    cycle = find_cycle(row, settle=400.0, over="belt")
    branch = follow(cycle, 0.25, 2.5, step=0.1)
    touching = [s for s in branch.special if s.kind == "grazing_sliding_fold"]
    (curve,) = follow_curves(replace(branch, special=touching), "link", 0.98, 8.0)
    assert {end for end, _ in curve.ends} == {CurveEnd.RANGE}
    link = curve.places[:, 1]
    assert np.all(np.diff(link) > 0) or np.all(np.diff(link) < 0)
    assert {mark.kind for mark in curve.special} == {"turn_belt"}
    for mark in curve.special:  # an extreme of belt(link): the points beside it lie on one side
        beside = curve.places[[mark.index - 1, mark.index + 1], 0] - curve.places[mark.index, 0]
        assert beside[0] * beside[1] > 0
    for (belt, link), facts in zip(curve.places[::4], curve.facts[::4], strict=True):
        motion = facts.cycle.motion
        _, second, _, rate = motion.samples[np.argmin(np.abs(motion.slip_speed[:-1]))]
        found = exact(link, second, rate, facts.period, belt)
        assert belt == pytest.approx(found[0], abs=1e-7)
        assert facts.period == pytest.approx(found[1], abs=1e-5)


NOTHING: Any = None


class Bending(Touch):
    """Cycles (x, a, b) of which b is the slip speed that is left: x - 20 b hangs on a alone, along
    which ever more of the curve lies."""

    def values(self, u):
        x, a, b = u
        along = x - 20 * b
        slope = STEEP * (0.5 + along)
        values = [a - STEEP * (along + along**2) / 2, b - self.left]
        return np.array(values), np.array([[-slope, 1.0, 20 * slope], [0.0, 0.0, 1.0]]), None

    def facts(self, u, more):
        return Facts(NOTHING, 1.0, 1.0, {}, Cycle(NOTHING, Found.FOUND))


def test_places_on_the_curve_are_in_the_order_of_the_cycles_that_they_are_of():
    """Where less than `STEEP` of the tangent lay along the parameters another way led to rest, to
    places a step beside: loads of 8.349, 8.357 and 8.263 N/m of the wiper followed each other."""
    driven: Any = SimpleNamespace(clock=abs)
    plane = Plane(NOTHING, ("a", "b"), np.zeros(2), np.ones(2))
    places = []
    for x in np.linspace(0.1, 1.2, 23):
        equations = Bending(plane, np.array([x, 0.0, AWAY]), driven, NOTHING, 0.0)
        spot = solve(equations, equations.start, np.array([1.0, 0.0, 0.0]))
        assert spot is not None
        places.append(spot.meant.place[0])
    assert np.all(np.diff(places) > 0)
