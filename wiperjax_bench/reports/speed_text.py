"""The text of `wiperjax bench speed`: what was asked, what was measured, and all rows."""

from pathlib import Path

import numpy as np
import xarray as xr

from ..harness.compare import cost_at

ASKED = {  # ratio: (at least, goal)
    "numba float64": (3.0, 5.0),
    "numba float32": (6.0, 10.0),
    "cores": (1.8, 1.95),
    "diffrax": (30.0, 60.0),
    "scipy": (1000.0, None),
    "heyoka": (1.0, None),
    "occupancy": (0.90, 0.97),
}
NARROW = {  # over the scalar loop where both have vectors of 256 bits
    "engine Tsit5": (2.2, None),
    "engine Dopri8": (3.3, None),
    "engine Tsit5 float32": (4.0, None),
}


def against(dataset: xr.Dataset, ours: str, theirs: str) -> tuple[float, str]:
    """Return (cost of a peer over ours at the error of our row, a word on where it stops short).

    The peer's cost is interpolated between its own tolerances; NaN where one of them did not run.
    """
    mine = dataset.isel(row=np.flatnonzero(dataset.method.values == ours))
    part = dataset.isel(row=np.flatnonzero(dataset.method.values == theirs)).sortby("state_error")
    if not mine.sizes["row"] or not part.sizes["row"]:
        return np.nan, "not run"
    error, cost = part.state_error.values[::-1], part.wall.values[::-1]
    target = float(mine.state_error[0])
    at, how = cost_at(error, cost, target), ""
    if np.isnan(at):  # its own finest row: it is less accurate there
        at, how = float(cost[-1]), f"it reaches an error of {error[-1]:.0e} only"
    return at / float(mine.wall[0]), how


def asked(dataset: xr.Dataset) -> list[tuple[str, float, str, str]]:
    """Return (what, measured, asked, remark) of every line that the speed table asks for."""
    names = list(dict.fromkeys(str(m) for m in dataset.method.values))
    cores = int(dataset.cores.max())
    many = f", {cores} cores"
    rows: list[tuple[str, float, str, str]] = []

    narrow = "limited to AVX2" in str(dataset.attrs.get("machine"))

    def add(what, key, value, remark="", border=None):
        least, goal = border or ASKED[key]
        wanted = f"{least:g}" + (f" (goal {goal:g})" if goal else "")
        rows.append((what, value, wanted, remark))

    ours = [n for n in names if n.startswith("engine") and not n.endswith(many)]
    for name in ours:
        precision = "float32" if "float32" in name else "float64"
        for end in ("", many) if cores > 1 else ("",):
            ratio = against(dataset, name + end, f"numba scalar loop{end}")
            where = f"all {cores} cores" if end else "one core"
            border = NARROW.get(name) if narrow else None
            what = f"numba scalar loop, {name}, {where}"
            add(what, f"numba {precision}", *ratio, border=border)
    for name in ours if cores > 1 else ():
        walls = [dataset.wall.values[dataset.method.values == name + end] for end in ("", many)]
        if all(map(len, walls)):
            add(f"our one core, on {cores}, {name}", "cores", float(walls[0][0] / walls[1][0]))
    rivals = [n for n in names if "diffrax" in n]
    if rivals:
        right = {n: float(dataset.wrong_events.values[dataset.method.values == n].min())
                 for n in rivals}  # fmt: skip
        for name in (n for n in ours if "float32" not in n):
            ratios = {n: against(dataset, name, n) for n in rivals}
            best = min(rivals, key=lambda n: ratios[n][0])
            remark = f"{best}; wrong events in {right[best]:.1%} of its cells"
            for other in rivals:
                if other != best:
                    remark += f"; against {other} {ratios[other][0]:.3g}"
            what = f"diffeqsolve + Event per phase, the faster one, {name}"
            add(what, "diffrax", ratios[best][0], remark)
    for rival in (n for n in names if "scipy" in n or "heyoka" in n):
        for name in (n for n in ours if "float32" not in n):
            key = "scipy" if "scipy" in rival else "heyoka"
            add(f"{rival}, {name}", key, *against(dataset, name, rival))
    for name in ours:
        row = dataset.isel(row=np.flatnonzero(dataset.method.values == name)[0])
        add(f"occupancy, {name}, {int(row.cells)} trajectories", "occupancy", float(row.occupancy))
    return rows


def costs(dataset: xr.Dataset) -> list[tuple[str, float, str, str]]:
    """Return the lines of the table in which less is better."""
    facts, rows = dataset.attrs, []
    sizes = sorted(int(k[5:]) for k in facts if k.startswith("wall_") and k[5:].isdigit())
    if sizes:
        each = [float(facts[f"wall_{n}"]) * 1e6 for n in sizes]
        text = ", ".join(f"{n}: {e:.1f} us" for n, e in zip(sizes, each, strict=True))
        text += f"; {facts['duration_sizes']:g} s of motion each, all cores"
        rows.append((f"cost per trajectory, {sizes[0]} to {sizes[-1]}: most over least, less 1 [%]",
                     100 * (max(each) / min(each) - 1), "10", text))  # fmt: skip
    rows.append(("cold: a sweep's first block [s]", float(facts["compile_cold"]), "20", ""))
    rows.append(("the same in a second process, with the compilation cache [s]",
                 float(facts["compile_cached"]), "3", ""))  # fmt: skip
    if "memory_gib" in facts:
        rows.append(("memory at 1e6 trajectories in one batch [GiB]", float(facts["memory_gib"]),
                     "2", ""))  # fmt: skip
    return rows


