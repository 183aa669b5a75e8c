"""Cores that this process may use."""

import os
import sys


def available() -> int:
    """How many cores this process may run on; all of the machine's on macOS, which keeps no process
    off any.
    """
    if sys.platform == "darwin":
        return os.cpu_count() or 1
    import psutil

    return len(psutil.Process().cpu_affinity())
