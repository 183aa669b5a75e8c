"""What a path leads to, seen before it is opened: a pipe would be waited for for ever."""

import os
import stat
from pathlib import Path

_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def oddity(path: str | Path) -> str:
    """What stands at `path`, links followed, if it is no regular file: `a pipe`; else empty, also
    if there is nothing.

    Raises: `OSError` if that cannot be found out.
    """
    try:
        kind = stat.S_IFMT(os.stat(path).st_mode)
    except FileNotFoundError:
        return ""
    return "" if kind == stat.S_IFREG else _KINDS.get(kind, "no regular file")


def same_file(one: str | Path, other: str | Path) -> bool:
    """Whether two paths lead to one existing file, by whatever links."""
    try:
        return os.path.samefile(one, other)
    except OSError:
        return False
