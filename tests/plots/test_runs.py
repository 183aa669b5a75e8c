"""Pictures of runs: known signals give known pictures, and what cannot be drawn is refused in one
line.
"""

import signal
import warnings

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from pictures import SIGHT, inside_the_page, lab
from PIL import Image
from processes import drop_ctrl_c

matplotlib.use("Agg")

from wiperjax import SteadyBelt, Stribeck, Wiper, exports, plots, simulate
from wiperjax.datasets import run_dataset  # noqa: E402
from wiperjax.machine.files import StoreError
from wiperjax.plots import files
from wiperjax.plots.runs import animation, bands, friction, history, levels, spectra
from wiperjax.plots.style import caption, palette
from wiperjax.plots.style.axes import time_text
from wiperjax.sound import sound
from wiperjax.store.whole import write_dataset  # noqa: E402
from wiperjax.vocabulary.codes import Event, Regime  # noqa: E402


def bouncing_run() -> xr.Dataset:
    """Run of the form that `wiperjax.simulate` returns: stick, slip and one short flight,
    repeated.
    """
    time = np.linspace(0, 0.1, 2001)
    phase = (time * 40) % 1
    regime = np.select(
        [phase < 0.7, phase < 0.8, phase < 0.9],
        [Regime.STICK, Regime.SLIP_NEG, Regime.FLIGHT],
        Regime.SLIP_POS,
    )
    x = 1e-3 * np.where(phase < 0.7, phase / 0.7, (1 - phase) / 0.3)
    gap = np.where(regime == Regime.FLIGHT, 4e-3 * (phase - 0.8) * (0.9 - phase), 0.0)
    position = np.column_stack([x, gap])
    start = np.arange(4) / 40
    order = [
        (0.7, Event.RELEASE, 0, 2),
        (0.8, Event.LIFT_OFF, 2, 3),
        (0.9, Event.IMPACT, 3, 1),
        (1.0, Event.CAPTURE, 1, 0),
    ]
    events = [
        (t + p / 40, kind, before, after)
        for t in start
        for p, kind, before, after in order
        if t + p / 40 < 0.1
    ]
    times, kinds, before, after = (np.array(column) for column in zip(*events, strict=True))

    def flags(names):
        codes = np.array([int(name) for name in names], dtype=np.int8)
        return {
            "flag_values": codes,
            "flag_meanings": " ".join(name.name.lower() for name in names),
        }

    return xr.Dataset(
        {
            "position": (("time", "axis"), position, {"units": "m"}),
            "velocity": (("time", "axis"), np.gradient(position, time, axis=0), {"units": "m/s"}),
            "regime": ("time", regime.astype(np.int8), flags(Regime)),
            "normal_force": (
                "time",
                np.where(regime == 3, 0.0, 15 + 5 * np.sin(250 * time)),
                {"units": "N/m"},
            ),
            "friction_force": ("time", np.where(regime == 3, 0.0, -8.0), {"units": "N/m"}),
            "event_time": ("event", times, {"units": "s"}),
            "event_kind": ("event", kinds.astype(np.int8), flags(Event)),
            "regime_before": ("event", before.astype(np.int8), flags(Regime)),
            "regime_after": ("event", after.astype(np.int8), flags(Regime)),
        },
        coords={"time": ("time", time, {"units": "s"})},
        attrs={"title": "a bouncing lip"},
    )


def tone(frequency=800.0, amplitude=1.0, seconds=0.5, rate=20_000, offset=0.0) -> xr.Dataset:
    """Run of a blade whose tip velocity is a sine, in slip throughout."""
    time = np.arange(round(seconds * rate)) / rate
    turn = 2 * np.pi * frequency
    speed = amplitude * np.sin(turn * time) + offset
    place = offset * time - amplitude / turn * np.cos(turn * time)
    flags = {"flag_values": np.arange(4), "flag_meanings": "stick slip_pos slip_neg flight"}
    return xr.Dataset(
        {
            "velocity": (("time", "axis"), np.column_stack([speed, 0 * speed]), {"units": "m/s"}),
            "position": (("time", "axis"), np.column_stack([place, 0 * place]), {"units": "m"}),
            "regime": ("time", np.full(time.size, 2, dtype=np.int8), flags),
            "belt_velocity": ("time", np.full(time.size, 0.5), {"units": "m/s"}),
            "slip_speed": ("time", speed - 0.5, {"units": "m/s"}),
        },
        coords={"time": ("time", time, {"units": "s"}), "axis": ["x", "y"]},
    )


# --- parts of a run -------------------------------------------------------------------------------


def test_regime_spans_are_those_of_the_events():
    run = bouncing_run()
    spans = list(run_dataset.regime_spans(run))
    assert spans[0][2] == "stick" and spans[0][:2] == pytest.approx((0, 0.0175))
    assert {name for *_, name in spans} == {"stick", "slip_neg", "flight", "slip_pos"}
    assert all(a[1] == b[0] for a, b in zip(spans, spans[1:], strict=False))
    sampled = list(run_dataset.regime_spans(run.drop_dims("event")))
    assert [name for *_, name in sampled] == [name for *_, name in spans]


