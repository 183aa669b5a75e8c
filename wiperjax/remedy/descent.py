"""Steepest descent of a cycle's noise, downhill until the cycle ends."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from ..blade.wiper import Wiper
from ..contact.fits import turns
from ..contact.system import AbstractSystem
from ..cycles.branch.dataset import column_attributes
from ..cycles.cycle import Cycle, close, same_word, shooting_of
from ..cycles.find import find_cycle
from ..cycles.return_map import Found
from ..cycles.shooting import Lost
from ..systems import numbers
from ..vocabulary import checks
from ..vocabulary.ranges import POSITIVE, Range
from .box import Box
from .gradient import MEASURES, sensitivities
from .judge import verdict

SETTLE, PERIODS = 0.1, 20  # s, and periods of the cycle: in the longer of them a motion settles


class Path(NamedTuple):
    """The way to a remedy."""

    steps: xr.Dataset  # over ``step``: the parameters, the measure, the word, ``same_events``
    blade: Any  # the last system
    end: str  # why it ends
    label: str  # class of the last blade, simulated from its default start ("" where none is told)


def descend(
    cycle: Cycle,
    bounds: Mapping[str, tuple[float, float]],
    *,
    measure: str = "velocity_rms",
    step: float = 0.04,
    most: int = 60,
    settle: float | None = None,
) -> Path:
    """Return the path of steepest descent of a cycle's noise inside ``bounds``, until it ends.

    **Arguments:** ``cycle`` to begin with; ``bounds``, name -> (low, high), SI units: a step is
    measured in these ranges, so a wide range is a cheap parameter; ``measure`` (see
    `sensitivities`); ``step``, its length; ``most`` steps; ``settle`` [s] of the simulations that
    look for another motion where the cycle has ended (None: `SETTLE`, or `PERIODS` of the cycle if
    these are longer).

    **Returns** a `Path`. ``end`` is one of: the cycle ends and no other is found (`at_rest` is
    quiet; what else it may be, it says); a measure of 0; bounds that leave no way down; the number
    of steps. A step may lead up, across a valley or where events change: where the last system is
    not the one of the least noise, ``end`` names the step that was. ``same_events`` is False at a
    step whose events are not those of the step before: the gradient that led there did not know of
    them; and where a period has more events than are told apart. Another system than a
    wiper, and one on a belt that turns, has no ``label``.
    """
    checks.instance("cycle", cycle, Cycle, "a cycle of find_cycle(...)")
    box = Box.of(cycle.system, bounds)
    checks.choice("measure", measure, MEASURES)
    step = checks.number("step", step, Range(1e-6, 1))
    most = checks.whole("most", most, Range(1, 10**6, whole=True))
    settle = None if settle is None else checks.number("settle", settle, POSITIVE)
    shooting_of(cycle)
    settle = max(SETTLE, PERIODS * cycle.period) if settle is None else settle
    share = box.shares_of(cycle.system)
    if np.any(outside := (share < 0) | (share > 1)):
        worst = box.names[int(np.argmax(outside))]
        raise ValueError(f"bounds must hold the blade as it is, but {worst} lies outside")
    rows = [_row(cycle, bounds, measure, True)]
    end, system = f"{most} steps", numbers.traceable(cycle.system, *bounds)
    cycle = replace(cycle, system=system)
    for _ in range(most):
        if getattr(cycle, measure) == 0:
            end = f"{measure} is 0"
            break
        slope = sensitivities(cycle, bounds, measure)["buys"].values
        untold = [name for name, one in zip(box.names, slope, strict=True) if np.isnan(one)]
        slope = np.where(np.isnan(slope), 0.0, slope)  # what has no derivative stays as it is
        free = ~(((share <= 0) & (slope > 0)) | ((share >= 1) & (slope < 0)))
        downhill = np.where(free, -slope, 0.0)
        if np.linalg.norm(downhill) < 1e-6:
            no = f"; there is no derivative by {' and '.join(untold)}" if untold else ""
            end = f"the bounds leave no way down{no}"
            break
        share = np.clip(share + step * downhill / np.linalg.norm(downhill), 0.0, 1.0)
        system = box.blade(system, share)
        following = _tracked(cycle, system)
        if following is None:  # the cycle ends here; is there another motion?
            following = _settled(cycle, system, settle)
        if following.found == Found.AT_REST:  # quiet from here; from the default start as well?
            other = _settled(cycle, system, settle, default=True)
            following = other if other.found == Found.FOUND else following
        if following.found != Found.FOUND:
            why = f" ({following.why})" if following.why else ""
            end = f"the cycle has ended: {following.found.name.lower()}{why}"
            rows.append(_row(replace(following, system=system), bounds, measure, False))
            break
        rows.append(_row(following, bounds, measure, _same_events(cycle, following)))
        cycle = following
    end += _least(rows, measure)
    said = ""
    if isinstance(system, Wiper) and not turns(system):
        said = verdict(system, settle=settle)["label"]
    return Path(_steps(rows, system, bounds, measure, end), system, end, said)


def _least(rows: list[dict[str, Any]], measure: str) -> str:
    """Which step had the least noise, if that is not the last one and the cycle goes on there."""
    noises = [row[measure] for row in rows]
    least = int(np.nanargmin(noises))
    return f"; {measure} was least at step {least}" if noises[-1] > noises[least] else ""


def _steps(rows: list[dict[str, Any]], system, bounds, measure: str, end: str) -> xr.Dataset:
    """The way as a dataset over ``step``."""
    about = {name: numbers.attributes(system, name) for name in bounds}
    about[measure] = column_attributes(system, measure)
    columns: dict[str, Any] = {
        name: ("step", np.array([row[name] for row in rows]), attrs)
        for name, attrs in about.items()
    }
    columns["word"] = ("step", np.array([row["word"] for row in rows], object))
    columns["same_events"] = ("step", np.array([row["same_events"] for row in rows]))
    return xr.Dataset(columns, attrs={"end": end})


def _same_events(a: Cycle, b: Cycle) -> bool:
    """Whether two cycles are known to pass the same events: more than are told apart are not."""
    return same_word(a, b) and not any(c.motion is None or c.motion.overflow for c in (a, b))


def _settled(cycle: Cycle, system, settle: float, default: bool = False) -> Cycle:
    """Return the cycle that ``system`` settles on from where ``cycle`` was; from its ``default``
    start, if it has one."""
    shooting, state = cycle.shooting, cycle.state
    assert shooting is not None and state is not None
    n = len(state) // 2
    own = default and type(system).default_state is not AbstractSystem.default_state
    return find_cycle(
        system,
        settle=settle,
        initial_state=None if own else (state[:n], state[n:]),
        period=shooting.clock,
        rtol=shooting.rtol,
        max_step=shooting.max_step,
    )


def _row(cycle: Cycle, bounds, measure: str, same: bool) -> dict[str, Any]:
    row: dict[str, Any] = {name: numbers.value(cycle.system, name) for name in bounds}
    noise = getattr(cycle, measure)
    rests = cycle.found == Found.AT_REST and measure == "velocity_rms"
    return row | {
        measure: 0.0 if rests else noise,
        "word": cycle.word,
        "same_events": same,
    }


def _tracked(cycle: Cycle, system) -> Cycle | None:
    """Return the cycle of ``system`` near ``cycle``, or None."""
    shooting = cycle.shooting
    assert shooting is not None and cycle.state is not None
    shooting = replace(shooting, system=system, over=None)
    try:
        found = close(shooting, cycle.state, cycle.regime, cycle.period, cycle.phase)
    except Lost:
        return None
    near = found.found == Found.FOUND and abs(found.period / cycle.period - 1) < 0.2
    # a cycle that has lost its stick and repels is not what is heard
    return found if near and found.stable else None
