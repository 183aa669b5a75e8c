"""The least noise of a simulated blade within bounds, from many starts at once."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..blade.wiper import Wiper
from ..contact.own_numbers import check_single
from ..engine.solve import solve
from ..numerics.kept import Kept
from ..systems import numbers
from ..vocabulary import checks
from ..vocabulary.codes import Result
from ..vocabulary.ranges import NON_NEGATIVE, POSITIVE, SETTINGS, Range
from ..vocabulary.thresholds import Thresholds
from .box import COST, Box, check_period, check_search, search
from .nearest import distance

STICKS = 2  # begun in a window that tells of a tip that sticks: between them lies a period
_FLOOR = 1e-6  # of the belt's speed, to the search alone: at rest the root has no derivative


class Quietened(NamedTuple):
    """What the search found, one blade from each start, the least of noise and price first."""

    parameters: xr.Dataset  # over ``start``: the parameters, ``velocity_rms``, ``cost``, ``steps``
    blade: Wiper  # the best one


def quieten(
    blade: Wiper,
    bounds: Mapping[str, tuple[float, float]],
    *,
    duration: float = 0.2,
    window: float = 0.1,
    effort: float = 0.1,
    starts: int = 8,
    seed: int = 0,
    most: int = 40,
    rtol: float = 1e-7,
) -> Quietened:
    """Return blades inside ``bounds`` with the least noise: the spread of the tip's velocity.

    Simulated from the blade's default start for ``duration`` [s], of which the last ``window`` [s]
    counts: of a belt that turns as many of its periods as are in it, one at least. The derivative
    is that of the simulation. Where the window cuts a period the noise is off by a share of one in
    the window, but its derivative by its own size (docs/gradients.md, "Of the window"); beyond a
    change of events it does not see. So it is a means, and the simulated value is what is reported.

    **Arguments:** ``bounds``, name -> (low, high), SI units; ``effort``, price of a change by a
    whole range, relative to the noise of the blade as it is, or to the most that is called quiet if
    that is more (what is below it is mostly rounding, worth no change): 0 asks for the quietest
    blade at any price; ``starts``, points in the bounds to begin from, the blade itself (what is
    nearest to it, where they leave it out) and random ones of ``seed``, one after the other
    (`scipy.optimize.minimize`, L-BFGS-B); ``most`` steps of it.

    **Returns** a `Quietened`. To the search a failed simulation is twice the noise that a change
    is paid by; where one ends in it, ``velocity_rms`` is NaN, and it comes last. So it is of a tip
    that sticks in its window and does not begin to twice, on a belt that does not turn: no period,
    from one stick to the next, lies in the window, which then does not tell how loudly it slips.
    For such a blade as it is, and for one whose simulation fails, a ValueError is raised.
    """
    checks.instance("blade", blade, Wiper, "a Wiper")
    check_single(blade)
    duration = checks.number("duration", duration, POSITIVE)
    window = checks.number("window", window, Range(0, duration, low_open=True, unit="s"))
    effort = checks.number("effort", effort, NON_NEGATIVE)
    rtol = checks.number("rtol", rtol, SETTINGS["rtol"])
    check_search(starts, seed, most)
    box, system = Box.of(blade, bounds), numbers.traceable(blade, *bounds)
    check_period(window, blade, bounds)
    given = box.shares_of(blade)
    times = jnp.array([duration, window]), jnp.asarray(rtol, float)

    def noise(share):
        """What the search sees, its slope, and what is reported."""
        level, slope, rms, fine = _noise(system, box, jnp.asarray(share), *times)
        if not fine:
            return np.nan, np.zeros(len(share)), np.nan
        return float(level), np.asarray(slope), float(rms)

    before, _, rms_before = noise(given)
    if np.isnan(before):
        must = "blade must be one whose simulation finishes, with a whole period in its window"
        but = "this one's fails, or rides on the belt for longer (a longer window and duration?)"
        raise ValueError(f"{must}, but {but}")
    heard = max(before, Thresholds.quiet_velocity_ratio * float(blade.belt.rms)) or 1.0

    def price(share):
        value, slope, _ = noise(share)
        level = 2.0 if np.isnan(value) else value / heard
        paid = effort * float(distance(share, given)), 2 * effort * (share - given)
        return level + paid[0], slope / heard + paid[1]

    shares, steps = search(price, box.starts(blade, starts, seed), 1e-6, most)
    levels = np.array([noise(share)[2] for share in shares])
    cost = distance(shares, given)
    rank = np.argsort(levels + effort * heard * cost)
    about = {"long_name": "rms of the tip velocity about its mean", "units": "m/s"}
    found = xr.Dataset(
        box.columns(blade, shares[rank])
        | {
            "velocity_rms": ("start", levels[rank], about),
            "cost": ("start", cost[rank], COST),
            "steps": ("start", steps[rank], {"long_name": "steps of the search"}),
        },
        attrs={"velocity_rms_before": rms_before},
    )
    return Quietened(found, box.plain_blade(system, shares[rank[0]]))


@Kept
def _noise(system: Any, box: Box, share, times, rtol):
    """Spread of the tip's velocity over its floor, the slope of that by the shares, the spread
    itself, and whether the motion finished, and tells of a noise."""
    duration, window = times

    def noise(share):
        changed = box.blade(system, share)
        frequency = jnp.asarray(changed.belt.wiping_frequency, float)
        repeats = frequency > 0
        periods = jnp.floor(window * frequency + 1e-6)
        judged = jnp.where(repeats, periods / jnp.where(repeats, frequency, 1.0), window)
        begins = jnp.maximum(duration - judged, 0.0)  # rounding, where the window is all of it
        run = solve(changed, duration, rtol=rtol, statistics_start=begins, max_events=0)
        # else the search would go where the slip falls just outside of the window
        cut = (run.statistics.stick_time > 0) & (run.statistics.stick_count < STICKS)
        carried = cut & ~repeats & (jnp.asarray(changed.belt.peak) > 0)
        fine = (run.result == Result.FINISHED) & ~carried
        spread = jnp.where(fine, run.statistics.variance(judged), 0.0)
        level = jnp.sqrt(spread + (_FLOOR * changed.belt.peak) ** 2)
        return level, (level, run.statistics.deviation(judged), fine)

    slope, (level, rms, fine) = jax.jacfwd(noise, has_aux=True)(share)
    return level, slope, rms, fine
