"""Set-valued friction laws: a limit at rest, a coefficient in slip (docs/model.md, section 4)."""

from abc import abstractmethod
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ..numerics.elementary import exp, larger
from ..vocabulary import checks, declared, kinds
from ..vocabulary.kinds import FRICTIONS
from ..vocabulary.ranges import FINITE
from .card import card, kind_parameters


class AbstractFriction(eqx.Module):
    """``|l_t| <= static l_n`` in stick, ``l_t = -sign(v_t) mu(|v_t|) l_n`` in slip."""

    kind: ClassVar[str] = ""  # its name in files (`kinds.FRICTIONS`), if it has one
    static: eqx.AbstractVar[Any]

    def __check_init__(self):
        names = FRICTIONS.get(self.kind, {})
        checks.parameters({key: getattr(self, key) for key in names}, names)
        declared.check(self)

    def _repr_html_(self) -> str:
        """Its parameters with their units, as a notebook shows them."""
        return card(self, kind_parameters(FRICTIONS.get(self.kind, {})))

    @abstractmethod
    def coefficient(self, speed) -> Any:
        """mu >= 0 at slip speed ``speed = sign * v_t`` [m/s]: a motion that it drives, being less,
        ends with `NO_CONSISTENT_REGIME`.

        A step that runs past ``v_t = 0`` before the crossing is located evaluates it at slightly
        negative speeds: it must continue smoothly there. Above 0 it must be twice continuously
        differentiable for derivatives and cycles: corners, as of measured points joined by lines,
        are not located (a spline has none).
        """


class Coulomb(AbstractFriction):
    """Constant coefficient in slip, ``dynamic`` (default: ``static``), and one at rest, equal or
    larger."""

    kind = "coulomb"
    static: Any
    dynamic: Any

    def __init__(self, static, dynamic=None):
        self.static = static
        self.dynamic = static if dynamic is None else dynamic

    def __check_init__(self):
        super().__check_init__()  # equinox calls it too, but after this one
        checks.at_most("dynamic", self.dynamic, self.static, "static")

    def coefficient(self, speed):
        return kinds.coulomb(speed, self.dynamic)


class Stribeck(AbstractFriction):
    """mu(v) = mu_m + (mu_s - mu_m) exp(-(|v|/v_s)^delta) + beta |v|: wet glass."""

    kind = "stribeck"
    static: float
    minimum: float
    stribeck_speed: float
    shape: float = 1.0
    viscous_slope: float = 0.0

    def coefficient(self, speed):
        return kinds.stribeck(
            speed,
            self.static,
            self.minimum,
            self.stribeck_speed,
            self.shape,
            self.viscous_slope,
            _decay,
        )


def _decay(ratio, shape):
    """exp(-ratio^shape), smooth through 0."""
    if not (isinstance(shape, float | int) and shape == 1):
        # |.|^delta has no smooth continuation through zero; the floor keeps its slope finite
        ratio = jnp.sign(ratio) * jnp.maximum(jnp.abs(ratio), 1e-30) ** shape
    # the clamp keeps wild trial stages finite; accepted states have speed >= 0
    return exp(-larger(-2.0, ratio))


CLASSES = {law.kind: law for law in (Stribeck, Coulomb)}
"""Kind -> class of the laws that files can ask for."""


def check_rest(law: AbstractFriction) -> None:
    """Raises ValueError for a law that rises at rest (what holds would begin to slip, and be held)
    or drives what has begun to slip. Asking as laws are made would start JAX's device too early."""
    what = f"{type(law).__name__}: its coefficient at speed 0"
    found = law.coefficient(jnp.zeros(())), law.static
    if any(map(checks.is_traced, found)):
        return
    slips, holds = map(np.asarray, found)
    checks.numbers(what, slips, FINITE)
    if np.any(slips > holds * (1 + 1e-9)):
        most, was = (checks.digits(x.max()) for x in (holds, slips))
        raise ValueError(f"{what} must not be larger in slip than at rest ({most}), was {was}")
    if np.any(slips < 0):
        raise ValueError(f"{what} must be >= 0, was {checks.digits(slips.min())}")
