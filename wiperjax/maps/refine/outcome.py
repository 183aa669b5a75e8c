"""What a refinement found: points on borders, and how far it can be believed."""

from typing import Any, NamedTuple

import numpy as np
from scipy.stats import binomtest

from ...vocabulary.codes import CROSSINGS
from .judge import REASONS

STEEP = 0.25  # of the change along the wide edge within one bracket: a number that jumps


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
    stated: np.ndarray  # the stated bracket, as a share of the axis in its scale
    report: dict[str, Any]

    @classmethod
    def of(cls, search: Any) -> "Outcome":
        """Of a `Search`, the unlike neighbours on its edges."""
        grid, known, facts = search.grid, search.known, search.known.facts
        now, edges = search.now, search.cubes.edges
        pairs = now.pairs.take(now.mixed)
        axis = edges.axis[pairs.edge]
        place = grid.places(known.index[pairs.low]).astype(float)
        rows = np.arange(len(axis))
        low = place[rows, axis]
        share = now.share(pairs)
        smooth = np.isfinite(share) & ~_steep(search, pairs, edges)
        place[rows, axis] += np.where(smooth, share, 0.5) * pairs.gap
        wide = pairs.gap > search.wanted[axis]
        kind = np.select(
            [now.crowded[pairs.edge], wide, smooth],
            [CROSSINGS["irregular"], CROSSINGS["unresolved"], CROSSINGS["smooth"]],
            default=CROSSINGS["jump"],
        )
        level = np.log2(grid.width / edges.length[pairs.edge]).astype(np.int8)
        # an edge of a large cube and one of a small one beside it may hold the same bracket
        order = np.argsort(-level, kind="stable")
        _, first, same = np.unique(
            (known.index[pairs.low] * grid.dim + axis)[order],
            return_index=True,
            return_inverse=True,
        )
        keep = order[first]
        stated = search.wanted[axis[keep]]
        np.maximum.at(stated, same, _stated(search)[pairs.edge[order]])
        wide_points = int((stated > search.wanted[axis[keep]]).sum())
        length = grid.lengths(grid.places(known.index[pairs.low[keep]]))
        stated = stated * length[np.arange(len(keep)), axis[keep]] / (grid.shape - 1)[axis[keep]]
        rows = (
            *(place, axis, low, low + pairs.gap),
            *(facts.code[pairs.low], facts.code[pairs.high], kind, level),
        )
        kept = [values[keep] for values in rows]
        return cls(*kept, stated=stated, report=_report(search, kind[keep], wide_points))


def _stated(search: Any) -> np.ndarray:
    """Size of the largest cube on each edge that is not believed, 0 for none, (edges,)."""
    of = search.cubes.edges.of
    size = np.where(search.why > 0, search.cubes.size, 0)
    found = np.zeros(len(search.cubes.edges.axis), dtype=np.int64)
    np.maximum.at(found, of.ravel(), np.repeat(size, of.shape[1]))
    return found


def _steep(search: Any, pairs: Any, edges: Any) -> np.ndarray:
    """Whether a number changes within a bracket by much of what it changes along the edge."""
    grid, known, number = search.grid, search.known, search.known.facts.number
    start, length = edges.start[pairs.edge], edges.length[pairs.edge]
    ends = known.find(start), known.find(start + length * grid.strides[edges.axis[pairs.edge]])
    with np.errstate(invalid="ignore"):
        across = np.abs(number[ends[1]] - number[ends[0]])
        inside = np.abs(number[pairs.high] - number[pairs.low])
        return (inside > STEEP * across) & (8 * pairs.gap <= length)


def _in_longest_window(search: Any) -> np.ndarray:
    """Which known points had the longest window that the search asks for, (points,): all in its box
    where it asks for the map's alone."""
    if search.settings.lengthen > 1:
        return search.known.facts.longer
    places, cubes = search.grid.places(search.known.index), search.cubes
    low, high = cubes.origin.min(axis=0), (cubes.origin + cubes.size[:, None]).max(axis=0)
    return ((low <= places) & (places <= high)).all(axis=1)


def share_of(wrong: np.ndarray) -> tuple[int, int, float]:
    """How many were looked at, how many were wrong, and the share of wrong ones that is exceeded
    with a probability of 5 % at most (Clopper and Pearson, Biometrika 26 (1934) 404).
    """
    if not len(wrong):
        return 0, 0, 1.0
    found = binomtest(int(wrong.sum()), len(wrong), alternative="less")
    return len(wrong), int(wrong.sum()), float(found.proportion_ci(0.95, "exact").high)


def _report(search: Any, kind: np.ndarray, wide_points: int) -> dict[str, Any]:
    """Attributes of a refinement: what it took, and what it can promise."""
    grid, known = search.grid, search.known
    volume, wide = search.cubes.volume, search.why > 0
    length = grid.lengths(search.cubes.origin)
    across = np.array([steps.sum() / steps.max() for steps in search.box]) * grid.width
    report: dict[str, Any] = {
        "simulations": search.used,
        "map_cells": int(np.prod([len(steps) + 1 for steps in search.box])),
        "full_grid_cells": float(np.prod(np.ceil(across / search.wanted) + 1)),
        "budget_spent": int(search.spent),
        "unsettled_points": int((~known.facts.settled & _in_longest_window(search)).sum()),
        "lengthened_points": int(known.facts.longer.sum()),
        "cubes": len(search.cubes),
        "cubes_with_border": int((~search.now.pure).sum()),
        "wide_cubes": int(wide.sum()),
        "wide_cubes_volume_share": float(volume[wide].sum() / volume.sum()),
        "wide_points": wide_points,
    }
    size = np.where(wide, search.cubes.size, 0)[:, None]
    plain = (search.wanted * length).max(axis=0) / (grid.shape - 1)
    widest = (np.maximum(search.wanted, size) * length).max(axis=0) / (grid.shape - 1)
    for k, name in enumerate(grid.names):
        report[f"bracket_share_{name}"] = float(plain[k])
        report[f"widest_bracket_share_{name}"] = float(widest[k])
    for code, name in enumerate(REASONS, 1):
        report[f"wide_cubes_{name}"] = int((search.why == code).sum())
    for name, code in CROSSINGS.items():
        report[f"{name}_points"] = int((kind == code).sum())
    for name, (count, wrong, bound) in search.shares.items():
        report[f"{name}s"] = count
        report[f"{name}s_wrong"] = wrong
        report[f"{name}s_wrong_share_at_most"] = bound
    return report
