"""Which cubes hold what the points on their edges tell, and which do not.

A cube is believed if it has one border, a plane; if points were looked at on either side of it; and
if every known point in it is told right, but for those right beside it. Its stated bracket is then
that of the points. Of a cube that is not believed no more is said than that a border is in it: its
stated bracket is the cube.
"""

import itertools

import numpy as np

from .view import View

OFF = 0.75  # brackets from the plane at which a surface is tested
CLEAR = 0.5  # brackets from the plane, from which on known points must be told right
UNCLEAR = 1.0  # brackets: root mean square distance of crossings that no plane fits

REASONS = {
    "irregular": "at or beside irregular motion",  # an edge where the answer changes to and fro
    "unresolved": "not looked at to the end",  # a bracket was not reached, or a test not made
    "meeting": "of more than two answers",
    "unsettled": "with answers that are not settled",  # beside the border
    "bent": "whose border is no plane",  # a cube beside it where none is seen may hide a part of it
}
"""Why a cube is not believed -> what a person is told of such cubes."""


def tests(now: View) -> tuple[np.ndarray, np.ndarray]:
    """Points beside the planes, each within the answer of one, by number, and their cubes."""
    cubes, surfaces = now.cubes, now.surfaces
    good = (surfaces.rest <= UNCLEAR) & ~(now.irregular | now.busy)[surfaces.cube]
    cube, answer = surfaces.cube[good], surfaces.code[good]
    place = (surfaces.middle[good] + OFF * surfaces.normal[good]) * now.wanted
    low, best = cubes.origin[cube], np.full(len(cube), np.inf)
    found = np.zeros(place.shape, dtype=np.int64)
    for step in itertools.product((0, 1), repeat=now.grid.dim):  # of those around, the closest
        near = np.clip(np.floor(place).astype(np.int64) + step, low, low + cubes.size[cube, None])
        code, depth = surfaces.answer(cube, near / now.wanted)
        better = (code == answer) & (depth > CLEAR) & (depth < best)
        best[better], found[better] = depth[better], near[better]
    some = np.isfinite(best)
    return now.grid.flat(found[some]), cube[some]


def bent(now: View) -> np.ndarray:
    """Cubes whose border is not what its edges tell: their crossings lie on no plane, or a known
    point in them is of another answer than told, and not beside the border.
    """
    found = np.zeros(len(now.cubes), dtype=bool)
    found[now.surfaces.cube[now.surfaces.rest > UNCLEAR]] = True
    places, code = now.grid.places(now.known.index), now.known.facts.code
    seen: list[np.ndarray] = []
    for back in itertools.product((0, 1), repeat=now.grid.dim):  # a point on a face is in both
        cube = now.cubes.locate(places - np.array(back))
        fresh = cube >= 0
        for other in seen:
            fresh &= cube != other
        seen.append(cube)
        here = np.flatnonzero(fresh)
        told, depth = now.told(cube[here], places[here])
        found[cube[here[(told != code[here]) & (depth > CLEAR)]]] = True
    return found


def meeting(now: View) -> np.ndarray:
    """Cubes with more than two answers on their edges."""
    return np.bincount(now.surfaces.cube, minlength=len(now.cubes)) > 2


def reasons(now: View) -> np.ndarray:
    """Why each cube is not believed: 1 + its place in `REASONS`, 0 for those that are."""
    facts, pairs = now.known.facts, now.pairs
    index, cube = tests(now)
    untested = np.zeros(len(now.cubes), dtype=bool)
    untested[cube[now.known.find(index) < 0]] = True
    folded = bent(now)
    unsettled = ~(facts.settled[pairs.low] & facts.settled[pairs.high])
    masks = {
        "irregular": now.cubes.touching(now.irregular),
        "unresolved": now.busy | untested,
        "meeting": meeting(now),
        "unsettled": now.with_pairs(now.mixed & unsettled),
        "bent": folded | (now.pure & now.cubes.touching(folded)),
    }
    return np.select([masks[name] for name in REASONS], range(1, len(REASONS) + 1), default=0)
