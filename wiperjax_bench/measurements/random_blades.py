"""`wiperjax bench random`: blades drawn wide at default settings, and what became of each.

Every blade leaves its result code and what it cost. Some, every failure, every one flagged as
indeterminate and every one a hundred times dearer than the rest leave their events too, for a
`Referee`.
"""

import json
import time
from collections import Counter
from pathlib import Path

import diffrax
import equinox as eqx
import jax
import numpy as np
import xarray as xr

from wiperjax.engine.carry.problem import Integration, Recording, make_case
from wiperjax.engine.lanes import Pool, run_pool
from wiperjax.maps.cells.devices import dearest_first, lane_count
from wiperjax.specs.sweep import RTOL
from wiperjax.specs.tables import SweepRun
from wiperjax.vocabulary.codes import Event, Result

from ..harness import measure
from ..harness.keep import Parts
from ..scenes import wide
from .referee import ENDED, LOG, Referee

DURATION = 0.02  # s
SOLVER = diffrax.Dopri8()  # and `RTOL`: what a sweep takes where its file says nothing
MAX_STEPS = SweepRun.model_fields["max_steps"].default
CHUNK = 16384  # fewer are slower: a chunk waits for its few longest
DEAR = 100  # times the median steps
SEED = 20261123
COLUMNS = ("result", "steps", "rejected", "unproved", "events")


@eqx.filter_jit
def batch(wiper, start, count, rtol, lanes):
    """Return the `Outcome` of blades at the default settings, with their events."""
    integration = Integration(SOLVER, rtol, None, MAX_STEPS)
    state = (start[0], start[1]), (start[2], start[3])
    case = make_case(wiper, DURATION, state, integration, Recording(max_events=LOG))
    return run_pool(Pool(case, count), lanes)[0].tree()


def blades(group: int, drawn: wide.Drawn):
    """Return the `Outcome` of ``drawn``, as NumPy arrays in its order."""
    wiper = wide.wiper(group, drawn)
    cells = len(drawn.start)
    order = dearest_first(wiper, cells)
    ordered = jax.tree.map(lambda x: x[order] if np.ndim(x) else x, wiper)
    back, lanes = np.argsort(order), lane_count("float64", cells)
    found = batch(ordered, drawn.start[order].T, np.int32(cells), np.float64(RTOL), lanes)
    return jax.tree.map(lambda x: np.asarray(x)[back] if np.ndim(x) else x, found)


def logged(outcome, i: int) -> list[list]:
    """Return the events of blade ``i``: [time, kind, regime before, regime after] each."""
    log = outcome.log
    kept = slice(min(int(log.count[i]), LOG))
    columns = (np.asarray(x[i])[kept].tolist() for x in (log.time, log.kind, log.before, log.after))
    return [list(row) for row in zip(*columns, strict=True)]


def chunk_of(number: int, every: int) -> dict:
    """Return codes and costs of a chunk's blades, and the events of those for the referee."""
    group = number % len(wide.GROUPS)
    drawn = wide.draw(group, SEED, number, CHUNK)
    spent = time.process_time()
    outcome = blades(group, drawn)
    columns = {name: getattr(outcome, name).tolist() for name in COLUMNS}
    steps = outcome.steps
    chosen = ~np.isin(outcome.result, ENDED) | (steps > DEAR * np.median(steps))
    chosen |= outcome.result == Result.PAINLEVE_INDETERMINATE
    chosen[::every] = True
    logs = {str(i): logged(outcome, i) for i in np.flatnonzero(chosen).tolist()}
    return {"group": group, "columns": columns, "logs": logs, "cpu": time.process_time() - spent}


def run(output: Path, count: int, every: int, reference: Path | None, say=print) -> xr.Dataset:
    """Return the dataset of ``count`` blades (rounded up to chunks). One in ``every`` and all
    that failed, were flagged or were dear have a verdict where ``reference`` names the folder of
    its code.

    Finished chunks stay in `<output>.parts/`: a later call may ask for more.
    """
    chunks = -(-count // CHUNK)
    parts = Parts(output, {"chunk": CHUNK, "every": every, "seed": SEED, "rtol": RTOL})
    referee = None if reference is None else Referee(reference, DURATION, RTOL)
    quiet = lambda text: None
    found, rows = [], []
    for number in range(chunks):
        part = parts.once(f"blades-{number}", lambda n=number: chunk_of(n, every), quiet)
        codes = np.array(part["columns"]["result"])
        say(f"chunk {number + 1} of {chunks} ({'-'.join(_name(part['group']))}): "
            f"{np.sum(~np.isin(codes, ENDED))} failed, {part['cpu']:.0f} s")  # fmt: skip
        found.append(part)
    for number, part in enumerate(found):
        if referee is None:
            break
        judge = lambda n=number, p=part: _judged(referee, n, p)
        verdicts = parts.once(f"verdicts-{number}", judge, quiet)
        rows += [[number, int(i), *verdict] for i, verdict in verdicts.items()]
        counts = Counter(verdict[0] for verdict in verdicts.values())
        said = ", ".join(f"{count} {what}" for what, count in counts.most_common())
        say(f"judged {number + 1} of {chunks}: {said}")
    dataset = _dataset(found, rows, every)
    small = {str(name): {"zlib": True} for name in dataset.variables if name != "verdict"}
    dataset.to_netcdf(output, engine="h5netcdf", encoding=small)
    return dataset


def _name(group: int) -> tuple[str, ...]:
    kind, hinge = wide.GROUPS[group]
    return (kind, "hinge") if hinge else (kind,)


def _judged(referee: Referee, number: int, part: dict) -> dict:
    drawn = wide.draw(part["group"], SEED, number, CHUNK)
    results = part["columns"]["result"]
    return {
        i: referee.verdict(drawn, int(i), log, results[int(i)]) for i, log in part["logs"].items()
    }


def _dataset(found: list[dict], rows: list[list], every: int) -> xr.Dataset:
    """Put chunks and verdicts together; failures and dear blades can be drawn again from it."""
    columns = {
        name: ("blade", np.concatenate([part["columns"][name] for part in found]).astype("int32"))
        for name in COLUMNS
    }
    group = np.repeat([part["group"] for part in found], CHUNK).astype("int32")
    names = ("judged_chunk", "judged_place", "verdict", "agreed", "known", "lag")
    verdicts = {
        name: ("judged", np.array([row[k] for row in rows], float))
        for k, name in enumerate(names)
        if name != "verdict"
    }
    verdicts["verdict"] = ("judged", np.array([row[2] for row in rows], "U16"))
    return xr.Dataset(
        columns | {"group": ("blade", group)} | verdicts,
        attrs=measure.attributes("blades drawn wide, at default settings")
        | {
            "groups": json.dumps(wide.GROUPS),
            "events": json.dumps({e.name: int(e) for e in Event}),
            "chunk": CHUNK,
            "seed": SEED,
            "every": every,
            "duration": DURATION,
            "cpu": sum(part["cpu"] for part in found),
        },
    )
