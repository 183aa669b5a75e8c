"""Pictures of maps: they show what they must, in colours that can be told apart, and refuse what they
cannot draw.
"""

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

matplotlib.use("Agg")

from wiperjax import dataset, labels, mapfile, plots  # noqa: E402
from wiperjax.plots import axes as plot_axes  # noqa: E402
from wiperjax.plots import classes, line, palette, planes  # noqa: E402
from wiperjax.results import RESULTS  # noqa: E402
from wiperjax.spec import parse_sweep  # noqa: E402
from wiperjax.storage import StoreError, write_dataset  # noqa: E402


def reference_spec(angles: int = 41, loads: int = 11, speeds: int = 21):
    """The reference sweep, coarser on request."""
    axes = {
        "attack_angle": {"start": -40, "stop": 40, "num": angles},
        "normal_load": {"start": 5, "stop": 30, "num": loads},
        "belt_speed": {"start": 0.02, "stop": 1.0, "num": speeds, "spacing": "geometric"},
    }
    return parse_sweep(
        {"title": "Reference blade", "axes": axes, "run": {"transient": 0.2, "window": 0.2}}
    )


def steady_slip(angle, load, speed):
    """Angle, growth rate (1/s) and frequency (Hz) of steady slip, branch of largest phi
    (VERIFICATION.md V11).

    The reference blade; angles in radians; no root on the grid gives NaN.
    """
    m, length, k, c, k1, k2, bend = 2.4e-3, 6e-3, 2000.0, 1.0, 0.05, 2.0, 0.6
    mu = 0.3 + 0.7 * np.exp(-speed / 0.1) + 0.02 * speed
    slope = -7.0 * np.exp(-speed / 0.1) + 0.02
    phi = np.linspace(-1.5, 1.5, 6001)[:, None]
    force = load + k * length * (np.cos(phi) - np.cos(angle))
    theta = phi - angle
    moment = k1 * theta + (k2 - k1) * (np.maximum(theta - bend, 0) + np.minimum(theta + bend, 0))
    excess = moment - length * force * (np.sin(phi) + mu * np.cos(phi))
    up = (excess[:-1] < 0) & (excess[1:] >= 0)
    row = len(phi) - 2 - np.argmax(up[::-1], axis=0)
    found = up.any(axis=0)
    root = np.where(found, phi[row, 0], np.nan)
    tau, force = np.tan(root), load + k * length * (np.cos(root) - np.cos(angle))
    stiff = np.where(np.abs(root - angle) > bend, k2, k1) / (length * np.cos(root)) ** 2
    damping = c * tau * (tau + mu) + slope * force
    stiffness = stiff + k * tau * (tau + mu) + force * (mu * tau - 1) / (length * np.cos(root))
    return root, -damping / (2 * m), np.sqrt(np.maximum(stiffness, 0) / m) / (2 * np.pi)


def realistic_columns(spec, seed: int = 0):
    """Columns of a map that looks like the real one: analytic where that is known, drawn by hand
    where not.
    """
    cells = spec.cells(np.arange(spec.size))
    angle, load, speed = (cells[name] for name in ("attack_angle", "normal_load", "belt_speed"))
    _, growth, frequency = steady_slip(angle, load, speed)
    random = np.random.default_rng(seed)
    loud = (growth > -60) & (speed < 1.4)
    leading = (angle < np.radians(-14)) & (speed < 0.1 + 0.02 * load)
    stick = np.where(leading, 0.8 - 0.5 * speed, np.where(loud, np.clip(0.6 - speed, 0, 1), 0.0))
    flight = np.where(leading & (load < 9), 0.06, 0.0)
    result = np.zeros(spec.size, dtype=int)
    result[(angle < np.radians(-37)) & (load > 26)] = RESULTS["collapsed"]
    result[random.random(spec.size) < 0.003] = RESULTS["step_budget_spent"]
    shaking = loud | leading
    return {
        "result": result,
        "stick_fraction": stick,
        "flight_fraction": flight,
        "slip_fraction": 1 - stick - flight,
        "dominant_frequency": np.where(
            leading, 12 + 90 * speed / (0.1 + 0.02 * load), np.maximum(frequency, 110)
        ),
        "velocity_rms": np.where(shaking, 0.7 * speed + 0.02, 1e-7),
        "belt_speed_rms": speed,
        "growth_rate": growth,
        "linear_frequency": frequency,
        "steps": np.full(spec.size, 1000),
    }


def realistic_map(**size) -> xr.Dataset:
    """Map with labels."""
    spec = reference_spec(**size)
    columns = realistic_columns(spec)
    columns["label"] = labels.label(columns, spec.classes)
    return dataset.assemble(spec, columns)


@pytest.fixture(scope="module")
def small_map():
    return realistic_map(angles=17, loads=3, speeds=9)


def test_overview_shows_every_class_the_boundary_and_physical_axes(small_map):
    figure = plots.map_overview(small_map)
    texts = [text.get_text() for legend in _legends(figure) for text in legend.get_texts()]
    present = [name for name, count, _ in labels.class_table(small_map) if count]
    assert {"quiet", "squeal", "chattering", "other"} <= set(present)
    assert all(any(text.startswith(name) for text in texts) for name in present)
    assert any("linear" in text for text in texts)
    words = [ax.get_xlabel() for ax in figure.axes] + [ax.get_ylabel() for ax in figure.axes]
    assert "attack angle (deg)" in words and "belt speed (m/s)" in words
    assert figure.axes[0].get_yscale() == "log" and figure.axes[0].get_xscale() == "linear"


def _legends(figure):
    return [*figure.legends, *(legend for part in figure.subfigs for legend in part.legends)]


def test_boundary_is_where_the_growth_rate_vanishes(small_map):
    ax = Figure().subplots()
    plots.class_map(small_map.isel(normal_load=[1]), ax)
    lines = [c for c in ax.collections if hasattr(c, "levels")]
    assert lines
    points = np.concatenate([path.vertices for path in lines[-1].get_paths()])
    load = float(small_map.normal_load[1])
    inside = np.abs(points[:, 0]) < 30
    _, growth, _ = steady_slip(np.radians(points[inside, 0]), load, points[inside, 1])
    # On a coarse grid the line is within a tenth of a cell or so: its growth rate is small beside
    # the range.
    assert np.nanmedian(np.abs(growth)) < 0.02 * np.nanmax(np.abs(small_map.growth_rate))


def test_failed_and_collapsed_cells_are_hatched(small_map):
    ax = Figure().subplots()
    broken = small_map.copy(deep=True)
    broken["label"][:3, :, :3] = dataset.LABELS["failed"]
    broken["label"][-3:, :, :3] = dataset.LABELS["collapsed"]
    plots.class_map(broken, ax)
    hatches = {c.get_hatch() for c in ax.collections if c.get_hatch()}
    assert hatches == {palette.HATCHES["failed"][0], palette.HATCHES["collapsed"][0]}
    assert sum(len(c.get_paths()) for c in ax.collections if c.get_hatch()) == 6  # rows, not cells


def test_class_map_draws_small_multiples_over_the_third_axis(small_map):
    assert plots.class_map(small_map).shape == (3,)
    assert plots.class_map(small_map, panels=2).shape == (2,)
    assert plots.class_map(small_map, x="normal_load", y="attack_angle").shape == (6,)
    assert plots.class_map(small_map.isel(normal_load=[0])).shape == (1,)
    with pytest.raises(ValueError, match="two axes"):
        plots.class_map(small_map.isel(normal_load=[0], attack_angle=[0]))


def test_maps_without_a_number_anywhere_are_still_drawn(small_map):
    empty = small_map.copy(deep=True)
    for name in ("dominant_frequency", "velocity_rms", "growth_rate"):
        empty[name][:] = np.nan
    empty["label"][:] = dataset.LABELS["failed"]
    plots.map_overview(empty).savefig("/dev/null", format="png")


def test_edges_enclose_values_on_both_kinds_of_axis():
    for values in (
        np.linspace(-40, 40, 41),
        np.geomspace(0.02, 1, 21),
        np.array([3.0]),
        np.array([1.0, 2.0]),
    ):
        border = plot_axes.edges(values)
        assert border.size == values.size + 1
        assert (border[:-1] < values).all() and (values < border[1:]).all()
    assert plot_axes.is_geometric(np.geomspace(0.02, 1, 21))
    assert not plot_axes.is_geometric(np.linspace(0.02, 1, 21))
    assert not plot_axes.is_geometric(np.linspace(-40, 40, 41))
