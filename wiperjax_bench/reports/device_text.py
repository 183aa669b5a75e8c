"""The text of `wiperjax bench speed --device`."""

import xarray as xr


def text(dataset: xr.Dataset) -> str:
    """Return the table as Markdown."""
    attrs = dataset.attrs
    lines = [
        "# Speed on one device",
        "",
        f"{attrs['device']} ({attrs['machine']}), {attrs['duration']} s of motion each, "
        f"{attrs['created']}; medians of {attrs['repeats']} interleaved repeats, compilation "
        "apart, all programs at once. Errors at 20 ms against the scalar loop at 1e-12.",
        "",
        "| method | rtol | batch | lanes | trajectories/s (10-90 %) | a turn [us] | occupancy | "
        "not finished | wrong events | error | event time [s] | first call [s] |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for i in range(dataset.sizes["row"]):
        r = {name: float(x) for name, x in dataset.isel(row=i).data_vars.items()}
        lines.append(
            f"| {dataset.method.values[i]} | {r['rtol']:.0e} | {r['cells']:.0f} | "
            f"{r['lanes']:.0f} | {r['per_second']:.4g} ({1 / r['wall_high']:.4g}-"
            f"{1 / r['wall_low']:.4g}) | {r['turn'] * 1e6:.3g} | {r['occupancy']:.3f} | "
            f"{r['failed']:.2%} | {r['wrong_events']:.2%} | {r['state_error']:.1e} | "
            f"{r['event_time_error']:.1e} | {r['first_call']:.1f} |"
        )
    return "\n".join([*lines, ""])
