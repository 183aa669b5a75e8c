"""The text of `wiperjax bench random`: how many blades ended how, and what the referee said."""

import json

import numpy as np
import xarray as xr

from wiperjax.vocabulary.codes import Result

from ..measurements.referee import VERDICTS
from .words import versions

LISTED = 20  # blades that the text names


def text(dataset: xr.Dataset) -> str:
    """Return the page of ``dataset``."""
    groups = [f"{kind}{', hinge mass' * hinge}" for kind, hinge in json.loads(dataset.groups)]
    result, group = dataset["result"].to_numpy(), dataset["group"].to_numpy()
    count = len(result)
    steps = dataset["steps"].to_numpy()
    lines = [
        f"# {count} random blades",
        "",
        f"Every parameter over decades, all belts, restitution from 0 to 1; "
        f"{1e3 * dataset.duration:g} ms each at a sweep's default settings. "
        f"{dataset.cpu:.0f} s of processor time on {dataset.machine}.",
        "",
        "| ended as | " + " | ".join(groups) + " | all |",
        "|---" * (len(groups) + 2) + "|",
    ]
    for code in np.unique(result):
        cells = [np.sum((result == code) & (group == g)) for g in range(len(groups))]
        row = " | ".join(str(n) for n in [*cells, np.sum(result == code)])
        lines.append(f"| {Result(code).name.lower()} | {row} |")
    lines += [
        "",
        f"Trial steps: median {np.median(steps):.0f}, 99th percentile "
        f"{np.quantile(steps, 0.99):.0f}, most {steps.max()}. Steps not proved free of events: "
        f"{int(dataset['unproved'].sum())}, in {int(np.sum(dataset['unproved'] > 0))} blades.",
        "",
        *_judged(dataset),
        versions(dataset),
        "",
    ]
    return "\n".join(lines)


def _judged(dataset: xr.Dataset) -> list[str]:
    """Return the verdicts, and the blades that want an explanation."""
    verdict = dataset["verdict"].to_numpy()
    if not len(verdict):
        return ["No reference was given (`--reference tests/helpers/reference`).", ""]
    lines = ["| beside the independent reference | blades | |", "|---|---|---|"]
    for name, meaning in VERDICTS.items():
        lines.append(f"| {name} | {np.sum(verdict == name)} | {meaning} |")
    agreed = int(dataset["agreed"].sum())
    lines += ["", f"{agreed} events agree in kind, order and regimes.", ""]
    told = [np.flatnonzero(verdict == name) for name in ("different", "one of several", "failed")]
    for at in np.concatenate(told)[:LISTED]:
        row = {k: dataset[k].to_numpy()[at] for k in ("judged_chunk", "judged_place", "agreed")}
        chunk, place = int(row["judged_chunk"]), int(row["judged_place"])
        code = Result(int(dataset["result"][chunk * dataset.attrs["chunk"] + place])).name.lower()
        lines.append(
            f"- chunk {chunk}, blade {place}: {verdict[at]} after {int(row['agreed'])} events, "
            f"ended as {code}"
        )
    return [*lines, ""]
