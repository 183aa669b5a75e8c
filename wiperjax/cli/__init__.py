"""Command line: files in, files and short tables out; no physics.

What can be wrong with paths and files is checked before anything is computed. Heavy modules (jax,
xarray, matplotlib) are imported inside the commands, after `machine.jax_settings.configure`, for
two reasons: `--help` stays fast, and the settings of XLA have to precede `import jax`.
"""

import contextlib
import importlib.metadata
import os
import sys
import threading
import traceback
from collections.abc import Sequence
from typing import Annotated

import typer

from ..machine.interrupt import end_as_by_ctrl_c, heeded
from ..machine.memory import seek_garbage_less
from .compute import sweep, verify
from .example import example
from .explore import explore
from .export import export
from .modes import modes
from .motion import follow, ladder, simulate
from .options import INTERRUPTED, Said, of_file
from .refine import refine
from .show import LISTEN_HELP, PLOT_HELP, info, listen, plot

app = typer.Typer(
    name="wiperjax",
    help="Noise maps of windscreen wipers: stick, slip and flight of a blade lip.",
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

for command in (sweep, of_file(refine), simulate, follow, of_file(modes)):
    app.command()(command)
app.command(help=PLOT_HELP)(of_file(plot))
app.command(help=LISTEN_HELP)(of_file(listen))
for command in (of_file(export), of_file(explore), of_file(info), ladder, of_file(verify)):
    app.command()(command)
app.command()(example)
for extra in sorted(importlib.metadata.entry_points(group="wiperjax.commands")):
    app.add_typer(extra.load(), name=extra.name)  # such as `bench`, of a package on top of this one


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; every error of a user becomes one line on stderr.

    Arguments:
        arguments: words after the program's name; those of the process if None.

    Returns: exit status, 0 if all went well, 2 for a wrong command line, 130 after Ctrl-C (143 and
        129 after SIGTERM and SIGHUP), else 1.
    """
    if arguments is not None:
        return _run(arguments)
    seek_garbage_less()  # the process is ours
    ended = end_as_by_ctrl_c()
    if sys.stderr is None:  # closed: lines for it would go to standard output
        sys.stderr = open(os.devnull, "w", encoding="utf-8")
    try:
        return ended(_run(sys.argv[1:]))
    finally:
        _end_timers()


@heeded(insists=True)
def _run(arguments: Sequence[str]) -> int:
    """`main`, but for what is the process's."""
    words = list(arguments) or ["--help"]
    if hasattr(sys.stdout, "reconfigure"):  # what a terminal cannot show must not end the work
        sys.stdout.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    try:
        status = app(words, prog_name="wiperjax", standalone_mode=False)
        if status == INTERRUPTED and not isinstance(status, Said):  # typer has caught the Ctrl-C
            return _complain("interrupted", INTERRUPTED)
        return status if isinstance(status, int) else 0
    except (KeyboardInterrupt, typer.Abort):  # outside of a long command
        return _complain("interrupted", INTERRUPTED)
    except Exception as error:
        usage = getattr(error, "format_message", None)  # only errors of the command line have it
        if usage is not None:
            where = getattr(getattr(error, "ctx", None), "command_path", "wiperjax")
            return _complain(f"{usage().rstrip('.')}; try '{where} --help'", 2)
        if not isinstance(error, OSError | ValueError | RuntimeError | MemoryError):
            raise  # a bug: its traceback is wanted
        if "WIPERJAX_TRACEBACK" in os.environ:
            traceback.print_exc()
        return _complain(_one_line(error), 1)


def _end_timers() -> None:
    """Ends threads that only wait: the process would wait for them. JAX has one of a minute while
    it looks for a TPU, which a Ctrl-C may leave behind.
    """
    for thread in threading.enumerate():
        if isinstance(thread, threading.Timer):
            thread.cancel()


def _complain(text: str, status: int) -> int:
    with contextlib.suppress(OSError):  # of a terminal that is closed
        print(f"wiperjax: {' '.join(text.split())}", file=sys.stderr)
    return status


def _one_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__


def _version(wanted: bool) -> None:
    if wanted:
        try:
            print(f"wiperjax {importlib.metadata.version('wiperjax')}")
        except importlib.metadata.PackageNotFoundError:
            print("wiperjax (not installed)")
        raise typer.Exit


@app.callback(epilog="WIPERJAX_TRACEBACK=1 in the environment shows where an error came from.")
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass
