"""From a scene file to a branch of its noise over one parameter: the command ``follow``."""

import json
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr

from ...blade.steady_slip import steady_slip_branches
from ...contact.belts import SteadyBelt
from ...contact.system import AbstractSystem
from ...datasets.branch_dataset import (
    check_fixed,
    check_over,
    with_curves,
    with_rest,
    with_simulations,
)
from ...machine import provenance
from ...specs.scene import SceneSpec
from ...systems import numbers
from ...systems.build import belt_of, build, start
from ...vocabulary import cf
from ...vocabulary.cf import units_text
from ...vocabulary.wording import not_there
from ..curve.dataset import curves_dataset
from ..curve.follow import follow_curves
from ..find import find_cycle
from ..return_map import Found
from .dataset import branch_dataset
from .follow import follow
from .up_and_down import up_and_down

_ADVICE = {
    Found.AT_REST: "its motion dies out: quiet; start where it makes a noise",
    Found.NOT_PERIODIC: "its motion is not periodic within run.duration: make that longer, unless "
    "it is quasi-periodic or chaotic, or runs on",
    Found.NOT_CONVERGED: "Newton's method found none near its motion after run.duration",
    Found.NOT_ISOLATED: "its cycle is at a fold, or one of a family; start at another value",
    Found.TRAJECTORY_FAILED: "its motion ends early",
}


def follow_scene(
    spec: SceneSpec,
    over: str,
    low: float,
    high: float,
    step: float | None = None,
    simulate: int = 0,
    second: tuple[str, float, float] | None = None,
    keep: Callable[[xr.Dataset, str], None] = lambda branch, lacks: None,
) -> xr.Dataset:
    """Return the branch through the motion that a scene settles on, as `branch_dataset`.

    **Arguments:** ``over``, a parameter of sweep files; ``low``, ``high``, its range in their units
    (degrees); ``step``, that of `follow` and of `follow_curves` (None: the default of each);
    ``simulate``, number of values in the range at which motions are simulated on the way up and on
    the way down (`up_and_down`; 0: none); ``second``, another parameter and its range, in which the
    folds and Hopf points of the branch are followed as curves; ``keep(branch, lacks)``, told what
    is finished before anything else that takes long is begun, and what that still lacks, which its
    title says too. The motion is taken after ``run.duration`` of the scene. Of a wiper on a steady
    belt, all steady slip is added.

    Raises ValueError if there is no such parameter or its name is taken, no cycle at the scene's
    own value, that value lies outside the range, or the scene is on a poorer model than the lip.
    """
    if spec.model != "lip":
        raise ValueError(f"model must be 'lip' to follow its cycles, but was {spec.model!r}")
    begun = time.perf_counter()
    built = build(spec, spec.parameters())
    system = built.system
    ranges, stated = _ranges(spec, system, (over, low, high), second), _stated(spec, over)
    check_fixed(stated)
    period = _clock(system)
    position, velocity = (tuple(np.asarray(x, float) for x in part) for part in start(spec, built))
    alike: dict[str, Any] = {
        "settle": spec.run.duration,
        "initial_state": (position, velocity),
        "period": period,
        "max_step": spec.run.max_step,
    }
    cycle = find_cycle(system, over=over, **alike)
    if cycle.found != Found.FOUND:
        why = f" ({cycle.why})" if cycle.why else ""
        raise ValueError(f"the scene has no cycle to follow: {_ADVICE[cycle.found]}{why}")
    steps: dict[str, Any] = {} if step is None else {"step": step}
    branch = follow(cycle, *ranges[over], **steps)
    found = branch_dataset(branch).assign_attrs(_attributes(spec, over, stated))
    if period is None and built.wiper is not None:
        found = _with_steady_slip(found, built.wiper, over, (low, high), ranges[over])

    def so_far(lacks: str = "") -> xr.Dataset:
        title = found.attrs["title"] + (f" (unfinished: without {lacks})" if lacks else "")
        made = provenance.record(None, time.perf_counter() - begun)
        return found.assign_attrs(title=title, **made)

    def keep_without(*later: str) -> None:
        lacks = " and ".join(later)
        keep(so_far(lacks), lacks)

    simulations = ("simulations",) if simulate else ()
    if second is not None:
        keep_without("curves", *simulations)
        if lines := follow_curves(branch, second[0], *ranges[second[0]], **steps):
            fixed = {name: value for name, value in stated.items() if name != second[0]}
            found = with_curves(found, curves_dataset(lines).assign_attrs(fixed=json.dumps(fixed)))
    if simulate:
        keep_without(*simulations)
        values = np.linspace(*ranges[over], simulate)
        brute = up_and_down(system, over, values, window=10 * cycle.period, **alike)
        found = with_simulations(found, brute)
    return so_far()


