"""The largest stable step of each method, measured, beside what linear theory says.

Three stiffnesses, each on a blade at rest that is disturbed a little:

- **friction**: the tip sticks to the belt, by friction regularised over a width [m/s];
- **contact**: the tip rests on a penalty glass of a stiffness [N/m per m];
- **spring**: the lip flies and swings on its neck, of a stiffness [N m/rad per m], damped.

Theory is that of `stability_theory`. Measured: the largest fixed step at which the disturbance does
not grow, by bisection on the actual methods. Set-valued methods (the engine, Moreau-Jean) have
neither of the first two stiffnesses: they are measured on the same blade.
"""

import dataclasses
from collections.abc import Callable
from functools import partial

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

import wiperjax
from wiperjax import SteadyBelt, Wiper

from ..harness.measure import attributes
from ..rivals import moreau_jean
from ..rivals.penalty import SmoothContact, damping_ratio
from ..rivals.regularised import scaled_field
from .stability_theory import RANGE, stability_function, theoretical, theta_function

STEPS = 2000  # of a trial; a disturbance outside the region grows by far more than GROWTH in them
DISTURBANCE, GROWTH = 1e-6, 10.0  # small: stages of an unstable step reach much farther
EXPLICIT = {
    "Bosh3": diffrax.Bosh3,
    "Tsit5": diffrax.Tsit5,
    "Dopri5": diffrax.Dopri5,
    "Dopri8": diffrax.Dopri8,
}


def bisect(grows: Callable[[float], bool], eigenvalue: float) -> float:
    """Return the largest step [s] at which ``grows`` is false; inf where none grows in `RANGE`."""
    low, high = 0.01 / eigenvalue, RANGE / eigenvalue
    if not grows(high):
        # the region may be left and entered again: look below, too
        inside = [s for s in np.geomspace(0.3, 30, 9) / eigenvalue if grows(float(s))]
        if not inside:
            return np.inf
        high = float(inside[0])
    for _ in range(12):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if grows(middle) else (middle, high)
    return float(np.sqrt(low * high))


def resting_blade() -> Wiper:
    """Return the blade of the first two problems: upright on glass at rest, its neck stiff."""
    return Wiper(belt=SteadyBelt(0.0), neck_stiffness=2.0)


@partial(jax.jit, static_argnames="solver")
def _fixed_steps(z, smooth, step, solver):
    """Return the states after each of `STEPS` steps of the smooth contact, in its own scales."""
    wiper = resting_blade().prepared()
    field = scaled_field(wiper, smooth, "tanh", _scales(wiper, smooth))
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(field), solver, 0.0, step * STEPS, step, z,
        stepsize_controller=diffrax.ConstantStepSize(), max_steps=STEPS + 1, throw=False,
        adjoint=diffrax.ForwardMode(), saveat=diffrax.SaveAt(steps=True),
    )  # fmt: skip
    assert solution.ys is not None
    return jnp.stack(solution.ys, -1)


def _scales(wiper: Wiper, smooth: SmoothContact):
    """Scales of the fast motion: the depth under the load, and the width of friction."""
    return wiper.normal_load / smooth.stiffness, smooth.width


@jax.jit
def smooth_problem(width, stiffness):
    """Return (contact, state at rest, Jacobian [1/s]) of the tip on smooth contact, scaled."""
    wiper = resting_blade().prepared()
    smooth = SmoothContact(width, stiffness, damping_ratio(wiper.restitution))
    field = scaled_field(wiper, smooth, "tanh", _scales(wiper, smooth))
    rate = lambda z: jnp.stack(field(jnp.zeros(()), tuple(z), None))
    # upright: the load presses the tip in by the unit of length, less what the support gives way
    share = smooth.stiffness / (smooth.stiffness + wiper.support_stiffness)
    rest = jnp.array([0.0, -1.0, 0.0, 0.0]) * share
    return smooth, rest, jax.jacfwd(rate)(rest)


