"""The curve of Hopf points of steady slip: where a pair of eigenvalues crosses the imaginary axis.

Steady slip is an equilibrium of the motion within its slip regime, with the contact closed; it is
linearised in the coordinates that the contact leaves free (`chart`). A pair of eigenvalues has the
sum zero where the bialternate product of the linearisation with the identity is singular
(Kuznetsov, Elements of Applied Bifurcation Theory, section 10.2.2): a smooth function of all
unknowns, which needs no eigenvalue told from the others. Whether the cycles born there are unstable
and lie around the stable side says the first Lyapunov coefficient (ibid., equation 5.62), from the
exact second and third derivatives.
"""

from dataclasses import dataclass, replace
from itertools import combinations
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ...contact.regimes import forces, slip_sign
from ...contact.space import contact
from ...numerics.kept import Kept
from ...vocabulary.codes import CurveEnd
from ..chart import Chart, chart
from ..shooting import Lost, flow, tidy
from .equations import Equations, Facts, Test, null, solve
from .plane import placed

SAME = 1e-6  # of the unknowns: the linearisation at a corner is the same from both sides
INSIDE = 1e-4  # of the unknowns: how far behind a corner its curve is taken up


@dataclass(frozen=True)
class Hopf(Equations):
    """Unknowns: coordinates of the equilibrium in ``where``, and the two parameters."""

    kind: ClassVar[str] = "hopf"
    enough: ClassVar[float] = 1e-13
    tests: ClassVar[tuple[Test, ...]] = (
        Test("bautin", "the onset turns from soft to hard: a curve of folds begins"),
        Test("double_zero", "the frequency is zero", CurveEnd.DOUBLE_ZERO),
        Test("lift_off", "the normal force of steady slip vanishes", CurveEnd.CONTACT_LOST),
        Test("rest", "the slip speed vanishes", CurveEnd.STICK),
        Test("shoulder", "steady slip reaches a corner of the forces", CurveEnd.CORNER),
    )
    where: Chart
    sides: tuple[float, ...]  # signs of the system's switches, which it is continued across
    rate: float  # [1/s] of the linear oscillation, roughly: the unit of time
    weight: float = 1.0  # of the last equation

    def values(self, u):
        out = _hopf(*self._numbers(), jnp.asarray(u))
        values, jacobian = np.array(out[0]), np.array(out[1])
        if not (np.all(np.isfinite(values)) and np.all(np.isfinite(jacobian))):
            raise Lost("steady slip has no finite linearisation there")
        values[-1] *= self.weight
        jacobian[-1] *= self.weight
        return values, jacobian, None

    def facts(self, u, more):
        here = self._expanded(u)
        square = opposite_pair(here.first)
        period = lyapunov = np.nan
        if square > 0:
            period = 2 * np.pi / (np.sqrt(square) * self.rate)
            lyapunov = first_lyapunov(here.first, np.sqrt(square), here.second, here.third)
        test = {
            "bautin": lyapunov,
            "double_zero": square,
            "lift_off": float(here.normal_force),
            "rest": float(here.slip_speed),
            "shoulder": float(np.min(here.room, initial=1.0)),
        }
        return Facts(here.state, 0.0, period, test)

    def centred(self, facts, place):
        where = chart(self.plane.at(place), facts.state, 0.0, self.where.regime, self.where.scale)
        start = np.concatenate([np.zeros(where.basis.shape[1]), place / self.plane.scale])
        moved = replace(self, where=where, start=start, weight=1.0)
        steepness = float(np.linalg.norm(moved.values(start)[1][-1]))
        if steepness == 0:
            raise Lost("no number changes the growth of oscillations there")
        return replace(moved, weight=1 / steepness)

    def beyond(self, spot, test):
        if test.end != CurveEnd.CORNER:
            return None
        here = self._expanded(spot.unknowns)
        k = int(np.argmin(here.room))
        if here.ends[k]:
            return None
        sides = tuple(-side if i == k else side for i, side in enumerate(self.sides))
        try:
            other = replace(self, sides=sides).centred(spot.facts, spot.place)
        except Lost:
            return None
        along = null(other.values(other.start)[1], np.ones(len(other.start)))
        found = solve(other, other.start, along)
        if found is None or np.linalg.norm(found.unknowns - other.start) > SAME:
            return None  # the linearisation jumps
        for tangent in (found.tangent, -found.tangent):
            inside = solve(other, found.unknowns + INSIDE * tangent, tangent)
            if inside is not None and inside.facts.test["shoulder"] > 0:
                return inside
        return None

    @property
    def sizes(self):
        return 1.0, 1 / self.rate

    def spread(self, tangent):
        state = self.where.basis @ tangent[:-2] / self.where.scale
        return np.concatenate([state, tangent[-2:]])

    def _expanded(self, u) -> "Expansion":
        return Expansion(*(np.asarray(x) for x in _expansion(*self._numbers(), jnp.asarray(u))))

    def _numbers(self):
        w, plane, sides = self.where, self.plane, tuple(float(s) for s in self.sides)
        where = w.origin, w.basis, w.scale, w.regime
        return plane.system, plane.ways, plane.scale, *where, jnp.asarray(sides), self.rate


