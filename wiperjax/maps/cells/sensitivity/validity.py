"""Whether a derivative can be believed: grazing, changes of word, contested cells."""

from typing import Any

import numpy as np

from ....blade.wiper import Wiper
from ....contact.friction import Stribeck
from ....contact.system import AbstractSystem
from ....noise.spectrum import dominant_frequency
from ....numerics.arrays import cellwise
from ....vocabulary.columns import DIFFERENTIABLE
from ....vocabulary.kinds import STEADY_KINDS
from ....vocabulary.schema import SCHEMA
from ....vocabulary.thresholds import silence
from .differences import STENCIL, Moved, scale_of
from .tangents import LARGEST, SECOND

FLOOR = 0.01  # a derivative that changes its outcome by less of its scale is compared with that


REST = 1e-5  # of the belt speed: below it the standard deviation of the velocity is rounding


LEFT_OVER = ("final_vx", "final_vy")  # of a quiet cell: what its steps leave of a decayed start


GRAZING = 1e4  # times the tolerance: at this margin a derivative is 1.5e-4 off


SAME = 1e-5  # relative difference of two derivatives that are one


def mask_contested(slopes, columns, theta, system, spec) -> None:
    """Make NaN the derivatives, in ``slopes``, of a largest value by a parameter along which
    another peak, with another derivative, overtakes it within the finite-difference steps."""
    count, asked = len(columns["result"]), spec.sensitivities
    entries = [spec.parameter_table[name] for name in theta]
    scale = np.stack(
        [
            scale_of(entry, np.asarray(value)[:count]) / float(entry.to_si(1.0))
            for entry, value in zip(entries, theta.values(), strict=True)
        ],
        axis=1,
    )
    for field, second in SECOND.items():
        name = LARGEST[field]
        gap = (columns[name] - columns[second])[:, None]
        least = FLOOR * _outcome_scale(name, columns, system)[:, None]
        slope, jump = scale * slopes[name], scale * (slopes[name] - slopes[second])
        differs = np.abs(jump) > SAME * np.maximum(np.abs(slope), least)
        contested = differs & (gap < max(STENCIL) * asked.step * np.abs(jump))
        slopes[name] = np.where(contested, np.nan, slopes[name])


def mask_rounding(slopes, columns, spec) -> None:
    """Make NaN the derivatives, in ``slopes``, of what is rounding at rest, and of the velocity at
    the end of a quiet cell: there steps are as long as the integrator stays stable, and what the
    start has left decays by its leave, not by the equations.
    """
    speed = columns.get("belt_speed_rms", spec.classes.quiet_velocity)  # without a belt
    rests = columns["velocity_rms"] < REST * np.abs(speed)
    masked = {"velocity_rms": rests} | dict.fromkeys(LEFT_OVER, is_quiet(columns, spec))
    for name, where in masked.items():
        if name not in slopes:  # of another system than the wiper
            continue
        slopes[name] = np.where(where[:, None], np.nan, slopes[name])


def mask_bent_peaks(slopes, system: AbstractSystem) -> None:
    """Make NaN the derivatives, in ``slopes``, of the largest normal force where friction has a
    part in it and Stribeck's law a shape between 1 and 2. Such a law bends without bound where slip
    begins or ends: the quartic through a step beside that instant turns elsewhere than the force,
    and its derivatives there were off by factors at any tolerance.
    """
    name, law = "normal_force_max", system.law
    if system.coupled and isinstance(law, Stribeck):
        shape = cellwise(law.shape, len(slopes[name]))
        bent = (shape > 1) & (shape < 2)
        slopes[name] = np.where(bent[:, None], np.nan, slopes[name])


def mask_first_bounces(slopes, bounces: dict[str, np.ndarray]) -> None:
    """Make NaN the derivatives, in ``slopes``, of a trajectory by what makes it bounce
    (`tangents.starts_to_bounce`) where it does not."""
    for name, slope in slopes.items():
        masks = np.stack([mask[: len(slope)] for mask in bounces.values()], axis=1)
        slopes[name] = np.where(masks, np.nan, slope)


