"""`diffrax.diffeqsolve` with `diffrax.Event`, restarted phase by phase, under vmap or `lax.map`.

What a JAX user writes, made correct (docs: events are looked for at the ends of steps only, and the
first in the list wins, not the earliest):

- one condition: the smallest of all guards of the regime, each positive inside, so the earliest
  crossing is found and then named;
- a guard that is zero at the start of a phase is divided by the time since then, so that it neither
  fires again nor hides a true crossing;
- steps are bounded, because two crossings inside one step are not seen.

Forces come from `wiperjax.Wiper` (`diffrax_wiper`); stepping, event detection and location are
diffrax's (`diffrax_trajectory`).
"""

from functools import partial

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..harness.interface import Answer, NotForThisScene
from ..scenes.scene import Scene
from .compiled import cells_of
from .diffrax_trajectory import LOG, Found, Marks, trajectory
from .engine import arrays


@partial(jax.jit, static_argnames=("solver", "mapped"))
def run(varying, shared, marks: Marks, rtol, solver, mapped: bool) -> Found:
    """Return what `trajectory` returns, for every cell."""

    def one(varying):
        wiper, start, scales = eqx.combine(varying, shared)
        return trajectory(wiper, start, marks, rtol, scales, solver)

    return jax.lax.map(one, varying) if mapped else jax.vmap(one)(varying)


def marks_of(scene: Scene) -> Marks:
    """Return the times that end a phase of every cell, in their order."""
    _, _, breaks, kinds = cells_of(scene)
    ends, samples = breaks[0][:-1], len(scene.sample_times)
    times = np.concatenate([ends, scene.sample_times])
    kinds = np.concatenate([kinds[:-1], np.zeros(samples, int)])
    numbers = np.concatenate([np.full(len(ends), -1), np.arange(samples)])
    order = np.argsort(times, kind="stable")
    return Marks(*(jnp.asarray(column[order]) for column in (times, kinds, numbers)))


class PerPhase:
    """diffeqsolve and Event per phase; ``mapped``: one cell after the other, else vmap."""

    setting_name = "rtol"
    settings = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)

    def __init__(self, mapped: bool, solver: type = diffrax.Tsit5, cells: int | None = None):
        self.mapped, self.solver = mapped, solver()
        self.name = f"diffrax Event per phase, {'lax.map' if mapped else 'vmap'}"
        self.name += f", {solver.__name__}" * (solver is not diffrax.Tsit5)
        self.cells = cells or (32 if mapped else 64)

    def available(self) -> str | None:
        return None

    def prepare(self, scene: Scene, setting: float):
        wiper, position, velocity, scales = arrays(scene, "float64")
        if np.any(scene.parameters()["hinge_mass"]):
            raise NotForThisScene("written for hinge_mass = 0")
        parts = jax.tree.map(
            lambda x: jnp.asarray(x) if isinstance(x, np.ndarray) else x,
            (wiper, (*position, *velocity), scales),
        )
        varying, shared = eqx.partition(
            parts, lambda x: eqx.is_array(x) and x.shape == (scene.cells,)
        )
        marks = marks_of(scene)
        rtol = jnp.asarray(setting)

        def call() -> Answer:
            found = run(varying, shared, marks, rtol, self.solver, self.mapped)
            kept, stopped, steps = jax.tree.map(np.asarray, found)
            samples = kept.samples[:, : len(scene.sample_times)]
            logged = np.minimum(kept.count, LOG)
            return Answer(
                scene.sample_times, samples[..., :2], samples[..., 2:],
                [times[:n] for times, n in zip(kept.times, logged, strict=True)],
                [kinds[:n] for kinds, n in zip(kept.kinds, logged, strict=True)],
                stopped, steps,
            )  # fmt: skip

        return call


RIVALS = [PerPhase(mapped=True), PerPhase(mapped=False)]
