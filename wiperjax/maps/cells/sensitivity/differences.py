"""Cells moved a little along each parameter, for central differences of fourth order."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ....vocabulary.parameters import REFERENCE, Parameter
from ..batch import Run, Settings
from ..devices import capacity, deal
from .tangents import plain, start_of, with_parameters

STENCIL = {1: 2 / 3, -1: -2 / 3, 2: -1 / 12, -2: 1 / 12}  # steps -> weight

FINER = 1e-3  # times the tolerance of the cells themselves

SIZES = {  # of what the reference blade has none of, by what else it has
    "hinge_mass": REFERENCE["tip_mass"],
    "hinge_damping": REFERENCE["neck_stiffness"]
    * (REFERENCE["tip_mass"] / REFERENCE["support_stiffness"]) ** 0.5,
}


class Moved(NamedTuple):
    """What became of some cells at all places of the stencil."""

    cells: np.ndarray  # which
    scale: dict[str, np.ndarray]  # of each parameter: a step is relative to it, (cells,)
    inside: dict[str, np.ndarray]  # whether it may be moved both ways; else it was not, (cells,)
    found: dict[str, np.ndarray]  # outcomes, (parameters, places, cells)
    words: np.ndarray  # told of the sequence of events, of the same shape


def move(spec, ways, theta, base, cells: np.ndarray) -> Moved:
    """Return the ``cells`` of the system ``base`` with each of the parameters ``theta``, name ->
    (cells of the block,), at all places of the stencil."""
    asked, n, known = spec.sensitivities, len(cells), spec.parameter_table
    names = list(theta)
    shape = len(names), len(STENCIL), n
    copies = len(names) * len(STENCIL) * n
    values = {name: np.asarray(x) for name, x in theta.items()}
    scale = {name: scale_of(known[name], x[cells]) for name, x in values.items()}
    step = {name: asked.step * s for name, s in scale.items()}
    inside = {
        name: _is_inside(known[name], x[cells], max(STENCIL) * step[name])
        for name, x in values.items()
    }
    # filled up with the last, as blocks are
    place = np.tile(cells, len(names) * len(STENCIL))
    place = np.concatenate([place, np.full(capacity(copies) - copies, cells[-1])])
    moved: dict[str, Any] = {}
    for k, name in enumerate(names):
        steps = np.zeros(shape)
        steps[k] = np.array(list(STENCIL))[:, None] * step[name] * inside[name]
        moved[name] = jnp.asarray(
            values[name][place] + np.pad(steps.ravel(), (0, place.size - copies))
        )
    whole = values[names[0]].shape
    at = jax.tree.map(lambda x: x[place] if eqx.is_array(x) and x.shape == whole else x, base)
    state, further = start_of(at, ways, moved, spec.start, spec.family.coordinates)
    settings, run = Settings.of(spec, place.size), Run.of(spec)
    run = run._replace(rtol=jnp.asarray(max(FINER * spec.rtol, 1e-13)))

    def compute(given, number):
        return plain(*given, number, run, settings)

    given = with_parameters(at, ways, moved), state
    (found, words), _ = deal(compute, given, np.arange(copies))
    found |= {name: np.asarray(x)[:copies] for name, x in further.items()}
    found, words = jax.tree.map(lambda x: x.reshape(shape), (found, words))
    return Moved(cells, scale, inside, found, words)


def scale_of(entry: Parameter, value: np.ndarray) -> np.ndarray:
    """Return the size of a parameter, which its step is relative to."""
    if entry.unit == "rad":
        return np.ones_like(value)
    return np.where(value == 0, entry.reference or SIZES.get(entry.name, 1.0), np.abs(value))


def _is_inside(entry: Parameter, value: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Whether a parameter may be changed by ``step`` both ways: at an end of its range it is not
    checked."""
    low, high = entry.to_edge(value - step), entry.to_edge(value + step)
    return (low >= entry.range.low) & (high <= entry.range.high)
