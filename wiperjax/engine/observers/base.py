"""Statistics gathered while integrating, instead of stored trajectories.

An observer sees every committed stretch of motion (its state at the nodes of the step) and every
event, and keeps a few numbers. The engine does not know which.
"""

from abc import abstractmethod
from functools import partial, reduce
from operator import or_
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.lax import stop_gradient

from ...contact.regimes import as_told, forces
from ...contact.space import contact
from ...numerics.arrays import where
from ...numerics.elementary import larger, within
from ...numerics.fusion_barrier import keep
from ...numerics.types import Scalar
from ...vocabulary.codes import HITS, Regime
from ...vocabulary.wording import shown

BOOLE = (7 / 90, 32 / 90, 12 / 90, 32 / 90, 7 / 90)  # quadrature over the five nodes, order 6
TURNS = 2  # of Newton's method, to a vertex: its height is off by the square of its place
MORE_TURNS = 4  # for its derivatives, which are off as its place
END_SLOPE = (1.0, -16 / 3, 12.0, -16.0, 25 / 3)  # of the quartic through them


class Stretch(NamedTuple):
    """A committed piece of smooth motion in one regime."""

    system: Any
    start: Scalar  # time
    step: Scalar  # length of the step whose nodes are below
    correction: Scalar  # from its end to an event: short, but with the derivative of its time
    regime: Scalar
    nodes: tuple  # of five `Node`, at equal distances from its start to its end
    guards: tuple  # of five node values, one a slot (see `guards`)
    sizes: tuple  # of the guards, so far
    there: tuple  # system, time, position and velocity at its end, behind the correction
    lead: Scalar | float = 0.0  # from where statistics begin to its start: 0, but both may move

    @property
    def told(self) -> Scalar:
        """Regime that it counts as."""
        return as_told(self.there[0], self.regime)

    @property
    def length(self) -> Scalar:
        """Duration."""
        return self.step + self.correction

    @property
    def counted(self) -> Scalar:
        """Duration, with the derivative by where statistics begin."""
        return led(self.length, 1.0, self.lead)

    def integral(self, values) -> Scalar:
        """Integral of something given at the nodes: Boole's rule, of order 6, over the step, and
        the trapezoidal one from its end to the event."""
        dtype = values[-1].dtype
        h, rest = self.step.astype(dtype), self.correction.astype(dtype)
        bend = 0.5 * rest * self._past.astype(dtype)
        weights = [h * w + bend * s for w, s in zip(BOOLE, END_SLOPE, strict=True)]
        weights[-1] = weights[-1] + rest
        total = sum(w * x for w, x in zip(weights, values, strict=True))
        return led(total, values[0], self.lead)

    @property
    def _past(self) -> Scalar:
        """The correction in units of the step."""
        return self.correction / jnp.where(self.step > 0, self.step, 1.0)

    def end(self, values) -> Scalar:
        """Value at the event of something given at the nodes."""
        rise = sum(w * x for w, x in zip(END_SLOPE, values, strict=True))
        return values[-1] + rise * self._past.astype(values[-1].dtype)

    def peak(self, values) -> Scalar:
        """Largest value of something given at the nodes, up to the event (`highest`)."""
        return highest(values, self.end(values))


@jax.custom_jvp
def led(total, first, lead) -> Scalar:
    """Return the ``total`` of a stretch, with the derivative of ``total + first * lead``. Where a
    stretch starts on a break of the prescribed motion, as after whole periods of a belt, that is
    what moves its start, and not what moves the beginning of the statistics.
    """
    return total


@led.defjvp
def _with_lead(given, tangents):
    (total, first, _), (change, _, lead) = given, tangents
    return total, change + first * jnp.asarray(lead).astype(total.dtype)


@eqx.filter_custom_jvp
def force_there(force, there, regime) -> Scalar:
    """Return the normal ``force`` at the end of a stretch, with the derivative of the force in the
    state ``there``: the slope of the quartic, times that of the event's time, would be off by far
    more than the value (8 % where the largest force of a motion lies at an event).
    """
    return force


@force_there.def_jvp
def _force_there_jvp(primals, tangents):
    force, there, regime = primals

    def normal(system, t, q, v):
        return forces(system, contact(system, t, q, v), regime).normal

    _, change = eqx.filter_jvp(normal, there, tangents[1])
    return force, jnp.zeros_like(force) if change is None else change.astype(force.dtype)


@jax.custom_jvp
def highest(values, end) -> Scalar:
    """Largest value of the quartic through five ``values`` at equal distances: that of an end
    (the last one is ``end``), or the vertex beside the largest inner value.

    Nothing changes at first order when a vertex moves, so its place carries no derivative; the end
    does, with the time of an event. That holds at the vertex only, to which Newton's method comes
    in `MORE_TURNS` in steps that resolve the motion.
    """
    return _highest(values, end, TURNS)


@highest.defjvp
def _with_derivative(given, tangents):
    return jax.jvp(partial(_highest, turns=MORE_TURNS), given, tangents)