def _field(system, ways, scale, origin, basis, sizes, regime, sides, rate):
    """Return (w, p) -> (state, its change in the coordinates w) within ``regime``."""
    time = jnp.zeros(())

    def local(p):
        found = placed(system, ways, p * scale)
        found = found.prepared().on_piece(found.first_piece(time))
        return found.on_sides(tuple(sides)) if len(sides) else found

    def state(w, p):
        return tidy(local(p), time, origin + basis @ w, regime)

    def contacts(w, p):
        n = len(sizes) // 2
        here, z = local(p), state(w, p)
        q = tuple(z[:n])
        return here, q, here.from_rates(time, q, tuple(z[n:]))

    def change(w, p):
        here, q, v = contacts(w, p)
        read = basis.T / sizes**2
        inner = read @ jax.jacfwd(state)(w, p)
        return jnp.linalg.solve(inner, read @ flow(here, time, q, v, regime)) / rate

    return state, contacts, change


@Kept
def _hopf(system, ways, scale, origin, basis, sizes, regime, sides, rate, u):
    change = _field(system, ways, scale, origin, basis, sizes, regime, sides, rate)[2]

    def values(u):
        w, p = u[:-2], u[-2:]
        return jnp.append(change(w, p), pair_sums(jax.jacfwd(change)(w, p)))

    return values(u), jax.jacfwd(values)(u)


class Expansion(NamedTuple):
    """The motion about an equilibrium."""

    state: np.ndarray  # (2n,)
    first: np.ndarray  # derivatives of the motion, (m, m)
    second: np.ndarray
    third: np.ndarray
    normal_force: np.ndarray
    slip_speed: np.ndarray  # in the sense of the slip: above 0
    room: np.ndarray  # switches times the signs that are supposed: above 0
    ends: np.ndarray  # whether the model ends at their zeros


@Kept
def _expansion(system, ways, scale, origin, basis, sizes, regime, sides, rate, u):
    state, contacts, change = _field(system, ways, scale, origin, basis, sizes, regime, sides, rate)
    w, p = u[:-2], u[-2:]
    first = jax.jacfwd(change)
    second = jax.jacfwd(first)
    here, q, v = contacts(w, p)
    time = jnp.zeros(())
    c = contact(here, time, q, v)
    normal = forces(here, c, regime).normal
    slip = jnp.where(here.law is None, 1.0, slip_sign(regime) * c.slip_speed)
    room = sides * jnp.stack([jnp.zeros(()), *here.switches(time, q, v)])[1:]
    ends = jnp.stack([jnp.zeros((), bool), *here.ends(time, q, v)])[1:]
    derivatives = first(w, p), second(w, p), jax.jacfwd(second)(w, p)
    return state(w, p), *derivatives, normal, slip, room, ends


def pair_sums(matrix):
    """Product of the sums of all pairs of eigenvalues of ``matrix`` (m, m).

    The determinant of X -> A X + X A^T on the antisymmetric matrices X.
    """
    m = matrix.shape[0]
    pairs = list(combinations(range(m), 2))
    basis = np.zeros((len(pairs), m, m))
    for k, (i, j) in enumerate(pairs):
        basis[k, i, j], basis[k, j, i] = 1.0, -1.0
    image = matrix @ basis + basis @ matrix.T
    rows, columns = np.array(pairs).T
    return jnp.linalg.det(image[:, rows, columns])


def opposite_pair(matrix: np.ndarray) -> float:
    """Return the product of the two eigenvalues that come nearest to x and -x.

    Above zero they are an imaginary pair, and it is the square of their frequency; below zero they
    are real, and nothing oscillates.
    """
    values = np.linalg.eigvals(matrix)
    one, two = min(combinations(values, 2), key=lambda pair: abs(pair[0] + pair[1]))
    return float(np.real(one * two))


def first_lyapunov(matrix, omega: float, second, third) -> float:
    """Return the first Lyapunov coefficient of a Hopf point: below 0, the cycles are stable.

    Arguments: the linearisation (m, m) with eigenvalues +- i ``omega``, and the second and third
    derivatives (m, m, m) and (m, m, m, m), those by the coordinates last.
    """

    def vector(a, value):
        values, vectors = np.linalg.eig(a)
        return vectors[:, np.argmin(np.abs(values - value))]

    q, p = vector(matrix, 1j * omega), vector(matrix.T, -1j * omega)
    p = p / np.conj(np.vdot(p, q))  # <p, q> = 1

    def bilinear(x, y):
        return np.einsum("ijk,j,k", second, x, y)

    mean = np.linalg.solve(matrix, bilinear(q, q.conj()))
    twice = np.linalg.solve(2j * omega * np.eye(len(matrix)) - matrix, bilinear(q, q))
    cubic = np.einsum("ijkl,j,k,l", third, q, q, q.conj())
    inner = cubic - 2 * bilinear(q, mean) + bilinear(q.conj(), twice)
    return float(np.real(np.vdot(p, inner)) / (2 * omega))
