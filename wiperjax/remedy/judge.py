"""What counts in the end: the class of a simulated blade."""

from typing import Any

import numpy as np

from ..blade.wiper import Wiper
from ..contact.fits import turns
from ..engine.observers.totals import RegimeTotals
from ..noise.run_class import assess, words
from ..runs.simulate import simulate
from ..vocabulary import checks
from ..vocabulary.ranges import NON_NEGATIVE, POSITIVE
from ..vocabulary.thresholds import Thresholds

SAMPLES, INTERVAL = 4096, 2.5e-5  # of a window at least, and at most between two of them [s]
ENOUGH = 4  # periods in a window; else one that is longer,
LONGER, LONGEST = 4, 1.6  # by that factor, up to so many seconds


def verdict(
    blade: Wiper, *, settle: float = 0.2, window: float = 0.1, rtol: float = 1e-8
) -> dict[str, Any]:
    """Return the class of noise of ``blade`` from its default start, with what it rests on.

    A simulation of ``settle`` seconds, and of ``window`` seconds that are looked at; of up to 1.6,
    if a noise has no four periods in them. They are judged as a run is, by `assess`, with its
    default thresholds. Names as of the columns of a map: ``label``, ``mechanism``, ``band`` and
    ``settled`` in words; ``dominant_frequency`` is NaN where the window does not tell it, or
    nothing sounds; ``window`` [s] is that which was looked at.

    Raises ValueError for a blade on a belt that turns: its class is that of whole periods, by their
    turns and strokes, as `run_scene` and `assess` judge it.
    """
    checks.instance("blade", blade, Wiper, "a Wiper")
    if turns(blade):
        must = "must be on a belt that does not turn (whole periods of one are judged by run_scene)"
        raise ValueError(f"blade {must}, but was on {type(blade.belt).__name__}")
    settle = checks.number("settle", settle, NON_NEGATIVE)
    window = checks.number("window", window, POSITIVE)
    speed = float(blade.belt.rms)
    limits = Thresholds(quiet_velocity=Thresholds.quiet_velocity_ratio * speed)
    while True:
        whole, interval = settle + window, min(window / SAMPLES, INTERVAL)
        seen_from = RegimeTotals(settle)
        run = simulate(blade, whole, sample_interval=interval, rtol=rtol, observer=seen_from)
        seen = assess(run.assign_attrs(belt_kind=blade.belt.kind), limits)
        known = ("result", "velocity_rms", "dominant_frequency", "stick_fraction")
        found: dict[str, Any] = {n: seen[n].item() for n in (*known, "flight_fraction")}
        found |= {"settled": "unknown", **words(seen)}
        found |= {"belt_speed_rms": speed, "window": window}
        if found["band"] == "none":  # rounding has a strongest line, too
            found["dominant_frequency"] = np.nan
        enough = found["dominant_frequency"] * window >= ENOUGH
        ended = found["label"] in ("quiet", "failed", "collapsed")
        if enough or ended or LONGER * window > LONGEST * (1 + 1e-9):
            return found
        window *= LONGER
