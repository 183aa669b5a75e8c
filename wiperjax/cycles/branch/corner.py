"""A corner of a branch, where the order of events changes: where it is, and what lies beyond it.

On either side the return map is smooth, and the branch arrives and leaves with the derivatives of
that side. It may go on, or turn back on the spot: no continuity tells which, only where cycles of
the new word are.
"""

from dataclasses import replace
from itertools import product

import numpy as np

from ..cycle import same_word
from ..orbit import words
from ..return_map import Shooting
from ..shooting import Lost
from ..walk import GENTLE
from .bifurcations import change
from .step import LOCATED, BranchStep, ahead_of, centred, direction, near, place

LOOKED = (1e-5, 1e-4, 1e-3, 1e-2)  # how far ahead the other side of a corner is looked for
JOINED = 3e-3  # how near to its corner a branch begins; further away it is followed back
CLOSER = 0.1  # of that, and of a step: where cycles of many hits lie close together
BACK = 0.25  # of the way to a corner: at half of it the tangent of a root grazes no more
SHORT = 1e-2  # of the longest step: where this one fails, the branch does not go on smoothly


def smooth(shooting: Shooting, here: BranchStep, ahead: BranchStep | None) -> bool:
    """Whether the branch goes on smoothly from ``here`` to ``ahead``: same word, gentle turn."""
    if ahead is None or not same_word(here.cycle, ahead.cycle):
        return False
    return float(direction(shooting, here) @ direction(shooting, ahead)) > GENTLE


def edge_of(shooting: Shooting, here: BranchStep, length: float) -> BranchStep:
    """Return the last step within ``length`` that the branch comes to smoothly, by bisection."""
    edge, low, high = here, 0.0, length
    while high - low > LOCATED:
        middle = 0.5 * (low + high)
        step = ahead_of(shooting, here, middle)
        if step is not None and smooth(shooting, here, step) and here.index * step.index >= 0:
            edge, low = step, middle
        else:
            high = middle
    return edge


def beyond(shooting: Shooting, edge: BranchStep, longest: float) -> list[BranchStep] | str:
    """Return the first steps of the branch beyond a corner, or why there are none.

    Steps are no longer than ``longest``. Where other cycles lie as near as those behind the corner,
    they are looked for nearer to it; what is found from afar alone is returned all the same.
    """
    way = _beyond(shooting, edge, longest, JOINED)
    if isinstance(way, str) or not jumped(shooting, edge, way[0]):
        return way
    closer = _beyond(shooting, edge, CLOSER * longest, CLOSER * JOINED)
    return way if isinstance(closer, str) else closer


def jumped(shooting: Shooting, edge: BranchStep, other: BranchStep) -> bool:
    """Whether ``other`` may be of another piece of the branch than that behind the corner at
    ``edge``: one grazing brings or takes one hit, and cycles of many lie close together.
    """
    one, two = (step.cycle.word.split() for step in (edge, other))
    hits = [sum(word.count(name) for name in ("impact", "blow")) for word in (one, two)]
    if abs(hits[0] - hits[1]) < 2 or "zeno" in one + two:
        return False
    return _apart(shooting, edge, other) > CLOSER * JOINED


def _apart(shooting: Shooting, one: BranchStep, two: BranchStep) -> float:
    """Distance of two cycles, in scaled numbers."""
    return float(np.linalg.norm(place(shooting, two) - place(shooting, one)))


def _beyond(
    shooting: Shooting, edge: BranchStep, longest: float, near_by: float
) -> list[BranchStep] | str:
    """Return the first steps beyond a corner, the first of them within ``near_by``, or why not.

    A motion a little beyond, closed or not, has the new word: its derivatives give the tangent
    there. Of its two senses that one leads away on which there are cycles of a new word and of the
    same index. A branch comes to a grazing along motions that all but graze, and so its tangent may
    not lead beyond: from the start at the edge a step of the parameter alone does.
    """
    where, phase, start = edge.point.where, edge.point.phase, edge.point.unknowns
    d = where.basis.shape[1]
    alone, why = np.copysign(np.eye(len(start))[-1], edge.sense), ""
    for onward, size in product((edge.tangent, alone), LOOKED):
        u = start + size * onward
        period = shooting.period_of(where, u)
        try:
            parameter = float(u[-1] * shooting.parameter_scale)
            _, jacobian, motion = shooting.returned(where, phase, u[:d], period, parameter)
        except Lost as lost:
            why = str(lost)
            continue
        word, regimes = words(motion)
        if same_word(edge.cycle, replace(edge.cycle, word=word, regimes=regimes)):
            why = why or "no cycle beyond, though no event changes"
            continue
        tangent = np.linalg.svd(jacobian)[2][-1]
        aside = size * (onward - (onward @ tangent) * tangent)
        # a root (grazing impacts) needs a run-up, which leads deep enough without `aside`
        for length, off in ((size, aside), (10 * size, 0.0), (100 * size, 0.0)):
            for along in (tangent, -tangent):
                step = near(shooting, edge, start + off + length * along, along)
                if step is None or same_word(edge.cycle, step.cycle):
                    continue
                way = _joined(shooting, edge, step, longest, near_by)
                if edge.index * step.index >= 0 and way:
                    return way
        why = f"the events change ({change(edge.cycle, word)}), no cycle beyond"
    return why


def _joined(
    shooting: Shooting, edge: BranchStep, other: BranchStep, longest: float, near_by: float
) -> list[BranchStep]:
    """Return the steps from the corner at ``edge`` to ``other``; none if it lies on another branch.

    The branch is followed back from ``other``, ever nearer to the corner.
    """

    def far(step: BranchStep) -> float:
        return _apart(shooting, edge, step)

    way, length = [other], longest
    while far(way[-1]) > near_by:
        here = centred(shooting, way[-1])
        here = replace(here, tangent=-here.tangent, sense=-here.sense)
        length = min(length, BACK * far(here))
        ahead = ahead_of(shooting, here, length)
        if ahead is not None and smooth(shooting, here, ahead) and far(ahead) < far(here):
            way.append(replace(ahead, tangent=-ahead.tangent, sense=-ahead.sense))
        elif length > SHORT * longest:
            length *= 0.5
        else:
            return []
    return way[::-1]
