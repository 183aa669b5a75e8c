"""A part of a map, computed again and finer, in memory: nothing is written."""

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from ..datasets.map_dataset import assemble
from ..maps.block import Evaluate
from ..maps.computing import computing
from ..plots.style.axes import is_geometric, long_name
from ..specs.load import parse_sweep
from ..vocabulary.kinds import WAYS
from .cells import begun, start_of
from .explored import Explored, explored

FEWEST, MOST = 48, 128  # cells along each side of a box of two axes
BLOCK = 1280  # cells computed at once, of every box: all have one compiled program


class Stopped(Exception):
    """The window has another wish."""


def box_spec(
    whole: Explored, ends: Mapping[str, tuple[float, float]], at: Mapping[str, int], start: Any
) -> Any:
    """The sweep of a box: its two axes at twice the density of the map, with `FEWEST` to `MOST`
    cells each, all others at one value. Of a map of one axis it has as many cells as are computed
    at once.

    Arguments: axis -> the first and the last cell of the box (with parts of one); axis -> place of
    each other one; the start, of a map of several.

    Raises: `ValueError` where the map does not say what it was made from, its cells go on from
    each other, or the box is empty, or so large that it would be no finer than the map.
    """
    if whole.spec is None:
        raise ValueError(f"cells of this map cannot be simulated: {whole.unable}")
    several = whole.spec.starts
    place = {dim: int(at.get(dim, 0)) for dim in whole.dims}
    start = None if several is None else begun(whole, place, start)
    if start in WAYS:
        raise ValueError("choose another start: with up and down a cell needs its whole line")
    document = whole.spec.document()
    for table in ("starts", "refine", "sensitivities"):
        document.pop(table, None)
    if several is not None and start == "steady_slip":  # its own in each cell
        document["starts"] = {"names": ["steady_slip"], "kick": several.kick}
    else:
        document["start"] = start_of(whole, place, start)
    most = (FEWEST, MOST) if len(ends) > 1 else (BLOCK, BLOCK)
    document["axes"] = {
        dim: {"values": _finer(whole.ds[dim], *ends[dim], *most).tolist()}
        if dim in ends
        else {"values": [float(whole.ds[dim].values[at[dim]])]}
        for dim in whole.dims
    }
    title = str(whole.ds.attrs.get("title", ""))[:400]
    return parse_sweep(document | {"title": title}, "the box")


def _finer(axis: Any, first: float, last: float, fewest: int, most: int) -> np.ndarray:
    """Values between two places of an axis, (n,), spaced as the axis is."""
    values = axis.values
    first, last = (float(np.clip(place, 0, len(values) - 1)) for place in sorted((first, last)))
    if last - first < 1e-3:
        raise ValueError("the box must reach over more than one cell, along each axis")
    if last - first >= most - 1:
        reaches = f"the box reaches over {last - first:.0f} cells along {long_name(axis)}"
        raise ValueError(f"{reaches}, and its {most} would be no finer; drag a smaller one")
    count = int(np.clip(np.ceil(2 * (last - first)) + 1, fewest, most))
    places, cells = np.linspace(first, last, count), np.arange(len(values))
    if is_geometric(values):
        return np.exp(np.interp(places, cells, np.log(values)))
    return np.interp(places, cells, values)


def compute(
    spec: Any, report: Callable[[int, int], None], stop: threading.Event,
    evaluate: Evaluate | None = None,
) -> Explored:  # fmt: skip
    """The map of a box; `report` is told cells done and cells in all. Raises: `Stopped`."""
    ends = [min(begin + BLOCK, spec.size) for begin in range(0, spec.size, BLOCK)]
    spans = {k: (end - BLOCK, end) for k, end in enumerate(ends)}  # the last overlaps another
    blocks, _ = computing(spec, evaluate, None)
    pieces: list[Mapping[str, np.ndarray]] = []
    done = 0
    report(done, spec.size)
    for piece in blocks(spec, spans):
        if stop.is_set():
            raise Stopped
        new = ends[piece.number] - done
        pieces.append({name: values[BLOCK - new :] for name, values in piece.columns.items()})
        done += new
        report(done, spec.size)
    columns = {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}
    return explored(assemble(spec, columns), trusted=True)  # modules are imported by now


class Boxes:
    """Computes boxes of all windows, one after another, in the background; `evaluate` as in
    `sweep`.
    """

    def __init__(self, evaluate: Evaluate | None = None) -> None:
        self._evaluate = evaluate
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="box")

    def begin(
        self, spec: Any, report: Callable[[int, int], None], done: Callable[[Any], None]
    ) -> threading.Event:
        """Has a box computed; `done` is called from another thread, with the map or the exception
        raised, unless the event that is returned was set before.
        """
        stop = threading.Event()

        def work() -> None:
            try:
                found: Any = (
                    compute(spec, report, stop, self._evaluate) if not stop.is_set() else None
                )
            except Stopped:
                return
            except Exception as error:  # shown where it was wished
                found = error
            if not stop.is_set():
                done(found)

        self._pool.submit(work)
        return stop

    def stop(self) -> None:
        """Drops all boxes that are not begun."""
        self._pool.shutdown(wait=False, cancel_futures=True)
