"""Pictures of maps: they show what they must, in colours that can be told apart, and refuse what
they cannot draw.
"""

import matplotlib
import numpy as np
import pytest
import stub_sweep
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from pictures import SIGHT, inside_the_page, lab, legends
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from wiperjax.noise import class_counts
from wiperjax.vocabulary import cf, codes

matplotlib.use("Agg")

from wiperjax import plots
from wiperjax.datasets import map_dataset
from wiperjax.machine.files import StoreError
from wiperjax.noise import classes
from wiperjax.plots import files
from wiperjax.plots.catalogue import usual_of_map
from wiperjax.plots.maps import categories, numbers, planes, stability
from wiperjax.plots.maps.borders import border_pieces, border_places
from wiperjax.plots.modes import modes_page
from wiperjax.plots.style import axes as plot_axes  # noqa: E402
from wiperjax.plots.style import palette  # noqa: E402
from wiperjax.specs.load import parse_sweep  # noqa: E402
from wiperjax.store import whole
from wiperjax.vocabulary import schema  # noqa: E402
from wiperjax.vocabulary.codes import RESULTS  # noqa: E402


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
    (docs/model.md, section 10).

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
    columns["label"] = classes.classify(columns, spec.classes)["label"]
    return map_dataset.assemble(spec, columns)


@pytest.fixture(scope="module")
def small_map():
    return realistic_map(angles=17, loads=3, speeds=9)


def test_overview_shows_every_class_the_boundary_and_physical_axes(small_map):
    figure = plots.map_overview(small_map)
    texts = [text.get_text() for legend in legends(figure) for text in legend.get_texts()]
    present = [name for name, count, _ in class_counts.class_table(small_map) if count]
    assert {"quiet", "squeal", "chattering", "other"} <= set(present)
    assert all(any(text.startswith(name) for text in texts) for name in present)
    assert any("linear" in text for text in texts)
    words = [ax.get_xlabel() for ax in figure.axes] + [ax.get_ylabel() for ax in figure.axes]
    assert "attack angle (deg)" in words and "belt speed (m/s)" in words
    assert figure.axes[0].get_yscale() == "log" and figure.axes[0].get_xscale() == "linear"


def _texts(figure):
    return [text.get_text() for legend in legends(figure) for text in legend.get_texts()]


def _shares(cells, variable="label"):
    return {
        f"{palette.readable(name)} ({share:.1%})"
        for name, count, share in class_counts.class_table(cells, variable)
        if share >= 0.001
    }


def test_shares_are_those_of_the_cells_shown(small_map):
    low = {"normal_load": 5.0}
    slices = {
        (1,): small_map.sel(normal_load=[5.0]),
        (2,): small_map.sel(normal_load=[5.0, 30.0]),
        (3,): small_map,
    }
    assert len({frozenset(_shares(cells)) for cells in slices.values()}) == 3
    for shape, options in (((1,), {"at": low}), ((2,), {"panels": 2}), ((3,), {})):
        axes = plots.class_map(small_map, **options)
        figure, cells = axes[0].figure, slices[shape]
        assert axes.shape == shape and _shares(cells) <= set(_texts(figure))
        said = f"shares of the {cells['label'].size:,} cells shown, of 459" in " ".join(
            figure.legends[0].get_title().get_text().split()
        )
        assert said == (cells["label"].size < 459)
        assert ("normal load 5 N/m" in figure.get_suptitle()) == (options.get("at") == low)
    for at, cells in ((low, slices[1,]), (None, small_map)):
        figure = plots.map_overview(small_map, at=at)
        bars = next(ax for ax in figure.axes if "cells" in ax.get_title())
        assert bars.get_title().startswith(f"share of {cells['label'].size} cells")
        numbers = {text.get_text().split()[0] for text in bars.texts}
        found = {f"{share:.1%}" for _, count, share in class_counts.class_table(cells) if count}
        assert numbers == found
        assert not any("%" in text for text in _texts(figure))  # one statement of the shares


@pytest.mark.slow
def test_nothing_reaches_beyond_a_page_of_a_map(small_map):
    long = small_map["growth_rate"].assign_attrs(
        long_name="derivative of standard deviation of the tip velocity by shoulder stiffness",
        units="(m/s)/(N m/rad/m)",
    )
    names = list(palette.MECHANISMS)
    drawn = xr.zeros_like(small_map["label"])
    drawn[:] = np.arange(drawn.size).reshape(drawn.shape) % len(names)
    drawn.attrs = {"flag_values": np.arange(len(names)), "flag_meanings": " ".join(names)}
    ds = small_map.assign(mechanism=drawn, d_velocity_rms_d_shoulder_stiffness=long)
    at = {"normal_load": 5.0}
    for drawn in (
        plots.mechanism_map(ds, at=at)[0].figure,
        plots.mechanism_map(ds)[0].figure,
        plots.regime_map(ds, at=at)[0].figure,
        plots.map_overview(ds),
        plots.value_map(ds, "d_velocity_rms_d_shoulder_stiffness").figure,
        plots.along_axis(ds)[0].figure,
    ):
        assert inside_the_page(drawn) == []


def test_signed_numbers_have_colours_that_part_at_zero(small_map):
    def drawn(values, name="d_gap_max_d_normal_load"):
        column = small_map["growth_rate"].copy(data=np.broadcast_to(values, (17, 3, 9)))
        mesh = plots.value_map(small_map.assign({name: column}), name).collections[0]
        return mesh.norm, mesh.cmap.name

    ramp = np.linspace(-1.0, 3.0, 9)
    for name in ("d_gap_max_d_normal_load", "growth_rate"):
        norm, colours = drawn(ramp, name)
        assert (norm.vmin, norm.vmax) == (-3.0, 3.0) and norm(0.0) == 0.5
        assert colours == numbers.SIGNED
    # of one sign by chance, a derivative says so; a level does not pretend to have a sign
    assert drawn(ramp + 2)[0](0.0) == 0.5 and drawn(ramp + 2)[1] == numbers.SIGNED
    assert drawn(ramp + 2, "velocity_rms")[1] == "viridis"
    # one cell of a thousand times the size of the others does not leave these white
    norm, _ = drawn(np.where(np.arange(9) == 4, 1e3, ramp))
    assert norm(0.0) == 0.5 and norm(1.0) > 0.55 and norm(-1.0) < 0.45
    assert drawn(np.zeros(9))[0](0.0) == 0.5


