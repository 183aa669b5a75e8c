"""The smallest change of a blade that makes its steady slip stable, from many starts at once."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import xarray as xr

from .. import named
from ..belts import SteadyBelt
from ..stability import equilibria
from ..wiper import Wiper


class Stabilised(NamedTuple):
    """Cheapest changes that make steady slip stable, one from each start, best first."""

    parameters: xr.Dataset  # over ``start``: the parameters, ``cost``, ``growth_rate``
    blade: Wiper  # the best one


def stabilise(
    blade: Wiper,
    bounds: Mapping[str, tuple[float, float]],
    *,
    margin: float = 50.0,
    starts: int = 8,
    seed: int = 0,
) -> Stabilised:
    """Return the smallest change of ``blade`` whose steady slip decays at ``margin`` [1/s] or more.

    **Arguments:** ``bounds``, name -> (low, high), SI units; a change costs the square of its share
    of that range; ``starts``, points in the bounds that the search begins from, the blade itself
    and random ones of ``seed``, all in one batch (`optimistix.BFGS`, bounds by a sine).

    **Returns** a `Stabilised`. Stable steady slip is no promise of quiet: see `verdict`.
    """
    names = tuple(bounds)
    low, high = (jnp.array([pair[i] for pair in bounds.values()], float) for i in (0, 1))
    system: Any = named.traceable(blade, *names)
    given = (jnp.array([named.value(blade, name) for name in names]) - low) / (high - low)
    others = np.random.default_rng(seed).uniform(0.05, 0.95, (starts - 1, len(names)))
    # an angle whose sine spans the box: the bounds hold by themselves
    angle = jnp.arcsin(2 * jnp.clip(jnp.vstack([given, others]), 0.01, 0.99) - 1)
    shares, rate = _stabilise(system, names, low, high, given, angle, jnp.asarray(margin, float))
    shares, rate = np.asarray(shares), np.asarray(rate)
    cost = np.sum((shares - np.asarray(given)) ** 2, axis=1)
    rank = np.argsort(np.where(rate < 0, cost, np.inf))
    values = np.asarray(low) + shares[rank] * np.asarray(high - low)
    found = xr.Dataset(
        {name: ("start", values[:, i]) for i, name in enumerate(names)}
        | {
            "cost": ("start", cost[rank], {"long_name": "squared share of the ranges"}),
            "growth_rate": ("start", rate[rank], {"units": "1/s"}),
        }
    )
    for name, value in zip(names, values[0], strict=True):
        system = named.replaced(system, name, value)
    return Stabilised(found, system)


@eqx.filter_jit
def _stabilise(system, names, low, high, given, angles, margin):
    def rate(share):
        changed: Any = system
        for i, name in enumerate(names):
            changed = named.replaced(changed, name, low[i] + share[i] * (high[i] - low[i]))
        slip = equilibria(replace(changed, belt=SteadyBelt(changed.belt.peak)), 1)
        return slip.growth_rate[0]

    def share(angle):
        return 0.5 * (1 + jnp.sin(angle))

    def price(angle, _):
        excess = jnp.maximum(rate(share(angle)) / margin + 1, 0.0)
        return jnp.sum((share(angle) - given) ** 2) + 10.0 * excess**2

    def one(angle):
        found = optx.minimise(
            price,
            optx.BFGS(rtol=1e-6, atol=1e-8),
            angle,
            max_steps=100,
            throw=False,
            options={"autodiff_mode": "fwd"},
        ).value
        return share(found), rate(share(found))

    return jax.vmap(one)(angles)
