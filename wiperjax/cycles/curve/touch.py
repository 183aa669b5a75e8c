"""The curve of grazing-sliding folds: cycles in whose slip the tip comes to rest on the glass.

There the branch turns back at a corner, so the place is come to from the side without that stick,
where all is smooth: the smallest slip speed within slip is held at a small part of the largest,
then at a tenth and at a hundredth of that, and continued to zero at each point.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ...contact.space import contact
from ...numerics.kept import Kept
from ...vocabulary.codes import CurveEnd
from ..orbit import slip_minimum
from ..return_map import Shooting
from ..shooting import Arc, Lost, at_state, flow
from .equations import Spot, Test, solve
from .of_cycles import OfCycles
from .plane import placed

AWAY = 5e-3  # of the largest slip speed: what is left of it where the curve is walked, about
SMALL = 1e-10  # of the largest slip speed: how well its smallest value is told
CENTRED = 4  # motions to where it is
GONE = "slip nowhere slows down and speeds up again"
NEARER = (5e-4, 5e-5)  # and nearer to its limit, and nearest
LONGEST = 0.9  # of what is left of it: where the shortest stride towards the limit fails
ROUNDING = 1e-9  # of the nearest: strides that multiply to it end so near
AGREED = 1e-3  # of a range: how near the limit is to that of a cubic from ten times as far away
STEEP = 0.05  # of what a parameter counts for: all else, where the place along the curve is told


@dataclass(frozen=True)
class Touch(OfCycles):
    """Cycles whose smallest slip speed inside slip is ``left`` times ``speed``."""

    kind: ClassVar[str] = "grazing_sliding_fold"
    tests: ClassVar[tuple[Test, ...]] = (
        Test("smooth", "a multiplier is 1 before stick begins", CurveEnd.OTHER_FOLD),
    )
    speed: float = 1.0  # [m/s]
    left: float = AWAY

    def values(self, u):
        residual, jacobian, motion = self.returned(u)
        lowest, row = self._lowest(u, motion)
        more = residual, jacobian, motion
        values = np.append(residual, lowest / self.speed - self.left)
        return values, np.vstack([jacobian, row / self.speed]), more

    def _lowest(self, u, motion: Arc) -> tuple[float, np.ndarray]:
        """Return the smallest slip speed inside slip and its derivatives by the unknowns.

        Where it is smallest its derivative by time is zero: the derivatives at a fixed share of the
        period are all.
        """
        found = slip_minimum(motion)
        if found is None:
            raise Lost(GONE)
        (part, regime), width = found, 1 / (len(motion.times) - 1)
        place, d, period = self.place(u), self.where.basis.shape[1], self.period(u)
        pair, slopes = self.pair(place), (0.0, 0.0)
        if self.shooting.clock is not None:
            period = pair[0].driven_period(place[0])[0]
            slopes = tuple(p.driven_period(x)[1] for p, x in zip(pair, place, strict=True))
        start = self.where.state(u[:d])

        def moved(shooting: Shooting) -> Arc:
            stretch = {"phase": self.phase, "part": part, "regime": self.where.regime}
            return shooting.motion(shooting.system, start, period, **stretch)

        for _ in range(CENTRED):
            arc = moved(pair[0])
            time = jnp.asarray((self.phase + part) * period)
            numbers = jnp.asarray(place), jnp.asarray(arc.state), time, jnp.asarray(regime)
            out = _slip(self.plane.system, self.plane.ways, *numbers)
            speed, by, rate, jerk = (np.asarray(x) for x in out)
            if rate**2 < 2 * SMALL * self.speed * abs(jerk):
                break
            part -= float(rate / jerk) / period
            if not abs(part - found[0]) < width:
                raise Lost(GONE)
        by_place, by_state, by_time = by[:2], by[2:-1], by[-1]
        by_period = by_state @ arc.by_period + by_time * (self.phase + part)
        row = [by_state @ (arc.by_state @ self.where.basis)]
        if self.shooting.clock is None:
            row.append(by_period * self.shooting.period_scale)
        for k, each in enumerate((arc, moved(pair[1]))):
            by_number = by_state @ each.by_parameter + by_place[k] + slopes[k] * by_period
            row.append(by_number * self.plane.scale[k])
        sign = np.sign(speed)
        return float(sign * (speed - rate**2 / (2 * jerk))), sign * np.hstack(row)

    def facts(self, u, more):
        cycle = self.cycle(u, *more)
        assert cycle.multipliers is not None
        return self.known(cycle, {"smooth": float(np.real(np.prod(1 - cycle.multipliers)))})

    def centred(self, facts, place):
        # near in the measure of this cycle: along a curve speeds may fall by orders of magnitude
        return replace(self.moved(facts, place), speed=fastest(facts.cycle))

    def same(self, one: Spot, two: Spot) -> bool:
        try:
            return super().same(one, two) and two.meant is not None
        except Lost:
            return False

    def limit(self, spot: Spot) -> Spot:
        """Raises `Lost` where it can not be come to: a guess from afar may be anywhere."""
        held, ends = _held(spot), [spot]
        for left in NEARER:  # the same ones at each point: what a cubic is off changes smoothly
            ends.append(self._drawn(ends[-1], held, left))
        afar, rest = _at_rest(ends[:2], held), _at_rest(ends[1:], held)
        if np.max(np.abs(rest - afar)[-2:]) > AGREED:
            raise Lost("cycles near rest do not tell where one comes to rest")
        facts = ends[-1].facts
        if self.shooting.clock is None:
            facts = facts._replace(period=self.period(rest))
        return replace(ends[-1], unknowns=rest, facts=facts)

    def _drawn(self, spot: Spot, held: np.ndarray, left: float) -> Spot:
        """Return the cycle that has the share ``left`` of slip speed, in as many strides as it
        takes. Raises `Lost` where there is none."""
        here, stride = spot, left / spot.equations.left  # type: ignore[attr-defined]
        # what ends a rounding above is there: a stride of no length gives no direction
        while here.equations.left > left * (1 + ROUNDING):  # type: ignore[attr-defined]
            nearer = self._nearer(here, held, max(left, stride * here.equations.left))  # type: ignore[attr-defined]
            if nearer is not None:
                here = nearer
            elif stride < LONGEST:
                stride = np.sqrt(stride)
            else:
                raise Lost("no cycle was found nearer to rest")
        return here

    def _nearer(self, spot: Spot, held: np.ndarray, left: float) -> Spot | None:
        """Return the cycle that has the share ``left`` of slip speed, from one that has more."""
        equations = replace(spot.equations, left=left)  # type: ignore[type-var]
        guess = spot.unknowns + _slope(spot, held) * (left - spot.equations.left)  # type: ignore[attr-defined]
        found = solve(equations, guess, held, float(held @ spot.unknowns))
        return found if found is not None and super().same(spot, found) else None


def _held(spot: Spot) -> np.ndarray:
    """Return what is kept on the way to rest: the place along the curve, in the parameters before
    all, so that these go straight to it. Else the way may lead far along it.

    One measure at all places: of two, the ends of the ways would not be in the order of the curve.
    """
    along = spot.tangent.copy()
    along[:-2] *= STEEP**2
    return along / np.linalg.norm(along)


def _slope(spot: Spot, held: np.ndarray) -> np.ndarray:
    """Return the derivative of the unknowns by the share of slip speed that is left."""
    square = np.vstack([spot.jacobian, held])
    return np.linalg.solve(square, np.eye(len(square))[-2])


def _at_rest(spots: list[Spot], held: np.ndarray) -> np.ndarray:
    """Return the unknowns where no slip speed is left, by a cubic through two spots."""
    lefts = np.array([spot.equations.left for spot in spots])  # type: ignore[attr-defined]
    slopes = [-_slope(spot, held) for spot in spots]
    return CubicHermiteSpline(-lefts, [spot.unknowns for spot in spots], slopes)(0.0)


def fastest(cycle) -> float:
    """Return the largest slip speed of a cycle."""
    return float(np.max(np.abs(cycle.motion.slip_speed)))


@Kept
def _slip(system, ways, place, state, time, regime):
    """Slip speed, its derivatives by (place, state, time), and its first two derivatives by time
    along the motion within ``regime``."""

    def speed(place, state, time):
        here, q, v = at_state(placed(system, ways, place), time, state)
        return contact(here, time, q, v).slip_speed

    def motion(state, time):
        here, q, v = at_state(placed(system, ways, place), time, state)
        return flow(here, time, q, v, regime)

    def rate(state, time):
        change = motion(state, time), jnp.ones(())
        return jax.jvp(lambda s, t: speed(place, s, t), (state, time), change)[1]

    change = motion(state, time), jnp.ones(())
    first, second = jax.jvp(rate, (state, time), change)
    by = jax.grad(speed, argnums=(0, 1, 2))(place, state, time)
    return speed(place, state, time), jnp.concatenate([by[0], by[1], by[2][None]]), first, second
