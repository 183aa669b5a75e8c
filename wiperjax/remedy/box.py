"""Bounds of the numbers that may change, and points within them to begin a search from."""

from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize

from ..blade.wiper import Wiper
from ..contact.fits import turns
from ..contact.system import AbstractSystem
from ..systems import numbers
from ..vocabulary import checks
from ..vocabulary.ranges import Range
from ..vocabulary.wording import digits

COST = {"long_name": "squared share of the ranges", "units": "1"}  # attributes of that of a change


class Box(eqx.Module):
    """Ranges of ``names``; a point is given by its shares of them, in [0, 1]."""

    low: jax.Array  # (n,), SI units
    high: jax.Array
    names: tuple[str, ...] = eqx.field(static=True)

    @classmethod
    def of(cls, blade: AbstractSystem, bounds: Mapping[str, tuple[float, float]]) -> "Box":
        """Return the box of ``bounds``, name -> (low, high). Raises ValueError for an empty one, or
        for what ``blade`` cannot be."""
        numbers.check_bounds("bounds", blade, bounds)
        low, high = (jnp.array([pair[i] for pair in bounds.values()], float) for i in (0, 1))
        return cls(low, high, tuple(bounds))

    def shares_of(self, blade: AbstractSystem) -> np.ndarray:
        """Shares of the ranges where ``blade`` is, (n,)."""
        at = np.array([numbers.value(blade, name) for name in self.names])
        return (at - np.asarray(self.low)) / np.asarray(self.high - self.low)

    def starts(self, blade: Wiper, count: int, seed: int) -> np.ndarray:
        """Shares to begin from, (count, n): what is nearest to the blade as it is, and random ones
        of ``seed``."""
        others = np.random.default_rng(seed).uniform(0.05, 0.95, (count - 1, len(self.names)))
        return np.vstack([np.clip(self.shares_of(blade), 0.0, 1.0), others])

    def blade(self, blade: Any, share) -> Any:
        """Return ``blade`` with its numbers at ``share`` of the ranges."""
        for i, name in enumerate(self.names):
            number = self.low[i] + share[i] * (self.high[i] - self.low[i])
            blade = numbers.replaced(blade, name, number)
        return blade

    def plain_blade(self, blade: Any, share) -> Any:
        """Return `blade` at ``share`` with numbers of Python, which print as what they are."""
        plain = lambda x: float(x) if eqx.is_inexact_array(x) and x.ndim == 0 else x
        return jax.tree.map(plain, self.blade(blade, share))

    def columns(self, blade: Wiper, shares) -> dict[str, tuple[str, np.ndarray, dict[str, str]]]:
        """Numbers of ``blade`` at ``shares`` (starts, n), as variables over ``start``."""
        values = np.asarray(self.low) + np.asarray(shares) * np.asarray(self.high - self.low)
        return {
            name: ("start", values[:, i], numbers.attributes(blade, name))
            for i, name in enumerate(self.names)
        }


def check_search(starts: int, seed: int, most: int = 1) -> None:
    """Raises ValueError for how a search cannot begin: its starts, their seed, its steps."""
    checks.whole("starts", starts, Range(1, 2**16, whole=True))
    checks.whole("seed", seed, Range(0, whole=True))
    checks.whole("most", most, Range(1, 10**6, whole=True))


def check_period(window: float, blade: Wiper, bounds: Mapping[str, tuple[float, float]]) -> None:
    """Raises ValueError for a ``window`` [s] that may miss a turn of the belt of ``blade``, or of a
    slower one in ``bounds``, and for a belt that turns and does not say how often."""
    blades: list[Any] = [blade]
    blades += [numbers.replaced(blade, name, end) for name, pair in bounds.items() for end in pair]
    frequencies = [float(each.belt.wiping_frequency) for each in blades]
    if turns(blade) and min(frequencies) == 0:
        must = "must say how often a second a belt that turns does so (1 / its period)"
        raise ValueError(f"{type(blade.belt).__name__}.wiping_frequency {must}, but was 0")
    slowest = min((f for f in frequencies if f > 0), default=np.inf)
    if window * slowest < 1 - 1e-9:
        must = f"must hold the longest period in bounds of the belt ({1 / slowest:.4g} s)"
        raise ValueError(f"window {must}, but was {digits(window)}")


Price = Callable[[np.ndarray], tuple[float, np.ndarray]]  # shares (n,) -> value, slope (n,)
Demand = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]  # -> values (m,), slopes (m, n)


def search(
    price: Price, shares: np.ndarray, tolerance: float, most: int, demand: Demand | None = None
):
    """Return (shares, steps) where a search from each of ``shares`` (starts, n) ends, in the box.

    At most ``most`` steps each; ``tolerance``: relative change of the value that ends it;
    ``demand``: what must all be >= 0 at the end. A jump may end a search early, and one of a demand
    on its wrong side. Searches run outside of the compiled program, of which there is one however
    often they look.
    """
    how: dict[str, Any] = {"method": "L-BFGS-B"}
    if demand is not None:
        parts = {"fun": lambda share: demand(share)[0], "jac": lambda share: demand(share)[1]}
        how = {"method": "SLSQP", "constraints": {"type": "ineq"} | parts}
    how |= {"bounds": [(0, 1)] * shares.shape[1], "options": {"maxiter": most, "ftol": tolerance}}
    ends = [minimize(price, start, jac=True, **how) for start in shares]
    return np.array([e.x for e in ends]), np.array([e.nit for e in ends])
