"""The text of `wiperjax bench profile`: shares of a lane-turn, and a roofline."""

import diffrax

from ..measurements.engine_parts import EVENTS, LADDER
from ..measurements.profile import Profile
from ..rivals.engine import RTOL


def text(profile: Profile) -> str:
    """Return the profile as Markdown."""
    p = profile
    turn = p.seconds / p.executed
    return "\n".join(
        [
            f"# Profile, {p.precision}, {p.lanes} lanes on one core of {p.machine}",
            "",
            f"Processor time; rtol {RTOL[diffrax.Tsit5, p.precision]:.0e}, Tsit5, {p.cells} "
            f"trajectories of 20 ms of the speed workload: {p.seconds / p.cells * 1e6:.1f} us "
            f"each, {p.steps:.0f} trial steps and {p.events:.1f} events each, occupancy "
            f"{p.useful / p.executed:.2f}, {turn * 1e9:.1f} ns a lane-turn, all in "
            f"all. {p.flows} flows a jump. Load average {p.load:.1f}.",
            "",
            *shares(p.parts, turn, p.flows),
            *roofline(p.parts, p.peak, p.streams, p.precision),
            "",
        ]
    )


def shares(found: dict, lane_turn: float, flows: int) -> list[str]:
    """Return the table of where a lane-turn (a flow, with its share of the rest) goes."""
    rows = ["| part, per lane-turn | ns | share |", "|---|---|---|"]
    left = lane_turn
    for name, _, less in LADDER:
        if name not in found or (less is not None and less not in found):
            continue
        cost = found[name][0] - (found[less][0] if less else 0.0)
        if name.endswith("a jump"):
            name, cost = f"{name} ({flows} flows share one)", cost / flows
        left -= cost
        rows.append(f"| {name} | {cost * 1e9:.1f} | {cost / lane_turn:.0%} |")
    rest = "bookkeeping: refill, outcomes, and the error of this sum"
    if len(found) < len(LADDER):
        rest = "everything that was not measured by itself"
    rows.append(f"| {rest} | {left * 1e9:.1f} | {left / lane_turn:.0%} |")
    rows.append(f"| all | {lane_turn * 1e9:.1f} | 100% |")
    return [*rows, ""]


TITLES = {EVENTS: "flow (the whole of it)"}


def roofline(found: dict, top: float, streams: dict[str, float], precision: str) -> list[str]:
    """Return the table of operations and bytes against the measured limits."""
    rows = [
        "| a lane's | operations | comparisons, selects | bytes | ns | Gflop/s | of peak | GB/s |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in ("right-hand sides (6)", EVENTS, "change of regime, a jump"):
        if name not in found:
            continue
        seconds, work = found[name]
        title = TITLES.get(name, name)
        rows.append(
            f"| {title} | {work.flops} | {work.choices} | {work.memory} | {seconds * 1e9:.1f} | "
            f"{work.flops / seconds / 1e9:.2f} | {work.flops / seconds / top:.1%} | "
            f"{work.memory / seconds / 1e9:.1f} |"
        )
    speeds = ", ".join(f"{name}: {v / 1e9:.0f} GB/s" for name, v in streams.items())
    rows += [
        "",
        f"Measured limits of this core: {top / 1e9:.1f} Gflop/s ({precision}, fused multiply-adds "
        f"in registers), sum of two arrays of {speeds}. A division or a root "
        "counts as one operation but costs many, and comparisons and selects use the same units "
        "uncounted: the share of peak is a lower bound on how busy they are. Bytes are all "
        "operands and results that the traced program names, were none of them kept in registers: "
        "an upper bound.",
    ]
    if EVENTS in found:
        seconds, work = found[EVENTS]
        operations = work.flops + work.choices
        least = 2 * operations / top  # a fused operation counts two in the peak
        rows.append(
            f"A flow issues {operations} vector operations a lane, which at the measured rate of "
            f"fused multiply-adds take {least * 1e9:.1f} ns; it takes {seconds * 1e9:.1f} ns: "
            f"{least / seconds:.0%} of that rate (additions and comparisons have units of their "
            "own on some processors: more than all of it is possible)."
        )
    return [*rows, ""]
