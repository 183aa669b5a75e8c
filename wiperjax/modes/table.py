"""Modes of one system as a labelled dataset, and in words."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..contact.own_numbers import check_single, in_full
from ..contact.system import AbstractSystem
from ..machine import provenance
from ..systems import numbers
from ..vocabulary import checks
from .linear import Linear, linear_at

CONVENTION = "-Re/|lambda|; -2 Re/|Im| is twice as much where it is small"  # of damping
ROUNDING = 1e-11  # of an eigenvalue: a smaller part is none, closer real parts are the same


class Modes(NamedTuple):
    """Eigenvalues with Im >= 0, the fastest growing first, of those that grow alike the slowest,
    and their shapes.
    """

    values: Any  # (..., modes) complex [1/s]; NaN where there are fewer
    shapes: Any  # (..., coordinates, modes) complex, the largest coordinate 1


def modes_of(matrix: np.ndarray, basis: np.ndarray) -> Modes:
    """Eigenvalues and shapes of linear motions (`Linear`): of every pair one, of real ones each."""
    values, vectors = np.linalg.eig(matrix)
    m = basis.shape[-1]
    values = _without_rounding(values, np.abs(values))
    order = _order(values)
    values = np.take_along_axis(np.where(np.imag(values) < 0, np.nan, values), order, axis=-1)
    shapes = np.take_along_axis(basis @ vectors[..., :m, :], order[..., None, :], axis=-1)
    largest = np.take_along_axis(shapes, np.abs(shapes).argmax(axis=-2)[..., None, :], axis=-2)
    with np.errstate(invalid="ignore"):  # NaN where there is no steady sliding
        return Modes(values, _without_rounding(shapes / largest, 1.0))


def _without_rounding(values: np.ndarray, size: Any) -> np.ndarray:
    """Complex numbers without parts that are rounding of their size: no sign of a zero is left."""
    parts = np.real(values), np.imag(values)
    real, imag = (np.where(np.abs(x) <= ROUNDING * size, 0.0, x) for x in parts)
    return real + 1j * imag


def _order(values: np.ndarray) -> np.ndarray:
    """Places of eigenvalues (..., n) in the order of `Modes`, those with Im < 0 last."""
    real, imag = np.real(values), np.imag(values)
    falls = np.where(imag < 0, np.finfo(float).max, -real)
    order = np.argsort(falls, axis=-1, kind="stable")
    falls = np.take_along_axis(falls, order, axis=-1)
    closest = ROUNDING * np.abs(values).max(axis=-1, keepdims=True)
    alike = np.cumsum(np.diff(falls, axis=-1, prepend=falls[..., :1]) > closest, axis=-1)
    tones = np.take_along_axis(imag, order, axis=-1)
    return np.take_along_axis(order, np.lexsort((tones, alike), axis=-1), axis=-1)


def modes(system: AbstractSystem, near=None) -> xr.Dataset:
    """Return the complex eigenvalues of steady sliding of ``system``.

    Steady sliding is a place at which the system rests while its partner slides under it, as it
    does at t = 0; a belt that turns does so at its peak speed, as in the growth rate of a map. The
    linearisation is the exact derivative of the engine's accelerations in slip.

    **Arguments:** ``near``, a place (one number a coordinate) from which it is sought (default:
    that of a wiper's steady slip, else the system's default start).

    **Returns** a dataset with the dimensions ``mode`` (one of every conjugate pair, the fastest
    growing first) and ``axis`` (coordinates): ``real_part`` [1/s], above 0 if the mode grows;
    ``frequency`` [Hz]; ``damping_ratio`` = -Re/|lambda| (that of textbooks; brake papers often give
    -2 Re/|Im|, twice as much where it is small); ``shape_amplitude`` and ``shape_phase`` [rad], the
    largest coordinate having 1 and 0: it is the phase between coordinates by which friction feeds a
    mode; ``position``, ``normal_force``, ``slip_speed`` of steady sliding.

    Raises ValueError for a system without friction, and where no steady sliding is found.
    """
    checks.instance("system", system, AbstractSystem, "a system such as Wiper()")
    check_single(system)
    system = in_full(system)
    if system.law is None:
        raise ValueError(f"system must have friction, but {type(system).__name__} has none")
    near = _place(system, near)
    found = linear_at(numbers.traceable(system), tuple(jnp.asarray(x) for x in near))
    if not bool(found.exists):
        raise ValueError(
            f"{type(system).__name__} must have a steady sliding near {near}, but none was found"
        )
    return _dataset(system, found)


def _place(system: AbstractSystem, near) -> tuple[float, ...]:
    """Return the place from which steady sliding is sought. Raises ValueError for what is none."""
    if near is None:
        return tuple(float(x) for x in system.sliding_near())
    count = len(system.default_state()[0])  # that of a blade's steady slip would be compiled first
    fine = isinstance(near, tuple | list) or np.ndim(near) == 1  # an array, of JAX's too
    if (
        not fine
        or len(near) != count
        or not all(checks.is_number(x, arrays=False) and np.isfinite(x) for x in near)
    ):
        must = f"must be {count} finite numbers, one a coordinate"
        raise ValueError(f"near {must}, but was {checks.shown(near)}")
    return tuple(float(x) for x in near)


def _dataset(system: AbstractSystem, found: Linear) -> xr.Dataset:
    values, shapes = modes_of(np.asarray(found.matrix), np.asarray(found.basis))
    shown = np.isfinite(values)
    values, shapes = values[shown], shapes[:, shown]
    n = len(found.position)
    names = list(system.coordinates) or [f"q{i}" for i in range(n)]
    size = np.maximum(np.abs(values), np.finfo(float).tiny)

    def about(long_name: str, units: str = "1") -> dict[str, str]:
        return {"long_name": long_name, "units": units}

    plane = ("axis", "mode")
    words = "above 0: the mode grows"
    return xr.Dataset(
        {
            "real_part": ("mode", values.real, about("real part", "1/s") | {"comment": words}),
            "frequency": ("mode", values.imag / (2 * np.pi), about("frequency", "Hz")),
            "damping_ratio": ("mode", -values.real / size, about("damping ratio -Re/|lambda|")),
            "shape_amplitude": (plane, np.abs(shapes), about("amplitude of the coordinate")),
            "shape_phase": (plane, np.angle(shapes), about("phase of the coordinate", "rad")),
            "position": ("axis", np.asarray(found.position), {"long_name": "steady sliding"}),
            "normal_force": ((), float(found.normal_force), {"long_name": "normal force"}),
            "slip_speed": ((), float(found.slip_speed), about("slip speed", "m/s")),
        },
        coords={"mode": np.arange(1, len(values) + 1), "axis": names},
        attrs={
            **provenance.maker(),
            "title": f"modes of steady sliding of {type(system).__name__}",
            "damping_convention": CONVENTION,
        },
    )
