"""What one guard does along a trial step: proved free of zeros, or where its first zero may be.

It is known at the five nodes of the step, each to within its rounding errors.
"""

from functools import reduce
from typing import NamedTuple

import jax.numpy as jnp
from jax.lax import stop_gradient

from ...numerics.bernstein import (
    control_values,
    deflated,
    descent_cut,
    interpolation_error,
    largest,
    minimum,
    power_of,
)
from ...numerics.elementary import larger
from ...numerics.fusion_barrier import keep
from ...numerics.known_zeros import plus
from ...numerics.types import Scalar

COARSE = 1e-4  # largest error of a guard's polynomial, over the guard, at which steps may grow
NOISE = {"float64": 256, "float32": 8}  # rounding errors of a guard, in digits of its size


def noise_digits(dtype) -> float:
    """Return what a guard may be off by rounding, over its size."""
    return NOISE[dtype.name] * float(jnp.finfo(dtype).eps)


class Guard(NamedTuple):
    """What one guard does along a trial step."""

    value: Scalar  # at the end of the step (differentiable)
    slope: Scalar  # d/dtheta there
    control: tuple  # Bernstein control values of the deflated guard, less its error estimate
    start: Scalar  # deflated value at the start
    blur: Scalar  # its error estimate,
    error: Scalar  # the same before it was set aside as rounding
    cut: Scalar  # lower bound of the first zero
    proved: Scalar  # it has no zero in the step,
    lone: Scalar  # or one at most, towards its end or beyond
    falls: Scalar  # it is violated from the start of the step on
    murky: Scalar  # its start is no larger than what it may be off: nothing can be said of it
    coarse: Scalar  # its polynomial would not do for a longer step
    size: Scalar  # so far, this step included
    noise: Scalar  # what it may be off by rounding
    nodes: tuple  # values at the nodes


def examine(values, order, size, unsure, sliver, highest: int, coarse) -> Guard:
    """Return what a guard with ``values`` at the nodes does.

    ``order``, at most ``highest``, is its zero at the start; ``size`` is the largest that was
    committed so far: what its own rounding errors scale with. ``unsure``: what those of the state
    make of it, which counts where it is steep.
    ``coarse``: error of its polynomial, over the guard, from which on steps are not to grow.
    ``sliver``: hardly any time is left before a known time, and no event fires in it.
    """
    nodes = tuple(stop_gradient(x) for x in values)
    noise = rounding = plus(noise_digits(size.dtype) * size, unsure)
    # A guard within its own rounding errors of zero says nothing by its sign: it is treated like
    # one that starts at zero, by the way it goes.
    order = jnp.where((order == 0) & (jnp.abs(nodes[0]) <= rounding), 1, order)
    # dividing by theta^m magnifies it
    noise = noise * power_of(10.0, order, highest).astype(noise.dtype)
    start, *rest = deflated(nodes, order, highest)
    order, rounding, noise, start, rest = keep((order, rounding, noise, start, rest))
    height = largest(rest)
    if highest > 1:
        # A double or triple zero is left upwards by construction (release, lift-off). Its event was
        # located to within the tolerance, so a hair's breadth downwards is not a new event.
        upwards = (order >= 2) & (start > -0.05 * height)
        start = jnp.where(upwards, larger(start, 1e-6 * height), start)
    # Only a guard that goes down from its zero all along counts as violated there; an extrapolation
    # that merely turns negative asks for a shorter step.
    top = reduce(larger, rest)
    falls = (top <= 0) & (start <= -0.5 * height)
    falls = jnp.where(order == 0, start <= 0, falls & (start < -noise))
    quotient = (start, *rest)
    control, error = keep((control_values(quotient), interpolation_error(quotient, order)))
    low = minimum(control)
    proved = (low > error) | ((order > 0) & (low >= -noise) & (error <= noise)) | sliver
    # below this the estimate is rounding: the polynomial itself decides
    extent = larger(height, jnp.abs(start))
    blur = jnp.where(error > larger(1e-9 * extent, noise), error, 0.0)
    # an error estimate near the value itself makes roots out of nothing, and so does rounding, of a
    # guard that rises from its zero
    rising = (order > 0) & (minimum(rest) > 0)
    murky = start - blur <= larger(8 * blur, jnp.where(rising, noise, 0.0))
    control, blur, start = keep((tuple(b - blur for b in control), blur, start))
    return Guard(
        value=values[-1],
        # of theta^m p(theta), at 1
        slope=order * nodes[-1] + (len(control) - 1) * (control[-1] - control[-2]),
        control=control,
        start=start,
        blur=blur,
        error=error,
        cut=descent_cut(control),
        proved=proved,
        lone=minimum(control[:-1]) > 0,
        falls=falls,
        murky=murky,
        coarse=blur > coarse * extent,
        size=larger(size, jnp.abs(nodes[-1])),
        noise=rounding,
        nodes=nodes,
    )
