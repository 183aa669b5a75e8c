"""Scenes at which methods fail, small families of four blades each, with the engine's promise.

Every family moves far enough that a missed or invented event shows in the position. Independent
codes confirm the reference of each (`tests/bench/test_failures.py`).
"""

from collections.abc import Callable

from .hard_contact import (
    chatter_in_slip,
    grazing,
    large_step,
    load_to_zero,
    near_painleve,
    two_at_once,
    zeno,
)
from .hard_sliding import (
    belt_corners,
    friction_spike,
    growth,
    kink_chain,
    long_stick,
    near_collapse,
    reversal,
    steep_stribeck,
    stiff_shoulder,
)
from .scene import Scene

SCENES: dict[str, Callable[[], Scene]] = {
    make.__name__: make
    for make in (
        grazing,
        zeno,
        steep_stribeck,
        stiff_shoulder,
        reversal,
        near_painleve,
        large_step,
        friction_spike,
        long_stick,
        two_at_once,
        chatter_in_slip,
        load_to_zero,
        kink_chain,
        belt_corners,
        near_collapse,
        growth,
    )
}
