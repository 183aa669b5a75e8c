"""Roots: of equations with one more unknown than they are, and of a test between two places."""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np
import scipy.optimize

from .shooting import Lost

JUMP = 1e-2  # of a test function between two steps: it does not vanish there, it jumps
T = TypeVar("T")


class _Solved(Exception):
    """The equations are solved to rounding: no further step is wanted."""


class Solved(NamedTuple):
    """What `pinned_root` has come to."""

    unknowns: np.ndarray
    values: np.ndarray
    jacobian: np.ndarray
    more: Any
    off: float  # of the last equation


def pinned_root(
    equations: Callable,
    guess: np.ndarray,
    pinned: np.ndarray,
    target: float | None = None,
    *,
    enough: float,
    tolerance: float,
    most: int,
) -> Solved:
    """Return where ``equations(u)``, (values, derivatives, more), and ``pinned @ u = target`` hold.

    By `scipy.optimize.root` (MINPACK's Levenberg-Marquardt: Newton's method within a trust region),
    which takes the exact derivatives at each place, where its hybrid method would update one and
    take three times as many. ``most`` of them; values below ``enough`` are rounding. Raises what
    ``equations`` do, such as `Lost`.
    """
    if target is None:
        target = float(pinned @ guess)
    last: dict[str, Any] = {}

    def square(u):
        values, jacobian, more = equations(u)
        last.update(unknowns=u.copy(), values=values, jacobian=jacobian, more=more)
        every = np.append(values, pinned @ u - target)
        if np.max(np.abs(every)) < enough:
            raise _Solved
        return every, np.vstack([jacobian, pinned])

    try:
        options = {"xtol": tolerance, "ftol": tolerance, "factor": 0.1, "maxiter": most}
        answer = scipy.optimize.root(square, guess, jac=True, method="lm", options=options)
        if not np.array_equal(last["unknowns"], answer.x):
            square(answer.x)
    except _Solved:
        pass
    return Solved(**last, off=abs(float(pinned @ last["unknowns"]) - target))


def root_between(
    ahead: Callable[[float], T | None],
    ends: dict[float, T],
    test: Callable[[T], float],
    located: float,
) -> tuple[float, T] | None:
    """Return (distance, what lies there) at which ``test`` vanishes between two ``ends``.

    ``ahead(distance)`` is what lies there, or None; ``located``, how closely the distance is told.
    None if it does not vanish, if it jumps over zero, or if it is lost on the way.
    """
    known = dict(ends)

    def value(distance: float) -> float:
        if distance not in known:
            there = ahead(distance)
            if there is None:
                raise Lost("nothing lies on the way to a special point")
            known[distance] = there
        return test(known[distance])

    low, high = ends
    try:
        a, b = value(low), value(high)
        if not (np.isfinite(a) and np.isfinite(b)) or a * b >= 0:
            return None
        root = float(scipy.optimize.brentq(value, low, high, xtol=located))  # type: ignore[arg-type]
    except Lost:
        return None
    if abs(value(root)) > JUMP * max(abs(a), abs(b)):
        return None
    return root, known[root]
