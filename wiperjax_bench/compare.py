"""From curves to statements: cost at equal error, and who leads whom by how much."""

import numpy as np
import xarray as xr

OURS = "engine Tsit5"
TARGETS = (1e-3, 1e-5, 1e-7)  # state error


def curve(dataset: xr.Dataset, scene: str, method: str, clock: str = "wall"):
    """Return (error, cost) of a method, by falling error, only points that no other beats.

    Points whose events are mostly wrong, or that stopped, are kept out: an error that is small by
    luck is no accuracy.
    """
    part = dataset.sel(scene=scene, solver=method)
    error, cost = part.state_error.values, part[clock].values
    fine = np.isfinite(error) & np.isfinite(cost) & (error > 0)
    fine &= ~(part.wrong_events.values > 0.5) & ~(part.stopped.values > 0.1)
    error, cost = error[fine], cost[fine]
    order = np.argsort(error)
    error, cost = error[order], cost[order]
    best = cost <= np.minimum.accumulate(cost)  # nothing more accurate is cheaper
    return error[best][::-1], cost[best][::-1]


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


def ratios(dataset: xr.Dataset, ours: str = OURS, clock: str = "wall") -> xr.DataArray:
    """Return cost of each method over the cost of ours, over (scene, method, error).

    Above 1: ours is faster. NaN: the method does not reach this error; 0: it does, ours does not.
    """
    table = np.full((dataset.sizes["scene"], dataset.sizes["solver"], len(TARGETS)), np.nan)
    for i, scene in enumerate(dataset.scene.values):
        mine = curve(dataset, scene, ours, clock) if ours in dataset.solver.values else ([], [])
        for j, method in enumerate(dataset.solver.values):
            theirs = curve(dataset, scene, method, clock)
            for k, target in enumerate(TARGETS):
                their, my = cost_at(*theirs, target), cost_at(*mine, target)
                table[i, j, k] = 0.0 if np.isnan(my) and np.isfinite(their) else their / my
    return xr.DataArray(
        table,
        coords={"scene": dataset.scene, "solver": dataset.solver, "error": list(TARGETS)},
        dims=("scene", "solver", "error"),
    )


def against_us(dataset: xr.Dataset, clock: str = "wall") -> list[str]:
    """Return one line for every rival and scene in which it beats our default, worst first."""
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
            lines.append((max(faster.values(), default=np.inf), f"{scene}: {method} leads {text}"))
    return [line for _, line in sorted(lines, reverse=True)]


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