def test_a_scale_says_that_something_lies_below_it(small_map):
    speed = small_map["velocity_rms"]
    for lowest, extends in ((1e-9, "min"), (0.01, "neither")):
        level = speed.copy(data=np.geomspace(lowest, 1.0, speed.size).reshape(speed.shape))
        mesh = plots.value_map(small_map.assign(velocity_rms=level), "velocity_rms").collections[0]
        assert mesh.colorbar.extend == extends
        # what quiet cells leave by rounding does not take the scale from the others
        assert mesh.norm.vmin >= 0.99e-4 * mesh.norm.vmax


def test_codes_are_drawn_as_what_they_mean(small_map):
    names = list(codes.BANDS)
    drawn = xr.zeros_like(small_map["label"])
    drawn[:] = np.arange(drawn.size).reshape(drawn.shape) % 5
    drawn.attrs = schema.SCHEMA["band"].attributes()
    picture = plots.PICTURES["map"]["value"]
    axes = picture.draw(small_map.assign(band=drawn), quantity="band")
    figure = axes[0].figure
    assert {text.split(" (")[0] for text in _texts(figure)} >= set(names)
    assert "band of the dominant frequency" in figure.get_suptitle()
    with pytest.raises(ValueError, match="'impact' is not in this map; it holds label"):
        picture.draw(small_map, quantity="impact")


@pytest.mark.parametrize("low", [12.0, 60.0, 120.0, 450.0, 501.0, 999.0])
@pytest.mark.parametrize("ratio", [1.05, 1.3, 1.9, 4.0, 30.0, 1e3])
def test_a_logarithmic_scale_has_marks_however_narrow(low, ratio):
    ax = Figure().subplots()
    plot_axes.plain_log(ax, "y")
    ax.set_ylim(low, low * ratio)
    marks = ax.yaxis.get_major_locator()()
    shown = [mark for mark in marks if low <= mark <= low * ratio]
    assert 3 <= len(shown) <= 12
    words = [ax.yaxis.get_major_formatter()(mark) for mark in shown]
    assert len(set(words)) == len(words)  # no two marks read the same


@pytest.mark.parametrize(("low", "high"), [(25, 900), (7143, 19000), (130, 470), (18000, 20000)])
def test_logarithmic_marks_do_not_touch_on_a_narrow_axis(low, high):
    """Less than a decade of them did, at its upper end."""
    figure = Figure(figsize=(1.6, 1.6), layout="constrained")
    ax = figure.subplots()
    plot_axes.plain_log(ax, "x")
    ax.set_xlim(low, high)
    figure.draw_without_rendering()
    boxes = [
        t.get_window_extent() for t in ax.get_xticklabels() if low <= t.get_position()[0] <= high
    ]
    assert len(boxes) >= 2
    assert all(a.x1 + 4 < b.x0 for a, b in zip(boxes, boxes[1:], strict=False))


@pytest.mark.parametrize("low", [0.0021, 3.02, 84.4])
@pytest.mark.parametrize("decades", [1.35, 3.3, 5.5, 8.0])
@pytest.mark.parametrize("inches", [1.6, 2.2, 3.0])
def test_logarithmic_marks_of_many_decades_lie_all_over_a_narrow_axis(low, decades, inches):
    """Even ones stood at the upper end: 50k, 100k, 150k, 200k alone from 0.002 to 200k."""
    figure = Figure(figsize=(inches, 1.6), layout="constrained")
    ax = figure.subplots()
    plot_axes.plain_log(ax, "x")
    ax.set_xlim(low, low * 10**decades)
    figure.draw_without_rendering()
    marks = [mark for mark in ax.get_xticks() if low <= mark <= low * 10**decades]
    assert len(marks) >= 2
    steps = np.diff(np.log10(marks))
    assert steps.max() < 2.2 * steps.min()
    assert np.log10(marks[-1] / marks[0]) > 0.3 * decades


def exact_boundary(angle, load):
    """Speed (m/s) below which steady slip at that angle (deg) and load (N/m) grows."""
    return brentq(lambda v: steady_slip(np.radians([angle]), load, np.array([v]))[1][0], 0.05, 2)


def test_boundary_is_where_the_growth_rate_vanishes(small_map):
    """To a few per cent, where the speeds of the map are a factor of 1.6 apart."""
    ax = Figure().subplots()
    one = small_map.isel(normal_load=[1])
    plots.class_map(one, ax)
    lines = [c for c in ax.collections if hasattr(c, "levels")]
    assert lines
    points = np.concatenate([path.vertices for path in lines[-1].get_paths()])
    load = float(small_map.normal_load[1])
    for angle in (0.0, 10.0, 20.0, 30.0):
        near = points[np.argmin(np.abs(points[:, 0] - angle))]
        assert near[1] == pytest.approx(exact_boundary(near[0], load), rel=0.03)
        rows = plots.along_axis(one.sel(attack_angle=[angle]))
        (grey,) = [c for c in rows[0].collections if c.get_alpha() == 0.08]
        edge = grey.get_paths()[0].vertices[:, 0].max()
        assert edge == pytest.approx(exact_boundary(angle, load), rel=0.04)


def test_where_steady_slip_jumps_the_line_keeps_to_the_borders_of_cells():
    """Below -35 degrees the equilibrium on the far shoulder ends at a speed that rises with the
    angle; the rates on either side lie on no curve, nor do those to the left and right of -35.
    """
    angles, speeds = np.arange(-40.0, -29.0, 2.0), np.geomspace(0.02, 1.0, 21)
    growth = [steady_slip(np.radians([angle]), 15.0, speeds)[1] for angle in angles]
    ds = xr.Dataset(
        {"growth_rate": (("attack_angle", "belt_speed"), np.array(growth))},
        coords={"attack_angle": angles, "belt_speed": speeds},
    )
    ax = Figure().subplots()
    assert stability.stability_boundary(ds, ax, "attack_angle", "belt_speed")
    angle, speed = np.concatenate([p.vertices for p in ax.collections[-1].get_paths()]).T
    smooth = angle > -34.5
    exact = [exact_boundary(place, 15.0) for place in angle[smooth]]
    np.testing.assert_allclose(speed[smooth], exact, rtol=0.01)
    place = np.log(speed / 0.02) / np.log(speeds[1] / 0.02)
    off = np.minimum(np.abs(place % 1 - 0.5), np.abs((angle + 40) / 2 % 1 - 0.5))
    assert (off[(angle > -38) & (angle < -35.5)] < 0.11).all()  # cells; the first has no neighbour


