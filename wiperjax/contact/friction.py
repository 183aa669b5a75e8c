"""Set-valued friction laws: a limit at rest, a coefficient in slip (docs/model.md, section 4)."""

from abc import abstractmethod
from dataclasses import fields
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from ..numerics.elementary import exp, larger
from ..vocabulary import checks


class AbstractFriction(eqx.Module):
    """``|l_t| <= static l_n`` in stick, ``l_t = -sign(v_t) mu(|v_t|) l_n`` in slip."""

    static: eqx.AbstractVar[float]

    @abstractmethod
    def coefficient(self, speed) -> Any:
        """mu at slip speed ``speed = sign * v_t`` [m/s].

        A step that runs past ``v_t = 0`` before the crossing is located evaluates it at slightly
        negative speeds: it must continue smoothly there.
        """


class Coulomb(AbstractFriction):
    """Constant coefficient in slip, and one (equal or larger) at rest."""

    static: float
    dynamic: float

    def __check_init__(self):
        checks.parameters(_given(self), {"static": "mu_static", "dynamic": "mu_minimum"})
        checks.at_most("dynamic", self.dynamic, self.static, "static")

    def coefficient(self, speed):
        return self.dynamic + 0 * speed


class Stribeck(AbstractFriction):
    """mu(v) = mu_m + (mu_s - mu_m) exp(-(|v|/v_s)^delta) + beta |v|: wet glass."""

    static: float
    minimum: float
    stribeck_speed: float
    shape: float = 1.0
    viscous_slope: float = 0.0

    def __check_init__(self):
        names = {"static": "mu_static", "minimum": "mu_minimum", "shape": "stribeck_shape"}
        checks.parameters(_given(self), names)

    def coefficient(self, speed):
        ratio = speed * (1 / self.stribeck_speed)
        if not (isinstance(self.shape, float | int) and self.shape == 1):
            # |.|^delta has no smooth continuation through zero; the floor keeps its slope finite
            ratio = jnp.sign(ratio) * jnp.maximum(jnp.abs(ratio), 1e-30) ** self.shape
        # the clamp keeps wild trial stages finite; accepted states have speed >= 0
        decay = exp(-larger(-2.0, ratio))
        return self.minimum + (self.static - self.minimum) * decay + self.viscous_slope * speed


def _given(law: AbstractFriction) -> dict[str, Any]:
    return {field.name: getattr(law, field.name) for field in fields(law)}  # type: ignore[arg-type]
