"""Which rung of the ladder does a scene need? Every rung is run, assessed and timed.

A rung suffices if it says what the lip says: the same class, mechanism and band, and frequency and
amplitude within a stated tolerance; for a reversal, the same ratio of forces too.
"""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..blade.rungs import MODELS
from ..noise.run_class import assess, words
from ..specs.load import load_scene, parse_scene
from ..specs.scene import SceneSpec
from . import scene
from .simulate import SAMPLES

FREQUENCY, AMPLITUDE = 0.02, 0.10  # tolerated, relative to the lip
HINGED = "lip, hinge mass"  # the lip with a tenth of the tip mass at the hinge
HINGE_SHARE = 0.1
TURNS = 3  # of a run that is timed


@dataclass(frozen=True)
class Rung:
    """What one model says of one scene.

    Attributes:
        scene, model: what was run.
        label, mechanism, band: its class.
        frequency: dominant frequency of the (stroke's) tip velocity [Hz].
        amplitude: standard deviation of the tip velocity [m/s]; of the strokes on a belt that
            reverses, unless the class is `reversal`: then the vibration just after V = 0.
        ratio: largest normal force around V = 0 over the mean outside; NaN on a steady belt.
        seconds, steps: CPU time and trial steps of the motion; compilation, and what a run of no
            length costs as well (checks, labels), are not counted.
        share: CPU time over that of the lip.
        suffices: whether it agrees with the lip.
    """

    scene: str
    model: str
    label: str
    mechanism: str
    band: str
    frequency: float
    amplitude: float
    ratio: float
    seconds: float
    steps: int
    share: float = 1.0
    suffices: bool = True


def compare(
    path: str | Path, hinged: bool = True, say: Callable[[str], None] = lambda text: None
) -> list[Rung]:
    """Return what every rung says of the scene file `path`, poorest first, the lip judged by none.

    `hinged`: whether to run the lip with hinge mass too; it is compared, not a rung below.
    `say` is called with what begins, `SCENE: MODEL`.

    Raises SpecError for a wrong file; a rung that fails numerically says `failed`.
    """
    name = Path(path).stem
    specs = {model: load_scene(path, model) for model in MODELS}
    if hinged:
        specs[HINGED] = _hinged(specs["lip"])
    rungs = {}
    for model, spec in specs.items():
        say(f"{name}: {model}")
        rungs[model] = _run(name, model, spec)
    lip = rungs["lip"]
    return [_judged(rung, lip) for rung in rungs.values()]


def lowest_sufficient(rungs: Iterable[Rung]) -> str:
    """Model of the first rung that suffices, of a result of `compare`."""
    return next(rung.model for rung in rungs if rung.suffices and rung.model in MODELS)


def preface() -> str:
    """What stands above the table in `docs/ladder.md`."""
    return f"""# Which model does a scene need?

Made by `wiperjax ladder sweeps/scenes/*.toml -o docs/ladder.md --force`; the numbers are measured.

Rungs, poorest first: **block** on a belt (1 dof, constant load, linear spring; equals the lip
to first order about steady slip), **bar** (1 dof, the lip held on the glass), **lip** (2 dof, the
full model). Beside them the lip with a hinge mass of {HINGE_SHARE:.0%} of the tip's: not a rung
below, but what inertia at the hinge makes of the same blade. Formulas: `wiperjax/blade/`.

A model suffices if it says what the lip says: class, mechanism and band the same, frequency
within {FREQUENCY:.0%} and amplitude within {AMPLITUDE:.0%}; for a reversal force ratio and
vibration within {AMPLITUDE:.0%}. The poorest that does is in bold. Any scene or sweep runs on it
with `--model` (or `model = "bar"` in the file).

Amplitude: standard deviation of the tip velocity (of the strokes on a wiping belt; for a
reversal, the vibration just after it). Steps and CPU time are of one motion on one core; what a
run of no length costs as well (checks, labels) and compilation are not counted; on a busy machine
shares scatter by a fifth. The default start of lip and bar is phi = alpha at rest, of the block its
relaxed spring. The frequency of a squeal that comes and goes is that of its strongest line. Two
blades on one linkage are no rung: that is two contacts.

"""


