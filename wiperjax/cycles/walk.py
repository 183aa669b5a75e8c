"""The walk along solutions with one number free, in one direction, and both ways made one curve.

Pseudo-arclength continuation (Keller, in Applications of Bifurcation Theory, 1977): predict along
the tangent, correct at that distance; shorter where that fails, longer where the way is straight.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

from ..vocabulary.codes import CurveEnd
from .shooting import Lost

FIRST = 0.3  # of the longest step: the first one
GROWTH = 1.4  # of a step after a straight one
STRAIGHT = 0.98  # cosine of a turn after which steps grow
GENTLE = 0.8  # cosine of the largest turn within a step
ROOM = 0.3  # of an amplitude that may vanish: the longest step
P = TypeVar("P")


class AbstractWalk(ABC, Generic[P]):
    """One direction: its points (the first one too), special points, why it ended."""

    vanished: ClassVar[float]  # of the largest amplitude: the cycles shrink onto steady slip

    def __init__(self, longest: float, most: int):
        self.longest, self.most = longest, most
        self.points: list[P] = []
        self.special: list[Any] = []  # each with the `index` of its point
        self.end = ""  # why it ended
        self.code: CurveEnd | None = None  # the same, where it has a name
        self.largest = 0.0  # amplitude on the way

    def run(self, first: P) -> None:
        """Walk from ``first`` along its tangent."""
        self._append(first)
        length = FIRST * self.longest
        while not self.end:
            try:
                length = self._onward(length)
            except Lost as lost:
                self._stop(str(lost), CurveEnd.FAILED)
            if len(self.points) > self.most and not self.end:
                self._stop(f"{self.most} points: a longer step reaches farther", CurveEnd.POINTS)

    def _onward(self, length: float) -> float:
        """Go on by ``length``, or find out why not. Returns the length to go on with."""
        here = self._centred(self.points[-1])
        length = min(length, self.longest, self._room(here))
        way = self._ahead(here, length)
        if way is not None:
            self._take(here, *way, length)
            return length * (GROWTH if self._turn(here, way[0]) > STRAIGHT else 1.0)
        if length > self._shortest(here):
            return 0.5 * length
        return self._stuck(here, length)

    def _append(self, point: P) -> None:
        self.points.append(point)
        self.largest = max(self.largest, self._amplitude(point))

    def _stop(self, end: str, code: CurveEnd | None = None) -> None:
        self.end, self.code = end, code

    def _vanishing(self, here: P, ahead: P) -> float | None:
        """Return how far behind ``ahead`` the amplitude vanishes, whose square is linear there, in
        ways from ``here`` to ``ahead``; None where it does not, or is not small yet."""
        one, two = self._amplitude(here), self._amplitude(ahead)
        if two >= one or two > self.vanished * self.largest:
            return None
        return two**2 / (one**2 - two**2)

    @abstractmethod
    def _amplitude(self, point: P) -> float: ...

    @abstractmethod
    def _centred(self, point: P) -> P:
        """Return ``point`` in coordinates around itself. Raises `Lost`."""

    @abstractmethod
    def _room(self, here: P) -> float:
        """Return the longest step from ``here`` on."""

    @abstractmethod
    def _shortest(self, here: P) -> float:
        """Return the length that a step which fails is not to be halved from."""

    @abstractmethod
    def _turn(self, here: P, ahead: P) -> float:
        """Return the cosine of the angle between the tangents of two neighbours."""

    @abstractmethod
    def _ahead(self, here: P, length: float) -> tuple[P, list] | None:
        """Return the point at a distance along the tangent, and the special points up to it, in
        order; None if the way does not go smoothly there."""

    @abstractmethod
    def _take(self, here: P, ahead: P, found: list, length: float) -> None:
        """Append the way to ``ahead``, up to where it ends, with the special points on it."""

    @abstractmethod
    def _stuck(self, here: P, length: float) -> float:
        """End, or go on in another way, where no step leads on smoothly. Returns the length to go
        on with."""


class BothWays(NamedTuple):
    """A walk in either direction, in order from the end of the one to the end of the other."""

    points: list
    special: list
    back: AbstractWalk  # the walk to the first point,
    ahead: AbstractWalk  # and that to the last one: the same if the curve is closed
    begin: int  # index of the point that both began at


def both_ways(walked: Callable[[float], AbstractWalk]) -> BothWays:
    """Return what is ``walked`` in the senses -1 and 1; a closed curve is walked once."""
    back = ahead = walked(-1.0)
    begin = len(back.points) - 1
    points = back.points[::-1]
    special = [s._replace(index=max(0, begin - s.index)) for s in reversed(back.special)]
    if back.code != CurveEnd.CLOSED:
        ahead = walked(1.0)
        points += ahead.points[1:]
        special += [s._replace(index=begin + s.index) for s in ahead.special]
    return BothWays(points, special, back, ahead, begin)