def test_a_part_of_a_run_has_its_own_events_and_regimes():
    run = bouncing_run()
    part = run_dataset.between(run, 0.03, 0.06)
    assert float(part.time[0]) >= 0.03 and float(part.time[-1]) <= 0.06
    assert part.sizes["event"] == int(((run.event_time >= 0.03) & (run.event_time <= 0.06)).sum())
    # the same stretches, also when xarray cut the samples and left all events
    for cut in (part, run.sel(time=slice(0.03, 0.06))):
        spans = list(run_dataset.regime_spans(cut))
        assert (spans[0][0], spans[-1][1]) == (float(part.time[0]), float(part.time[-1]))
        assert spans[0][2] == "stick"
    with pytest.raises(ValueError, match="8 samples must lie between"):
        run_dataset.between(run, 0.05, 0.0501)


def test_pitch_and_last_periods():
    run = tone(800.0)
    assert run_dataset.pitch(run) == pytest.approx(800.0, abs=0.01)
    assert np.isnan(run_dataset.pitch(tone(800.0, amplitude=1e-4)))  # quiet beside the glass
    assert np.isnan(run_dataset.pitch(tone(8.0, seconds=0.4)))  # 1.6 periods in the second half
    assert (
        run_dataset.last_periods(run).sizes["time"] == run.sizes["time"]
    )  # one regime: all is seen
    turning = run.assign(belt_velocity=0.5 * np.cos(4 * run.time))
    assert np.isnan(run_dataset.pitch(turning)) and run_dataset.settled(turning) is turning


def test_frames_follow_the_motion_that_they_show():
    """A tone in one regime, and what happens around V = 0: the whole run in as many frames would
    show another motion, slower than it is."""
    run, frames = tone(800.0, seconds=1.0), 150
    turns = {
        "event_time": [0.25, 0.75], "event_kind": [int(Event.BELT_REVERSAL)] * 2,
        "regime_before": [2, 2], "regime_after": [2, 2],
    }  # fmt: skip
    turning = run.assign(
        belt_velocity=0.5 * np.cos(2 * np.pi * run.time),
        **{name: ("event", values, run["regime"].attrs) for name, values in turns.items()},
    )
    turning["event_kind"].attrs = bouncing_run()["event_kind"].attrs
    for one, ends in ((run, (1 - 6 / 800, 1)), (turning, (0.745, 0.775))):
        part = animation.slow_part(one, 6)
        assert part.time.values[[0, -1]] == pytest.approx(ends, abs=1e-4)
        assert np.ptp(part.time.values) / frames < 1 / 800 / 6
    assert animation.slow_part(bouncing_run(), 6).sizes["time"] == 2001  # no period
    late = run_dataset.between(turning, 0.0, 0.755)  # it ends soon after the last V = 0
    assert animation.slow_part(late, 6).time.values[[0, -1]] == pytest.approx((0.725, 0.755))
    slow = turning.assign_attrs(class_reversal_window=0.1)  # the lip takes so long to flip over
    assert animation.slow_part(slow, 6).time.values[[0, -1]] == pytest.approx((0.73, 0.85))
    fast = tone(6000.0)  # two periods are fewer samples than a part has
    assert animation.slow_part(fast, 2).sizes["time"] == 9


def test_a_system_of_ones_own_is_heard_and_seen_by_what_it_is_judged_by():
    """Its output, here a tone of 300 Hz beside a first coordinate of 800."""
    run, other = tone(800.0), tone(300.0, amplitude=0.1)
    run["output"] = other["velocity"].isel(axis=0).assign_attrs(long_name="output", units="m/s")
    assert run_dataset.pitch(run) == pytest.approx(300.0, abs=0.01)
    assert levels.lines(run).strongest == pytest.approx(300.0, abs=0.01)
    for component, pitch in ((0, 800.0), (1, np.nan)):  # what is asked for by name stays that
        found = levels.lines(run, "velocity", component)
        peak = found.frequency[np.argmax(found.amplitude)]
        assert peak == pytest.approx(pitch, abs=2) or found.amplitude.max() == 0
    slow = levels.lines(tone(1.5, seconds=2.0, rate=1000))  # 1.5 periods settled tell no tone,
    assert np.isnan(slow.strongest) and slow.frequency[0] <= 1.5  # but are no silence
    assert sound(run).rms == pytest.approx(0.1 / np.sqrt(2), rel=0.02)
    held, unit = exports.columns(run)["output"]
    assert np.array_equal(held, other["velocity"][:, 0]) and unit == "m/s"


# --- pictures -------------------------------------------------------------------------------------


def test_history_has_bands_of_regime_and_marks_of_events():
    run = bouncing_run()
    ax = plots.time_history(run)
    shaded = [c for c in ax.collections if c.get_alpha() == bands.ALPHA]
    assert sum(len(c.get_paths()) for c in shaded) == len(list(run_dataset.regime_spans(run)))
    texts = [text.get_text() for text in ax.figure.legends[0].get_texts()]
    assert "impact (4)" in texts and "flight" in texts and "slip backward" in texts
    marks = [line for line in ax.lines if line.get_marker() == palette.EVENTS["impact"]]
    assert len(marks[0].get_xdata()) == 4
    axes = plots.history_page(run)
    assert [ax.get_ylabel() for ax in axes] == [
        "velocity (m/s)", "position (mm)", "gap (mm)", "normal\nforce (N/m)",
        "friction\nforce (N/m)",
    ]  # fmt: skip
    assert len(plots.history_page(run, "normal_force")) == 1
    with pytest.raises(ValueError, match="'speed' is not in this run; it holds position"):
        plots.time_history(run, quantity="speed")


