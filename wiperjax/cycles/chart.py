"""Coordinates on the section of a return map: those that the constraints leave free."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg

from ..contact.projection import SMALL
from ..contact.space import contact
from ..numerics.kept import Kept
from ..vocabulary.codes import Regime
from .shooting import Lost, at_state


class Chart(NamedTuple):
    """Coordinates near ``origin``: ``origin + basis @ w``, within the contact and on the section.

    ``wide`` spans the states that keep the contact (m of them), ``basis`` those that lie on the
    ``section`` as well (the same without one).
    """

    origin: np.ndarray  # (2n,)
    basis: np.ndarray  # (2n, d)
    wide: np.ndarray  # (2n, m); scaled so that wide.T @ (x / scale^2) reads coordinates
    scale: np.ndarray  # (2n,)
    regime: int
    section: Callable | None = None

    def state(self, w) -> np.ndarray:
        """State at the coordinates ``w`` (d,)."""
        return self.origin + self.basis @ w

    def read(self, x) -> np.ndarray:
        """Coordinates (m, ...) of states' differences ``x`` (2n, ...) in ``wide``."""
        scale = self.scale.reshape((-1,) + (1,) * (np.ndim(x) - 1))
        return self.wide.T @ (x / scale**2)


def chart(system, state, time, regime: int, scale, section=None) -> Chart:
    """Return coordinates of the states near ``state`` in ``regime``, on ``section`` if given.

    ``section(t, q, v)`` is a function of time, positions and velocities q' that vanishes there.
    Raises `Lost` if no motion in ``regime`` crosses the section: one that stick holds, say.
    """
    state, scale = np.asarray(state, float), np.asarray(scale, float)
    values, slopes = _constraints(system, jnp.asarray(time, float), jnp.asarray(state), section)
    values = np.asarray(values)
    gap, closing, slip, crossing = (np.asarray(row) for row in slopes)
    rows = []
    if regime != Regime.FLIGHT and system.unilateral:
        rows += [gap, closing]
    if regime == Regime.STICK:
        rows += [slip]
    wide = _null_space(rows, scale)
    if section is None:
        return Chart(state, wide, wide, scale, regime)
    slope = wide.T @ crossing
    if np.linalg.norm(slope) <= SMALL * np.linalg.norm(crossing * scale):
        raise Lost(f"in {Regime(regime).name.lower()} no motion crosses the section")
    towards = wide @ slope  # the shortest way to the section that keeps the contact
    distance = values[3] / (crossing @ towards)
    basis = _null_space([*rows, crossing], scale)
    return Chart(state - distance * towards, basis, wide, scale, regime, section)


def _null_space(rows, scale) -> np.ndarray:
    """Orthonormal directions (in units of ``scale``) in which none of ``rows`` changes, scaled."""
    if not rows:
        return np.diag(scale)
    directions = scipy.linalg.null_space(np.stack(rows) * scale)
    directions[np.abs(directions) < SMALL] = 0.0  # coordinates that rest do so exactly
    return scale[:, None] * directions


@Kept
def _constraints(system, time, state, section):
    n = state.shape[0] // 2

    def values(state):
        local, q, v = at_state(system, time, state)
        c = contact(local, time, q, v)
        crossing = jnp.zeros(()) if section is None else section(time, q, tuple(state[n:]))
        return jnp.stack([c.gap, c.normal_speed, c.slip_speed, crossing])

    return values(state), jax.jacfwd(values)(state)


class Turning(eqx.Module):
    """A section: zero where a coordinate turns."""

    coordinate: int = eqx.field(static=True)

    def __call__(self, t, q, v) -> Any:
        return v[self.coordinate]


class Passing(eqx.Module):
    """A section: zero where a coordinate passes a level; it falls where that goes as ``sense``."""

    coordinate: int = eqx.field(static=True)
    level: Any
    sense: Any  # 1: upwards, -1: downwards

    def __call__(self, t, q, v) -> Any:
        return self.sense * (self.level - q[self.coordinate])


class Across(eqx.Module):
    """A section: the plane through a state, across a direction in which it falls."""

    state: Any  # (2n,)
    along: Any  # (2n,): what the direction reads of a state's difference

    def __call__(self, t, q, v) -> Any:
        return self.along @ (self.state - jnp.stack([*q, *v]))
