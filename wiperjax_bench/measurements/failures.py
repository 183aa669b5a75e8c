"""The failure chart: every method on every hard scene, at every setting it offers.

**Right** means: in every cell and at every sample the tip is within `TOLERANCE` of the reference
position, as a share of the range of each coordinate in that cell. (A coordinate that hardly moves
has a twentieth of the other's range: a tip that only slides may sink in by 1/2000 of its way.)
**Wrong without a word**: some cell is not, and the method did not report failure of it. **Stopped
with an error**: what is not right was reported by the method itself. **Not run**: not installed
here, or the method cannot express the scene.
"""

import contextlib
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from enum import IntEnum
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

import wiperjax

from ..harness.batching import arrays, over_cells
from ..harness.interface import Answer, NotForThisScene, Rival
from ..harness.keep import Parts
from ..harness.measure import attributes, load
from ..rivals import every
from ..scenes.hard import SCENES
from ..scenes.scene import Scene

TOLERANCE = 0.01
STILL = 0.05  # least range of a coordinate, as a share of the other's
RESOLVED = 3000  # least steps of a reference: what grows out of 1e-12 no tolerance sees
PATIENCE = 1.0  # s: after a run longer than this finer settings are left out


class Outcome(IntEnum):
    """What one method at one setting made of one scene."""

    RIGHT = 0
    WRONG = 1
    STOPPED = 2
    NOT_RUN = 3


@jax.jit
def _engine(wiper, start, duration, times, rtol, steps):
    def one(wiper, s):
        solved = wiperjax.solve(
            wiper,
            duration,
            initial_state=((s[0], s[1]), (s[2], s[3])),
            rtol=rtol,
            sample_times=times,
            max_events=0,
            max_step=duration / steps,
        )
        return jnp.stack(solved.samples.position, -1), solved.result

    return over_cells(one, wiper, (), start)


def reference(scene: Scene, rtol: float = 1e-12, steps: int = RESOLVED) -> np.ndarray:
    """Return the positions (cells, samples, 2) [m] of a scene by the engine.

    It takes at least ``steps`` steps. Raises RuntimeError if a cell did not finish.
    """
    fixed = (arrays(scene.wiper), jnp.asarray(scene.start), scene.duration)
    times = jnp.asarray(scene.sample_times)
    position, result = map(np.asarray, _engine(*fixed, times, rtol, steps))
    if np.any(result != wiperjax.Result.FINISHED) or not np.all(np.isfinite(position)):
        raise RuntimeError(f"no reference for scene {scene.name!r}: result codes {result}")
    return position


def error(answer: Answer, exact: np.ndarray) -> np.ndarray:
    """Return the error (cells,) that `Outcome` is judged by; inf where a position is not finite."""
    cells = len(answer.position)
    extent = np.ptp(exact[:cells], axis=1, keepdims=True)
    extent = np.maximum(extent, STILL * extent.max(axis=-1, keepdims=True))
    off = (np.abs(answer.position - exact[:cells]) / extent).max(axis=(1, 2))
    return np.where(np.isfinite(off), off, np.inf)


def judge(answer: Answer, exact: np.ndarray) -> Outcome:
    """Return the outcome over all cells; one that is wrong without a word counts most."""
    right = error(answer, exact) <= TOLERANCE
    stopped = np.asarray(answer.stopped, bool)
    if np.any(~right & ~stopped):
        return Outcome.WRONG
    return Outcome.STOPPED if np.any(stopped) else Outcome.RIGHT


def measure(
    rivals: Iterable[Rival],
    scenes: dict[str, Callable[[], Scene]] | None = None,
    settings: int | None = None,
    tell: Callable[[str], None] = lambda line: None,
    parts: Parts | None = None,
) -> xr.Dataset:
    """Return outcome, error, seconds per trajectory and steps by (solver, scene, level).

    ``level`` counts a method's settings from coarse to fine; ``settings`` limits them (None: all).
    Seconds are wall time of one call for all cells, over the cells; the median of three where a
    call takes less than 0.3 s. Reasons of what was not run are in ``reason``. ``parts``: where
    finished methods are kept.
    """
    rivals = list(rivals)
    built = {name: make() for name, make in (scenes or SCENES).items()}
    exact: dict[str, np.ndarray] = {}
    levels = max(len(rival.settings[:settings]) for rival in rivals)
    shape = (len(rivals), len(built), levels)
    outcome = np.full(shape, Outcome.NOT_RUN, np.int8)
    setting, off, seconds, steps = (np.full(shape, np.nan) for _ in range(4))
    reason = np.full(shape[:2], "", object)
    for i, rival in enumerate(rivals):
        values = rival.settings[:settings]
        setting[i, :, : len(values)] = values
        missing = rival.available()
        if missing is not None:
            reason[i] = missing
            continue
        make = partial(measure_rival, rival, built, exact, settings, tell)
        found = parts.once(rival.name.replace("/", "-"), make, tell) if parts else make()
        for j, (runs, note) in enumerate(found):
            reason[i, j] = note
            for k, run_ in enumerate(runs):
                outcome[i, j, k], off[i, j, k], seconds[i, j, k], steps[i, j, k] = run_
    names = [rival.name for rival in rivals]
    axes = ("solver", "scene", "level")
    meanings = " ".join(o.name.lower() for o in Outcome)
    flags = {"flag_values": np.array([int(o) for o in Outcome], np.int8), "flag_meanings": meanings}
    return xr.Dataset(
        {
            "outcome": (axes, outcome, {"long_name": "outcome", **flags}),
            "setting": (axes, setting, {"long_name": "setting of the method, coarse to fine"}),
            "error": (axes, off, {"long_name": "largest position error over extent", "units": "1"}),
            "seconds": (axes, seconds, {"long_name": "wall time per trajectory", "units": "s"}),
            "steps": (axes, steps, {"long_name": "steps per trajectory", "units": "1"}),
            "reason": (axes[:2], reason.astype(str), {"long_name": "why settings were not run"}),
        },
        coords={
            "solver": names,
            "scene": [scene.name for scene in built.values()],
            "level": np.arange(levels),
            "setting_name": ("solver", [rival.setting_name for rival in rivals]),
            "about": ("scene", [scene.about for scene in built.values()]),
            "promise": ("scene", [scene.promise for scene in built.values()]),
        },
        attrs=attributes("where each method fails")
        | {"tolerance": TOLERANCE, "load_average": load()},
    )