def buzzing_run(periods=900, stick=1 / 3, quiet=0.25) -> xr.Dataset:
    """Run of 1 s that slips for `quiet` s, then sticks for a share `stick` of each period."""
    run = tone(seconds=1.0)
    start = quiet + (1 - quiet) / periods * np.arange(periods)
    times = np.stack([start, start + stick * (1 - quiet) / periods], axis=1).ravel()
    after = np.tile([Regime.STICK, Regime.SLIP_NEG], periods)
    before = np.roll(after, 1)
    return run.assign(
        event_time=("event", times, {"units": "s"}),
        event_kind=(
            "event",
            np.tile([Event.CAPTURE, Event.RELEASE], periods),
            {
                "flag_values": [int(e) for e in Event],
                "flag_meanings": " ".join(e.name for e in Event),
            },
        ),
        regime_before=("event", before, run["regime"].attrs),
        regime_after=("event", after, run["regime"].attrs),
    )


def test_stays_too_short_to_show_are_drawn_by_their_share_of_the_time():
    run = buzzing_run()
    end = float(run.time[-1])
    found = bands.pieces(run)
    exact: dict[str, float] = {}
    for start, stop, name in run_dataset.regime_spans(run):
        exact[name] = exact.get(name, 0.0) + stop - start
    for name, time in exact.items():
        drawn = sum(shares.get(name, 0) * (stop - start) for start, stop, shares in found)
        assert drawn == pytest.approx(time, rel=1e-9)
    assert found[0][:2] == (0.0, 0.25) and found[0][2] == {"slip_neg": 1.0}  # long: as it is
    assert found[-1][1] == end
    assert all(a[1] == b[0] for a, b in zip(found, found[1:], strict=False))
    # whole periods: a steady motion has steady shares, but for its cut end
    assert all(shares["stick"] == pytest.approx(1 / 3) for *_, shares in found[1:-1])
    assert all(stop - start >= bands.FINEST * end for start, stop, _ in found)
    texts = [text.get_text() for text in plots.time_history(run).figure.legends[0].get_texts()]
    assert any(text.startswith("divided") for text in texts)
    # seen from near, each stay is a band of its own
    near = run_dataset.between(run, 0.5, 0.55)
    assert {len(shares) for *_, shares in bands.pieces(near)} == {1}
    texts = [text.get_text() for text in plots.time_history(near).figure.legends[0].get_texts()]
    assert not any(text.startswith("divided") for text in texts)


@pytest.mark.parametrize("sight", SIGHT)
def test_bands_of_regimes_are_told_apart_by_everybody(sight):
    seen = {}
    for name, colour in palette.REGIMES.items():
        paler = bands.ALPHA * np.array(matplotlib.colors.to_rgb(colour)) + 1 - bands.ALPHA
        seen[name] = lab(tuple(paler), SIGHT[sight])
    near = {(a, b): np.linalg.norm(seen[a] - seen[b]) for a in seen for b in seen if a < b}
    assert min(near.values()) > 12, min(near, key=lambda pair: near[pair])


@pytest.mark.slow
def test_every_picture_of_a_run_says_its_class_and_frequency(squeal):
    heard = "squeal (stick-slip), 780.8 Hz"
    for name, picture in files.PICTURES["run"].items():
        drawn = files.draw(squeal, "run", name, picture, "run.h5", {})
        figure = getattr(drawn, "_fig", drawn)
        assert heard in figure.get_suptitle().splitlines(), name
        if name == "animation":
            drawn._draw_was_started = True  # else matplotlib warns that it was never shown
    # of a part that somebody cut, nothing is claimed of the whole
    assert caption.noise_text(run_dataset.between(squeal, 0.1, 0.11)) == ""
    assert caption.noise_text(bouncing_run()) == ""
    assert caption.noise_text(tone(800.0)) == "800 Hz"
    still = squeal.assign(velocity=squeal["velocity"] * 0 + [1e-9, 0.0])
    del still.attrs["statistics_start"]  # what was gathered is not of these samples
    assert caption.noise_text(still) == "quiet"


@pytest.mark.parametrize("lost", ["event_time", "event_kind", "regime_before"])
def test_events_that_lack_a_part_are_refused_in_one_line(lost):
    """A KeyError of xarray's."""
    run = bouncing_run()
    must = f"the events of a run must have {lost}, but have none; run.drop_dims"
    with pytest.raises(ValueError, match=must):
        plots.run_overview(run.drop_vars(lost))


def test_no_two_rows_of_an_overview_show_the_same():
    turning = tone(seconds=1.0).assign(belt_velocity=0.5 * np.cos(4 * tone(seconds=1.0).time))
    for run, framed in ((turning, False), (buzzing_run(), True)):
        figure = plots.run_overview(run)
        limits = [ax.get_xlim() for ax in figure.axes if ax.get_ylabel() == "velocity (m/s)"]
        assert len(limits) == len(set(limits)) == 1 + framed
        assert ("in the frame" in figure.get_suptitle()) == framed


