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
from .explored import Explored, explored
from .server import serve


class Served:
    """A page that is served from a thread of this process until it ends, or `stop` is called.

    Attributes:
        address: of the page, on this machine.
        height: of the frame in a notebook, in pixels.
    """

    def __init__(self, found: Explored, height: int = 1000, evaluate: Evaluate | None = None):
        self.height, self._unpacked = height, found.unpacked
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

        self._thread = threading.Thread(target=work, daemon=True, name="explorer")
        self._thread.start()
        served = answer.get()
        if isinstance(served, BaseException):
            raise served
        self._loop, self._server, self.address = served

    def stop(self) -> None:
        """Serves no more."""

        def end() -> None:
            self._server.stop()
            self._loop.stop()

        self._loop.add_callback(end)
        self._thread.join(timeout=10)
        self._unpacked.close()

    def __repr__(self) -> str:
        return f"the explorer at {self.address}"

    def _repr_html_(self) -> str:
        address = html.escape(self.address, quote=True)
        return (
            f'<iframe src="{address}" width="100%" height="{int(self.height)}" '
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

    Raises: `StoreError` for what is no map that can be shown.
    """
    checks.instance("ds", ds, xr.Dataset, "a map, such as open_map(...)")
    checks.flag("trust", trust)
    if borders is not None:
        ds = with_borders(ds, borders)
    return Served(explored(ds, str(ds.attrs.get("title", "")), trust), height)
