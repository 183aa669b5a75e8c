"""Branches on which a section comes to touch the cycles, or to miss them."""

import math

import numpy as np
import pytest
from rows import Row
from systems import Ring

import wiperjax
from wiperjax.cycles import close, find_cycle, follow, follow_curves
from wiperjax.cycles.chart import Turning
from wiperjax.cycles.return_map import Shooting
from wiperjax.systems import numbers


@pytest.mark.long
def test_a_branch_goes_on_where_its_section_misses_the_cycles():
    """Circles that shrink below the level at which they begin: the branch ended there."""
    cycle = find_cycle(
        Ring(), settle=60.0, initial_state=((1.2,), (0.0,)), over="a",
        section=lambda t, q, v: q[0] - 0.8,
    )  # fmt: skip
    branch = follow(cycle, -0.1, 0.3, step=0.1)
    assert branch.ends == ("the end of the range", "a Hopf point")
    fold, hopf = branch.special
    assert (fold.parameter, hopf.parameter) == pytest.approx((0.25, 0.0), abs=1e-6)
    for a, found in zip(branch.parameters, branch.cycles, strict=True):
        r2 = found.maximum**2
        assert a == pytest.approx(r2 - r2**2, abs=1e-8)
        exact = math.exp(-2 * math.pi * r2 * (2 * r2 - 1))
        assert found.multipliers[0].real == pytest.approx(exact, rel=1e-6)
    # its fold, too, begins on another section, and passes on to smaller circles
    curves = follow_curves(branch, "b", -1.05, -0.6, step=0.1)
    (curve,) = [curve for curve in curves if curve.kind == "fold"]
    a, b = curve.places.T
    assert (b.min(), b.max()) == pytest.approx((-1.05, -0.6), abs=1e-8)
    np.testing.assert_allclose(a, b**2 / 4, atol=2e-6)


@pytest.mark.long
def test_a_branch_goes_on_where_its_section_touches_the_cycles():
    """The first block turns without acceleration at a link of 2.3518: multipliers of -9.4 and 6.8
    were told there, and the branch "came back on itself".
    """
    system = numbers.traceable(Row(link=2.46322998), "link")
    scale = np.array([0.86, 1.0, 0.41, 0.43])
    family = Shooting(system, "link", None, Turning(0), 1, scale, 14.1)
    state = np.array([0.90993086, 1.01403646, 0.0, -0.31898533])
    cycle = close(family, state, int(wiperjax.Regime.SLIP_NEG), 14.1020535)
    branch = follow(cycle, 2.3, 2.5, step=0.1)
    assert branch.ends == ("the end of the range",) * 2 and branch.special == []
    for found in branch.cycles:  # those of the whole motion: whatever the section
        whole = np.linalg.eigvals(found.motion.by_state)
        for value in (1.0, *found.multipliers):
            assert np.min(np.abs(whole - value)) < 1e-6
    sizes = np.abs([found.multipliers[0] for found in branch.cycles])
    assert np.all((sizes > 2.3) & (sizes < 2.7))