@pytest.mark.long
def test_nothing_reaches_beyond_a_page_of_a_run(squeal):
    run = bouncing_run()
    kinds = run["event_kind"].copy(data=np.resize([e for e in Event if e != Event.NONE], 15))
    belt = 0.1 * np.sin(30 * run.time)
    slip = run["velocity"].isel(axis=0) - belt
    run = run.assign(event_kind=kinds, belt_velocity=belt, slip_speed=slip)
    run.attrs |= squeal.attrs | {"support_stiffness": 1e4, "neck_stiffness": 0.01, "gravity": 9.81}
    run.attrs |= {"noise": "reversal (reversal impulse)", "hinge_damping": 0.001}
    run.attrs.pop("result_message")  # it has no result
    for drawn in (
        plots.history_page(run)[0].figure,
        plots.time_history(run).figure,
        plots.run_overview(run),
        plots.run_overview(squeal),
        plots.phase_portrait(run).figure,
        friction.friction_page(run)[0].figure,
        plots.spectrum(run).figure,
        plots.spectrogram(run)[0].figure,
    ):
        assert inside_the_page(drawn) == []


@pytest.mark.parametrize("amplitude", [0.0, 1e-9, 1e-4])
def test_scale_of_a_quiet_spectrum_is_that_of_the_class(amplitude):
    """Rounding noise is not blown up: the limits contain the border of quiet, and end five decades
    below it."""
    run = tone(3000.0, amplitude=amplitude)
    border = 0.01 * 0.5  # of the speed of the glass
    low, high = plots.spectrum(run).get_ylim()
    assert low == pytest.approx(border * 1e-5) and high > border
    level = plots.spectrogram(run)[0].collections[0]
    assert level.norm.vmax == pytest.approx(20 * np.log10(border))
    assert level.norm.vmin == level.norm.vmax - spectra.LEVELS
    # other quantities: a share of what they are on the whole
    force = xr.DataArray(9.0 + amplitude * run["velocity"].values[:, 0], dims="time")
    force = run.assign(normal_force=force.assign_attrs(units="N/m"))
    low, high = plots.spectrum(force, quantity="normal_force").get_ylim()
    assert low == pytest.approx(0.09e-5, rel=1e-3)


def test_spectrogram_shows_no_silence_where_it_knows_nothing():
    run = tone(800.0, seconds=0.2)
    mesh = plots.spectrogram(run)[0].collections[0]
    level, corners = np.asarray(mesh.get_array()), mesh.get_coordinates()
    assert (corners[0, 0, 0], corners[0, -1, 0]) == (0.0, float(run.time[-1]))
    assert corners[0, 0, 1] <= 0 and mesh.axes.get_ylim()[1] <= corners[-1, 0, 1]
    loudest = level.max(axis=0)  # a steady tone is as loud at the ends as anywhere
    assert np.ptp(loudest) < 0.5 and loudest.max() == pytest.approx(-3.01, abs=0.1)


def test_spectrum_has_the_level_and_frequency_of_a_sine():
    ax = plots.spectrum(tone(800.0, amplitude=2.0, offset=0.3))
    curve = max(ax.lines, key=lambda line: len(line.get_xdata()))
    frequency, level = curve.get_data()
    assert level.max() == pytest.approx(np.sqrt(2.0), rel=1e-3)
    assert frequency[level.argmax()] == pytest.approx(800.0, abs=2.0)
    assert "800 Hz" in [text.get_text() for text in ax.texts]
    silent = plots.spectrum(tone(amplitude=1e-9))
    assert not [text for text in silent.texts if "Hz" in text.get_text()]
    with pytest.raises(ValueError, match="component must be 0 ... 1, was 2"):
        plots.spectrum(tone(), component=2)


@pytest.mark.parametrize("pitch", [800.5, 801.0, 806.25, 812.5])
def test_a_line_between_two_bins_is_as_high_as_on_one(pitch):
    """They lie 2 Hz apart in the spectrum, where halfway between a line was drawn 1.4 dB too low,
    and were 25 Hz apart in the spectrogram."""
    found = levels.lines(tone(pitch))
    assert found.amplitude.max() == pytest.approx(np.sqrt(0.5), rel=3e-3)
    assert found.frequency[found.amplitude.argmax()] == pytest.approx(pitch, abs=1.01)
    assert levels.levels(tone(pitch)).decibels.max() == pytest.approx(-3.01, abs=0.1)


@pytest.mark.parametrize("begin", [0.1, 0.45, 0.8])
def test_a_spectrum_hears_all_strokes_of_a_belt_that_turns_alike(begin):
    """Hann's window showed a squeal near the end of a run a fifth as high as in its middle."""
    run = tone(800.0, seconds=1.0)
    time = run["time"]
    heard = (time >= begin) & (time < begin + 0.1)
    run = run.assign(velocity=run["velocity"].where(heard, 0.0))
    run = run.assign(belt_velocity=0.5 * np.cos(2 * np.pi * time))
    found = levels.lines(run)
    assert found.amplitude.max() == pytest.approx(0.1 * np.sqrt(0.5), rel=0.06)  # of all the run
    assert "5% faded at each end" in plots.spectrum(run).figure.get_suptitle()