def text(dataset: xr.Dataset, folder: Path | None = None) -> str:
    """Return the table as Markdown; ``folder``: where chart.h5 and maps.h5 may lie, of which it
    takes the work-precision of the engine's variants and the classes that float32 gets wrong.
    """
    attrs = dataset.attrs
    lines = [
        "# Speed",
        "",
        f"{attrs['duration']} s of motion each, {attrs['machine']}, load average "
        f"{attrs['load']:.1f} at the end, {attrs['created']}; medians of {attrs['repeats']} "
        "interleaved repeats, compilation apart.",
        "",
        "## Asked and measured",
        "",
        "Ratios of trajectories per second on as many cores, at the error of the engine's row "
        "(median position error at 20 ms); the peer's cost there is interpolated. Their schemes "
        "are of order 5, as Tsit5, but where Dopri8 is named, and heyoka's series.",
        "",
        "| against | measured | at least | met | |",
        "|---|---|---|---|---|",
    ]
    for what, value, wanted, remark in asked(dataset):
        met = "yes" if value >= float(wanted.split()[0]) else "**no**"
        met = "not run" if np.isnan(value) else met
        lines.append(f"| {what} | {value:.3g} | {wanted} | {met} | {remark} |")
    lines += ["", "| cost | measured | at most | met | |", "|---|---|---|---|---|"]
    for what, value, wanted, remark in costs(dataset):
        met = "yes" if value <= float(wanted) else "**no**"
        lines.append(f"| {what} | {value:.3g} | {wanted} | {met} | {remark} |")
    lines += [
        "",
        "## Rows",
        "",
        "Errors at 20 ms: median position error over the lip's length, and event time.",
        "",
        "| method | cores | rtol | cells | trajectories/s (10-90 %) | CPU us each | error | "
        "event time [s] | wrong events | occupancy |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for i in range(dataset.sizes["row"]):
        r = dataset.isel(row=i)
        occupancy = "" if np.isnan(r.occupancy) else f"{float(r.occupancy):.3f}"
        lines.append(
            f"| {r.method.item()} | {int(r.cores)} | {float(r.rtol):.0e} | {int(r.cells)} | "
            f"{float(r.per_second):.4g} ({1 / float(r.wall_high):.4g}-{1 / float(r.wall_low):.4g})"
            f" | {float(r.cpu) * 1e6:.4g} | {float(r.state_error):.1e} | "
            f"{float(r.event_time_error):.1e} | {float(r.wrong_events):.2%} | {occupancy} |"
        )
    lines.append("")
    if folder is not None:
        lines += variants(folder / "chart.h5") + float32_classes(folder / "maps.h5")
    return "\n".join(lines)


def variants(file: Path) -> list[str]:
    """Return error and cost of every variant of the engine on the chart's random batch."""
    if not file.exists():
        return []
    with xr.open_dataset(file, engine="h5netcdf") as dataset:
        if "batch" not in dataset.scene.values:
            return []
        part = dataset.sel(scene="batch").load()
    rows = [
        "## Work and precision of the engine's variants",
        "",
        f"From `{file.name}`: {int(part['cells'].max())} random blades of the reference sweep, "
        "20 ms, one core.",
        "",
        "| variant | setting | us each | steps | error at 20 ms | 90 % of cells | event time [s] | "
        "wrong events |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in (n for n in part.solver.values if str(n).startswith("engine")):
        for step in range(part.sizes["step"]):
            one = part.sel(solver=name).isel(step=step)
            if not np.isfinite(one.wall):
                continue
            rows.append(
                f"| {name} | {float(one.setting):.0e} | {float(one.wall) * 1e6:.1f} | "
                f"{float(one.steps):.0f} | {float(one.state_error):.1e} | "
                f"{float(one.state_error_p90):.1e} | {float(one.event_time_error):.1e} | "
                f"{float(one.wrong_events):.1%} |"
            )
    return [*rows, ""]


def float32_classes(file: Path) -> list[str]:
    """Return the share of classes that float32 gets wrong on the reference sweep."""
    if not file.exists():
        return []
    with xr.open_dataset(file, engine="h5netcdf") as dataset:
        part = dataset.load()
    single = np.flatnonzero(part.precision.values == "float32")
    rows = [
        "## float32 on the reference sweep",
        "",
        f"From `{file.name}`: {part.attrs['cells']} cells of 0.8 s. On "
        f"{float(part.attrs['undecided']):.2%} of them the two references differ (chaos, or an "
        "edge of a class); the last column is of the others.",
        "",
        "| rtol | class differs | of decided cells |",
        "|---|---|---|",
    ]
    for i in single:
        r = part.isel(row=int(i))
        rows.append(
            f"| {float(r.rtol):.0e} | {float(r.wrong):.2%} | {float(r.wrong_settled):.2%} |"
        )
    return [*rows, ""] if len(single) else []
