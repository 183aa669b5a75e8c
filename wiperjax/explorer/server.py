"""Who is served: a Bokeh server on this machine, one document for each window."""

import logging
import os
import socket
import traceback
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.core.validation import silence
from bokeh.core.validation.warnings import EMPTY_LAYOUT
from bokeh.document import Document
from bokeh.models import Div
from bokeh.protocol.exceptions import ProtocolError
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from bokeh.server.util import bind_sockets
from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop, PeriodicCallback

from ..machine.interrupt import heeded
from ..maps.block import Evaluate
from .box import Boxes
from .explored import Explored
from .motion import wish_ahead
from .page import Page
from .worker import Worker

silence(EMPTY_LAYOUT, True)  # a map of two axes has no slider
logging.getLogger("bokeh.server.views.ws").setLevel(logging.ERROR)  # a window that was closed


def _one_line(record: logging.LogRecord) -> bool:
    """Has a message that no page of ours sends be one line: it is no fault of who serves."""
    error = record.exc_info[1] if record.exc_info else None
    ours = record.name == "tornado.application" and not isinstance(error, ProtocolError)
    if error is not None and not ours and "WIPERJAX_TRACEBACK" not in os.environ:
        record.msg = "a window sent what means nothing here, or a bug: %r (%s); "
        record.msg += "WIPERJAX_TRACEBACK=1 shows all of it"
        record.args, record.exc_info = (error, _where(error)), None
    return True


def _where(error: BaseException) -> str:
    """File and line where an error came from: the innermost that neither Python nor a package has
    brought; of one that was never raised, that."""
    brought = ("site-packages", str(Path(os.__file__).parent))
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if not any(part in frame.filename for part in brought)]
    if not frames:
        return "never raised"
    last = (own or frames)[-1]
    return f"{Path(last.filename).name}, line {last.lineno}"


for _name in ("bokeh.server.views.ws", "bokeh.server.protocol_handler", "tornado.application"):
    logging.getLogger(_name).addFilter(_one_line)

LOCAL = ("127.0.0.1", "localhost", "::1")
ANY = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # all addresses of a kind -> this machine's own
MOST_WINDOWS = 16  # at once: each holds what it shows in memory
LOOK = 500  # milliseconds: how often a Ctrl-C is looked for that Python dropped
MESSAGE = 2**20  # bytes that a window may send at once; it sends clicks


def serve(
    explored: Explored, host: str = "127.0.0.1", port: int = 0, evaluate: Evaluate | None = None
) -> tuple[BaseServer, str]:
    """A server that shows a map, started, and its address; port 0: any that is free. `evaluate` is
    what computes boxes, as in `sweep`.

    Bokeh's own scripts come from this server: the page asks no other machine for anything.

    Raises: `OSError` where the port is taken.
    """
    worker, boxes, windows = Worker(), Boxes(evaluate), set()

    def window(document: Document) -> None:
        if len(windows) >= MOST_WINDOWS:
            words = f"{MOST_WINDOWS} windows are open; close one and load this page again."
            document.add_root(Div(text=words))
            return
        page = Page(document, explored, worker, boxes)
        windows.add(page)

        def gone(_: Any) -> None:
            windows.discard(page)
            worker.forget(page)
            worker.forget((page, "file"))
            page.finer.stop()

        document.on_session_destroyed(gone)

    sockets, found = bind_sockets(host, port)
    names = {host, socket.gethostname(), socket.getfqdn()} if host not in LOCAL else {host, *LOCAL}
    tornado = BokehTornado(
        {"/": Application(FunctionHandler(window))},
        extra_websocket_origins=[f"{name}:{found}" for name in sorted(names)],
        websocket_max_message_size_bytes=MESSAGE,
    )
    http = HTTPServer(tornado)
    http.add_sockets(sockets)
    server = BaseServer(IOLoop.current(), tornado, http)
    server.start()
    wish_ahead(worker, explored)
    shown = ANY.get(host, host)
    return server, f"http://{f'[{shown}]' if ':' in shown else shown}:{found}/"


def run(server: BaseServer, address: str, browser: bool, say: Callable[[str], None]) -> None:
    """Serves until Ctrl-C; opens the page in a browser if asked."""
    if browser:
        server.io_loop.add_callback(lambda: webbrowser.open(address))
    say(f"explore  {address}  (Ctrl-C ends it)")
    try:
        with heeded() as check:
            PeriodicCallback(check, LOOK).start()
            server.run_until_shutdown()
    except KeyboardInterrupt:
        server.stop()
