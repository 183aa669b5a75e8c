"""Bounds of the numbers that may change, and points within them to begin a search from."""

from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from ..blade import numbers
from ..blade.wiper import Wiper
from ..vocabulary import checks
from ..vocabulary.ranges import Range


class Box(eqx.Module):
    """Ranges of ``names``; a point is given by its shares of them, in [0, 1].

    Searches run over angles whose sine spans the box, so that the bounds hold by themselves.
    """

    low: jax.Array  # (n,), SI units
    high: jax.Array
    names: tuple[str, ...] = eqx.field(static=True)

    @classmethod
    def of(cls, bounds: Mapping[str, tuple[float, float]]) -> "Box":
        """Return the box of ``bounds``, name -> (low, high). An empty one raises ValueError."""
        checks.bounds("bounds", bounds)
        low, high = (jnp.array([pair[i] for pair in bounds.values()], float) for i in (0, 1))
        return cls(low, high, tuple(bounds))

    def share(self, angle: jax.Array) -> jax.Array:
        """Shares of the ranges at ``angle``, (n,) each."""
        return 0.5 * (1 + jnp.sin(angle))

    def shares_of(self, blade: Wiper) -> jax.Array:
        """Shares of the ranges where ``blade`` is, (n,)."""
        at = jnp.array([numbers.value(blade, name) for name in self.names])
        return (at - self.low) / (self.high - self.low)

    def starts(self, blade: Wiper, count: int, seed: int) -> jax.Array:
        """Angles to begin from, (count, n): the blade as it is and random ones of ``seed``."""
        others = np.random.default_rng(seed).uniform(0.05, 0.95, (count - 1, len(self.names)))
        shares = jnp.vstack([self.shares_of(blade), others])
        return jnp.arcsin(2 * jnp.clip(shares, 0.01, 0.99) - 1)

    def blade(self, blade: Any, share) -> Any:
        """Return ``blade`` with its numbers at ``share`` of the ranges."""
        for i, name in enumerate(self.names):
            number = self.low[i] + share[i] * (self.high[i] - self.low[i])
            blade = numbers.replaced(blade, name, number)
        return blade

    def columns(self, shares) -> dict[str, tuple[str, np.ndarray]]:
        """Values of the numbers at ``shares`` (starts, n), as variables over ``start``."""
        values = np.asarray(self.low) + np.asarray(shares) * np.asarray(self.high - self.low)
        return {name: ("start", values[:, i]) for i, name in enumerate(self.names)}


def check_search(starts: int, seed: int, most: int = 1) -> None:
    """Raises ValueError for how a search cannot begin: its starts, their seed, its steps."""
    checks.whole("starts", starts, Range(1, 2**16, whole=True))
    checks.whole("seed", seed, Range(0, whole=True))
    checks.whole("most", most, Range(1, 10**6, whole=True))


def search(price: Callable[[jax.Array], Any], angles: jax.Array, tolerance, most: int):
    """Return (angles, steps) where BFGS from each of ``angles`` (starts, n) ends, all in one batch.

    At most ``most`` steps each; derivatives of ``price`` are taken forwards. ``tolerance``:
    (relative, absolute).
    """
    solver = optx.BFGS(*tolerance)

    def one(angle):
        found = optx.minimise(
            lambda angle, _: price(angle),
            solver,
            angle,
            max_steps=most,
            throw=False,
            options={"autodiff_mode": "fwd"},
        )
        return found.value, found.stats["num_steps"]

    return jax.vmap(one)(angles)
