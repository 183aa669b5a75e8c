"""The command that shows a map as a page."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from .options import Force, check_source, check_target, configure, cuts

HERE = "127.0.0.1"  # this computer alone


def explore(
    file: Annotated[Path, typer.Argument(metavar="MAP.h5", help="A finished map.")],
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port to serve on.", show_default="a free one")
    ] = 0,
    browser: Annotated[bool, typer.Option(help="Open the page in a browser.")] = True,
    static: Annotated[
        Path | None,
        typer.Option(
            metavar="PAGE.html",
            help="Write one file instead, for a browser alone: the map, and motions of some cells.",
        ),
    ] = None,
    cell: Annotated[
        list[str] | None,
        typer.Option(
            metavar="AXIS=VALUE,...",
            help="With --static: a cell whose motion is stored, the nearest; more of them.",
            show_default="a coarse choice",
        ),
    ] = None,
    force: Force = False,
    trust: Annotated[
        bool,
        typer.Option(
            "--trust",
            help="Import the module of a system of your own that the map names: that runs it.",
        ),
    ] = False,
    host: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help=f"Address to listen on. Any but {HERE} lets other computers see the map and "
            "have cells computed on this one, without a password.",
        ),
    ] = HERE,
) -> None:
    """Look into a map in a browser: click on a cell, see and hear its motion."""
    check_source(file)
    cells = [dict(cuts(one.split(","), "--cell") or {}) for one in cell] if cell else None
    if static is None and (cells or force):
        raise ValueError("--cell and --force are for --static PAGE.html")
    if static is not None and (port or host != HERE):
        raise ValueError("--port and --host are for a page that is served, not for --static")
    if not host.strip():  # sockets take it for every address
        raise ValueError(f"--host must be an address, such as {HERE}, but was empty")
    if static is not None:
        check_target(static, (".html",), force, file)
    configure(None)
    try:
        import bokeh  # noqa: F401
    except ImportError:
        raise ValueError("the page needs bokeh: pip install bokeh") from None
    from ..explorer import server
    from ..explorer.explored import open_explored

    explored, ds = open_explored(file, trust)
    with ds:
        if static is not None:
            from ..explorer.static import write_static

            count = write_static(explored, static, cells, force, _working)
            print(f"page     {static}: {static.stat().st_size / 1e6:.1f} MB, {count} motions")
            return
        if host not in server.LOCAL:
            print(
                f"note: on {host} every computer that reaches this one can see the map and have "
                "cells computed here; there is no password and no encryption",
                file=sys.stderr,
            )
        try:
            served, address = server.serve(explored, host, port)
        except (OSError, UnicodeError) as error:  # the latter of a name that no host can have
            why = getattr(error, "strerror", None) or "no name of a host"
            raise ValueError(
                "--host and --port must be an address of this computer and a port that is free, "
                f"but were {host} and {port}: {why}"
            ) from None
        server.run(served, address, browser, lambda text: print(text, flush=True))


def _working(text: str) -> None:
    print(f"simulating {text}", file=sys.stderr, flush=True)
