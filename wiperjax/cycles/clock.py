"""What drives a system: whether anything does, and whether it comes again after a period."""

from collections.abc import Callable, Iterable, Iterator

import jax
import jax.numpy as jnp
import numpy as np

from ..contact.space import contact
from ..contact.system import AbstractSystem
from ..numerics.kept import Kept
from ..systems import numbers
from ..vocabulary import checks
from ..vocabulary.ranges import POSITIVE
from .shooting import at_state

INSTANTS = 64  # at which what drives is compared
STATES = 8  # of a settled motion, in which it is
CHANGED = 1e-9  # of it: less is rounding
AGAIN = 1e-6  # of it: how nearly it comes again
ASIDE = 1e-3  # of a number that will be varied: at that distance the period is tried as well


def scattered(count: int) -> np.ndarray:
    """Indices of the `STATES` samples, of ``count``, that are looked at: one in each stretch of
    them, wherever, so that none of a whole number of periods is in step with them."""
    within = np.random.default_rng(0).random(STATES)
    return (count * (np.arange(STATES) + within) / STATES).astype(int)


def refuse_a_clock(system: AbstractSystem, states, span: float, varied: Iterable[str] = ()) -> None:
    """Raises ValueError if what drives a system in ``states`` (k, 2n) changes within ``span`` [s],
    also beside the values of what will be ``varied``: a drive may begin at an amplitude of zero.

    What is pushed against only now and then, a shaken wall say, is seen in the states of a motion.
    """
    for local, where in _beside(system, varied):
        found = seen(local, states, span * jnp.geomspace(1e-6, 1.0, INSTANTS))
        if any(np.any(np.ptp(x, axis=1) > CHANGED * np.max(np.abs(x))) for x in found):
            raise ValueError(
                f"period must be given: forces, speeds or stops of {type(system).__name__} change "
                f"with time{where} (a scene has that of its belt, or what its system says as "
                f"drive_period; cycles.find_cycle takes any)"
            )


def check_clock(system: AbstractSystem, clock: Callable, varied: Iterable[str], states) -> None:
    """Raises ValueError unless what drives a system in ``states`` (k, 2n) comes again after the
    period ``clock(system)``, also beside the values of what will be ``varied``.
    """
    for local, where in _beside(system, varied):
        period = checks.number(f"period{where}", clock(local), POSITIVE)
        times = period * (jnp.arange(INSTANTS) + 0.5**0.5) / INSTANTS  # no corner's own times
        now, then = (seen(local, states, t) for t in (times, times + period))
        pairs = zip(now, then, strict=True)
        if any(np.any(np.abs(a - b) > AGAIN * np.max(np.abs(a))) for a, b in pairs):
            name = type(system).__name__
            raise ValueError(
                f"period must be one after which forces, speeds and stops of {name} come again "
                f"(a function of the system where it changes), but was {period:g} s{where}"
            )


def _beside(system: AbstractSystem, varied: Iterable[str]) -> Iterator[tuple[AbstractSystem, str]]:
    """Yield the system, and as it is beside the value of each number ``varied``, with where."""
    yield system, ""
    for name in varied:
        own = numbers.value(system, name)
        aside = own + ASIDE * (abs(own) or 1.0)
        yield numbers.replaced(system, name, aside), f" at {name} = {aside:g}"


def seen(system: AbstractSystem, states, times) -> list[np.ndarray]:
    """All that depends on time beside the state, (states, instants, ...) each."""
    found = _looked_at(system, jnp.asarray(states, float), times)
    return [np.asarray(x) for x in jax.tree.leaves(found)]


@Kept
def _looked_at(system, states, times):
    def at(state, t):
        local, q, v = at_state(system, t, state)
        blows = tuple(local.rebound(k, t, q, v, jnp.zeros((), bool)) for k in local.stops)
        return contact(local, t, q, v), local.switches(t, q, v), blows

    return jax.vmap(jax.vmap(at, in_axes=(None, 0)), in_axes=(0, None))(states, times)
