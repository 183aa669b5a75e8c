"""From curves to statements: cost at equal error, and who leads whom by how much."""

import numpy as np
import xarray as xr

OURS = "engine Tsit5"
TARGETS = (1e-2, 1e-3, 1e-5, 1e-7)  # state error


def curve(dataset: xr.Dataset, scene: str, method: str, clock: str = "wall"):
    """Return (error, cost, steps) of a method, by falling error, only points no other beats.

    Points whose events are mostly wrong, or that stopped, are kept out: an error that is small by
    luck is no accuracy.
    """
    part = dataset.sel(scene=scene, solver=method)
    error, cost, steps = part.state_error.values, part[clock].values, part.steps.values
    fine = np.isfinite(error) & np.isfinite(cost) & (error > 0)
    fine &= ~(part.wrong_events.values > 0.5) & ~(part.stopped.values > 0.1)
    order = np.flatnonzero(fine)[np.argsort(error[fine])]
    error, cost, steps = error[order], cost[order], steps[order]
    best = cost <= np.minimum.accumulate(cost)  # nothing more accurate is cheaper
    return error[best][::-1], cost[best][::-1], steps[best][::-1]


def cost_at(error, cost, target: float) -> float:
    """Return the cost at an error by interpolation in logarithms; NaN if it is never reached.

    A method that is already better at its coarsest setting costs what that setting costs.
    """
    if not len(error) or error[-1] > target:
        return np.nan
    if error[0] <= target:
        return float(cost[0])
    x = np.log(error[::-1])
    return float(np.exp(np.interp(np.log(target), x, np.log(cost[::-1]))))


def ratios(dataset: xr.Dataset, clock: str = "wall") -> xr.DataArray:
    """Return cost of each method over that of `OURS`, over (scene, method, error).

    Above 1: ours is faster. NaN: the method does not reach this error; 0: it does, ours does not.
    """
    table = np.full((dataset.sizes["scene"], dataset.sizes["solver"], len(TARGETS)), np.nan)
    for i, scene in enumerate(dataset.scene.values):
        mine = ([], [])
        if OURS in dataset.solver.values:
            mine = curve(dataset, scene, OURS, clock)[:2]
        for j, method in enumerate(dataset.solver.values):
            theirs = curve(dataset, scene, method, clock)[:2]
            for k, target in enumerate(TARGETS):
                their, my = cost_at(*theirs, target), cost_at(*mine, target)
                table[i, j, k] = 0.0 if np.isnan(my) and np.isfinite(their) else their / my
    return xr.DataArray(
        table,
        coords={"scene": dataset.scene, "solver": dataset.solver, "error": list(TARGETS)},
        dims=("scene", "solver", "error"),
    )


def against_us(dataset: xr.Dataset, clock: str = "wall") -> list[str]:
    """Return one line for every rival and scene in which it beats our default, worst first.

    Each ends with what the factor is made of: steps of a trajectory, and the cost of a step.
    """
    table = ratios(dataset, clock=clock)
    lines = []
    for scene in dataset.scene.values:
        for method in dataset.solver.values:
            if method.startswith("engine"):
                continue
            part = table.sel(scene=scene, solver=method)
            lead = {float(e): float(v) for e, v in zip(part.error, part, strict=True) if v < 1}
            if not lead:
                continue
            missed = [e for e, v in lead.items() if v == 0]
            faster = {e: 1 / v for e, v in lead.items() if v > 0}
            text = ", ".join(f"{f:.1f} x at {e:.0e}" for e, f in faster.items())
            text += "".join(f", ours does not reach {e:.0e}" for e in missed)
            if faster:
                worst = max(faster, key=lambda e: faster[e])
                text += why(dataset, scene, method, worst, clock)
            lines.append((max(faster.values(), default=np.inf), f"{scene}: {method} leads {text}"))
    return [line for _, line in sorted(lines, reverse=True)]


def why(dataset: xr.Dataset, scene: str, method: str, target: float, clock: str = "wall") -> str:
    """Return what a method's lead at an error is made of, from the steps that were counted."""
    if "scipy" in method:  # it counts evaluations
        return ""
    words = []
    for name in (OURS, method):
        error, cost, steps = curve(dataset, scene, name, clock)
        number, price = cost_at(error, steps, target), cost_at(error, cost, target)
        if not np.isfinite(number) or number <= 0:
            return ""
        words.append(f"{number:.0f} steps of {1e9 * price / number:.0f} ns")
    return f" (at {target:.0e} ours takes {words[0]}, it {words[1]})"


def statements(dataset: xr.Dataset, clock: str = "wall") -> list[str]:
    """Return, for each rival and error, one sentence: who leads whom by which factor, and where."""
    found = ratios(dataset, clock=clock)
    lines = []
    for method in dataset.solver.values:
        ran = bool(dataset.state_error.sel(solver=method).notnull().any())
        if method.startswith("engine") or not ran:
            continue
        for target in TARGETS:
            part = found.sel(solver=method, error=target)
            values = {str(s): float(v) for s, v in zip(part.scene.values, part.values, strict=True)}
            leads = {s: v for s, v in values.items() if v > 1}
            trails = {s: 1 / v for s, v in values.items() if 0 < v <= 1}
            only = [s for s, v in values.items() if v == 0]
            never = [s for s, v in values.items() if np.isnan(v)]
            parts = []
            if leads:
                parts.append(f"the engine leads by {_factors(leads)}")
            if trails:
                parts.append(f"the engine trails by {_factors(trails)}")
            if only:
                parts.append(f"only the rival reaches it on {', '.join(only)}")
            if never and len(never) < len(values):
                parts.append(f"the rival does not reach it on {', '.join(never)}")
            if not parts or len(never) == len(values):
                parts = ["the rival does not reach it on any scene"]
            lines.append(f"{method}, at error {target:.0e}: {'; '.join(parts)}.")
    return lines


def _factors(values: dict[str, float]) -> str:
    """Return '3.1 x on squeal' or '2.1 x (zeno) to 8 x (squeal), 4 x in the geometric mean'."""
    low, high = min(values, key=lambda s: values[s]), max(values, key=lambda s: values[s])
    if low == high:
        return f"{values[low]:.2g} x on {low}"
    mean = np.exp(np.mean(np.log(list(values.values()))))
    return (
        f"{values[low]:.2g} x ({low}) to {values[high]:.2g} x ({high}), {mean:.2g} x in the "
        f"geometric mean of {len(values)} scenes"
    )


def table(dataset: xr.Dataset, clock: str = "wall") -> str:
    """Return the ratios as a Markdown table: one row a method, one column a scene."""
    found = ratios(dataset, clock=clock)
    scenes = list(dataset.scene.values)
    head = ["method", *scenes]
    rows = [" | ".join(head), " | ".join(["---"] * len(head))]
    for method in dataset.solver.values:
        cells = [method]
        for scene in scenes:
            values = found.sel(scene=scene, solver=method).values
            cells.append(" / ".join("-" if np.isnan(v) else f"{v:.2g}" for v in values))
        rows.append(" | ".join(cells))
    return "\n".join(f"| {row} |" for row in rows)
