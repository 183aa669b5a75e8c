"""The smallest change of a blade that makes its steady slip stable, from many starts at once."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..blade import numbers
from ..blade.belts import SteadyBelt, operating_speed
from ..blade.steady_slip import equilibria
from ..blade.wiper import Wiper
from ..vocabulary import checks
from ..vocabulary.ranges import FINITE
from .box import Box, check_search, search


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
    checks.instance("blade", blade, Wiper, "a Wiper")
    margin = checks.number("margin", margin, FINITE)
    check_search(starts, seed)
    box, system = Box.of(bounds), numbers.traceable(blade, *bounds)
    given = box.shares_of(blade)
    angles = box.starts(blade, starts, seed)
    shares, rate = _stabilise(system, box, given, angles, jnp.asarray(margin, float))
    shares, rate = np.asarray(shares), np.asarray(rate)
    cost = np.sum((shares - np.asarray(given)) ** 2, axis=1)
    rank = np.argsort(np.where(rate < 0, cost, np.inf))
    found = xr.Dataset(
        box.columns(shares[rank])
        | {
            "cost": ("start", cost[rank], {"long_name": "squared share of the ranges"}),
            "growth_rate": ("start", rate[rank], {"units": "1/s"}),
        }
    )
    return Stabilised(found, box.blade(system, shares[rank[0]]))


@eqx.filter_jit
def _stabilise(system: Any, box: Box, given, angles, margin):
    def rate(share):
        changed = box.blade(system, share)
        slip = equilibria(replace(changed, belt=SteadyBelt(operating_speed(changed.belt))), 1)
        return slip.growth_rate[0]

    def price(angle):
        share = box.share(angle)
        excess = jnp.maximum(rate(share) / margin + 1, 0.0)
        return jnp.sum((share - given) ** 2) + 10.0 * excess**2

    shares = box.share(search(price, angles, (1e-6, 1e-8), 100)[0])
    return shares, jax.vmap(rate)(shares)