def test_the_spectrum_of_what_is_too_fast_to_be_heard_has_its_tone():
    """It ended at 20 kHz, below what counts as quiet: a tip of 1.5 MHz looked silent."""
    found = levels.lines(tone(1.5e6, seconds=1e-4, rate=5e7))
    assert found.strongest == pytest.approx(1.5e6, rel=1e-3)
    assert found.amplitude.max() == pytest.approx(np.sqrt(0.5), rel=1e-2)
    plots.spectrum(tone(1.5e6, seconds=2e-5, rate=5e7))  # shorter than a spectrum of sound


def test_spectrogram_has_the_level_of_a_sine_and_ticks_of_events():
    axes = plots.spectrogram(tone(800.0, amplitude=1.0))
    mesh = axes[0].collections[0]
    assert float(mesh.get_array().max()) == pytest.approx(-3.01, abs=0.1)  # 1 m/s peak
    row = np.unravel_index(np.argmax(mesh.get_array()), mesh.get_array().shape)[0]
    assert mesh.get_coordinates()[row, 0, 1] < 800 < mesh.get_coordinates()[row + 1, 0, 1]
    axes = plots.spectrogram(bouncing_run())
    rows = {tick.get_text() for tick in axes[1].get_yticklabels()}
    assert {"impact (4)", "lift-off (4)", "stick to slip (4)", "slip to stick (3)"} <= rows


def test_short_runs_have_the_spectra_that_they_can_have():
    """4 ms and 50 us of samples a tenth of a microsecond apart."""
    for short in (tone(amplitude=1e-9, seconds=4e-3, rate=1e7), tone(seconds=5e-5, rate=1e7)):
        mesh = plots.spectrogram(short)[0].collections[0]
        assert mesh.get_array().shape[0] >= 8
    with pytest.raises(ValueError, match=r"must be of 0.0002 s or more, was of 5e-05 s$"):
        plots.spectrum(short)
    with pytest.raises(ValueError, match=r"^highest must be \S+ Hz or more where a window is"):
        plots.spectrogram(short, highest=500.0)
    texts = [text.get_text() for ax in plots.run_overview(short).axes for text in ax.texts]
    assert any("0.0002 s" in text for text in texts)


def test_a_run_of_one_sample_is_drawn_without_a_warning_and_not_animated(squeal):
    """matplotlib's own went to a person's terminal, four times a page."""
    one = squeal.isel(time=[0], event=[])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plots.run_overview(one)
        with pytest.raises(
            ValueError, match="^the run must have two samples or more .*, but has 1"
        ):
            plots.animate(one)


def test_a_run_whose_time_falls_is_drawn_by_none(squeal):
    """Its history had no regimes, its portrait asked for bins that increase."""
    for draw in (plots.time_history, plots.phase_portrait, plots.run_overview):
        with pytest.raises(ValueError, match="^the time of the run must rise, but falls; run.sort"):
            draw(squeal.sortby("time", ascending=False))


def test_friction_force_lies_on_the_stribeck_curve(squeal):
    speed = np.linspace(0.01, 2.0, 50)
    law = Stribeck(1.0, 0.3, 0.1, 1.0, 0.02)
    np.testing.assert_allclose(friction.coefficient(squeal, speed), law.coefficient(speed))
    ax = plots.friction_curve(run_dataset.settled(squeal))
    dots = [line for line in ax.lines if line.get_marker() == "."]
    assert len(dots) == 2  # stick and backward slip
    slip, ratio = np.concatenate([line.get_xydata() for line in dots]).T
    moving = slip < -1e-6
    assert moving.sum() > 1000 and (slip <= 1e-9).all()
    expected = friction.coefficient(squeal, -slip[moving])
    np.testing.assert_allclose(ratio[moving], expected, rtol=1e-9)
    assert np.abs(ratio).max() <= 1.0 + 1e-9


@pytest.mark.parametrize(
    ("law", "words"),
    [
        ({}, []),  # as of a run in Python of a law without the numbers of the usual one
        ({"friction": "laws:Weak"}, []),
        (
            {"friction": "coulomb", "mu_static": 1.0, "mu_minimum": 0.5},
            ["friction law (right: times mean normal force)"],
        ),
    ],
)
def test_the_curve_of_a_law_is_drawn_and_named_as_far_as_a_run_tells_it(law, words):
    """A law of one's own was refused, and `plot --all` left the picture out without a word; one of
    Coulomb was called a Stribeck curve."""
    run = bouncing_run().assign(slip_speed=("time", np.linspace(-0.5, 0.3, 2001)))
    run = run.assign_attrs(law)
    axes = friction.friction_page(run)
    curve, *dots = axes[0].lines
    assert np.isfinite(curve.get_ydata()).any() == bool(words)
    assert sum(line.get_xdata().size for line in dots if line.get_marker() == ".") > 1500
    (legend,) = axes[0].figure.legends
    said = [text.get_text() for text in legend.get_texts()]
    assert said == [*words, "stick", "slip forward", "slip backward"]
    assert any("slip speed" in ax.get_xlabel() for ax in plots.run_overview(run).axes)