def measure_smooth(solver, width: float, stiffness: float, disturbed: int) -> tuple[float, float]:
    """Return the (theoretical, measured) largest stable step [s] of a diffrax solver.

    ``disturbed``: the coordinate that is displaced and watched, 1: y (in depths under the load),
    2: slip speed (in widths).
    """
    smooth, rest, jacobian = smooth_problem(jnp.asarray(width), jnp.asarray(stiffness))
    eigenvalues = np.linalg.eigvals(np.asarray(jacobian))
    start = tuple(rest.at[disturbed].add(DISTURBANCE))

    def grows(step: float) -> bool:
        states = np.asarray(_fixed_steps(start, smooth, jnp.asarray(step), solver)[:STEPS])
        # the largest on the way, for saturated friction may end anywhere
        off = np.abs(states[:, disturbed] - float(rest[disturbed]))
        known = off[np.isfinite(off)]
        if np.any(known > GROWTH * DISTURBANCE):
            return True
        # the root search of an implicit solver may give up once all that is left is rounding
        ends = known[-1] if known.size else np.inf
        return len(known) < STEPS and ends >= 0.1 * DISTURBANCE

    fastest = float(np.abs(eigenvalues).max())
    return theoretical(stability_function(solver), eigenvalues), bisect(grows, fastest)


def swinging_blade(stiffness: float) -> tuple[Wiper, float]:
    """Return a lip in flight on a linear neck, damped to 0.2 of critical, and its |lambda|."""
    wiper = Wiper(
        belt=SteadyBelt(0.0),
        support_stiffness=0.0,
        support_damping=0.0,
        normal_load=1e-9,
        neck_stiffness=stiffness,
        shoulder_stiffness=stiffness,
    )
    inertia = wiper.tip_mass * wiper.lip_length**2
    natural = float(np.sqrt(stiffness / inertia))
    damped = 2 * 0.2 * natural * inertia
    return dataclasses.replace(wiper, hinge_damping=damped), natural


@partial(jax.jit, static_argnames="solver")
def _engine(wiper, step, solver):
    angle = DISTURBANCE * wiper.lip_length
    times = step * STEPS * jnp.arange(1, 65) / 64
    # no error is too large: every step is the longest
    solved = wiperjax.solve(
        wiper, step * STEPS, initial_state=((angle, wiper.lip_length), (0.0, 0.0)), solver=solver,
        atol=1e9, max_step=step, max_events=0, max_steps=10 * STEPS, sample_times=times,
    )  # fmt: skip
    # the largest on the way: steps that swing too far are shortened by the guards, and recover;
    # a run that did not finish has blown up
    largest = jnp.max(jnp.where(times < step * STEPS, jnp.abs(solved.samples.position[0]), 0.0))
    return jnp.where(solved.result == wiperjax.Result.FINISHED, largest, jnp.inf)


@partial(jax.jit, static_argnames="theta")
def _moreau(wiper, step, theta):
    start = jnp.array([DISTURBANCE, 1.0, 0.0, 0.0]) * wiper.lip_length
    position, _, _ = moreau_jean.trajectory(wiper, start, step * STEPS, STEPS, 1, theta)
    return position[-1, 0]


def measure_spring(end: Callable, stability, stiffness: float) -> tuple[float, float]:
    """Return the (theoretical, measured) largest stable step [s] on the swinging lip.

    ``end(wiper, step)`` is the tip's x after `STEPS` steps, or the largest on the way.
    """
    wiper, natural = swinging_blade(stiffness)
    grown = GROWTH * DISTURBANCE * wiper.lip_length

    def grows(step: float) -> bool:
        return not abs(float(end(wiper, jnp.asarray(step)))) < grown

    eigenvalue = natural * (-0.2 + 1j * np.sqrt(1 - 0.2**2))
    return theoretical(stability, np.array([eigenvalue])), bisect(grows, natural)