def _highest(values, end, turns: int) -> Scalar:
    a, b, c, d, e = values
    # powers of s, the place in quarters of the way from its middle
    c1 = (a - 8 * b + 8 * d - e) * (1 / 12)
    c2 = (16 * (b + d) - 30 * c - (a + e)) * (1 / 24)
    c3 = (2 * (b - d) - (a - e)) * (1 / 12)
    c4 = (a + e - 4 * (b + d) + 6 * c) * (1 / 24)
    s = stop_gradient(_vertex(values, c1, c2, c3, c4, turns))
    vertex = c + s * (c1 + s * (c2 + s * (c3 + s * c4)))
    # never below a node: there may be two vertices; past the last one the end tells
    node = larger(larger(b, c), d)
    top = jnp.where(jnp.abs(s) < 2, larger(vertex, node), node)
    return jnp.maximum(jnp.maximum(a, end), top)  # a NaN at any node is one of the end


def _vertex(values, c1, c2, c3, c4, turns: int) -> Scalar:
    """Place of the vertex within a node's distance of the largest inner one of five ``values``: by
    Newton's method from the vertex of the parabola through it and its neighbours.
    """
    a, b, c, d, e = values
    first = (b > c) & (b >= d)
    last = ~first & (d > c)
    node = jnp.where(first, -1.0, jnp.where(last, 1.0, 0.0)).astype(c.dtype)
    before, here, after = (
        jnp.where(first, x, jnp.where(last, z, y)) for x, y, z in ((a, b, c), (b, c, d), (c, d, e))
    )
    fall = 2 * here - before - after
    s = node + within(-1.0, (after - before) / (2 * jnp.where(fall > 0, fall, jnp.inf)), 1.0)
    for _ in range(turns):
        slope = ((4 * c4 * s + 3 * c3) * s + 2 * c2) * s + c1
        bend = (12 * c4 * s + 6 * c3) * s + 2 * c2
        s = within(node - 1, s - slope / jnp.where(bend < 0, bend, -jnp.inf), node + 1)
    return s


def extremes(stretch: Stretch) -> tuple[Scalar, Scalar]:
    """Largest normal force and largest gap of a stretch.

    There is no gap in contact and no force in flight: one vertex is sought, not two.
    """
    nodes, system = stretch.nodes, stretch.system
    force = [node.forces.normal for node in nodes]
    last = force_there(stretch.end(force), stretch.there, stretch.regime)
    if not system.unilateral:
        peak = highest(force, last)
        return peak, jnp.zeros_like(peak)
    flying = stretch.regime == Regime.FLIGHT
    gap = [jnp.asarray(system.gap(n.time, n.position), n.position[0].dtype) for n in nodes]
    values = [jnp.where(flying, g, f) for g, f in zip(gap, force, strict=True)]
    peak = keep(highest(values, jnp.where(flying, stretch.end(gap), last)))
    none = jnp.zeros_like(peak)
    return jnp.where(flying, none, peak), jnp.where(flying, peak, none)


def outputs(stretch: Stretch) -> list[Scalar]:
    """The system's output velocity at the nodes of a stretch, in the state's precision."""
    return [
        jnp.asarray(stretch.system.output(n.time, n.position, n.velocity), n.velocity[0].dtype)
        for n in stretch.nodes
    ]


def higher(best, new) -> Scalar:
    """The larger of two values, with its derivative; of equal ones the first, NaN if either is.
    (Of equal ones `jnp.maximum` has the mean of both derivatives, which is that of neither.)
    """
    return jnp.where(_is_higher(best, new), new, best)


def lower(best, new) -> Scalar:
    """The value that `higher` leaves."""
    return jnp.where(_is_higher(best, new), best, new)


def _is_higher(best, new) -> Scalar:
    return (new > best) | (new != new)


class Happening(NamedTuple):
    """An event as an observer sees it."""

    system: Any
    time: Scalar
    kind: Scalar
    before: Scalar  # regimes, as they are told
    after: Scalar
    impulse: Scalar  # normal impulse
    duration: Scalar  # of a sequence of impacts that was completed, else 0
    output: Scalar  # behind it
    position: tuple = ()  # behind it
    velocity: tuple = ()


class AbstractObserver(eqx.Module):
    """Online statistics: immutable rules over an explicit record, whose structure stays."""

    @property
    def begin(self) -> Any:
        """Time [s] from which it gathers: a step then ends there. None: from the start on."""
        return None

    @abstractmethod
    def init(self, dtype, shape=()) -> Any:
        """Return the empty record of a batch of ``shape`` (lanes), or of one trajectory."""

    @abstractmethod
    def stretch(self, record: Any, stretch: Stretch) -> Any:
        """Return the record after a stretch of motion."""

    @abstractmethod
    def event(self, record: Any, happening: Happening) -> Any:
        """Return the record after an event."""


class Nothing(AbstractObserver):
    """Keeps nothing."""

    def init(self, dtype, shape=()):
        return ()

    def stretch(self, record, stretch):
        return record

    def event(self, record, happening):
        return record


def gathered(observer: AbstractObserver, method: str, record: Any, seen: Any, where_so) -> Any:
    """Return the record of an observer, after what it has ``seen`` (a stretch or an event)
    ``where_so``. Raises ValueError for one of another structure than `AbstractObserver.init` gave.
    """
    found = getattr(observer, method)(record, seen)
    had, has = jax.tree.structure(record), jax.tree.structure(found)
    if has != had:
        must = f"must return a record of the structure that init returns, {shown(had)}"
        raise ValueError(f"{type(observer).__name__}.{method} {must}, but was {shown(has)}")
    return where(where_so, found, record)


def is_hit(kind) -> Scalar:
    """Whether an event of `kind` is one of `HITS`."""
    return reduce(or_, [kind == hit for hit in HITS])