def test_phase_portrait_has_the_orbit_and_the_angle_of_the_lip(squeal):
    part = run_dataset.last_periods(squeal)
    assert float(part.time[0]) == pytest.approx(0.2 - 6 / 780.8, abs=2e-4)
    ax = plots.phase_portrait(part, transient=squeal)
    left, right = ax.get_xlim()
    assert 3.7 < left < right < 4.1  # mm: the orbit, not the way there
    ax.figure.draw_without_rendering()
    upper = ax.child_axes[0]
    assert upper.get_xlabel() == "angle of the lip (deg)"
    angle = np.degrees(np.arcsin(np.array([left, right]) / 6.0))
    np.testing.assert_allclose(upper.get_xlim(), angle, rtol=1e-6)
    plots.phase_portrait(bouncing_run().drop_dims("event"), component=1)


@pytest.mark.slow
@pytest.mark.parametrize("angle", [60.0, -60.0])
def test_a_phase_portrait_holds_the_end_of_a_lip_that_collapses(angle):
    blade = Wiper(belt=SteadyBelt(0.3), attack_angle=np.deg2rad(angle))
    ds = simulate(blade, 0.2, sample_interval=2e-5)
    ax = plots.phase_portrait(ds)
    low, high = ax.get_xlim()
    (end,) = (line for line in ax.lines if line.get_label() == "end")
    assert abs(end.get_xdata()[0]) > 0.99 * 1e3 * blade.lip_length  # it does collapse
    assert low <= end.get_xdata()[0] <= high


@pytest.mark.parametrize("kind", ["IMPACT", "BLOW"])
def test_velocity_jumps_at_the_glass_in_a_phase_portrait(kind):
    """A ball falls from 1 mm and rebounds, from the glass or a stop: its samples are 0.1 mm and
    more above it."""
    g, e = 9.81, 0.6
    hit = np.sqrt(2e-3 / g)
    time = np.linspace(0, 1.4 * hit, 31)
    since = np.maximum(time - hit, 0.0)
    speed = np.where(time < hit, -g * time, e * g * hit - g * since)
    height = np.where(time < hit, 1e-3 - g * time**2 / 2, e * g * hit * since - g * since**2 / 2)
    run = bouncing_run().isel(time=slice(0, 31), event=[2]).assign_coords(time=time)
    run["event_time"][:], run["regime"][:] = hit, int(Regime.FLIGHT)
    run["event_kind"][:] = int(Event[kind])
    run["position"][:, 1], run["velocity"][:, 1] = height, speed
    ax = plots.phase_portrait(run, component=1, transient=run)
    (flight,) = [c for c in ax.collections if c.get_label() == "flight"]
    jumps = [s for s in flight.get_segments() if s[0, 1] < -0.1 and s[1, 1] > 0.05]
    assert len(jumps) == 1 and np.ptp(jumps[0][:, 0]) == 0  # upright, in mm
    assert abs(jumps[0][0, 0]) < 0.01 < height.min() * 1e3 + 0.1
    # speeds at the glass, not those of the samples beside it
    np.testing.assert_allclose(jumps[0][:, 1], [-g * hit, e * g * hit], rtol=1e-9)
    way = ax.lines[0].get_xydata()  # the grey way there
    down = np.flatnonzero((way[:-1, 1] < -0.1) & (way[1:, 1] > 0.05))
    assert down.size == 1 and way[down, 0] == way[down + 1, 0]


def test_caption_names_the_parameters_in_degrees(squeal):
    text = caption.parameters_text(squeal)
    assert text == "attack angle 5°, normal load 15 N/m, belt speed 0.3 m/s"
    radians = squeal.assign_attrs(
        attack_angle=np.radians(-30.0),
        support_stiffness=8000.0,
        parameter_units="attack_angle: rad; normal_load: N/m; belt_speed: m/s; "
        "support_stiffness: N/m/m; shoulder_angle: rad; collapse_angle: rad",
        shoulder_angle=0.6,
        collapse_angle=np.radians(89.0),
    )
    text = caption.parameters_text(radians)
    assert text.startswith("attack angle -30°") and text.endswith("support stiffness 8000 N/m/m")
    assert caption.parameters_text(bouncing_run()) == ""


@pytest.mark.slow
def test_run_page_frames_the_part_that_it_shows(squeal):
    figure = plots.run_overview(squeal)
    assert "780.8 Hz" in figure.get_suptitle() and "attack angle 5°" in figure.get_suptitle()
    assert figure.axes[1].get_xlim()[0] == pytest.approx(0.2 - 6 / 780.8, abs=2e-4)
    plots.run_overview(bouncing_run()).savefig("/dev/null", format="png", dpi=30)