def methods(problem: str) -> dict[str, Callable[[float], tuple[float, float]]]:
    """Return name -> (stiffness -> (theory, measured)) of what a problem is measured with."""
    if problem == "spring":
        engine = {
            f"engine, {name}": partial(
                measure_spring, partial(_engine, solver=make()), stability_function(make())
            )
            for name, make in EXPLICIT.items()
        }
        moreau = {
            f"Moreau-Jean, theta = {theta:g}": partial(
                measure_spring, partial(_moreau, theta=theta), theta_function(theta)
            )
            for theta in (0.5, 0.0)
        }
        return engine | moreau
    finder = diffrax.VeryChord(rtol=1e-8, atol=1e-8)
    solvers = {
        "smooth contact, Tsit5": diffrax.Tsit5(),
        "smooth contact, Dopri8": diffrax.Dopri8(),
        "smooth contact, Kvaerno5": diffrax.Kvaerno5(root_finder=finder),
    }
    if problem == "friction":
        return {n: lambda w, s=s: measure_smooth(s, w, 1e6, 2) for n, s in solvers.items()}
    return {n: lambda k, s=s: measure_smooth(s, 1.0, k, 1) for n, s in solvers.items()}


POINTS = {
    "friction": np.geomspace(1e-1, 1e-5, 5),
    "contact": np.geomspace(1e5, 1e11, 5),
    "spring": np.geomspace(0.05, 500.0, 5),
}
UNITS = {"friction": "m/s", "contact": "N/m per m", "spring": "N m/rad per m"}


def set_valued() -> dict[str, float]:
    """Return the largest step [s] tried of the set-valued methods on the resting blade, stable.

    NaN where the tip did not stay. Neither has a width or a stiffness of contact.
    """
    wiper = resting_blade()
    x = wiper.lip_length * np.sin(wiper.attack_angle)
    step = 1e-2
    start = jnp.array([x, 0.0, 0.0, 0.0])
    position, velocity, _ = moreau_jean.trajectory(wiper, start, step * STEPS, STEPS, 1)
    moved = np.abs(np.asarray(position[-1]) - np.asarray(start[:2])).max()
    stays = moved < 1e-9 and np.abs(np.asarray(velocity[-1])).max() < 1e-9
    solved = wiperjax.solve(wiper, step * STEPS, max_step=step, rtol=1e-6, max_events=8)
    still = abs(float(solved.final_position[0]) - x) < 1e-9
    mean = step * STEPS / max(int(solved.steps), 1)
    return {"Moreau-Jean": step if stays else np.nan, "engine": mean if still else np.nan}


def measure(
    points: int | None = None,
    tell: Callable[[str], None] = lambda line: None,
    only: tuple[str, ...] = ("",),
):
    """Return the dataset: theory and measurement [s] by (problem, solver, point).

    inf: no limit found within `RANGE` times the fastest time constant. ``points``: how many
    stiffnesses; ``only``: parts of the methods' names.
    """
    found = {
        problem: {n: m for n, m in methods(problem).items() if any(part in n for part in only)}
        for problem in POINTS
    }
    names = list(dict.fromkeys(name for entry in found.values() for name in entry))
    chosen = {p: values[:points] for p, values in POINTS.items()}
    count = max(len(values) for values in chosen.values())
    shape = (len(chosen), len(names), count)
    theory, measured = np.full(shape, np.nan), np.full(shape, np.nan)
    stiffness = np.full((len(chosen), count), np.nan)
    for i, (problem, values) in enumerate(chosen.items()):
        stiffness[i, : len(values)] = values
        for name, measure_one in found[problem].items():
            j = names.index(name)
            for k, value in enumerate(values):
                theory[i, j, k], measured[i, j, k] = measure_one(float(value))
                tell(
                    f"{problem:9s} {name:28s} {value:9.1e} theory {theory[i, j, k]:9.3e} s, "
                    f"measured {measured[i, j, k]:9.3e} s"
                )
    free = set_valued()
    axes = ("problem", "solver", "point")
    return xr.Dataset(
        {
            "theory": (axes, theory, {"long_name": "largest stable step, theory", "units": "s"}),
            "measured": (
                axes,
                measured,
                {"long_name": "largest stable step, measured", "units": "s"},
            ),
            "stiffness": (("problem", "point"), stiffness, {"long_name": "see unit"}),
        },
        coords={
            "problem": list(chosen),
            "solver": names,
            "unit": ("problem", [UNITS[problem] for problem in chosen]),
        },
        attrs=attributes("largest stable step of each method")
        | {f"set_valued_step_{name}": step for name, step in free.items()},
    )
