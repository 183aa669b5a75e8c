"""Regularised friction and penalty contact in diffrax: explicit (Tsit5) or implicit (Kvaerno5).

One number w refines the model: the width over which friction turns, as a share of the scene's
speed. Under its load the tip sinks into the glass by w^2 of its length, because a bounce lasts as
the root of that; and the solver's tolerance is a tenth of it, as a looser one does not see the
contact. So each curve has both errors in it, of the model and of the solver, kept in step.
"""

from functools import partial

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from ..harness.batching import absent, arrays, over_cells
from ..harness.interface import Answer
from ..scenes.scene import Scene
from .penalty import SmoothContact, Smoothing, damping_ratio, vector_field


def smooth_contact(system, width, sink) -> SmoothContact:
    """Return the contact with friction ``width`` [m/s] that gives ``sink`` [m] under the load."""
    return SmoothContact(width, system.normal_load / sink, damping_ratio(system.bounce))


def scaled_field(system, smooth: SmoothContact, smoothing: Smoothing, scales):
    """Return the vector field of z = (q / length, v / speed), as diffrax calls it.

    Scaled, because the error control has one absolute tolerance for all components.
    """
    length, speed = scales

    def field(t, z, args):
        q = tuple(length * x for x in z[:2])
        v = tuple(speed * x for x in z[2:])
        local = system.on_piece(jnp.asarray(system.first_piece(t)))
        rate, acceleration = vector_field(local, smooth, smoothing, t, q, v)
        return tuple(x / length for x in rate) + tuple(x / speed for x in acceleration)

    return field


def trajectory(system, start, model, rtol, times, scales, smoothing: Smoothing, solver):
    """Return positions, velocities q' (samples, 2), success and steps of one trajectory.

    ``model`` = (width [m/s], sink [m]).
    """
    system = system.prepared()
    field = scaled_field(system, smooth_contact(system, *model), smoothing, scales)
    length, speed = scales
    zero = jnp.zeros(())

    def local(t):
        return system.on_piece(jnp.asarray(system.first_piece(t)))

    v = local(zero).from_rates(zero, tuple(start[:2]), tuple(start[2:]))
    z = tuple(x / length for x in start[:2]) + tuple(x / speed for x in v)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(field),
        solver,
        t0=0.0,
        t1=times[-1],
        dt0=None,
        y0=z,
        saveat=diffrax.SaveAt(ts=times),
        stepsize_controller=diffrax.PIDController(rtol=rtol, atol=rtol),
        max_steps=400_000 if isinstance(solver, diffrax.AbstractERK) else 40_000,
        adjoint=diffrax.ForwardMode(),
        throw=False,
    )
    assert solution.ys is not None
    x, y, u, w = solution.ys
    q, v = (length * x, length * y), (speed * u, speed * w)
    v = jax.vmap(lambda t, q, v: local(t).rates(t, q, v))(times, q, v)
    fine = solution.result == diffrax.RESULTS.successful
    return jnp.stack(q, -1), jnp.stack(v, -1), fine, solution.stats["num_steps"]


@partial(jax.jit, static_argnames=("smoothing", "solver", "zeros"))
def run(wiper, cells, rtol, times, smoothing, solver, zeros):
    """`trajectory` of all ``cells`` = (start, model, scales); compiled once, whatever the scene's
    numbers and the setting.
    """

    def one(wiper, cell):
        start, model, scales = cell
        return trajectory(wiper, start, model, rtol, times, scales, smoothing, solver)

    return over_cells(one, wiper, zeros, cells)


class Regularised:
    """One smoothing with one solver; the setting is the width as a share of the scene's speed."""

    setting_name = "width / speed"
    cells = 16

    def __init__(self, name: str, smoothing: Smoothing, solver, settings):
        self.name, self.smoothing, self.solver, self.settings = name, smoothing, solver, settings

    def available(self):
        return None

    def prepare(self, scene: Scene, setting: float):
        return self.build(scene, setting, setting**2, max(0.1 * setting**2, 1e-12))

    def build(self, scene: Scene, width: float, sink: float, rtol: float):
        """Prepare with each share on its own: ``width`` of speed, ``sink`` of length, ``rtol``."""
        length, speed = (np.broadcast_to(np.asarray(s, float), scene.cells) for s in scene.scales)
        cells = scene.start, (width * speed, sink * length), (length, speed)
        fixed = (arrays(scene.wiper), jax.tree.map(jnp.asarray, cells), jnp.asarray(rtol))
        names = dict(smoothing=self.smoothing, solver=self.solver, zeros=absent(scene))
        times = jnp.asarray(scene.sample_times)
        jax.block_until_ready(run(*fixed, 1e-9 * times, **names))  # compiles

        def answer() -> Answer:
            q, v, fine, steps = map(np.asarray, run(*fixed, times, **names))
            stopped = ~fine | ~np.isfinite(q).all(axis=(1, 2))
            return Answer(scene.sample_times, q, v, None, None, stopped, steps)

        return answer


EXPLICIT = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4)
IMPLICIT = EXPLICIT + (1e-4, 3e-5)
RIVALS = (
    Regularised("tanh, penalty, Tsit5", "tanh", diffrax.Tsit5(), EXPLICIT),
    Regularised("tanh, penalty, Kvaerno5", "tanh", diffrax.Kvaerno5(), IMPLICIT),
    Regularised("smooth Stribeck, penalty, Tsit5", "root", diffrax.Tsit5(), EXPLICIT),
    Regularised("smooth Stribeck, penalty, Kvaerno5", "root", diffrax.Kvaerno5(), IMPLICIT),
)
