"""Derivatives of the outcomes of a sweep by parameters, and whether they hold.

Forward mode: the tangents of all parameters travel with the lanes of one batch. A derivative is
stored where it holds and is NaN elsewhere; `schema.VALIDITY` names the reasons, in this order of
precedence: the cell has no settled outcome; its motion is not settled; the sequence of events is
another one a finite-difference step away (checked cells); an event is near grazing. A share of the
cells is checked by central differences of fourth order at a thousandth of the tolerance.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax.numpy as jnp
import numpy as np

from ....blade.numbers import at
from ....machine.phases import during
from ....systems.build import routes
from ....vocabulary.codes import VALIDITY, Result
from ....vocabulary.columns import differentiable, sensitivity_name
from ....vocabulary.kinds import WIPER
from .. import batch, compiling
from ..columns import columns_of
from ..devices import alike, deal, dearest_first
from ..linear import slips
from .differences import move
from .tangents import (
    SECOND,
    check_fields,
    start_with_tangents,
    starts_to_bounce,
    tangents_of,
    whole,
)
from .validity import (
    GRAZING,
    check,
    drawn,
    is_settled,
    mask_contested,
    mask_first_bounces,
    mask_rounding,
)


def evaluate(spec, index: np.ndarray) -> dict[str, Any]:
    """Return the columns of `cells.evaluate`, and those of the sensitivities that ``spec`` asks."""
    asked, run = spec.sensitivities, spec.run
    names, count = asked.parameters, len(index)
    outcomes = differentiable(spec.system == WIPER, spec.belt_kind is not None)
    built, position, _ = batch.prepare(spec, index)
    size, ways = position[0].shape[-1], routes(spec, built)
    base = alike(built.system, run.precision, size)
    theta = {name: whole(at(ways[name])(built.system), size) for name in names}
    check_fields(spec, ways, names)
    settings, motion = batch.Settings.of(spec, size), batch.Run.of(spec)

    # per unit of files: an angle in degrees
    units = {name: float(spec.parameter_table[name].to_si(1.0)) for name in names}
    seeds = {
        name: jnp.zeros((len(names), size)).at[k].set(units[name]) for k, name in enumerate(names)
    }
    stated, coordinates = spec.start, spec.family.coordinates
    with compiling.apart("naming"):
        state, (dstate, dknown) = start_with_tangents(base, ways, theta, seeds, stated, coordinates)

    def compute(given, number):
        system, theta, state, seeds = given
        *found, samples, effort = tangents_of(
            system, ways, theta, state, seeds, number, motion, settings
        )
        return *found, motion.rows(samples, run.raster), effort

    order, checked = dearest_first(built.wiper, count), np.flatnonzero(drawn(index, asked.check))
    slip = moved = None
    with ThreadPoolExecutor(2) as beside:  # other programs compile while that with tangents does
        if checked.size:
            moved = beside.submit(move, spec, ways, theta, base, checked)
        if built.wiper is not None:
            slip = beside.submit(slips, built.wiper, size)
        (outcome, slopes, signal), effort = deal(
            compute, (base, theta, state, (seeds, dstate)), order
        )
        with compiling.apart("engine"), during("engine"):
            slip = None if slip is None else slip.result()
            moved = None if moved is None else moved.result()
    columns = columns_of(spec, outcome, signal, effort, built, slip, count)
    mask_first_bounces(slopes, starts_to_bounce(base, ways, theta))
    slopes |= {name: np.asarray(x).T[:count] for name, x in dknown.items()}

    watched = outcome.observed
    seconds = {SECOND[field]: x for field, x in watched.seconds._asdict().items()}
    code = np.full(count, VALIDITY["fine"], np.int8)
    mask_contested(slopes, columns | seconds, theta, base, spec)
    mask_rounding(slopes, columns, spec)
    code[watched.margin < max(asked.grazing, GRAZING * spec.rtol)] = VALIDITY["near_grazing"]
    agreement = np.full(count, np.nan)
    if moved is not None:
        other, gaps = check(spec, moved, base, columns, slopes, watched.word)
        agreement[checked] = np.fmax.reduce(list(gaps.values()))  # of what was compared
        code[checked[other]] = VALIDITY["sequence_changes"]
    code[~is_settled(columns, spec)] = VALIDITY["unsettled"]
    code[outcome.result != Result.FINISHED] = VALIDITY["not_differentiable"]

    holds = code == VALIDITY["fine"]
    for outcome_name in outcomes:
        for k, name in enumerate(names):
            slope = slopes[outcome_name][:, k]
            good = holds & np.isfinite(slope)
            columns[sensitivity_name(outcome_name, name)] = np.where(good, slope, np.nan)
    columns["sensitivity_code"] = code
    columns["grazing_margin"] = watched.margin
    columns["sensitivity_agreement"] = np.where(holds, agreement, np.nan)
    return columns