def measure_rival(rival: Rival, built: dict[str, Scene], exact: dict, settings, tell) -> list:
    """Return, for each scene, [(outcome, error, seconds, steps) of each setting, note].

    ``exact``: references by scene, filled where one is missing.
    """
    compile_ahead(rival, built.values(), settings)
    found = []
    for name, scene in built.items():
        runs, note = [], ""
        for value in rival.settings[:settings]:
            try:
                call = rival.prepare(scene.head(rival.cells), value)
            except NotForThisScene as why:
                note = str(why)
                break
            if name not in exact:
                exact[name] = reference(scene)
            answer, spent = answer_and_time(call)
            outcome = judge(answer, exact[name])
            off = float(error(answer, exact[name]).max())
            each = spent / len(answer.position)
            runs.append([int(outcome), off, each, float(np.mean(answer.steps))])
            tell(
                f"{rival.name:36s} {name:16s} {value:8.0e} {outcome.name.lower():8s} "
                f"error {off:8.1e} {each:9.2e} s"
            )
            if spent > PATIENCE:
                note = f"finer settings left out: this one took {spent:.0f} s"
                break
        found.append([runs, note])
    return found


def compile_ahead(rival: Rival, built: Iterable[Scene], settings) -> None:
    """Run a method at its coarsest setting on every scene, two at a time.

    Compiling is most of the time this chart takes, and nothing is timed here.
    """

    def once(scene: Scene) -> None:
        with contextlib.suppress(NotForThisScene):
            call = rival.prepare(scene.head(rival.cells), rival.settings[:settings][0])
            getattr(call, "answer", call)()

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(once, built))


QUICK = ("engine Tsit5", "Moreau-Jean", "tanh, penalty, Tsit5", "scipy solve_ivp RK45")
# of the engine's variants those that may fail in different ways: each of the others would only
# compile four more programs
LEFT_OUT = ("engine Dopri5", "engine Dopri5 float32", "engine Dopri8 float32",
            "engine Bosh3 float32")  # fmt: skip


def run(
    quick: bool,
    methods: list[str] | None,
    tell: Callable[[str], None],
    parts: Parts | None = None,
) -> xr.Dataset:
    """Return `measure` of all methods, or of those with a part of ``methods`` in their name.

    ``quick``: four methods at three settings on two scenes, in less than a minute.
    Raises ValueError where no method is left.
    """
    chosen = [r for r in every() if methods is None or any(m in r.name for m in methods)]
    if methods is None:
        chosen = [r for r in chosen if r.name not in LEFT_OUT]
    if quick and methods is None:
        chosen = [r for r in chosen if r.name in QUICK]
    if not chosen:
        raise ValueError(f"method must be part of a method's name, but was {methods}")
    few = {name: SCENES[name] for name in ("grazing", "zeno")}
    return measure(chosen, few if quick else None, 3 if quick else None, tell, parts)


def answer_and_time(call: Callable) -> tuple[Answer, float]:
    """Return the answer of a prepared method and the wall time [s] of one call.

    Of the engine that is its single solve, vmapped: a batch with refill is not made for four cells.
    The first call may compile, and is timed only where it shows that a second would take too long.
    """
    call = getattr(call, "answer", call)
    begun = time.perf_counter()
    answer = call()
    first = time.perf_counter() - begun
    spent = []
    while first < 10 * PATIENCE and (not spent or (spent[0] < 0.3 and len(spent) < 3)):
        begun = time.perf_counter()
        call()
        spent.append(time.perf_counter() - begun)
    return answer, float(np.median(spent)) if spent else first


def loosest(dataset: xr.Dataset) -> np.ndarray:
    """Return (method, scene): the coarsest level from which all that ran is right; -1 if none."""
    codes = dataset.outcome.values
    first = np.full(codes.shape[:2], -1)
    for i, j in np.ndindex(first.shape):
        ran = codes[i, j][codes[i, j] != Outcome.NOT_RUN]
        bad = np.flatnonzero(ran != Outcome.RIGHT)
        after = bad[-1] + 1 if len(bad) else 0
        if after < len(ran):
            first[i, j] = after
    return first
