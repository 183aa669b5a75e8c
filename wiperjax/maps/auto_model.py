"""`model = "auto"`: the poorest rung of the ladder that says what the lip says of some cells.

The cells of a probe are spread over the grid as the digest of the specification has it, so that the
same sweep is always given the same model. All rungs compute them; the poorest whose every cell is
the lip's, within the tolerances of `noise.agreement`, computes the map. Cells in which the lip
fails tell nothing; where they are most of the probe, it is the lip. From then on the sweep is that
of this model, as if a person had named it, and its attributes say why. What a probe misses, a map
of the bar tells by itself where the lip would leave the glass (`noise.class_counts.lifted_count`).
"""

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..machine import jax_settings
from ..machine.files import StoreError
from ..noise.agreement import LIP, POORER, Differences, Said, differences, held, said
from ..specs.errors import SpecError
from ..store import manifest
from ..store.whole import open_map
from ..vocabulary.codes import LABELS, NOT_COMPUTED
from ..vocabulary.kinds import AUTO, MODELS
from .block import Evaluate
from .computing import Blocks, computing
from .refine.grid import Grid
from .refine.points import Points

FEWEST, MOST = 5, 7  # binary digits of the number of cells in a probe: 32 to 128
SHARE = 32  # one of so many cells in between
DOUBT = 0.05  # probability that more of the map is unlike the lip than is said
CHOICE, PROBE = "model_choice", "model_probe"  # attributes of the map


def on_chosen_model(spec: Any, *, evaluate: Evaluate | None = None, workers: Any = None) -> Any:
    """The sweep `spec` on the model that a probe chooses, if it asks for one by `auto`; else as it
    is. `evaluate`, `workers`: as in `sweep`.
    """
    if spec.model != AUTO:
        return spec
    blocks, _ = computing(spec, evaluate, workers)
    here = evaluate is None and workers is None
    return _chosen(spec, blocks, here)


def as_chosen_for(output: Path, spec: Any) -> Any:
    """The sweep `spec` on the model that was chosen for the map at `output`, finished or not, if
    one was and `spec` asks for it by `auto`; else as it is. That the map is of this sweep, the
    driver sees to.
    """
    if spec.model != AUTO:
        return spec
    attrs: Mapping[str, Any] = {}
    if (found := manifest.read(manifest.parts_of(output))) is not None:
        attrs = found["map"]["attrs"]
    elif output.is_file():
        with suppress(StoreError), open_map(output) as ds:
            attrs = ds.attrs
    if attrs.get("model") not in MODELS or not {CHOICE, PROBE} <= attrs.keys():
        return spec
    return spec.on(str(attrs["model"]), {name: str(attrs[name]) for name in (CHOICE, PROBE)})


def probe_cells(spec: Any) -> np.ndarray:
    """Numbers of the cells of a probe, ascending: the first of a scrambled Sobol sequence over the
    axes, its seed the digest of `spec`. All cells of a map that has no more.
    """
    digits = int(np.clip(np.log2(max(spec.size / SHARE, 1)), FEWEST, MOST))
    if spec.size <= 2**digits:
        return np.arange(spec.size)
    from scipy.stats import qmc  # half a second

    sequence, found = qmc.Sobol(len(spec.shape), rng=int(spec.digest()[:16], 16)), {}
    while len(found) < 2**digits:  # on a coarse grid points fall into one cell
        places = (sequence.random(2**digits) * spec.shape).astype(np.int64)
        cells = np.ravel(np.ravel_multi_index(tuple(places.T), spec.shape))
        found |= dict.fromkeys(cells.tolist())
    return np.sort(list(found)[: 2**digits])


class Probed(NamedTuple):
    """What the lip says of the cells of a probe, counted."""

    cells: int
    failed: int
    quiet: int

    @classmethod
    def of(cls, lip: Said) -> "Probed":
        """Of what it says of each."""
        failed, quiet = (int((lip.label == LABELS[name]).sum()) for name in ("failed", "quiet"))
        return cls(len(lip.label), failed, quiet)

    @property
    def told(self) -> int:
        """Cells that a rung can be compared by."""
        return self.cells - self.failed


