"""The smallest change of a blade that makes its steady slip stable, from many starts at once."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..blade import numbers
from ..blade.steady_slip import equilibria
from ..blade.wiper import Wiper
from ..contact.belts import SteadyBelt, operating_speed
from ..numerics.kept import Kept
from ..vocabulary import checks
from ..vocabulary.ranges import FINITE
from .box import Box, check_search, search


class Stabilised(NamedTuple):
    """Cheapest changes that make steady slip stable, one from each start, best first."""

    parameters: xr.Dataset  # over ``start``: parameters, ``cost``, ``growth_rate``, ``meets``
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
    and random ones of ``seed``, one after the other (`scipy.optimize.minimize`, SLSQP).

    **Returns** a `Stabilised`. ``meets`` says whether the demand is met; what does not meet it
    comes last, and where nothing does, ``blade`` does not. Stable steady slip is no promise of
    quiet: see `verdict`.
    """
    checks.instance("blade", blade, Wiper, "a Wiper")
    margin = checks.number("margin", margin, FINITE)
    check_search(starts, seed)
    box, system = Box.of(blade, bounds), numbers.traceable(blade, *bounds)
    given, scale = box.shares_of(blade), max(abs(margin), 1.0)

    def change(share):
        return np.sum((share - given) ** 2), 2 * (share - given)

    def decay(share):
        rate, slope = _rate(system, box, jnp.asarray(share))
        return -(float(rate) + margin) / scale, -np.asarray(slope) / scale

    shares, _ = search(change, box.starts(blade, starts, seed), 1e-9, 100, decay)
    rate = np.array([float(_rate(system, box, jnp.asarray(share))[0]) for share in shares])
    cost = np.sum((shares - given) ** 2, axis=1)
    meets = rate + margin <= 1e-6 * scale
    rank = np.argsort(np.where(meets, cost, np.inf))
    found = xr.Dataset(
        box.columns(shares[rank])
        | {
            "cost": ("start", cost[rank], {"long_name": "squared share of the ranges"}),
            "growth_rate": ("start", rate[rank], {"units": "1/s"}),
            "meets": ("start", meets[rank], {"long_name": "steady slip decays as demanded"}),
        }
    )
    return Stabilised(found, box.blade(system, shares[rank[0]]))


@Kept
def _rate(system: Any, box: Box, share):
    """Growth rate of steady slip (1/s) and its slope by the shares."""

    def rate(share):
        changed = box.blade(system, share)
        slip = equilibria(replace(changed, belt=SteadyBelt(operating_speed(changed.belt))), 1)
        return (slip.growth_rate[0],) * 2

    slope, found = jax.jacfwd(rate, has_aux=True)(share)
    return found, slope
