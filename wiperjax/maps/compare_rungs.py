"""Which rung of the ladder does a scene need? Every rung is run, assessed and timed.

A rung suffices if it says what the lip says: the same class, mechanism and band, and frequency and
amplitude within a stated tolerance; for a reversal, the same ratio of forces too. One that is
`held` on the glass at any time does not, however near it is.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..machine import provenance
from ..machine.files import log
from ..noise.agreement import AMPLITUDE, FREQUENCY, Said, differences, held, said
from ..noise.run_class import words
from ..specs.errors import SpecError
from ..specs.load import load_scene, parse_scene
from ..specs.scene import SceneSpec
from ..vocabulary.codes import BANDS, LABELS, MECHANISMS
from ..vocabulary.kinds import MODELS
from . import around_scene

HINGED = "lip, hinge mass"  # the lip with a tenth of the tip mass at the hinge
HINGE_SHARE = 0.1
REFUSED = "cannot stand for it"  # in place of a class


@dataclass(frozen=True)
class Rung:
    """What one model says of one scene.

    Attributes:
        scene, model: what was run.
        label, mechanism, band: its class; `REFUSED` of a model that has not all that the scene
            asks for: a hinge mass, say.
        frequency: dominant frequency of the (stroke's) tip velocity [Hz].
        amplitude: standard deviation of the tip velocity [m/s]; of the strokes on a belt that
            reverses, unless the class is `reversal`: then the vibration just after V = 0.
        ratio: largest normal force around V = 0 over the mean outside; NaN on a steady belt.
        steps: trial steps of the motion.
        seconds: CPU time of a second of motion in a batch of blades around the scene; NaN where it
            is not known.
        share: CPU time over that of the lip.
        held: whether it is held on the glass where the lip would leave it.
        suffices: whether it agrees with the lip, which does not fail; the lip itself always.
    """

    scene: str
    model: str
    label: str
    mechanism: str
    band: str
    frequency: float
    amplitude: float
    ratio: float
    steps: int
    seconds: float = np.nan
    share: float = 1.0
    held: bool = False
    suffices: bool = True


def check_scene(path: str | Path) -> None:
    """Raises SpecError for a scene file that is wrong, has no rungs, or lies so near an end of a
    range that there is no map `around` it.
    """
    lip = load_scene(path, "lip")
    try:
        around_scene.around(lip)
    except SpecError as error:
        raise SpecError(f"{path}: {error}") from None


def compare(
    path: str | Path,
    hinged: bool = True,
    say: Callable[[str], None] = lambda text: None,
    costs: Callable[[Mapping[str, SceneSpec]], Mapping[str, float]] = around_scene.costs,
) -> list[Rung]:
    """Return what every rung says of the scene file `path`, poorest first, the lip judged by none.

    `hinged`: whether to run the lip with hinge mass too; it is compared, not a rung below.
    `say` is called with what begins, `SCENE: MODEL`. `costs` tells what a second of motion of each
    rung costs [s of CPU time]; it is given those that do not fail.

    Raises SpecError for a wrong file; a rung that fails numerically says `failed`, and one that has
    not all that the scene asks for `REFUSED`.
    """
    name, lip = Path(path).stem, load_scene(path, "lip")
    specs = {model: lip if model == "lip" else _poorer(path, model) for model in MODELS}
    if hinged and not lip.parameters()["hinge_mass"]:
        specs[HINGED] = _hinged(lip)
    able = {model: spec for model, spec in specs.items() if spec is not None}
    rungs = {}
    say(f"{name}: compiling")
    around_scene.ready(able.values())
    for model, spec in specs.items():
        say(f"{name}: {model}")
        rungs[model] = _run(name, model, spec)
    say(f"{name}: cost")
    seconds = costs({model: spec for model, spec in able.items() if rungs[model].label != "failed"})
    rungs = {
        model: replace(rung, seconds=seconds.get(model, np.nan)) for model, rung in rungs.items()
    }
    return [_judged(rung, rungs["lip"]) for rung in rungs.values()]


def lowest_sufficient(rungs: Iterable[Rung]) -> str:
    """Model of the first rung that suffices, of a result of `compare`."""
    return next(rung.model for rung in rungs if rung.suffices and rung.model in MODELS)


def preface(command: str) -> str:
    """What stands above the table that `command` makes; it may be read anywhere: without links."""
    return f"""# Which model does a scene need?

Made by `{command}`, its numbers measured on
{provenance.host_kind()}.

Rungs, poorest first: **block** on a belt (1 dof, constant load, linear spring; equals the lip
to first order about steady slip), **bar** (1 dof, the lip held on the glass), **lip** (2 dof, the
full model). Beside them the lip with a hinge mass of {HINGE_SHARE:.0%} of the tip's: not a rung
below, but what inertia at the hinge makes of the same blade (of one that has a hinge mass block and
bar cannot stand for it). Formulas: `wiperjax/blade/`.

A model suffices if it says what the lip says: class, mechanism and band the same, frequency
within {FREQUENCY:.0%} and amplitude within {AMPLITUDE:.0%}; for a reversal force ratio and
vibration within {AMPLITUDE:.0%}. A bar that is held on the glass where the lip would leave it,
at any time, does not suffice. The poorest that does is in bold. Any scene or sweep runs on it
with `--model` (or `model = "bar"` in the file); `wiperjax sweep --model auto` has a probe of some
cells choose (`docs/maps.md`, also for what a rung costs in a batch).

Amplitude: standard deviation of the tip velocity (of the strokes on a wiping belt; for a
reversal, the vibration in the scene's own `reversal_window` after it: twice the time of the
flip, `docs/classes.md`). A scene is the middle of a small map, as
`wiperjax sweep` makes it: {around_scene.SIDE**2} blades, load and speed within
{around_scene.SPREAD:.0%} of its own, with the settings that its `[run]` states (`rtol`, say).
Steps are those of the scene, tried ones. CPU time is that
of the engine on one core for a second of motion of one of those blades, the median of
{around_scene.TURNS} interleaved turns, without compilation. The default start
of lip and bar is phi = alpha at rest, of the block its relaxed spring. The frequency of a squeal
that comes and goes is that of its strongest line. Two blades on one linkage are no rung: that is
two contacts.

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
    names += ["steps", "CPU ms a s", "of lip", "suffices"]
    lines = [" | ".join(names), " | ".join(["---"] * len(names))] if head else []
    for rungs in results:
        lowest = lowest_sufficient(rungs)
        for rung in rungs:
            tells = rung.label not in ("quiet", "failed", "collapsed", REFUSED)
            costs = np.isfinite(rung.seconds)
            pitch = tells and rung.label != "reversal"
            cells = [
                rung.scene if rung is rungs[0] else "",
                f"**{rung.model}**" if rung.model == lowest else rung.model,
                f"{rung.label} ({rung.band})" if rung.label == "other" else rung.label,
                rung.mechanism.replace("_", " ") if tells else "",
                f"{rung.frequency:.1f}" if pitch else "",
                f"{rung.amplitude:.3g}" if tells else "",
                f"{rung.ratio:.2f}" if np.isfinite(rung.ratio) else "",
                str(rung.steps) if rung.label != REFUSED else "",
                f"{1e3 * rung.seconds:.3g}" if costs else "",
                f"{rung.share:.2f}" if np.isfinite(rung.share) else "",
                "yes" if rung.suffices else "no",
            ]
            lines.append(" | ".join(cells))
    return "\n".join(f"| {line} |" for line in lines) + "\n"


def _poorer(path: str | Path, model: str) -> SceneSpec | None:
    """The scene on a poorer model; None, and a word why, where that has not all that it asks for.

    As it is on the lip it was not refused.
    """
    try:
        return load_scene(path, model)
    except SpecError as error:
        log.warning("%s %s: %s", model, REFUSED, error)
        return None


def _hinged(spec: SceneSpec) -> SceneSpec:
    data = spec.document()
    mass = HINGE_SHARE * spec.parameters()["tip_mass"]
    return parse_scene(data | {"blade": data.get("blade", {}) | {"hinge_mass": mass}})


def _run(name: str, model: str, spec: SceneSpec | None) -> Rung:
    nothing = "none", "none", np.nan, np.nan, np.nan, 0
    if spec is None:
        return Rung(name, model, REFUSED, *nothing)
    try:
        found = around_scene.middle(spec)
    except ValueError:  # no start: a block without steady slip
        return Rung(name, model, "failed", *nothing)
    heard, named = said(found), words(found)
    return Rung(
        name,
        model,
        named["label"],
        named["mechanism"],
        named["band"],
        float(heard.frequency),
        float(heard.amplitude),
        float(heard.forces),
        int(found["steps"] + found["rejected_steps"]),
        held=bool(held(model, found)),
    )


def _judged(rung: Rung, lip: Rung) -> Rung:
    suffices = rung.model == "lip"
    if not suffices and rung.label != REFUSED:
        suffices = bool(differences(_said(rung), _said(lip)).tolerated) and not rung.held
    return replace(rung, share=rung.seconds / lip.seconds, suffices=suffices)


def _said(rung: Rung) -> Said:
    tables = (LABELS, rung.label), (MECHANISMS, rung.mechanism), (BANDS, rung.band)
    codes = (np.asarray(table[word]) for table, word in tables)
    return Said(*codes, *map(np.asarray, (rung.frequency, rung.amplitude, rung.ratio)))
