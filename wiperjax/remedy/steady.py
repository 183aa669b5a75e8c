"""The smallest change of a blade that makes its steady slip stable."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..blade.steady_slip import check_rigid, equilibria, judged_slip
from ..blade.wiper import Wiper
from ..contact.belts import SteadyBelt
from ..contact.own_numbers import check_single
from ..numerics.kept import Kept
from ..systems import numbers
from ..vocabulary import checks
from ..vocabulary.ranges import FINITE
from .box import COST, Box, check_search, search
from .nearest import best_first, distance, nearest

CLOSE = 1e-6  # of the demand: a search by derivatives ends on its border


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

    Steady slip is that at the `judged_at` of the belt, on the branch that leans farthest along its
    motion. Its rate is NaN where there is none, and jumps where branches are born or end. So it is
    looked at in `nearest.AT_ONCE` points spread over the bounds, the cheapest that meet the demand
    are drawn in to any such edge, and from there derivatives lead on (`scipy.optimize.minimize`,
    SLSQP).

    **Arguments:** ``bounds``, name -> (low, high), SI units; a change costs the square of its share
    of that range; ``starts``, points that are drawn in, apart from each other, spread by ``seed``.

    **Returns** a `Stabilised`. ``meets`` says whether the demand is met there; what does not meet
    it comes last, and where nothing does, ``blade`` does not: no point that was looked at did,
    which is no proof that none does. Stable steady slip is no promise of quiet: see `verdict`.
    """
    checks.instance("blade", blade, Wiper, "a Wiper")
    check_single(blade)
    check_rigid("blade", blade)
    margin = checks.number("margin", margin, FINITE)
    check_search(starts, seed)
    box, system = Box.of(blade, bounds), numbers.traceable(blade, *bounds)
    given, scale = box.shares_of(blade), max(abs(margin), 1.0)

    def excess(rate):
        """How far a rate is above the demand, relative to it; without steady slip, infinitely."""
        over = (np.asarray(rate) + margin) / scale - CLOSE
        return np.where(np.isnan(over), np.inf, over)

    def change(share):
        return float(distance(share, given)), 2 * (share - given)

    def decay(share):
        rate, slope = _rate(system, box, jnp.asarray(share))
        if not np.isfinite(rate):
            return -1.0, np.zeros(len(share))
        return -(float(rate) + margin) / scale, -np.asarray(slope) / scale

    near = nearest(lambda shares: excess(_rates(system, box, shares)), given, starts, seed)
    ends, _ = search(change, near, 1e-9, 100, decay)
    both = np.stack([near, np.clip(ends, 0, 1)], axis=1)  # a jump may have led a search astray
    rate = np.array([[_rate(system, box, jnp.asarray(x))[0] for x in pair] for pair in both])
    cost = distance(both, given)
    better = best_first(excess(rate), cost)[:, 0]
    shares, rate, cost = (x[np.arange(starts), better] for x in (both, rate, cost))
    rank = best_first(excess(rate), cost)
    meets = excess(rate) <= 0
    found = xr.Dataset(
        box.columns(blade, shares[rank])
        | {
            "cost": ("start", cost[rank], COST),
            "growth_rate": (
                "start",
                rate[rank],
                {"long_name": "growth rate of steady slip", "units": "1/s"},
            ),
            "meets": ("start", meets[rank], {"long_name": "steady slip decays as demanded"}),
        }
    )
    return Stabilised(found, box.blade(system, shares[rank[0]]))


def _rates(system: Any, box: Box, shares: np.ndarray) -> np.ndarray:
    """Growth rates of steady slip (1/s) at ``shares`` (points, n), NaN where there is none."""
    changed = box.blade(system, jnp.asarray(shares).T)
    return np.asarray(judged_slip(changed).growth_rate)


@Kept
def _rate(system: Any, box: Box, share):
    """Growth rate of steady slip (1/s) and its slope by the shares."""

    def rate(share):
        changed = box.blade(system, share)
        slip = equilibria(replace(changed, belt=SteadyBelt(changed.belt.judged_speed)), 1)
        return (slip.growth_rate[0],) * 2

    slope, found = jax.jacfwd(rate, has_aux=True)(share)
    return found, slope