def check(spec, moved: Moved, base, columns, slopes, word):
    """Return (whether the events are others, relative differences) of the ``moved`` cells.

    The second is a dict (outcome, parameter) -> (cells,), NaN where there was nothing to compare: a
    parameter at an end of its range is not moved. A difference is relative to the larger of the
    two, or to `FLOOR` of the outcome's scale over the parameter's own size, if that is more.
    """
    cells = moved.cells
    other = np.any(moved.words != word[cells], axis=(0, 1))
    gaps = {}
    for k, (name, scale) in enumerate(moved.scale.items()):
        unit = float(spec.parameter_table[name].to_si(1.0))
        for outcome in (name for name in DIFFERENTIABLE if name in slopes):
            # term by term: the last digits of a product of matrices hang on the other cells
            terms = zip(STENCIL.values(), moved.found[outcome][k], strict=True)
            change = sum(weight * x for weight, x in terms) / spec.sensitivities.step
            slope = slopes[outcome][cells, k] / unit * scale
            least = FLOOR * _outcome_scale(outcome, columns, base)[cells]
            larger = np.maximum(np.maximum(np.abs(change), np.abs(slope)), least)
            larger = np.where(larger > 0, larger, 1.0)  # both may be zero
            skip = ~moved.inside[name] | ~np.isfinite(slope) | ~np.isfinite(change)
            gaps[outcome, name] = np.where(skip, np.nan, np.abs(change - slope) / larger)
    return other, gaps


def _outcome_scale(name: str, columns, system: AbstractSystem) -> np.ndarray:
    """Size of an outcome by what it is: the load for forces, the lip for lengths, and so on; of
    another system than the wiper, its own value where no more is known. Speeds are measured without
    a belt by the motion's own: its mean over whole periods is rounding."""
    count = len(columns["result"])
    size = {"1": np.ones(count)}
    if "belt_speed_rms" in columns:
        size["m/s"] = np.asarray(columns["belt_speed_rms"])
    else:
        size["m/s"] = np.hypot(columns["velocity_rms"], columns["velocity_mean"])
    if isinstance(system, Wiper):
        blade: Any = system
        load, length, mass = (  # the wiper has some cells more, which fill up
            cellwise(x, count) for x in (blade.normal_load, blade.lip_length, blade.tip_mass)
        )
        size |= {"N/m": load, "m": length, "N s/m": mass * size["m/s"]}
    return np.asarray(size.get(SCHEMA[name].units, np.abs(columns[name])))


def drawn(index: np.ndarray, share: float) -> np.ndarray:
    """Which cells are checked: by their number alone, whatever block they are in."""
    return (np.asarray(index, np.uint64) * np.uint64(2654435761)) % 2**32 < share * 2**32


def is_settled(columns, spec) -> np.ndarray:
    """Whether the standard deviation of the tip velocity agrees in the first and the last whole
    periods of the settled window.

    A resting tip is settled; one with less than two periods in the window is not. Under a belt that
    reverses, the window is a stroke and cannot be judged.
    """
    run = spec.run
    if spec.belt_kind not in STEADY_KINDS:
        return np.ones(len(columns["result"]), bool)
    signal = np.asarray(columns["signal"], np.float64)
    settled = np.zeros(len(signal), bool)
    for i, f in enumerate(dominant_frequency(signal, run.window / spec.samples)):
        periods = np.floor(0.5 * f * run.window) if np.isfinite(f) else 0
        if periods >= 1:
            n = int(round(periods / f / run.window * spec.samples))
            a, b = np.std(signal[i, :n]), np.std(signal[i, -n:])
            settled[i] = abs(a - b) <= spec.sensitivities.settled * max(a, b)
    return settled | is_quiet(columns, spec)


def is_quiet(columns, spec) -> np.ndarray:
    return columns["velocity_rms"] < silence(spec.classes, columns.get("belt_speed_rms"))
