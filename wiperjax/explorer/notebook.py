"""The explorer from Python: in a notebook the page is shown below the cell."""

import asyncio
import html
import queue
import threading
from typing import Any

import xarray as xr
from tornado.ioloop import IOLoop

from ..maps.block import Evaluate
from ..plots.maps.borders import with_borders
from ..vocabulary import checks
from ..vocabulary.products import PRODUCTS
from ..vocabulary.ranges import Range
from .explored import Explored, explored
from .server import serve

HEIGHT = Range(100, 10_000, whole=True, unit="pixels")


class Served:
    """A page that is served from a thread of this process until it ends, or `stop` is called.

    Attributes:
        address: of the page, on this machine.
        height: of the frame in a notebook, in pixels.
        stopped: whether it serves no more.
    """

    def __init__(self, found: Explored, height: int = 1000, evaluate: Evaluate | None = None):
        self.height, self.stopped, self._unpacked = height, False, found.unpacked
        answer: queue.Queue[Any] = queue.Queue()

        def work() -> None:
            asyncio.set_event_loop(asyncio.new_event_loop())
            loop = IOLoop.current()
            try:
                answer.put((loop, *serve(found, evaluate=evaluate)))
            except BaseException as error:
                answer.put(error)
                return
            loop.start()
            loop.close(all_fds=True)  # pages that are open see that no one answers

        self._thread = threading.Thread(target=work, daemon=True, name="explorer")
        self._thread.start()
        served = answer.get()
        if isinstance(served, BaseException):
            raise served
        self._loop, self._server, self.address = served

    def stop(self) -> None:
        """Serves no more; pages that are open say that the connection is lost."""
        self.stopped = True

        def end() -> None:
            self._server.stop()
            self._loop.stop()

        if self._thread.is_alive():
            self._loop.add_callback(end)
            self._thread.join(timeout=10)
        self._unpacked.close()

    def __repr__(self) -> str:
        return f"the explorer at {self.address}{', stopped' * self.stopped}"

    def _repr_html_(self) -> str:
        if self.stopped:
            return html.escape(repr(self))
        address = html.escape(self.address, quote=True)
        return (
            f'<iframe src="{address}" width="100%" height="{self.height}" '
            f'style="border:0"></iframe><br><a href="{address}">{address}</a>'
        )


def explore(
    ds: xr.Dataset,
    *,
    borders: xr.Dataset | None = None,
    height: int = 1000,
    trust: bool = False,
) -> Served:
    """A map as a page: click on a cell, see and hear its motion. As the last line of a cell of a
    notebook it is shown below it; its `address` opens in any browser of this machine.

    Arguments:

    - `ds`: a map (`sweep`, `open_map`); it must stay open.
    - `borders`: those of a refined map (`wiperjax.borders`), to be drawn.
    - `height`: of the frame in a notebook, in pixels.
    - `trust`: whether a module that the map names (a system of one's own) may be imported, which
        runs it.

    Raises: `StoreError` for what is no map that can be shown, `ValueError` for another argument
        that cannot be meant.
    """
    checks.instance("ds", ds, xr.Dataset, PRODUCTS["map"].such_as)
    checks.flag("trust", trust)
    height = checks.whole("height", height, HEIGHT)
    if borders is not None:
        ds = with_borders(ds, borders)
    return Served(explored(ds, str(ds.attrs.get("title", "")), trust), height)
