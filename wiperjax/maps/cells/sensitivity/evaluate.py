"""Derivatives of the outcomes of a sweep by parameters, and whether they hold.

Forward mode: the tangents of all parameters travel with the lanes of one batch. A derivative is
stored where it holds and is NaN elsewhere; `codes.VALIDITY` names the reasons, in this order of
precedence: the cell has no settled outcome; its motion is not settled; the sequence of events is
another one a finite-difference step away (checked cells); an event is near grazing. A share of the
cells is checked by central differences of fourth order at a thousandth of the tolerance.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ....contact.own_numbers import at
from ....contact.system import AbstractSystem
from ....machine.phases import during
from ....systems.build import Built, belt_of, routes
from ....vocabulary.codes import VALIDITY, Result
from ....vocabulary.columns import OF_STEADY_SLIP, differentiable, sensitivity_name
from ....vocabulary.kinds import WIPER
from .. import batch, compiling
from ..columns import columns_of, sampled
from ..devices import alike, deal, dearest_first
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
    mask_bent_peaks,
    mask_contested,
    mask_first_bounces,
    mask_rounding,
)


class Lot(NamedTuple):
    """Cells and their tangents, as `tangents_of` takes them."""

    built: Built
    ways: dict[str, tuple[str, ...]]  # to the parameters
    base: AbstractSystem  # with an array for each number
    theta: dict[str, jax.Array]  # the parameters, (cells of the block,) each
    state: Any
    seeds: Any  # changes of theta and of the state, (parameters, cells of the block) each
    known: dict[str, jax.Array]  # what no motion is needed for, (cells of the block,) each,
    dknown: dict[str, jax.Array]  # and its derivatives, (parameters, cells of the block)


def evaluate(spec, index: np.ndarray, finer: int = 1, room: int | None = None) -> dict[str, Any]:
    """Return the columns of `cells.evaluate`, and those of the sensitivities that ``spec`` asks.

    A ``finer`` look gives samples alone, of the same motion, for its program is there: another one
    would be compiled for some seconds.
    """
    count, lot = len(index), _lot(spec, index, room)
    settings, motion = batch.Settings.of(spec, _size(lot)), batch.Run.of(spec, finer)
    order = dearest_first(lot.built.wiper, count)

    def compute(given, number):
        base, theta, state, seeds = given
        *found, samples, effort = tangents_of(
            base, lot.ways, theta, state, seeds, number, motion, settings
        )
        return *found, motion.rows(samples, spec.run.raster), effort

    def run():
        return deal(compute, (lot.base, lot.theta, lot.state, lot.seeds), order)

    if finer > 1:
        (*_, signal), _ = run()
        return sampled(spec, signal, belt_of(lot.built.system), count)
    return _judged(spec, index, lot, run)


def _size(lot: Lot) -> int:
    return next(iter(lot.theta.values())).shape[-1]


def _lot(spec, index, room: int | None) -> Lot:
    names = spec.sensitivities.parameters
    built, position, _ = batch.prepare(spec, index, room)
    size, ways = position[0].shape[-1], routes(spec, built)
    base = alike(built.system, spec.run.precision, size)
    theta = {name: whole(at(ways[name])(built.system), size) for name in names}
    check_fields(spec, ways, names)
    # per unit of files: an angle in degrees
    units = {name: float(spec.parameter_table[name].to_si(1.0)) for name in names}
    seeds = {
        name: jnp.zeros((len(names), size)).at[k].set(units[name]) for k, name in enumerate(names)
    }
    stated, coordinates = spec.start, spec.family.coordinates
    with compiling.apart("naming"):
        begun = start_with_tangents(base, ways, theta, seeds, stated, coordinates)
    (state, known), (dstate, dknown) = begun
    return Lot(built, ways, base, theta, state, (seeds, dstate), known, dknown)


def _judged(spec, index: np.ndarray, lot: Lot, run: Callable[[], Any]) -> dict[str, Any]:
    """Columns of what ``run`` does of a lot, its derivatives checked and masked."""
    asked, count = spec.sensitivities, len(index)
    names, base, theta, ways = asked.parameters, lot.base, lot.theta, lot.ways
    outcomes = differentiable(spec.system == WIPER, spec.belt_kind)
    checked, moved = np.flatnonzero(drawn(index, asked.check)), None
    with ThreadPoolExecutor(1) as beside:  # another program compiles while that with tangents does
        if checked.size:
            moved = beside.submit(move, spec, ways, theta, base, checked)
        (outcome, slopes, signal), effort = run()
        with compiling.apart("engine"), during("engine"):
            moved = None if moved is None else moved.result()
    linear = {n: np.asarray(lot.known[n])[:count] for n in OF_STEADY_SLIP if n in lot.known}
    columns = columns_of(spec, outcome, signal, effort, lot.built, linear, count)
    mask_bent_peaks(slopes, base)
    mask_first_bounces(slopes, starts_to_bounce(base, ways, theta))
    slopes |= {name: np.asarray(x).T[:count] for name, x in lot.dknown.items()}

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
        known = holds & np.isfinite(columns[outcome_name])
        for k, name in enumerate(names):
            slope = slopes[outcome_name][:, k]
            good = known & np.isfinite(slope)
            columns[sensitivity_name(outcome_name, name)] = np.where(good, slope, np.nan)
    columns["sensitivity_code"] = code
    columns["grazing_margin"] = watched.margin
    columns["sensitivity_agreement"] = np.where(holds, agreement, np.nan)
    return columns
