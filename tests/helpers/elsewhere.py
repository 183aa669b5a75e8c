"""`python elsewhere.py SYSTEM COMMAND...`: commands of wiperjax (each one word of the shell), on a
computer that is played.

`SYSTEM` is sys.platform, "win32" or "darwin". What POSIX or Linux alone has is gone. As "win32" no
file is renamed, replaced or removed that this process holds open, no folder is opened, and text
without an encoding is an error. Libraries are imported before; that they are at home there is
theirs to see to.
"""

import os
import sys
import types
import warnings

import matplotlib

matplotlib.use("Agg")

import bokeh.plotting  # noqa: E402, F401
import dask.threaded  # noqa: E402, F401
import diffrax  # noqa: E402, F401
import filelock  # noqa: E402, F401
import h5netcdf  # noqa: E402, F401
import matplotlib.animation  # noqa: E402, F401
import matplotlib.pyplot  # noqa: E402, F401
import optimistix  # noqa: E402, F401
import platformdirs  # noqa: E402, F401
import psutil  # noqa: E402
import rich.progress  # noqa: E402, F401
import scipy.io.wavfile  # noqa: E402, F401
import scipy.signal  # noqa: E402, F401
import typer.testing  # noqa: E402, F401
import xarray  # noqa: E402, F401

NOT_ON_WINDOWS = """pread pwrite sysconf getuid geteuid pathconf getloadavg killpg fchmod mkfifo
O_CLOEXEC""".split()
LINUX_ONLY = ["sched_getaffinity", "O_TMPFILE"]
MODULES = ["fcntl", "resource", "pwd", "grp", "termios"]


def held(path) -> bool:
    """Whether this process has the file at `path` open."""
    if isinstance(path, int) or not os.path.isfile(path):
        return False
    for descriptor in os.listdir("/proc/self/fd"):
        try:
            if os.path.samestat(os.fstat(int(descriptor)), os.stat(path)):
                return True
        except OSError:  # that of the listing itself
            pass
    return False


def refusing(deed, files: int):
    """`deed` as Windows does it: its first arguments must not be open files."""

    def done(*paths, **named):
        for path in paths[:files]:
            if held(path):
                raise PermissionError(13, "is open", str(path))
        return deed(*paths, **named)

    return done


def opening(path, *how, deed=os.open, **named):
    """`os.open` as Windows does it: folders are not opened."""
    if os.path.isdir(path):
        raise PermissionError(13, "is a folder", str(path))
    return deed(path, *how, **named)


def play(system: str) -> None:
    """From here on this process is on `system`."""
    for name in LINUX_ONLY + NOT_ON_WINDOWS * (system == "win32"):
        delattr(os, name)
    if system == "win32":
        sys.modules.update(dict.fromkeys(MODULES))  # cannot be imported
        for name, files in {"replace": 2, "rename": 2, "unlink": 1, "remove": 1}.items():
            setattr(os, name, refusing(getattr(os, name), files))
        os.open = opening
        told = psutil.Process.memory_info
        psutil.Process.memory_info = lambda self: types.SimpleNamespace(peak_wset=told(self).rss)
        warnings.filterwarnings("error", category=EncodingWarning, module=r"wiperjax\b")
    sys.platform = system


if __name__ == "__main__":
    play(sys.argv[1])
    from wiperjax.cli import main

    for command in sys.argv[2:]:
        sys.argv = ["wiperjax", *command.split()]
        print("$", *sys.argv, flush=True)
        if status := main():
            sys.exit(status)
