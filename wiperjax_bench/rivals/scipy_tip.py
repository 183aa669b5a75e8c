"""The tip of one cell between two phases: where it is, in which regime, and how events change it.

The equations are the compiled ones of `scalar`; so this file needs numba, `scipy_phases` does not.
"""

import math
from typing import NamedTuple

from ..scalar import model as m


class Cell(NamedTuple):
    """What is given of one cell. SI units."""

    blade: m.Blade
    pieces: list[m.Motion]  # of the belt
    breaks: list[float]  # ends of the pieces, the last beyond the trajectory's
    break_kinds: list[int]
    start: list[float]  # x, y, x', y'
    scales: tuple[float, float]  # m, m/s: absolute tolerances are rtol times these


class Tip:
    """Where the tip of a cell is, and in which regime; it changes from phase to phase."""

    def __init__(self, cell: Cell):
        self.cell, self.blade = cell, cell.blade
        self.t, self.piece = 0.0, 0
        self.x, self.y, self.u, self.vy = cell.start
        self.w = self.u - self.speed()
        theta = math.asin(self.x / self.blade.length) - self.blade.alpha
        self.zone = int(theta > self.blade.phi_s) - int(theta < -self.blade.phi_s)
        self.regime = m.FLIGHT if (self.y > 0 or self.vy != 0) else self.closed(self.w)

    @property
    def belt(self) -> m.Motion:
        """The piece of the belt's motion that holds now."""
        return self.cell.pieces[self.piece]

    def speed(self) -> float:
        """Return V now."""
        return m.belt(self.belt, self.t)[0]

    def sides(self) -> list[int]:
        """Return the shoulders that end the zone: the neck ends at both, a shoulder at its own."""
        return [side for side in (1, -1) if self.zone in (0, side)]

    def edge(self, side: int) -> float:
        """Return x of a shoulder."""
        return self.blade.x_high if side == 1 else self.blade.x_low

    def closed(self, w: float) -> int:
        """Return the regime of a closed contact that slips at ``w``."""
        if w == 0.0:
            return m.regime_at_rest(self.blade, self.belt, self.zone, self.t, self.x)
        phi = math.asin(self.x / self.blade.length)
        belt = m.belt(self.belt, self.t)
        n = m.slip_rate(self.blade, 0.0, 0.0, 1.0, self.x, phi, w, *belt)[3]
        return m.FLIGHT if n <= 0 else (m.SLIP_POS if w > 0 else m.SLIP_NEG)

    def arrive(self, place, reached: float, t: float) -> None:
        """Move to ``place``, where the phase ends at ``t`` (``reached``, but for rounding)."""
        origin, begun = self.x, self.t
        self.x, self.y, self.u, self.vy = (float(c) for c in place)
        if self.regime == m.STICK:
            self.x = origin + m.carried(self.belt, begun, reached)[0]
        self.t = t
        self.w = 0.0 if self.regime == m.STICK else self.u - self.speed()

    def pass_break(self) -> int:
        """Go on to the next piece of the belt; return the kind of the event."""
        kind = self.cell.break_kinds[self.piece]
        self.piece += 1
        if self.regime == m.STICK:
            self.regime = self.closed(0.0)
        self._tidy()
        return kind

    def cross(self, hit: int, contact: int) -> int:
        """Change as guard ``hit`` says, the first ``contact`` of them the regime's own; return the
        kind of the event.
        """
        sides = self.sides()
        if hit == contact + len(sides):
            return m.COLLAPSE
        kind = self._turn_shoulder(sides[hit - contact]) if hit >= contact else self._contact(hit)
        self._tidy()
        return kind

    def _turn_shoulder(self, side: int) -> int:
        self.x = self.edge(side)
        self.zone = side if self.zone == 0 else 0
        return m.KINK

    def _contact(self, hit: int) -> int:
        if self.regime == m.STICK:
            self.regime = (m.SLIP_NEG, m.SLIP_POS)[hit]
            return m.RELEASE
        if self.regime == m.FLIGHT:
            return self._strike()
        if hit == 1:
            self.regime = m.FLIGHT
            return m.LIFT_OFF
        self.w, before = 0.0, self.regime
        self.regime = self.closed(0.0)
        kinds = {m.STICK: m.CAPTURE, m.FLIGHT: m.LIFT_OFF, before: m.TOUCH}
        return kinds.get(self.regime, m.REVERSAL)

    def _strike(self) -> int:
        """Impact, the limit of a sequence of them included."""
        p, x, w = self.blade, self.x, self.w
        v, a = m.belt(self.belt, self.t)
        mu = m.friction(p, abs(w)) if w != 0.0 else p.mu_s
        push = -(1 + p.e) * self.vy
        w -= min(max(w, -mu * push), mu * push)
        vy = -p.e * self.vy
        phi = math.asin(x / p.length)
        _, free, lift = m.flight_rate(p, *self.spring(), x, phi, 0.0, w + v, 0.0)
        self.w, self.y, self.vy = w, 0.0, vy
        if vy <= 0:
            self.regime, self.vy = self.closed(w), 0.0
            return m.IMPACT
        if not (lift < 0 and p.e < 1 and 2 * vy < 1e-8 * -lift):
            self.regime = m.FLIGHT
            return m.IMPACT
        last = 2 * vy / -lift / (1 - p.e)
        s = math.copysign(1.0, w) if w != 0.0 else 0.0
        after = w + (free - a) * last - s * mu * (-lift * last - vy)
        self.w, self.vy = after if s * after > 0 else 0.0, 0.0
        self.regime = self.closed(self.w)
        self.t, self.x = self.t + last, x + last * (w + v)
        return m.ZENO

    def spring(self):
        """Return (kz, mz) of the branch of the rotational spring."""
        return m.spring(self.blade, self.zone)

    def _tidy(self) -> None:
        self.u = self.w + self.speed()
        if self.regime != m.FLIGHT:
            self.y = self.vy = 0.0
