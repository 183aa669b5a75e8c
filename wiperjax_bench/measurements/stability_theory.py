"""The largest stable step of a method on a linear problem.

With lambda the eigenvalues of the motion's Jacobian and R the method's stability function, it is
the largest h with abs(R(h lambda)) <= 1 for all of them (E. Hairer and G. Wanner, Solving Ordinary
Differential Equations II, Springer 1996, IV.2).
"""

from collections.abc import Callable
from typing import Any

import numpy as np

RANGE = 100.0  # a step this many times 1/|lambda| that is stable is called unlimited


def stability_function(solver) -> Callable[[complex], Any]:
    """Return R(z) = 1 + z b^T (I - z A)^-1 1 of a diffrax Runge-Kutta solver, from its tableau."""
    tableau = solver.tableau
    stages = len(tableau.b_sol)
    a = np.zeros((stages, stages))
    for i, row in enumerate(tableau.a_lower):
        a[i + 1, : len(row)] = row
    if tableau.a_diagonal is not None:
        a += np.diag(tableau.a_diagonal)
    b, one = np.asarray(tableau.b_sol), np.ones(stages)
    return lambda z: 1 + z * (b @ np.linalg.solve(np.eye(stages) - z * a, one))


def theta_function(theta: float) -> Callable[[complex], Any]:
    """Return R(z) of the theta rule, which Moreau-Jean time-stepping applies to smooth forces."""
    return lambda z: (1 + (1 - theta) * z) / (1 - theta * z)


def largest_radius(stability: Callable[[complex], Any], angle: float) -> float:
    """Return the largest r with |R(s e^(i angle))| <= 1 for all s <= r; inf past `RANGE`."""
    ray = np.exp(1j * angle)
    radii = np.geomspace(1e-3, RANGE, 4000)
    out = np.array([abs(stability(r * ray)) > 1 + 1e-12 for r in radii])
    if not out.any():
        return np.inf
    first = int(np.argmax(out))
    low, high = (radii[first - 1] if first else 0.0), radii[first]
    for _ in range(50):
        middle = 0.5 * (low + high)
        outside = abs(stability(middle * ray)) > 1 + 1e-12
        low, high = (low, middle) if outside else (middle, high)
    return float(low)


def theoretical(stability: Callable[[complex], Any], eigenvalues) -> float:
    """Return the largest stable step [s] for the damped ones of ``eigenvalues`` [1/s]."""
    damped = [x for x in eigenvalues if x.real < -1e-6 * np.abs(eigenvalues).max()]
    return min(largest_radius(stability, float(np.angle(x))) / abs(x) for x in damped)
