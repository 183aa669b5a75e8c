"""What lies beside a branch: equilibria, told apart as curves."""

import numpy as np
import pytest
import xarray as xr

from wiperjax.datasets.branch_dataset import rest, with_rest
from wiperjax.datasets.kinds import doubts


def held(parameter, position, stable):
    """Return equilibria as a branch over ``p`` holds them."""
    known = {"p": ("point", [0.0]), "maximum": ("point", [0.0], {"long_name": "largest x"})}
    branch = xr.Dataset(known, attrs={"over": "p"})
    return rest(with_rest(branch, parameter, position, stable))


def cubic(parameter):
    """Equilibria of x' = p + x - x^3, the largest first: up to three, with two folds."""
    every = np.full((len(parameter), 4), np.nan)
    for row, p in zip(every, parameter, strict=True):
        roots = np.roots([1.0, 0.0, -1.0, -p])
        real = np.sort(roots.real[np.abs(roots.imag) < 1e-9])[::-1]
        row[: len(real)] = real
    return every, 3 * every**2 > 1


@pytest.mark.parametrize("count", [40, 200])
def test_equilibria_are_joined_along_their_curves_and_not_over_folds(count):
    """What lies highest was one line: nearly upright where it jumps from one curve to another."""
    parameter = np.linspace(-1.0, 1.0, count)
    every, stable = cubic(parameter)
    p, x, holds = held(parameter, every, stable)
    known = np.isfinite(x)
    assert known.sum() == np.isfinite(every).sum() and np.isnan(p[~known]).all()
    assert (~known).sum() == 2 and not holds[~known].any()
    np.testing.assert_allclose(p[known], x[known] ** 3 - x[known], atol=1e-9)
    for curve in np.split(np.arange(len(x)), np.flatnonzero(~known)):
        curve = curve[known[curve]]
        assert np.all(np.abs(x[curve]) > 0.57) or np.all(np.abs(x[curve]) < 0.58)
        assert len(set(np.sign(3 * x[curve] ** 2 - 1))) == 1  # no fold inside
        assert len(set(holds[curve])) == 1
        assert np.all(np.abs(np.diff(p[curve])) < 2.1 / (count - 1))


def test_no_equilibria_are_none():
    parameter = np.linspace(0.0, 1.0, 3)
    p, x, holds = held(parameter, np.full((3, 5), np.nan), np.zeros((3, 5), bool))
    assert len(p) == len(x) == len(holds) == 0


@pytest.mark.parametrize(
    ("name", "number", "line"),
    [
        ("belt_speed", np.nan, "its belt_speed must be finite numbers up to 1e+150 in size, but"),
        (
            "maximum",
            1e300,
            "its maximum must be finite numbers up to 1e+150 in size, but had",
        ),
        ("period", -1.0, "its period must be > 0, but had -1"),
        ("stable", 7, "its stable must be 0 or 1, but had 7"),
    ],
)
def test_what_no_cycle_has_is_doubted(name, number, line):
    """`info` counted a stable of 7 as a stable cycle, and told no more."""
    names = ("belt_speed", "period", "maximum", "minimum", "stable")
    branch = xr.Dataset({n: ("point", np.ones(3)) for n in names}, attrs={"over": "belt_speed"})
    branch["special_kind"] = ("special", np.zeros(0))
    assert doubts(branch) == []
    branch[name][1] = number
    (found,) = doubts(branch)
    assert found.startswith(line)
