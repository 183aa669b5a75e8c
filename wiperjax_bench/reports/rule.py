"""The table behind `--target-error`, made from the chart's data."""

import json
from pathlib import Path

import numpy as np
import xarray as xr

from wiperjax.maps import accuracy
from wiperjax.numerics.runge_kutta import SOLVERS

SCENES = ("squeal", "chatter", "reversal", "zeno", "batch")  # blades; grazing is no sweep's norm
WRONG = 0.02  # share of cells with another sequence of events, at most
OWN_TABLE = Path(accuracy.__file__).with_name("accuracy_table.json")  # what `sweep` reads


def check(dataset: xr.Dataset) -> None:
    """Raise ValueError unless the chart may stand behind the package's own table."""
    missing = [s for s in SCENES if s not in dataset.get("scene", xr.DataArray([])).values]
    if missing or dataset.attrs.get("quick"):
        what = f"lacks {', '.join(missing)}" if missing else "is a quick one"
        raise ValueError(
            f"the package's own table needs a full chart, but this one {what}; "
            "with -o FILE the table goes elsewhere"
        )


def rows(dataset: xr.Dataset, clock: str = "wall") -> list[dict]:
    """Return solver, precision, rtol, error and relative cost of every measured engine setting.

    The error is the worst of the scenes'; the cost their geometric mean. A setting whose events
    are wrong in more than `WRONG` of the cells of a scene, or that stopped in one, or that was left
    out in one, is left out.

    Raises ValueError for a file that is no chart, or has no finished setting of the engine.
    """
    if "state_error" not in dataset or "scene" not in dataset.coords:
        raise ValueError("the file is not a chart (`wiperjax bench chart` makes one)")
    scenes = [s for s in SCENES if s in dataset.scene.values]
    found = []
    known = {
        " ".join(["engine", solver.__name__, *mark]): (name, precision)
        for name, solver in SOLVERS.items()
        for precision, mark in (("float64", ()), ("float32", ("float32",)))
    }  # what a sweep file can ask for; the chart has other variants beside
    for name in known.keys() & set(map(str, dataset.solver.values)):
        solver, precision = known[name]
        part = dataset.sel(solver=name, scene=scenes)
        for step in range(dataset.sizes["step"]):
            one = part.isel(step=step)
            error, cost = one.state_error_p90.values, one[clock].values
            if not np.all(np.isfinite(error)) or not np.all(np.isfinite(cost)):
                continue
            if one.stopped.max() > 0 or one.wrong_events.max() > WRONG:
                continue
            found.append(
                {
                    "solver": solver,
                    "precision": precision,
                    "rtol": float(one.setting.values[0]),
                    "error": float(f"{error.max():.2g}"),
                    "cost": float(np.exp(np.mean(np.log(cost)))),
                }
            )
    found = [r for r in found if r["precision"] == "float64" or r["rtol"] >= 1e-6]
    if not found:
        raise ValueError("the chart has no finished settings of the engine")
    least = min(r["cost"] for r in found)
    for row in found:
        row["cost"] = float(f"{row['cost'] / least:.3g}")
    return sorted(found, key=lambda r: r["cost"])


def write(dataset: xr.Dataset, output: Path, clock: str = "wall") -> list[dict]:
    """Write the table as JSON, with where it comes from; return its rows."""
    made = rows(dataset, clock)
    scenes = [s for s in SCENES if s in dataset.scene.values]
    head = {
        "about": f"work-precision of the engine, see {accuracy.__name__}",
        "machine": dataset.attrs["machine"],
        "created": dataset.attrs["created"],
        "scenes": scenes,
        "versions": json.loads(dataset.attrs["versions"]),
    }
    lines = ",\n".join("  " + json.dumps(row) for row in made)
    text = json.dumps(head, indent=1)[:-2] + ',\n "rows": [\n' + lines + "\n ]\n}\n"
    json.loads(text)
    output.write_text(text, encoding="utf-8")
    return made
