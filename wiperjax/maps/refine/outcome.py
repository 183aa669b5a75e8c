"""What a refinement found: points on borders, and how far it can be believed."""

from typing import Any, NamedTuple

import numpy as np
from scipy.stats import binomtest

from ...vocabulary.codes import CROSSINGS

STEEP = 0.25  # of the change along the whole edge within one bracket: a number that jumps


class Outcome(NamedTuple):
    """Points on borders, (points,) each, and a report."""

    place: np.ndarray  # (points, dim), steps of the grid
    axis: np.ndarray  # along which they are enclosed
    low: np.ndarray  # steps of the grid along it, ends of the bracket
    high: np.ndarray
    code_low: np.ndarray
    code_high: np.ndarray
    kind: np.ndarray  # of CROSSINGS
    level: np.ndarray  # of the cube's edge that it lies on
    report: dict[str, Any]

    @classmethod
    def of(cls, search: Any, pairs: Any, irregular: np.ndarray, edges: Any) -> "Outcome":
        """Of a `Search`, the unlike neighbours on its edges, and which lie on irregular ones."""
        grid, known, facts = search.grid, search.known, search.known.facts
        axis = edges.axis[pairs.edge]
        place = grid.places(known.index[pairs.low]).astype(float)
        rows = np.arange(len(axis))
        low = place[rows, axis]
        share = search.share(pairs)
        smooth = np.isfinite(share) & ~_steep(search, pairs, edges)
        place[rows, axis] += np.where(smooth, share, 0.5) * pairs.gap
        wide = pairs.gap > search.wanted[axis]
        kind = np.select(
            [irregular, wide, smooth],
            [CROSSINGS["irregular"], CROSSINGS["unresolved"], CROSSINGS["smooth"]],
            default=CROSSINGS["jump"],
        )
        level = np.log2(grid.width / edges.length[pairs.edge]).astype(np.int8)
        # an edge of a large cube and one of a small one beside it may hold the same bracket
        order = np.argsort(-level, kind="stable")
        _, first = np.unique(
            known.index[pairs.low][order] * grid.dim + axis[order], return_index=True
        )
        keep = order[first]
        rows = (
            *(place, axis, low, low + pairs.gap),
            *(facts.code[pairs.low], facts.code[pairs.high], kind, level),
        )
        return cls(*(values[keep] for values in rows), report=_report(search, kind[keep]))


def _steep(search: Any, pairs: Any, edges: Any) -> np.ndarray:
    """Whether a number changes within a bracket by much of what it changes along the edge."""
    grid, known, number = search.grid, search.known, search.known.facts.number
    start, length = edges.start[pairs.edge], edges.length[pairs.edge]
    ends = known.find(start), known.find(start + length * grid.strides[edges.axis[pairs.edge]])
    with np.errstate(invalid="ignore"):
        across = np.abs(number[ends[1]] - number[ends[0]])
        inside = np.abs(number[pairs.high] - number[pairs.low])
        return (inside > STEEP * across) & (8 * pairs.gap <= length)


def share_of(wrong: np.ndarray) -> tuple[int, int, float]:
    """How many were looked at, how many were wrong, and the share of wrong ones that is exceeded
    with a probability of 5 % at most (Clopper and Pearson, Biometrika 26 (1934) 404).
    """
    if not len(wrong):
        return 0, 0, 1.0
    found = binomtest(int(wrong.sum()), len(wrong), alternative="less")
    return len(wrong), int(wrong.sum()), float(found.proportion_ci(0.95, "exact").high)


def _report(search: Any, kind: np.ndarray) -> dict[str, Any]:
    """Attributes of a refinement: what it took, and what it can promise."""
    grid, known = search.grid, search.known
    fine = [int(n) for n in np.ceil((grid.shape - 1) / search.wanted) + 1]
    report: dict[str, Any] = {
        "simulations": search.used,
        "map_cells": int(np.prod(grid.coarse)),
        "full_grid_cells": float(np.prod([float(n) for n in fine])),
        "budget_spent": int(search.spent),
        "unsettled_points": int((~known.facts.settled & known.facts.longer).sum()),
        "lengthened_points": int(known.facts.longer.sum()),
        "cubes": len(search.cubes),
        "cubes_with_border": int((~search.pure()).sum()),
        "cubes_left_wrong": search.left,
    }
    for name, code in CROSSINGS.items():
        report[f"{name}_points"] = int((kind == code).sum())
    for name, (count, wrong, bound) in search.shares.items():
        report[f"{name}s"] = count
        report[f"{name}s_wrong"] = wrong
        report[f"{name}s_wrong_share_at_most"] = bound
    report["border_probes_wrong_within_brackets"] = search.farthest
    return report