@pytest.mark.slow
def test_animation_shows_lip_glass_and_force(squeal, tmp_path):
    part = run_dataset.last_periods(squeal, 2.0)
    film = plots.animate(part, seconds=0.4)
    assert film._save_count == 10
    film._draw_was_started = True  # else matplotlib warns that it was never shown
    film._func(9)
    ax = film._fig.axes[0]
    rod = next(line for line in ax.lines if line.get_linewidth() == 5)
    x, y = np.array(rod.get_data())
    assert np.hypot(*(np.diff(x), np.diff(y))) == pytest.approx(6.0)  # mm: rigid
    assert (x[1], y[1]) == pytest.approx(tuple(1e3 * part.position.values[-1]))
    arrow = next(t for t in ax.texts if getattr(t, "arrow_patch", None))
    push = np.subtract(arrow.xy, (x[1], y[1]))
    force = [float(part[name][-1]) for name in ("friction_force", "normal_force")]
    assert push[0] / push[1] == pytest.approx(force[0] / force[1])
    write_dataset(squeal, tmp_path / "run.h5")
    plots.plot_file(tmp_path / "run.h5", tmp_path / "run.gif", seconds=0.2, dpi=30)
    with Image.open(tmp_path / "run.gif") as image:
        assert image.n_frames == 5 and image.info["duration"] == 1000 // animation.FRAMES_PER_SECOND
    for dpi, width in ((None, 448), (120, 672)):  # more than 80 was not heard
        plots.plot_file(tmp_path / "run.h5", tmp_path / f"{dpi}.gif", seconds=0.1, dpi=dpi)
        with Image.open(tmp_path / f"{dpi}.gif") as image:
            assert image.width == width
    with pytest.raises(ValueError, match="must be of a Wiper"):
        plots.animate(bouncing_run())


# --- files ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    where = tmp_path_factory.mktemp("pictures")
    write_dataset(bouncing_run(), where / "run.h5")
    write_dataset(xr.Dataset({"a": ("n", [1.0])}), where / "other.h5")
    label = xr.DataArray(
        np.zeros((3, 2), dtype=np.int8),
        dims=("attack_angle", "belt_speed"),
        attrs={"flag_values": np.arange(2, dtype=np.int8), "flag_meanings": "quiet squeal"},
    )
    coords = {"attack_angle": [-30.0, 0.0, 5.0], "belt_speed": [0.1, 0.2]}
    made = xr.Dataset({"label": label}, coords=coords)
    write_dataset(made, where / "map.h5")
    write_dataset(made.isel(attack_angle=[0], belt_speed=[0]), where / "one.h5")
    shape = (("axis", "mode"), [[1.0]])
    modes = xr.Dataset({"real_part": ("mode", [1.0]), "shape_amplitude": shape})
    write_dataset(modes, where / "modes.h5")
    write_dataset(xr.Dataset({"special_kind": ("special", ["fold"])}), where / "branch.h5")
    return where


