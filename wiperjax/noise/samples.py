"""What a run is judged by: the step of its samples, and the velocity that tells its noise.

Both are those of the samples that a run holds now: it may have been thinned, cut or turned round
since it was simulated, and its attributes do not know.
"""

import numpy as np
import xarray as xr

FEWEST_EVEN = 8  # samples that tell their step
LARGEST = 1e150  # number of which a level can be told: its square is one, too


def sample_interval(run: xr.Dataset) -> float:
    """Time between the samples of a run (s).

    Raises: `ValueError` if there are fewer than `FEWEST_EVEN`, or their times are not evenly
        spaced, fall, or are not seconds: of another unit, or beyond the end of the run.
    """
    time = np.asarray(run["time"], dtype=float)
    if time.size < FEWEST_EVEN:
        must = f"must have at least {FEWEST_EVEN} samples"
        raise ValueError(f"the run {must}, but has {time.size}")
    steps = np.diff(time)
    if not np.allclose(steps, steps[0], rtol=1e-6, atol=0):
        raise ValueError("the samples of the run must be evenly spaced in time")
    if not steps[0] > 0:
        raise ValueError("the time of the run must rise, but falls; run.sortby('time') sorts it")
    if (unit := str(run["time"].attrs.get("units", "s"))) != "s":
        raise ValueError(f"the time of the run must be in s, but is in {unit}")
    if why := beyond_its_end(run):
        raise ValueError(f"the time of the run {why}")
    return float(steps.mean())


def beyond_its_end(run: xr.Dataset) -> str:
    """That the samples of a run do not end with it, as the end of `its time ...`; empty if they do,
    or nothing tells its end."""
    time, end = np.asarray(run["time"], dtype=float), float(run.get("final_time", np.inf))
    step = abs(time[1] - time[0]) if time.size > 1 else 0.0
    if time[-1] <= end + step:
        return ""
    return f"must be in s and end at its final_time, {end:g} s, but ends at {time[-1]:g}"


def judged(run: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Place and velocity over time that tell the noise: of the tip along the glass, or the output
    of a system of one's own with its integral (without an output its first coordinate).

    Raises: `ValueError` for a run of a blade without its coordinate x, and for samples that are no
        finite numbers: another class and no frequency would be told of them, without a word.
    """
    if "output" not in run:
        names = np.atleast_1d(run["axis"]).tolist() if "axis" in run.coords else []
        if names and "x" not in names and run.attrs.get("of_a_blade", True):
            must = "must hold the motion along the glass, axis x"
            raise ValueError(f"the run {must}, but holds {' and '.join(map(str, names))}")
        along = names.index("x") if "x" in names else 0
        tip = run.isel(axis=along) if "axis" in run.dims else run
        return finite(tip["position"]), finite(tip["velocity"])
    from scipy.interpolate import CubicSpline  # half a second, which a map's picture does not need

    velocity = finite(run["output"])
    spline = CubicSpline(np.asarray(run["time"], dtype=float), velocity)
    return spline.antiderivative()(run["time"]), velocity


def finite(variable: xr.DataArray) -> np.ndarray:
    """Numbers of a variable of a run. Raises: `ValueError` where they are none, or so large that
    nothing is told of them.
    """
    values = np.asarray(variable, dtype=float)
    if (broken := values[untold(values)]).size:
        must = f"must be finite numbers up to {LARGEST:g} in size"
        raise ValueError(f"the {variable.name} of the run {must}, but had {broken[0]:g}")
    return values


def untold(values: np.ndarray) -> np.ndarray:
    """Which of some numbers are none, or have a square that is none."""
    return ~(np.abs(values) <= LARGEST)