def _attributes(spec: SceneSpec, over: str, stated: dict[str, float]) -> dict[str, Any]:
    """Return what a branch says of its scene."""
    table, law = spec.parameter_table, spec.family.law(spec)
    attrs = {
        "title": spec.title or f"cycles over {table[over].long_name}",
        "belt_kind": spec.belt_kind or "",
        **({} if law is None else {"friction": law.name}),
        "parameter_units": units_text({name: table[name].edge_unit for name in stated}),
        **stated,
        "specification_text": spec.text,
        "specification": json.dumps(spec.document()),
    }
    return cf.plain_attributes(attrs)


def _with_steady_slip(
    found: xr.Dataset,
    wiper: Any,
    over: str,
    ends: tuple[float, float],
    bounds: tuple[float, float],
) -> xr.Dataset:
    """Return a branch with all steady slip between the ``ends`` of its range, in SI ``bounds``."""
    fine = np.linspace(*ends, 200)
    varied: Any = numbers.replaced(wiper, over, np.linspace(*bounds, len(fine)))
    slip = steady_slip_branches(varied)
    return with_rest(found, fine, np.asarray(slip.x), np.asarray(slip.growth_rate) < 0)


def _stated(spec: SceneSpec, over: str) -> dict[str, float]:
    """Return the numbers of a scene but the one that is varied, in the units of files."""
    return {
        name: float(spec.parameter_table[name].to_edge(value))
        for name, value in spec.parameters().items()
        if name != over
    }


def _ranges(
    spec: SceneSpec,
    system: AbstractSystem,
    first: tuple[str, float, float],
    second: tuple[str, float, float] | None,
) -> dict[str, tuple[float, float]]:
    """Return the range in SI of each parameter. Raises ValueError as `_bounds`, if there are not
    two, and where belt or law are none within."""
    ranges = {first[0]: _bounds(spec, system, *first, "--over")}
    if second is not None:
        along = _bounds(spec, system, *second, "--second")
        if second[0] == first[0]:
            raise ValueError(f"--second must not be that of --over, but both were {first[0]}")
        ranges[second[0]] = along
    numbers.check_corners(f"the range of {' and '.join(ranges)}", system, ranges)
    return ranges


def _bounds(
    spec: SceneSpec, system: AbstractSystem, name: str, low: float, high: float, option: str
) -> tuple[float, float]:
    """Return a range in SI. Raises ValueError if it is none of ``name``, or not the scene's."""
    entry = spec.parameter_table.get(name)
    if entry is None:
        raise ValueError(f"{option}: {not_there(name, 'system or its belt', spec.parameter_table)}")
    check_over(name)
    for end in (low, high):
        if problem := entry.problem(end):
            raise ValueError(f"{name}: {problem}")
    if not low < high:
        raise ValueError(f"the range of {name} must go upwards, but was {low:g} to {high:g}")
    bounds = float(entry.to_si(low)), float(entry.to_si(high))
    own = numbers.value(system, name)
    if not bounds[0] <= own <= bounds[1]:  # SI: the units of files round on the way there and back
        raise ValueError(
            f"the range of {name} must hold the scene's own value {entry.to_edge(own):g}, "
            f"but was {low:g} to {high:g}"
        )
    return bounds


def _clock(system: AbstractSystem) -> Callable[[Any], Any] | None:
    """Return the function that tells the period of what drives a system: the one that it says, else
    that of a belt which turns; None if there is neither."""
    if system.drive_period is not None:
        return _drive
    return None if isinstance(belt_of(system), SteadyBelt | None) else _stroke


def _drive(system):
    """Period that the system says."""
    return system.drive_period


def _stroke(system):
    """Period of the belt."""
    return 1 / system.belt.frequency
