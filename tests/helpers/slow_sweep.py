"""A sweep that takes its time, to be killed; run as a script, one to be interrupted."""

import signal
import sys
import time
from pathlib import Path

from stub_sweep import BLOCK, evaluate, make_spec

from wiperjax.maps import driver


def slow(spec, index, *look):
    """The stub, a tenth of a second slower."""
    time.sleep(0.1)
    return evaluate(spec, index, *look)


def slow_sweep(spec, path, delay, **options):
    """The map, each block of which took `delay` seconds more."""

    def slow(spec, index):
        time.sleep(delay)
        return evaluate(spec, index)

    return driver.sweep(spec, path, evaluate=slow, block=BLOCK, progress=False, **options)


if __name__ == "__main__":
    # where the tests run in a shell's background, SIGINT comes ignored
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        slow_sweep(
            make_spec(),
            Path(sys.argv[1]),
            float(sys.argv[2]),
            command="wiperjax sweep a.toml -o map.h5 --force",
        )
    except KeyboardInterrupt as stopped:
        print(stopped, file=sys.stderr)
        sys.exit(130)