def test_the_line_of_a_page_of_modes_is_that_of_maps():
    """Five speeds: a straight line from cell to cell would cross zero 14 % too far out."""
    angles, speeds = np.arange(-10.0, 31.0, 10.0), np.geomspace(0.1, 1.0, 5)
    growth = [steady_slip(np.radians([angle]), 15.0, speeds)[1] for angle in angles]
    found = modes_page(
        xr.Dataset(
            {"growth_rate": (("attack_angle", "belt_speed"), np.array(growth))},
            coords={"attack_angle": angles, "belt_speed": speeds},
        )
    )
    line = np.concatenate([p.vertices for p in found.axes[0].collections[-1].get_paths()])
    angle, speed = line[np.argmin(np.abs(line[:, 0]))]
    assert speed == pytest.approx(exact_boundary(angle, 15.0), rel=0.03)
    assert [t.get_text() for t in found.legends[0].get_texts()] == [stability.WORDS]
    assert stability.NOTE in found.get_suptitle()


def test_a_curve_between_cells_runs_through_them_and_keeps_holes():
    """It has no bulge that is not in the cells, and loses nothing but what lies beside a hole."""
    values = np.array([5.0, 1.0, 0.9, 0.3, -2.1, np.nan, 3.0, 4.0])
    curve = stability._finer(values)
    place = stability.places(values.size, curve.size)
    np.testing.assert_allclose(curve[:: (curve.size - 1) // 7], values)
    scipys = PchipInterpolator(np.arange(5), values[:5])(place[place <= 3])
    np.testing.assert_allclose(curve[place <= 3], scipys)
    hole = (place > 4) & (place < 6)
    assert np.isnan(curve[hole]).all() and np.isfinite(curve[~hole]).all()
    assert (np.diff(curve[place <= 4]) <= 0).all()


def test_headings_of_many_words_stay_on_the_page_and_apart(small_map):
    """A title may have 500 letters, and a fourth axis adds its value to each heading."""
    ds = small_map.assign_attrs(title="a title of many words " * 22)
    ds = ds.expand_dims(mu_static=[0.5, 1.0]).assign_coords(
        mu_static=("mu_static", [0.5, 1.0], {"long_name": "static friction coefficient"})
    )
    figure = plots.map_overview(ds)
    assert inside_the_page(figure) == []
    lower = [ax.title.get_window_extent() for ax in figure.subfigs[1].axes if ax.get_title()]
    lower = sorted((box.x0, box.x1) for box in lower)
    assert len(lower) == 4 and all(a[1] < b[0] for a, b in zip(lower, lower[1:], strict=False))


def test_codes_between_two_codes_are_no_class(small_map):
    """Squeal and quiet average to what no cell did; it was drawn, and counted, as a class."""
    between = small_map.interp(attack_angle=np.linspace(-39.0, 39.0, 7))
    says = r"^label must be whole codes, but had [0-9.]+: .* ds\.sel takes whole cells$"
    for picture in (plots.class_map, plots.regime_map, plots.map_overview, plots.frequency_map):
        with pytest.raises(ValueError, match=says):
            picture(between)
    with pytest.raises(ValueError, match=says):
        class_counts.class_table(between)
    masked = small_map.where(small_map.attack_angle < 39)  # whole numbers as floats, and NaN
    assert sum(count for _, count, _ in class_counts.class_table(masked)) == 16 * 27


def test_a_code_without_a_name_has_no_colour_of_another(small_map):
    """It had that of the last name."""
    strange = small_map.assign(label=small_map["label"].copy())
    strange["label"][0, 0, 0] = 100
    with pytest.raises(ValueError, match="label must have codes of 0 to 6 that .*, but had 100"):
        plots.class_map(strange)


def test_a_table_of_pandas_says_what_it_lost(small_map):
    lost = small_map.to_dataframe().to_xarray()
    with pytest.raises(ValueError, match="no flag_meanings; pandas, say, keeps no attributes: lab"):
        plots.class_map(lost)


def test_failed_and_collapsed_cells_are_hatched(small_map):
    ax = Figure().subplots()
    broken = small_map.copy(deep=True)
    broken["label"][:3, :, :3] = codes.LABELS["failed"]
    broken["label"][-3:, :, :3] = codes.LABELS["collapsed"]
    plots.class_map(broken, ax)
    hatches = {c.get_hatch() for c in ax.collections if c.get_hatch()}
    assert hatches == {palette.HATCHES["failed"][0], palette.HATCHES["collapsed"][0]}
    assert sum(len(c.get_paths()) for c in ax.collections if c.get_hatch()) == 6  # rows, not cells


def test_class_map_draws_small_multiples_over_the_third_axis(small_map):
    assert plots.class_map(small_map).shape == (3,)
    assert plots.class_map(small_map, panels=2).shape == (2,)
    assert plots.class_map(small_map, x="normal_load", y="attack_angle").shape == (6,)
    assert plots.class_map(small_map.isel(normal_load=[0])).shape == (1,)
    with pytest.raises(
        ValueError, match="'belt_speed' is an axis of the picture and cannot number"
    ):
        plots.class_map(small_map, panel="belt_speed")
    with pytest.raises(ValueError, match="x and y must be two axes, but both were 'belt_speed'"):
        plots.class_map(small_map, x="belt_speed", y="belt_speed")
    with pytest.raises(ValueError, match="two axes"):
        plots.class_map(small_map.isel(normal_load=[0], attack_angle=[0]))


@pytest.mark.slow
def test_maps_without_a_number_anywhere_are_still_drawn(small_map):
    empty = small_map.copy(deep=True)
    for name in ("dominant_frequency", "velocity_rms", "growth_rate"):
        empty[name][:] = np.nan
    empty["label"][:] = codes.LABELS["failed"]
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


def test_cells_of_few_values_reach_to_no_negative_load():
    """Speeds of 0.05 and 1 m/s had cells from -0.43 m/s on."""
    assert plot_axes.edges(np.array([0.05, 1.0])).tolist() == [0.0, 0.525, 1.475]
    assert plot_axes.edges(np.array([100.0, 1.0])).tolist() == [149.5, 50.5, 0.0]
    assert plot_axes.edges(np.array([-9.0, 0.0])).tolist() == [-13.5, -4.5, 0.0]
    assert plot_axes.edges(np.array([-1.0, 2.0])).tolist() == [-2.5, 0.5, 3.5]


@pytest.mark.slow
def test_marks_of_small_panels_do_not_touch(small_map):
    """The power of ten, or what all marks share, was written over the label of the axis."""
    narrow = small_map.assign_coords(normal_load=np.linspace(15.001, 15.009, 3))
    figure = plots.map_overview(narrow, x="normal_load", y="belt_speed")
    FigureCanvasAgg(figure).draw()
    for ax in figure.axes:
        if ax.get_xlabel():
            assert not ax.xaxis.get_offset_text().get_text()
            low, high = ax.get_xlim()
            marks = [t for t in ax.get_xticklabels() if low <= t.get_position()[0] <= high]
            boxes = [mark.get_window_extent() for mark in marks]
            assert all(a.x1 < b.x0 for a, b in zip(boxes, boxes[1:], strict=False))


def test_regime_map_names_what_occurs_in_the_motion(small_map):
    shares = {
        "steady_slip": (0.0, 0.0, 1e-9),
        "slip_only": (0.0, 0.0, 0.2),
        "stick_and_slip": (0.5, 0.0, 0.2),
        "stick_slip_and_flight": (0.5, 0.1, 0.2),
        "slip_and_flight": (0.0, 0.1, 0.2),
        "stick_only": (1.0, 0.0, 1e-9),
    }
    cells = small_map.isel(attack_angle=slice(0, len(shares)), normal_load=[0], belt_speed=[0, 1])
    cells = cells.copy(deep=True)
    cells["label"][:] = codes.LABELS["other"]
    for k, (stick, flight, speed) in enumerate(shares.values()):
        cells["stick_fraction"][k], cells["flight_fraction"][k] = stick, flight
        cells["velocity_rms"][k] = speed * cells["belt_speed"].values
    found = plots.motion(cells)
    names = cf.flag_names(found)
    assert [names[int(code)] for code in found[:, 0, 0]] == list(shares)
    cells["label"][0], cells["label"][1] = codes.LABELS["failed"], codes.LABELS["collapsed"]
    found = plots.motion(cells)
    assert [names[int(code)] for code in found[:2, 0, 1]] == ["failed", "collapsed"]
    assert plots.regime_map(cells).shape == (1,)
    beltless = cells.drop_vars("belt_speed_rms").assign_attrs(class_quiet_velocity=1e-3)
    assert plots.regime_map(beltless).shape == (1,)
    figure = files.draw(beltless, "map", "regimes", files.PICTURES["map"]["regimes"], "m.h5", {})
    assert "regimes in the settled window" in figure.get_suptitle()


def test_mechanism_map_shows_also_what_failed(small_map):
    names = list(palette.MECHANISMS)
    drawn = xr.zeros_like(small_map["label"])
    drawn[:] = np.arange(drawn.size).reshape(drawn.shape) % len(names)
    drawn.attrs = {"flag_values": np.arange(len(names)), "flag_meanings": " ".join(names)}
    ds = small_map.assign(mechanism=drawn)
    ds["label"] = ds["label"].copy(deep=True)
    ds["label"][0] = codes.LABELS["failed"]
    axes = plots.mechanism_map(ds)
    texts = [text.get_text() for text in axes[0].figure.legends[0].get_texts()]
    share = float((ds["label"] == codes.LABELS["failed"]).mean())
    assert f"failed ({share:.1%})" in texts
    assert any(text.startswith("self-excited slip (") for text in texts)
    assert any(text.startswith("quiet (") for text in texts)


@pytest.mark.parametrize("name", ["mechanism", "band"])
def test_what_ended_has_no_name_of_a_quiet_noise(small_map, name):
    """Both are "none" as stored: collapsed cells were counted and painted as quiet ones."""
    ds = small_map.assign(mechanism=small_map["label"], band=small_map["label"]).copy(deep=True)
    for each in ("mechanism", "band"):
        ds[each][:], ds[each].attrs = 0, cf.flags({"none": 0, "squeal": 1})
    ds["label"][:], ds["label"][0] = codes.LABELS["quiet"], codes.LABELS["failed"]
    ds["label"][1], ds["label"][2] = codes.LABELS["collapsed"], codes.LABELS["reversal"]
    picture = files.PICTURES["map"]["value"]
    figure = files.draw(ds, "map", "value", picture, "m.h5", {"quantity": name})
    part = 1 / ds.sizes["attack_angle"]
    shares = {"quiet": 1 - 3 * part, "failed": part, "collapsed": part, "none": part}
    texts = {text.get_text() for text in figure.legends[0].get_texts()}
    assert texts >= {f"{name} ({share:.1%})" for name, share in shares.items()}


def test_chatter_has_the_colour_of_chattering(small_map):
    """It was sand, beside squeal in its own."""
    bands = xr.DataArray([0], dims="x", attrs=cf.flags(codes.BANDS))
    found = categories.colours_of(bands)
    assert found["chatter"] == palette.CLASSES["chattering"]
    assert found["squeal"] == palette.CLASSES["squeal"]


def test_line_shows_frequency_amplitude_and_shares_of_one_axis(small_map):
    at = {"attack_angle": 5.0, "normal_load": 17.5}
    axes = plots.along_axis(small_map, at=at)
    cells = small_map.sel(at)
    loud = cells["label"].values != codes.LABELS["quiet"]
    offsets = np.concatenate([c.get_offsets() for c in axes[0].collections if _is_marks(c)])
    drawn = offsets[np.isfinite(offsets[:, 1].filled(np.nan))]
    assert drawn.shape[0] == loud.sum() > 0
    expected = cells["dominant_frequency"].values[loud]
    np.testing.assert_allclose(sorted(drawn[:, 1]), sorted(expected))
    assert axes[1].get_ylim()[1] > 1.05 * cells["velocity_rms"].max()  # marks are whole
    assert axes[2].get_ylim() == (0, 1) and axes[2].get_xlabel() == "belt speed (m/s)"
    title = axes[0].figure.get_suptitle()
    assert "attack angle 5°" in title and "normal load 17.5 N/m" in title
    assert axes[0].figure.legends[0].get_texts()
    other = plots.along_axis(small_map, along="attack_angle")
    assert other[2].get_xlabel() == "attack angle (deg)"


def test_line_shows_a_cell_between_failed_ones_and_hatches_these(small_map):
    at = {"attack_angle": 5.0, "normal_load": 17.5}
    broken = small_map.copy(deep=True)
    lost = np.arange(9) != 4
    broken["label"][:, :, lost] = codes.LABELS["failed"]
    broken["stick_fraction"][:] = 0.25  # of those, counted until they failed
    shares = plots.along_axis(broken, at=at)[2]
    stick = next(p for p in shares.patches if p.get_label() == "share of stick").get_data().values
    np.testing.assert_array_equal(stick, np.where(lost, np.nan, 0.25))
    hatched = [p for p in shares.patches if p.get_hatch() == palette.HATCHES["failed"][0]]
    border = plot_axes.edges(small_map["belt_speed"].values)
    spans = [(p.get_x(), p.get_x() + p.get_width()) for p in hatched]
    np.testing.assert_allclose(spans, [border[[0, 4]], border[[5, 9]]])
    (failed,) = (
        entry for entry in shares.figure.legends[0].get_patches() if entry.get_hatch()
    )  # not a dot that is nowhere
    assert failed.get_hatch() == palette.HATCHES["failed"][0]


def test_cells_that_have_not_settled_are_told_from_the_others(small_map):
    settled = xr.full_like(small_map["label"], codes.SETTLED["yes"])
    settled.loc[{"belt_speed": small_map["belt_speed"][4]}] = codes.SETTLED["no"]
    at = {"attack_angle": 5.0, "normal_load": 17.5}
    for ds, hollow in ((small_map, 0), (small_map.assign(settled=settled), 1)):
        axes = plots.along_axis(ds, at=at)
        marks = [c for c in axes[1].collections if _is_marks(c)]
        white = [c for c in marks if (c.get_facecolor() == 1).all()]
        assert len(white) == hollow and ("not settled" in _texts(axes[0].figure)) == hollow
        said = plots.map_overview(ds).subfigs[1].get_supxlabel()
        assert ("50 of 459 cells have not settled" in said) == hollow
    place = white[0].get_offsets()[0]
    assert tuple(place) == (small_map["belt_speed"][4], small_map.sel(at)["velocity_rms"][4])


def test_marks_that_overlap_do_not_hide_each_others_colours(small_map):
    """Of 10,000 cells nothing was seen but the dark outlines."""
    dense = small_map.isel(belt_speed=np.full(3000, 4), attack_angle=[0], normal_load=[0])
    dense = dense.assign_coords(belt_speed=np.linspace(0.1, 1, 3000)).copy(deep=True)
    dense["label"][:] = codes.LABELS["other"]
    dense["label"][..., 1500:] = codes.LABELS["squeal"]
    canvas = FigureCanvasAgg(plots.along_axis(dense)[0].figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    for name in ("other", "squeal"):
        colour = np.round(255 * np.array(matplotlib.colors.to_rgb(palette.CLASSES[name])))
        assert (pixels == colour).all(axis=-1).sum() > 1000


def test_what_is_not_computed_yet_is_none_of_the_cells_that_may_settle(small_map):
    part = small_map.copy(deep=True)
    part["settled"] = xr.zeros_like(part["label"]).drop_attrs()
    part["label"][:] = codes.LABELS["squeal"]
    part["label"][8:], part["settled"][8:] = codes.NOT_COMPUTED, codes.NOT_COMPUTED
    figure = plots.map_overview(part)
    said = "\n".join(lower.get_supxlabel() for lower in figure.subfigs)
    done = int((part["label"] != codes.NOT_COMPUTED).sum())
    assert 0 < done < part["label"].size and f"{done} of {done} cells have not settled" in said


def test_speeds_of_an_overview_have_the_colours_of_what_is_heard(small_map):
    """What quiet cells leave is rounding noise; over three decades 0.2 and 0.5 m/s look alike."""
    heard = small_map["label"] != codes.LABELS["quiet"]
    speed = xr.where(heard, 0.2 + 0.3 * (small_map["belt_speed"] > 0.1), 1e-9)
    figure = plots.map_overview(small_map.assign(velocity_rms=speed))
    (ax,) = (ax for ax in figure.axes if ax.get_title().startswith("tip velocity"))
    assert ax.collections[0].get_clim() == pytest.approx((0.2, 0.5))


def test_speeds_of_quiet_cells_alone_have_a_scale_of_their_own(small_map):
    """It was that of frequencies, 10 to 1000, as m/s."""
    speed = xr.zeros_like(small_map["velocity_rms"]) + 2e-3 * small_map["belt_speed"]
    quiet = xr.full_like(small_map["label"], codes.LABELS["quiet"])
    figure = plots.map_overview(small_map.assign(velocity_rms=speed, label=quiet))
    (ax,) = (ax for ax in figure.axes if ax.get_title().startswith("tip velocity"))
    assert ax.collections[0].get_clim()[1] == pytest.approx(float(speed.max()))


def test_what_stands_still_is_not_drawn_as_a_cell_without_a_number(small_map):
    """Cells that stuck all the time, of a speed of exactly zero, were grey among black ones."""
    speed = small_map["velocity_rms"].copy(data=np.full(small_map["label"].shape, 0.3))
    speed[:, :, :3], speed[:, :, 1] = 1e-9, 0.0
    squeal = xr.full_like(small_map["label"], codes.LABELS["squeal"])
    figure = plots.map_overview(small_map.assign(velocity_rms=speed, label=squeal))
    (ax,) = (ax for ax in figure.axes if ax.get_title().startswith("tip velocity"))
    mesh = ax.collections[0]
    drawn = mesh.to_rgba(mesh.get_array())
    assert "grey" not in ax.get_title() and not np.ma.getmaskarray(mesh.get_array()).any()
    np.testing.assert_array_equal(drawn[1], drawn[0])
    assert mesh.colorbar.extend == "min"


def test_a_grey_cell_is_called_what_it_is(small_map):
    """Ten of eighteen grey cells had failed below the words 'grey: quiet'."""
    broken, at = small_map.copy(deep=True), {"normal_load": 17.5}
    broken["label"][:] = codes.LABELS["squeal"]
    broken["dominant_frequency"][:] = 700.0
    assert "grey" not in plots.frequency_map(broken, at=at).figure.get_suptitle()
    broken["label"][:3] = codes.LABELS["failed"]
    assert "grey: failed" in plots.frequency_map(broken, at=at).figure.get_suptitle()
    broken["label"][3:5] = codes.LABELS["quiet"]
    broken["dominant_frequency"][6] = np.nan
    said = plots.frequency_map(broken, at=at).figure.get_suptitle()
    assert "grey: quiet, failed, no number" in said
    titles = [ax.get_title() for ax in plots.map_overview(broken, at=at).figure.axes]
    assert "dominant frequency\n(grey: quiet, failed, no number)" in "\n".join(titles)
    assert any(title.startswith("share of time in stick\n(grey: failed)") for title in titles)


def test_numbers_along_an_axis_never_read_the_same():
    for values in (
        5 + 2e-4 * np.arange(6), np.geomspace(0.02, 1, 3000), -40 + 80 / 4e5 * np.arange(99),
        1e6 + 0.5 * np.arange(4), np.array([3.0]),
    ):  # fmt: skip
        texts = plot_axes.axis_numbers(values)
        assert len(set(texts)) == len(values)
        np.testing.assert_allclose([float(text) for text in texts], values, rtol=5e-4)
    assert plot_axes.axis_numbers(np.array([0.0, 0.5, 1.0])) == ["0", "0.5", "1"]
    near = xr.DataArray([5.0, 5.0002], dims="a", attrs={"long_name": "load", "units": "N/m"})
    assert plot_axes.value_text(near, 1) == "load 5.0002 N/m"


def _is_marks(collection):
    """Whether it is marks of cells, and not their outlines."""
    if type(collection).__name__ != "PathCollection":
        return False
    return not matplotlib.colors.same_color(collection.get_facecolor()[0], "#333333")


def test_a_scale_without_speeds_has_no_negative_ones(small_map):
    """All failed, or all at rest: -0.1 to 0.1 m/s."""
    for label, speed in (("failed", np.nan), ("quiet", 0.0)):
        still = small_map.copy(deep=True)
        still["label"][:] = codes.LABELS[label]
        still["velocity_rms"][:] = speed
        mesh = plots.value_map(still, "velocity_rms").collections[0]
        assert (mesh.norm.vmin, mesh.norm.vmax) == (0.0, 1.0)


def test_a_line_that_nobody_sees_is_not_named(small_map):
    """Of steady slip that turns in one cell alone, and creeps away in its neighbours."""
    for place, named in (([2], 0), ([2, 4], 0), ([2, 3], 1)):
        some = small_map.isel(attack_angle=0, normal_load=0, drop=True).copy(deep=True)
        linear = np.zeros(some.sizes["belt_speed"])
        linear[place] = 500.0
        some["linear_frequency"] = ("belt_speed", linear)
        texts = plots.along_axis(some)[0].figure.legends[0].get_texts()
        assert sum(text.get_text() == "steady slip, linearised" for text in texts) == named


def test_a_line_without_a_tone_has_a_scale_that_can_be_read(small_map):
    """All quiet: 0.0005 to 2000 Hz, the marks over each other."""
    for quiet, lowest in ((True, 80.0), (False, 0.6)):
        still = small_map.copy(deep=True)
        still["label"][:] = codes.LABELS["quiet" if quiet else "chattering"]
        still["dominant_frequency"][:] = 1.0
        still["linear_frequency"][:] = np.nan
        assert plots.along_axis(still)[0].get_ylim() == (lowest, 1500.0)
    still["label"][:] = codes.LABELS["quiet"]
    still["linear_frequency"][:] = 2000.0  # a curve that is seen
    assert plots.along_axis(still)[0].get_ylim() == (80.0, 3200.0)


def test_raster_shows_the_regime_over_time(small_map):
    times = np.arange(4) * 0.01
    regimes = np.arange(small_map["label"].size * 4).reshape(*small_map["label"].shape, 4) % 4
    raster = schema.SCHEMA["regime_raster"]
    dims = (*small_map["label"].dims, "raster_time")
    ds = small_map.assign_coords(raster_time=("raster_time", times))
    ds["regime_raster"] = (dims, regimes.astype(np.uint8), raster.attributes())
    ds["regime_raster"][0] = 255  # ended before
    masked = ds.where(ds["attack_angle"] < ds["attack_angle"][-1])
    values = plots.regime_raster(masked, along="attack_angle").collections[0].get_array()
    assert values.mask[-1].all() and not values.mask[:-1].any()  # blank
    values = plots.regime_raster(ds, along="attack_angle").collections[0].get_array()
    assert values.shape == (17, 4) and (values[0] == 4).all()  # beside the four regimes: grey
    ds["label"][0] = codes.LABELS["collapsed"]
    ax = plots.regime_raster(ds, along="attack_angle")
    assert "ended before (collapsed)" in _texts(ax.figure)
    assert ax.get_xlim() == pytest.approx((0.0, 35.0))  # ms; began at -5
    np.testing.assert_array_equal(values[1:], regimes[1:, 1, 4])
    assert plots.class_map(ds).shape == (3,)  # the instants are no axis of the cells
    with pytest.raises(ValueError, match="not one number a cell: it has one for each raster_time"):
        plots.value_map(ds, "regime_raster")
    with pytest.raises(ValueError, match="no regime over time"):
        plots.regime_raster(small_map)
    ds["label"][:], ds["dominant_frequency"][:] = codes.LABELS["quiet"], 2928.0  # of rounding
    assert "beats" not in plots.regime_raster(ds).figure.get_suptitle()
    ds["label"][:] = codes.LABELS["other"]
    assert "too few for 2928 Hz" in plots.regime_raster(ds).figure.get_suptitle()
    falls = ds.isel(raster_time=slice(None, None, -1))  # said `every -1 ms`
    assert "too few for 2928 Hz" in plots.regime_raster(falls).figure.get_suptitle()
    with pytest.raises(ValueError, match="^raster_time must have values that rise, or fall"):
        plots.regime_raster(ds.isel(raster_time=[2, 0, 1]))


def test_cuts_are_at_the_nearest_cell_and_said(small_map):
    plane, where = planes.cut(small_map, ("attack_angle", "belt_speed"), {"normal_load": 6.0})
    assert float(plane.normal_load) == 5.0 and where == "normal load 5 N/m"
    for at, line_ in (
        ({"normal_load": 90.0}, "normal_load must lie inside 5 ... 30, was 90"),
        ({"lip_length": 1.0}, "'lip_length' is not in this map's axes; it holds attack_angle"),
        ({"belt_speed": 0.1}, "'belt_speed' is an axis of the picture"),
    ):
        with pytest.raises(ValueError, match=line_):
            planes.cut(small_map, ("attack_angle", "belt_speed"), at)
    with pytest.raises(ValueError, match="'impact' is not in this map; it holds label"):
        plots.value_map(small_map, "impact")


def test_speckled_maps_are_not_hatched_cell_by_cell():
    ax = Figure().subplots()
    speckle = (np.indices((300, 300)).sum(axis=0) % 2).astype(bool)
    categories._hatch(ax, np.arange(301.0), np.arange(301.0), speckle, "xxxx", "#000000")
    assert not ax.collections
    categories._hatch(ax, np.arange(301.0), np.arange(301.0), ~speckle | True, "xxxx", "#000000")
    assert len(ax.collections[0].get_paths()) == 300


def test_the_picture_that_suits_a_map_is_that_of_its_axes(small_map, tmp_path):
    """Of one axis it was refused, where its sweep drew it."""
    line = small_map.isel(attack_angle=[5], normal_load=[1])
    for ds, name in ((small_map, "overview"), (line, "line")):
        path = tmp_path / f"{name}.h5"
        whole.write_dataset(ds, path)
        assert files.usual_of_file(path) == name
        assert usual_of_map(ds["label"].shape) == name  # of its sweep
    plots.plot_file(path, tmp_path / "line.png", dpi=30)
    assert files.subject_of(tmp_path / "line.png").startswith("line of ")


def test_cells_along_an_axis_of_texts_are_not_called_one_cell(small_map, tmp_path):
    one = small_map.isel(attack_angle=[5], normal_load=[1], belt_speed=[3])
    laws = xr.DataArray(["mild", "steep"], dims="law", name="law")
    whole.write_dataset(xr.concat([one, one], dim=laws), tmp_path / "two.h5")
    with pytest.raises(ValueError, match="two.h5: has no axis of more than one number; a map ne"):
        files.usual_of_file(tmp_path / "two.h5")


def test_a_file_of_a_picture_does_not_hang_on_a_persons_style(small_map, tmp_path):
    """LaTeX that is not installed ended a sweep behind its map; a tight box cut its picture."""
    path = tmp_path / "map.h5"
    whole.write_dataset(small_map.isel(attack_angle=[5], normal_load=[1]), path)
    plots.plot_file(path, tmp_path / "usual.png", dpi=30)
    with matplotlib.rc_context({"savefig.bbox": "tight", "text.usetex": True}):
        plots.plot_file(path, tmp_path / "styled.png", dpi=30)
        assert matplotlib.rcParams["text.usetex"]  # still the person's
    assert (tmp_path / "styled.png").read_bytes() == (tmp_path / "usual.png").read_bytes()


@pytest.mark.slow
def test_unfinished_sweep_is_drawn_with_its_holes(small_map, tmp_path, monkeypatch):
    partial = small_map.copy(deep=True)
    known = partial["label"].attrs["flag_values"]
    partial["label"].attrs["flag_values"] = np.append(known, np.int8(-1))
    partial["label"].attrs["flag_meanings"] += " not_computed"
    partial["label"][8:] = codes.NOT_COMPUTED
    partial.attrs |= {"cells": 459, "cells_done": 216}
    parts = tmp_path / "map.h5.parts"
    parts.mkdir()
    monkeypatch.setattr(files, "open_partial", lambda path, wide: partial)
    for picture in ("overview", "regimes"):
        plots.plot_file(parts, tmp_path / f"{picture}.png", picture=picture, dpi=30)
    texts = [entry.get_label() for entry in categories.category_legend(partial)]
    assert "not computed" in texts
    assert "unfinished sweep: 216 of 459 cells" in plots.class_map(partial)[0].figure.get_suptitle()


def test_a_regime_has_its_colour_in_maps_too():
    """Stick was sand there, beside a motion in which it is dark blue."""
    ended = cf.flags({name: code for code, name in enumerate(palette.REGIMES)})
    found = categories.colours_of(xr.DataArray([0], dims="x", attrs=ended))
    assert found == palette.REGIMES


@pytest.mark.parametrize("sight", SIGHT)
@pytest.mark.parametrize("name", ["CLASSES", "REGIMES", "MOTIONS", "MECHANISMS", "BANDS", "SPARE"])
def test_colours_are_told_apart_by_everybody(name, sight):
    """A difference of 2 is just seen side by side; 15 is another colour. Hatched cells have their
    pattern too.
    """
    every = getattr(palette, name)
    every = every if isinstance(every, dict) else dict(enumerate(every))
    colours = {k: v for k, v in every.items() if k not in palette.HATCHES}
    seen = {key: lab(colour, SIGHT[sight]) for key, colour in colours.items()}
    pairs = [(a, b) for a in seen for b in seen if a < b]
    near = {pair: float(np.linalg.norm(seen[pair[0]] - seen[pair[1]])) for pair in pairs}
    closest = min(near, key=lambda pair: near[pair])
    assert near[closest] > 15, (closest, near[closest])


@pytest.mark.parametrize("sight", SIGHT)
def test_a_class_without_a_colour_is_not_taken_for_another(sight):
    """The first spare one was nearly that of `other`, the second, to some eyes, of `reversal`."""
    classes = [lab(c, SIGHT[sight]) for k, c in palette.CLASSES.items() if k not in palette.HATCHES]
    for spare in palette.SPARE[:4]:
        away = [np.linalg.norm(lab(spare, SIGHT[sight]) - colour) for colour in classes]
        assert min(away) > 15, spare


@pytest.mark.parametrize(
    "speeds",
    [
        {"values": [0.1, 0.2, 0.4, 0.8, 1.6]},  # looks spaced by ratio, and is halved evenly
        {"start": 0.4, "stop": 1.0, "num": 7, "spacing": "geometric"},  # does not look so, and is
    ],
)
def test_located_borders_are_joined_however_an_axis_is_spaced(tmp_path, monkeypatch, speeds):
    """Of a disc a curve is drawn all round; it was crumbs: 30 pieces between 53 points."""
    import border_maps

    monkeypatch.setitem(border_maps.AXES, "belt_speed", speeds)
    path, middle, radius = tmp_path / "map.h5", (0.5, 0.4), 0.3
    disc = border_maps.engine(
        lambda x, y: np.where(np.hypot(x - middle[0], y - middle[1]) < radius, 700.0, 300.0)
    )
    spec = border_maps.coarse_map(path, disc)
    found = border_maps.refined(path, disc, levels=5, probes=0)
    with whole.open_map(path) as ds:
        (ax,) = plots.class_map(plots.with_borders(ds, found))
    curves = next(one for one in ax.collections if isinstance(one, LineCollection))
    ends = np.array(curves.get_segments())  # (pieces, 2, 2)
    assert len(ends) > 0.9 * found.sizes["border"] > 25
    low, high = spec.axes["belt_speed"].values()[[0, -1]]
    x, y = (ends[..., 0] + 40) / 80, (ends[..., 1] - low) / (high - low)
    located = np.hypot(x - middle[0], y - middle[1])
    assert np.quantile(np.abs(located - radius), 0.9) < 1 / 2**5 / 4
    with whole.open_map(path) as ds:
        other = (3.6 * ds["belt_speed"]).assign_attrs(units="km/h")
        faster = plots.with_borders(ds, found).assign_coords(belt_speed=other)
        # those of more than the lowest of the other unit were drawn, at a third of their place
        with pytest.raises(ValueError, match="^belt_speed must be in m/s, as the borders of its"):
            plots.class_map(faster)


def refined_ball(path, radius, levels):
    """Borders of a map over three axes, in shares of which a ball about the middle squeals."""
    import border_maps

    def ball(x, y, z):
        off = (x - 0.5) ** 2 + (y - 0.5) ** 2 + (z - 0.5) ** 2
        return np.where(off < radius**2, 700.0, 300.0)

    engine = border_maps.engine(ball)
    border_maps.coarse_map(path, engine, axes=("attack_angle", "normal_load", "belt_speed"))
    return border_maps.refined(path, engine, levels=levels, probes=0)


def test_borders_that_lack_what_curves_are_drawn_from_are_refused(small_map):
    """The page had none, without a word."""
    lacking = xr.Dataset({"kind": ("border", [0])}, attrs={"on": "label", "levels": 1})
    with pytest.raises(ValueError, match="borders must be those of a map, but had no axis"):
        plots.with_borders(small_map, lacking)


def test_a_part_of_a_map_has_the_borders_that_lie_in_it(tmp_path):
    """Those beyond its ends were strokes along its frame, and those of all loads lay over one whose
    load was dropped; of what was masked or joined none could be drawn.
    """
    path = tmp_path / "map.h5"
    found = refined_ball(path, 0.4, levels=2)
    with whole.open_map(path) as ds:
        ds = plots.with_borders(ds.load(), found)
    plane = ("attack_angle", "belt_speed", "label")
    ends = np.array(border_pieces(ds.isel(normal_load=2), *plane)[0])  # (pieces, 2, 2), in cells
    inside = ((ends[..., 0] >= 3) & (ends[..., 0] <= 5)).all(axis=1)
    part = ds.isel(normal_load=2, attack_angle=slice(3, 6))
    np.testing.assert_allclose(border_pieces(part, *plane)[0], ends[inside] - [3.0, 0.0])
    assert 0 < inside.sum() < len(ends)
    along = border_places(part.isel(belt_speed=4), "attack_angle", "label")
    assert ((along > 0) & (along < 2)).all() and along.size
    with pytest.raises(ValueError, match="must say which normal_load it is of"):
        plots.class_map(ds.isel(normal_load=2, drop=True))
    plots.class_map(ds.isel(normal_load=2))
    halves = [ds.isel(attack_angle=part) for part in (slice(0, 4), slice(4, None))]
    for copied in (
        ds.where(ds.normal_load > float(ds.normal_load[1])),
        xr.concat(halves, "attack_angle", data_vars="all"),
    ):
        np.testing.assert_array_equal(border_pieces(copied.isel(normal_load=2), *plane)[0], ends)
        along = border_places(copied.isel(normal_load=2, belt_speed=4), "attack_angle", "label")
        assert along.size
        plots.class_map(copied)


@pytest.mark.slow
def test_borders_are_drawn_as_curves_over_the_classes_of_each_slice(tmp_path):
    """The curve of a disc that was located runs along the disc, in each plane that it crosses."""
    path = tmp_path / "map.h5"
    found = refined_ball(path, 0.3, levels=5)
    with whole.open_map(path) as ds:
        drawn = plots.class_map(plots.with_borders(ds, found), x="attack_angle", y="belt_speed")
        crossed = 0
        for ax, load in zip(drawn, ds.normal_load.values, strict=True):
            curves = [one for one in ax.collections if isinstance(one, LineCollection)]
            radius = 0.09 - ((load - 5) / 25 - 0.5) ** 2
            if radius <= 0:
                assert not curves
                continue
            crossed += 1
            places = np.concatenate(curves[0].get_segments())
            x, y = (places[:, 0] + 40) / 80, (places[:, 1] - 0.1) / 0.8
            assert len(places) > 8
            assert np.abs(np.hypot(x - 0.5, y - 0.5) - np.sqrt(radius)).max() < 1 / (8 * 2**5)
        assert crossed == 2
        words = [text.get_text() for text in drawn[0].figure.legends[0].get_texts()]
        assert "border (located)" in words
    plots.plot_file(path, tmp_path / "map.png", picture="classes")
    assert (tmp_path / "map.png").stat().st_size > 10_000


def test_a_picture_that_appears_meanwhile_is_not_replaced(tmp_path, monkeypatch):
    """Of two commands that draw into one new file the later replaced the other's picture."""
    path, picture = tmp_path / "map.h5", tmp_path / "map.png"
    stub_sweep.run(stub_sweep.make_spec(), path).close()

    def save(figure, temporary, **_):
        picture.write_bytes(b"precious")
        temporary.touch()

    monkeypatch.setattr(Figure, "savefig", save)
    options = {"picture": "line", "x": "belt_speed"}
    with pytest.raises(StoreError, match="was made by another program meanwhile"):
        plots.plot_file(path, picture, **options)
    assert picture.read_bytes() == b"precious"
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["map.h5", "map.png"]