def summary(results: Iterable[list[Rung]]) -> str:
    """Markdown list: the poorest model that suffices for each scene, and its cost."""
    lines = []
    for rungs in results:
        lowest = lowest_sufficient(rungs)
        chosen = next(rung for rung in rungs if rung.model == lowest)
        lip = next(rung for rung in rungs if rung.model == "lip")
        steps = chosen.steps / max(lip.steps, 1)
        cost = f", {chosen.share:.2f} of the CPU time and {steps:.2f} of the steps"
        lines.append(f"- {chosen.scene}: {lowest}{'' if chosen is lip else cost}")
    return "\n".join(lines) + "\n"


def table(results: Iterable[list[Rung]], head: bool = True) -> str:
    """Markdown table of results of `compare`, a row a rung; the lowest that suffices in bold.

    `head`: whether the columns' names stand above it.
    """
    names = ["scene", "model", "class", "mechanism", "Hz", "amplitude m/s", "force ratio"]
    names += ["steps", "CPU s", "of lip", "suffices"]
    lines = [" | ".join(names), " | ".join(["---"] * len(names))] if head else []
    for rungs in results:
        lowest = lowest_sufficient(rungs)
        for rung in rungs:
            tells = rung.label not in ("quiet", "failed", "collapsed")
            pitch = tells and rung.label != "reversal"
            cells = [
                rung.scene if rung is rungs[0] else "",
                f"**{rung.model}**" if rung.model == lowest else rung.model,
                f"{rung.label} ({rung.band})" if rung.label == "other" else rung.label,
                rung.mechanism.replace("_", " ") if tells else "",
                f"{rung.frequency:.1f}" if pitch else "",
                f"{rung.amplitude:.3g}" if tells else "",
                f"{rung.ratio:.2f}" if np.isfinite(rung.ratio) else "",
                str(rung.steps),
                f"{rung.seconds:.3f}",
                f"{rung.share:.2f}",
                "yes" if rung.suffices else "no",
            ]
            lines.append(" | ".join(cells))
    return "\n".join(f"| {line} |" for line in lines) + "\n"


def _hinged(spec: SceneSpec) -> SceneSpec:
    data = spec.document()
    mass = HINGE_SHARE * spec.parameters()["tip_mass"]
    return parse_scene(data | {"blade": data.get("blade", {}) | {"hinge_mass": mass}})


def _run(name: str, model: str, spec: SceneSpec) -> Rung:
    try:
        run = scene.run_scene(spec)  # compiles
    except ValueError:  # no start: a block without steady slip
        nothing = ("failed", "none", "none", np.nan, np.nan, np.nan, 0.0, 0)
        return Rung(name, model, *nothing)
    # what a run of no length costs as well (checks, labels) is not the model's
    spent = np.median([_spent(spec) - _spent(_brief(spec)) for _ in range(TURNS)])
    seconds = max(float(spent), 0.0)  # a difference, and nothing where the motion costs nothing
    found = assess(run)
    said = words(found)
    loud = "velocity_rms"
    if "velocity_rms_stroke" in found:
        loud = "vibration_reversal" if said["label"] == "reversal" else "velocity_rms_stroke"
    ratio = np.nan
    if "normal_force_max_reversal" in found:
        ratio = float(found["normal_force_max_reversal"] / found["normal_force_mean_stroke"])
    return Rung(
        name,
        model,
        said["label"],
        said["mechanism"],
        said["band"],
        float(found["dominant_frequency"]),
        float(found[loud]),
        ratio,
        seconds,
        int(run.attrs["steps"]),
    )


def _spent(spec: SceneSpec) -> float:
    """Return the processor time [s] of a run that is compiled."""
    begun = time.process_time()
    scene.run_scene(spec)
    return time.process_time() - begun


def _brief(spec: SceneSpec) -> SceneSpec:
    """Return the scene cut to one sample interval."""
    interval = spec.run.sample_interval or spec.run.duration / SAMPLES
    short = spec.run.model_copy(update={"duration": interval, "sample_interval": interval})
    return spec.model_copy(update={"run": short})


def _judged(rung: Rung, lip: Rung) -> Rung:
    same = (rung.label, rung.mechanism, rung.band) == (lip.label, lip.mechanism, lip.band)
    if same and lip.label not in ("quiet", "failed", "collapsed"):
        if lip.label != "reversal":
            same &= abs(rung.frequency - lip.frequency) <= FREQUENCY * lip.frequency
        else:
            same &= abs(rung.ratio - lip.ratio) <= AMPLITUDE * lip.ratio
        same &= abs(rung.amplitude - lip.amplitude) <= AMPLITUDE * lip.amplitude
    fields = vars(rung) | {"share": rung.seconds / (lip.seconds or np.nan), "suffices": bool(same)}
    return Rung(**fields)