class Unlike(NamedTuple):
    """How a rung differs from the lip in the cells of a probe in which the lip does not fail.

    Attributes:
        differing: cells in which the difference is not tolerated.
        renamed: those of them of another class, mechanism or band.
        frequency, amplitude, forces: largest relative differences in the others; None where none of
            them has any to compare.
    """

    differing: int
    renamed: int
    frequency: float | None
    amplitude: float | None
    forces: float | None

    @classmethod
    def of(cls, found: Differences) -> "Unlike":
        """Of the differences in each cell."""
        renamed, numbers = found.told & found.name, (found.frequency, found.amplitude, found.forces)
        compared = (x[found.told & ~found.name & ~np.isnan(x)] for x in numbers)
        largest = (float(x.max()) if len(x) else None for x in compared)
        return cls(int((found.told & ~found.tolerated).sum()), int(renamed.sum()), *largest)


def _chosen(spec: Any, blocks: Blocks, here: bool) -> Any:
    """The sweep on the poorest model that suffices; `here`: this process computes the blocks."""
    rungs: dict[str, Any] = {}
    refused: dict[str, str] = {}
    for model in POORER:
        try:
            rungs[model] = spec.on(model)
        except SpecError as error:
            refused[model] = str(error)
    unlike, seen = {}, Probed(0, 0, 0)
    if rungs:
        cells = probe_cells(spec)
        every = {model: _probe(rung, cells) for model, rung in {LIP: spec.on(LIP), **rungs}.items()}
        if here:
            from .cells.batch import compile_all  # jax, of the process that computes

            compile_all(every.values(), 2**MOST, jax_settings.cores())
        told = {model: _said(probe, blocks) for model, probe in every.items()}
        lip = told.pop(LIP)
        seen = Probed.of(lip)
        unlike = {model: Unlike.of(differences(found, lip)) for model, found in told.items()}
    same = [model for model, found in unlike.items() if not found.differing]
    model = same[0] if same and seen.told >= seen.failed else LIP
    probed = {name: found._asdict() for name, found in unlike.items()}
    probed |= {name: {"refused": why} for name, why in refused.items()}
    attributes = {
        CHOICE: _words(model, unlike, refused, seen, spec.size),
        PROBE: json.dumps(seen._asdict() | probed, sort_keys=True),
    }
    return spec.on(model, attributes)


def _probe(spec: Any, cells: np.ndarray) -> Points:
    """Some cells of a sweep; statistics and names are all that is computed of them."""
    return Points(spec, Grid(spec.axes, 0), cells, room=2**MOST)


def _said(probe: Points, blocks: Blocks) -> Said:
    """What a model says of the cells of a probe: nothing of the lip's where it is `held`."""
    (block,) = blocks(probe, {0: (0, probe.size)})
    found, none = said(block.columns), held(probe.model, block.columns)
    return found._replace(mechanism=np.where(none, NOT_COMPUTED, found.mechanism))


def _words(
    model: str, unlike: Mapping[str, Unlike], refused: Mapping[str, str], seen: Probed, size: int
) -> str:
    """What was chosen and at what disagreement, in one line; `size`: cells of the map."""
    parts = []
    if seen.told < seen.failed:
        cells = f"{seen.failed} of {seen.cells} cells of a probe"
        parts.append(f"it fails in {cells}, too many to choose by")
    for name, found in unlike.items():
        if name == model:
            within = _within(found, seen)
            alike = f"as the lip in all {seen.told} cells of a probe ({within})"
            if seen.cells < size:
                share = f"{100 * DOUBT ** (1 / seen.told):.3g} % of the map or more"
                alike += f", so in {share}, {100 * (1 - DOUBT):.0f} % sure"
            parts.insert(0, alike)
            break  # richer ones were not needed
        if found.differing:
            named = f"{found.renamed} by another name"
            cells = f"{found.differing} of {seen.told} cells"
            parts.append(f"{name} is unlike the lip in {cells} ({named})")
    parts += [f"{name} cannot stand for it ({why})" for name, why in refused.items()]
    return f"{model}: {'; '.join(parts)}"


def _within(found: Unlike, seen: Probed) -> str:
    """By what a rung was chosen, and at what largest differences of what could be compared."""
    names = "frequency", "amplitude", "force ratio"
    most = zip(names, (found.frequency, found.amplitude, found.forces), strict=True)
    parts = [f"without {seen.failed} in which the lip fails"] if seen.failed else []
    parts += [f"{seen.quiet} quiet"] if seen.quiet else []
    return ", ".join(parts + [f"{name} within {_percent(x)}" for name, x in most if x is not None])


def _percent(share: float) -> str:
    """A bound in words; what no one can hear is not told to its last digit."""
    return f"{max(100 * share, 0.01):.2g} %"
