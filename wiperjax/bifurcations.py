"""What can happen to a cycle along a branch: multipliers that cross, and events that change.

Where the events keep their order the return map is smooth, and a test function changes its sign.
Where they change it has a corner, named by what comes or goes.
"""

from collections.abc import Callable
from difflib import SequenceMatcher
from typing import NamedTuple

import numpy as np

from .branch_step import Step
from .cycles import Cycle


class Special(NamedTuple):
    """A special point of a branch."""

    kind: str
    detail: str  # what changes
    parameter: float
    index: int  # of the branch's point there


def same_word(a: Cycle, b: Cycle) -> bool:
    """Whether two cycles pass the same events in the same order, wherever they start."""
    one = list(zip(a.word.split(), strict=True))
    two = list(zip(b.word.split(), strict=True))
    turned = any(one == two[k:] + two[:k] for k in range(max(1, len(two))))
    return turned and sorted(a.regimes.split()) == sorted(b.regimes.split())


def _determinant(sign: float) -> Callable[[Step], float]:
    def test(step: Step) -> float:
        values = step.cycle.multipliers
        assert values is not None
        return float(np.real(np.prod(values + sign)))

    return test


def _products(step: Step) -> float:
    """Zero where two multipliers have the product 1."""
    values = step.cycle.multipliers
    assert values is not None
    pairs = [a * b - 1 for i, a in enumerate(values) for b in values[i + 1 :]]
    return float(np.real(np.prod(pairs))) if pairs else np.nan


def turning(cycle: Cycle) -> bool:
    """Whether a complex pair lies on the unit circle."""
    values = cycle.multipliers
    assert values is not None
    return bool(np.any((np.abs(np.abs(values) - 1) < 1e-4) & (np.abs(np.imag(values)) > 1e-6)))


TESTS: tuple[tuple[str, str, Callable[[Step], float]], ...] = (
    ("fold", "the branch turns back", lambda step: step.sense),
    ("period_doubling", "a multiplier passes -1", _determinant(1.0)),
    ("neimark_sacker", "a complex pair passes the unit circle", _products),
)


def change(cycle: Cycle, word: str) -> str:
    """Return what separates two words of events, as text: ``-kink -kink +capture``."""
    before, after = cycle.word.split(), word.split()
    parts = []
    for deed, a, b, c, d in SequenceMatcher(None, before, after, autojunk=False).get_opcodes():
        if deed != "equal":
            parts += [f"-{name}" for name in before[a:b]] + [f"+{name}" for name in after[c:d]]
    return " ".join(parts)


def corner_kind(one: Cycle, two: Cycle) -> str:
    """Return the name of the change between the words of two neighbouring cycles.

    The four sliding bifurcations after di Bernardo, Kowalczyk and Nordmark (2002): what they call
    sliding is stick here. ``grazing`` is a contact or an impact that begins with zero speed;
    ``shoulder`` a smooth passage over a switching function of the system.
    """
    short, long = sorted((one, two), key=lambda c: len(c.word.split()))
    extra = change(short, long.word).split()
    names = {part[1:] for part in extra}
    if names <= {"kink", "belt_kink", "belt_reversal"}:
        return "shoulder"
    if names & {"lift_off", "impact", "zeno", "touch"}:
        return "grazing"
    a, b = short.regimes.split(), long.regimes.split()
    for deed, _, _, k, m in SequenceMatcher(None, a, b, autojunk=False).get_opcodes():
        if deed == "equal" or m == k:
            continue
        inner, left, right = b[k:m], b[k - 1], b[m % len(b)]
        if "stick" in inner:
            return "grazing_sliding" if left == right else "crossing_sliding"
        return (
            "switching_sliding" if "stick" in (left, right) and left != right else "adding_sliding"
        )
    return "grazing_sliding" if "capture" in names else "crossing_sliding"