@pytest.mark.parametrize(
    ("source", "output", "options", "line"),
    [
        ("run.h5", "p.png", {"picture": "wheel"}, "'wheel' is no picture; of a run there are over"),
        ("run.h5", "p.png", {"picture": "classes"}, "'classes' is a picture of a map, and .* hold"),
        ("map.h5", "p.png", {"picture": "phase"}, "'phase' is a picture of a run, and .* holds a"),
        ("map.h5", "p.gif", {}, "'animation' is a picture of a run"),
        ("run.h5", "p.png", {"picture": "animation"}, "an animation must end in .gif or .mp4"),
        ("run.h5", "p.gif", {"picture": "phase"}, "a still picture must end in .png or .pdf"),
        ("run.h5", "p.txt", {}, "a still picture must end in .png or .pdf or .svg"),
        ("run.h5", "p.png", {"at": {"x": 1.0}}, "--at does not suit the picture 'overview' of a"),
        ("map.h5", "p.png", {"picture": "classes", "start": 0.1}, "--from does not suit the pict"),
        ("map.h5", "p.png", {"picture": "line"}, "has no dominant_frequency, which the picture"),
        ("one.h5", "p.png", {}, "one.h5: has one cell; a map needs an axis of two values"),
        ("modes.h5", "p.png", {}, "modes.h5: holds modes of one system; only a map, a branch"),
        ("branch.h5", "p.png", {"picture": "curves"}, "branch.h5: was made without --second, or"),
        ("run.h5", "p.gif", {}, "has no belt_velocity, which the picture 'animation' needs"),
        ("run.h5", "p.png", {"start": 0.2}, "0 lie from 0.2 s on; the run has"),
        (
            "map.h5",
            "p.png",
            {"picture": "classes", "x": "load"},
            "'load' is not in this map's axes; it holds",
        ),
        ("other.h5", "p.png", {}, "holds something else; only a map, .* or a run can be drawn"),
        ("none.h5", "p.png", {}, "does not exist"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_one_line(folder, source, output, options, line):
    with pytest.raises((StoreError, ValueError), match=line) as raised:
        plots.plot_file(folder / source, folder / output, **options)
    assert "\n" not in str(raised.value) and not (folder / output).exists()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_ctrl_c_that_a_callback_drops_is_heeded_before_a_picture_is_kept(folder, monkeypatch):
    monkeypatch.setattr(Figure, "savefig", lambda self, path, **_: (path.touch(), drop_ctrl_c()))
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may ignore it
    try:
        with pytest.raises(KeyboardInterrupt):
            plots.plot_file(folder / "map.h5", folder / "p.png", picture="classes")
    finally:
        signal.signal(signal.SIGINT, handler)
    assert not (folder / "p.png").exists()


def test_mp4_needs_ffmpeg(folder, monkeypatch):
    monkeypatch.setattr(animation.shutil, "which", lambda name: None)
    with pytest.raises(ValueError, match="needs the program ffmpeg, which is not here; take .gif"):
        plots.plot_file(folder / "run.h5", folder / "p.mp4")


@pytest.mark.slow
def test_all_pictures_of_a_file(folder, squeal, tmp_path, monkeypatch):
    write_dataset(run_dataset.between(squeal, 0.15), tmp_path / "run.h5")
    made = plots.plot_all(tmp_path / "run.h5", tmp_path / "p.png", dpi=30, seconds=0.2)
    assert [path.name for path in made] == [
        f"p-{name}.{'gif' if name == 'animation' else 'png'}" for name in files.PICTURES["run"]
    ]
    assert all(path.stat().st_size > 1000 for path in made)
    with pytest.raises(StoreError, match="p-overview.png: exists already"):
        plots.plot_all(tmp_path / "run.h5", tmp_path / "p.png")
    monkeypatch.setattr(files, "_write", lambda drawn, output, force, dpi: None)
    # of what lacks a velocity of the glass, all but friction and animation
    made = plots.plot_all(folder / "run.h5", tmp_path / "q.pdf", dpi=30)
    assert {path.stem for path in made} == {
        "q-overview", "q-history", "q-phase", "q-spectrum", "q-spectrogram"
    }  # fmt: skip
    made = plots.plot_all(folder / "map.h5", tmp_path / "m.png", dpi=30)
    assert {path.stem for path in made} == {"m-classes"}
    with pytest.raises(ValueError, match=r"one.h5: has one cell; a map needs an axis of two"):
        plots.plot_all(folder / "one.h5", tmp_path / "o.png")
    with pytest.raises(StoreError, match="modes.h5: holds modes of one system; only a map, a br"):
        plots.plot_all(folder / "modes.h5", tmp_path / "o.png")


@pytest.mark.slow
def test_existing_pictures_are_kept(folder):
    (folder / "there.png").write_bytes(b"precious")
    with pytest.raises(StoreError, match="exists already"):
        plots.plot_file(folder / "run.h5", folder / "there.png")
    with pytest.raises(ValueError, match="'velocty' is not in this run"):  # not about the picture
        options = {"picture": "history", "quantity": "velocty"}
        plots.plot_file(folder / "run.h5", folder / "there.png", **options)
    assert (folder / "there.png").read_bytes() == b"precious"
    plots.plot_file(folder / "run.h5", folder / "there.png", force=True, dpi=30)
    assert (folder / "there.png").read_bytes().startswith(b"\x89PNG")


def test_marks_that_are_a_carpet_are_left_out():
    ax = Figure().subplots()
    run = bouncing_run()
    many = run.isel(event=np.zeros(history.MOST_MARKS + 1, dtype=int) + 2)
    history.event_marks(many, ax)
    assert not ax.lines


def test_bands_of_a_spectrum_are_those_stored_with_the_run():
    def reach(run):
        ax = plots.spectrum(run)
        return {
            text.get_text(): sorted(patch.get_x() for patch in ax.patches)
            for text in ax.texts
            if text.get_text() in ("squeal", "chattering")
        }

    assert 500.0 in reach(tone())["squeal"]
    narrow = tone().assign_attrs(class_squeal_band=np.array([700.0, 900.0]))
    assert 700.0 in reach(narrow)["squeal"] and 500.0 not in reach(narrow)["squeal"]
    wide = tone().assign_attrs(class_squeal_band=np.array([60.0, 500.0]))
    spans = [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in
             plots.spectrum(wide).patches]  # fmt: skip
    assert sorted(spans) == [(pytest.approx(20.0), 60.0), (60.0, 500.0)]  # not one over the other


@pytest.mark.parametrize(
    ("share", "named"), [((10.0, 20.0), True), ((14.0, 14.2), True), ((0.1, 1.05), False)]
)
def test_a_band_is_named_where_the_frame_has_room_for_the_word(share, named):
    """The word stood over the marks of the axis, of a band of which a sliver is left beside it."""
    lowest = plots.spectrum(tone()).get_xlim()[0]
    ax = plots.spectrum(tone().assign_attrs(class_squeal_band=lowest * np.array(share)))
    ax.figure.draw_without_rendering()
    words = [text for text in ax.texts if text.get_text() in ("squeal", "chattering")]
    assert ("squeal" in {word.get_text() for word in words}) == named
    frame = ax.get_window_extent()
    for box in (word.get_window_extent() for word in words):
        assert frame.x0 <= box.x0 < box.x1 <= frame.x1


@pytest.mark.parametrize(("low", "names"), [(480.0, ["squeal"]), (50.0, ["squeal", "chattering"])])
def test_names_of_bands_do_not_lie_over_each_other(low, names):
    bands = {"class_squeal_band": [500.0, 530.0], "class_chatter_band": [low, 500.0]}
    ax = plots.spectrum(tone().assign_attrs(bands))
    assert [text.get_text() for text in ax.texts if text.get_text() in palette.CLASSES] == names


@pytest.mark.parametrize(
    ("seconds", "words"), [(7.68e-3, "7.68 ms"), (0.9994, "999 ms"), (61.2, "61.2 s"), (1, "1 s")]
)
def test_times_are_told_in_seconds_from_one_on(seconds, words):
    """The 6.12e+04 ms in the frame."""
    assert time_text(seconds) == words
