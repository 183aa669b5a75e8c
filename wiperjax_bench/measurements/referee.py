"""A blade's events and result code beside those of an independent code.

That code is the tests' own (`tests/helpers/reference/blade.py` of a checkout: scipy's DOP853 at
1e-12, phase by phase); it is read from a folder that is given, so that nothing installed needs it.
"""

import contextlib
import importlib.util
import signal
import sys
from math import inf
from pathlib import Path
from typing import NamedTuple

from wiperjax.vocabulary.codes import Event, Regime, Result

from ..scenes import wide

PATIENCE = 10  # s that the reference may take
LOG, MOST = 256, 1000  # events kept of the engine's, and asked of the reference
ENDED = (Result.FINISHED, Result.COLLAPSED, Result.PAINLEVE_INDETERMINATE)
BELT = (Event.BELT_REVERSAL, Event.BELT_KINK)
VERDICTS = {
    "same": "the same events and result code, as far as the start moved by rtol has them",
    "sensitive": "others where the start moved by 100 rtol has others, too",
    "one of several": "others behind an instant at which both say that several are possible",
    "different": "others before that",
    "failed": "the engine stopped; the reference was asked for its first 1000 events only",
    "both stopped": "neither came to the end",
    "no reference": "the reference stopped, or took too long",
}


class Seen(NamedTuple):
    """What the reference finds."""

    events: list  # (time in s, name, regime before, regime after) each
    splits: float  # first time at which several motions are possible, inf if there is none


class Referee:
    """Compares events and result code of a blade with those of the reference in ``folder``.

    Raises ValueError where that folder has no such code.
    """

    def __init__(self, folder: Path, duration: float, rtol: float):
        file = folder / "blade.py"
        if not file.is_file():
            raise ValueError(f"--reference must be a folder with blade.py, but was {folder}")
        spec = importlib.util.spec_from_file_location("independent_blade", file)
        assert spec is not None and spec.loader is not None
        self.code = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = self.code  # its dataclasses look themselves up
        spec.loader.exec_module(self.code)
        self.duration, self.rtol = duration, rtol

    def verdict(self, drawn: wide.Drawn, i: int, log: list, result: int) -> list:
        """Return [one of `VERDICTS`, events that agree, events that can be known, largest lag of
        an agreeing event in s] of blade ``i``, whose engine's events are ``log``.
        """
        stopped = result not in ENDED
        found = [_plain(t, _word(k), b, a) for t, k, b, a in log]
        if not stopped and len(log) < LOG:
            found.append(self._end(Result(result)))
        try:
            true, splits = self.seen(drawn, i)
            agreed = known = common(found, true)
            if stopped:
                verdict = "failed"
            elif agreed == len(found):
                verdict = "same"
            else:
                known = common(true, self.seen(drawn, i, self.rtol).events)
                verdict = "same" if agreed >= known else "different"
            if verdict == "different":
                far = common(true, self.seen(drawn, i, 100 * self.rtol).events)
                verdict = "sensitive" if agreed >= far else "different"
            if verdict == "different" and result == Result.PAINLEVE_INDETERMINATE:
                before = agreed < len(true) and splits < true[agreed][0]
                verdict = "one of several" if before else "different"
        except (ArithmeticError, ValueError, TimeoutError):
            return ["both stopped" if stopped else "no reference", 0, 0, 0.0]
        pairs = zip(found[:agreed], true[:agreed], strict=True)
        return [verdict, agreed, known, max((abs(f[0] - t[0]) for f, t in pairs), default=0.0)]

    def seen(self, drawn: wide.Drawn, i: int, moved: float = 0.0) -> Seen:
        """Return what the reference finds of blade ``i``, from its start or from one moved by that
        share of lip and belt speed; the last event is called as the result code where it got there
        within `MOST` events.

        Raises TimeoutError after `PATIENCE`, ArithmeticError where the reference stops.
        """
        blade = {name: float(values[i]) for name, values in drawn.blade.items()}
        belt = {name: float(values[i]) for name, values in drawn.belt.items()}
        x, y, along, up = (float(value) for value in drawn.start[i])
        speed = abs(belt.get("speed", belt.get("amplitude", 0.0)))
        start = x + moved * blade["lip_length"], y, along + moved * speed, up
        with _patience():
            run = self.code.simulate(blade, self._belt(belt), self.duration, start, max_events=MOST)
        events = _merged([(e.time, e.kind, e.before, e.after) for e in run.events])
        splits = min((time for time, _ in run.flags), default=inf)
        if run.result == "max_events":
            return Seen(events, splits)
        indeterminate = run.flags and run.result == "finished"
        code = "painleve_indeterminate" if indeterminate else run.result
        return Seen([*events, self._end(Result[code.upper()])], splits)

    def _end(self, code: Result) -> tuple:
        return self.duration, code.name.lower(), -1, -1

    def _belt(self, belt: dict):
        if "ramp" in belt:
            return self.code.Trapezoid(
                belt["speed"], belt["frequency"], belt["phase"], belt["ramp"]
            )
        if "amplitude" in belt:
            return self.code.Wiping(belt["amplitude"], belt["frequency"], belt["phase"])
        return self.code.Steady(belt["speed"])


@contextlib.contextmanager
def _patience():
    """Raises TimeoutError inside after `PATIENCE`; Windows, which sends no such signal, waits."""
    if sys.platform == "win32":
        yield
        return

    def too_long(signum, frame):
        raise TimeoutError

    signal.signal(signal.SIGALRM, too_long)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def _word(kind: int) -> str:
    return "belt" if Event(kind) in BELT else Event(kind).name.lower()


def _plain(time: float, kind: str, before: int, after: int) -> tuple:
    """Return an event as both codes name it: at the start, where a tip may jam, there is no regime
    before, and stick that ends in flight at the edge of the cone is a lift-off.
    """
    flies = before == Regime.STICK and after == Regime.FLIGHT and kind == "release"
    return time, "lift_off" if flies else kind, before if time > 0 else after, after


def _merged(events: list) -> list:
    """Return ``events`` with an impact and the completion that follows it as one, as the engine
    has them.
    """
    kept: list = []
    for time, kind, before, after in events:
        if kind == "zeno" and kept and kept[-1][1] == "impact":
            kept.append((time, "zeno", kept.pop()[2], after))
        else:
            kept.append(_plain(time, kind, before, after))
    return kept


def common(a: list, b: list) -> int:
    """Return how many leading events are of the same kind and regimes."""
    n = 0
    while n < min(len(a), len(b)) and a[n][1:] == b[n][1:]:
        n += 1
    return n
