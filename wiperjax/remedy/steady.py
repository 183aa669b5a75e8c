"""The smallest change of a blade that makes its steady slip stable."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..blade.steady_slip import check_rigid, equilibria, steady_slip
from ..blade.wiper import Wiper
from ..contact.belts import SteadyBelt
from ..contact.fits import turns
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
    motion; on a belt that turns it must decay on the way back as well. Its rate is NaN where there
    is none, and jumps where branches are born or end. So it is looked at in `nearest.AT_ONCE`
    points spread over the bounds, the cheapest that meet the demand are drawn in to any such edge,
    and from there derivatives lead on (`scipy.optimize.minimize`, SLSQP).

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
    strokes = jnp.array([1.0, -1.0] if turns(blade) else [1.0])

    def excess(rate):
        """How far a rate is above the demand, relative to it; without steady slip, infinitely."""
        over = (np.asarray(rate) + margin) / scale - CLOSE
        return np.where(np.isnan(over), np.inf, over)

    def change(share):
        return float(distance(share, given)), 2 * (share - given)

    def looked_at(share):
        return [np.asarray(x) for x in _rate(system, box, jnp.asarray(share), strokes)]

    def decay(share):
        rates, slopes = looked_at(share)
        if not np.all(np.isfinite(rates)):
            return np.full(rates.shape, -1.0), np.zeros(slopes.shape)
        return -(rates + margin) / scale, -slopes / scale

    near = nearest(lambda shares: excess(_rates(system, box, shares, strokes)), given, starts, seed)
    ends, _ = search(change, near, 1e-9, 100, decay)
    both = np.stack([near, np.clip(ends, 0, 1)], axis=1)  # a jump may have led a search astray
    rate = np.array([[np.max(looked_at(x)[0]) for x in pair] for pair in both])
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
    return Stabilised(found, box.plain_blade(system, shares[rank[0]]))


def _rates(system: Any, box: Box, shares: np.ndarray, strokes) -> np.ndarray:
    """Growth rates of steady slip (1/s) at ``shares`` (points, n), the largest of the ``strokes``:
    signs of the speed that is judged; NaN where one has none."""
    changed = box.blade(system, jnp.asarray(shares).T)
    slip = steady_slip(changed, strokes[:, None] * changed.belt.judged_speed)
    return np.asarray(slip.growth_rate).max(axis=0)


@Kept
def _rate(system: Any, box: Box, share, strokes):
    """Growth rates of steady slip (1/s) on ``strokes`` (m,), and slopes by the shares (m, n)."""

    def rates(share):
        changed = box.blade(system, share)

        def rate(stroke):
            belt = SteadyBelt(stroke * changed.belt.judged_speed)
            return equilibria(replace(changed, belt=belt), 1).growth_rate[0]

        return (jax.vmap(rate)(strokes),) * 2

    slopes, found = jax.jacfwd(rates, has_aux=True)(share)
    return found, slopes
