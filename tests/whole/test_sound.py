"""Sound of a run: its tone, its level relative to a velocity, and what is refused."""

import copy

import numpy as np
import pytest
import scipy.io.wavfile
import xarray as xr

from wiperjax import sound
from wiperjax.cli import main
from wiperjax.explorer.numbers import audio
from wiperjax.machine.files import StoreError
from wiperjax.noise.spectrum import dominant_frequency
from wiperjax.store.whole import write_dataset


def tone(frequency, amplitude=0.5, seconds=0.2, step=2e-5, mean=0.3) -> xr.Dataset:
    """Run of a blade whose tip velocity is a sine about a mean."""
    time = step * np.arange(round(seconds / step) + 1)
    speed = mean + amplitude * np.sin(2 * np.pi * frequency * time)
    place = mean * time - amplitude / (2 * np.pi * frequency) * np.cos(2 * np.pi * frequency * time)
    flags = {"flag_values": np.arange(4), "flag_meanings": "stick slip_pos slip_neg flight"}
    return xr.Dataset(
        {
            "position": (("time", "axis"), np.column_stack([place, 0 * place]), {"units": "m"}),
            "velocity": (("time", "axis"), np.column_stack([speed, 0 * speed]), {"units": "m/s"}),
            "normal_force": ("time", 15 + 3 * (speed - mean) / amplitude, {"units": "N/m"}),
            "regime": ("time", np.full(time.size, 2, dtype=np.int8), flags),
            "belt_velocity": ("time", np.full(time.size, 0.3), {"units": "m/s"}),
        },
        coords={"time": ("time", time, {"units": "s"}), "axis": ["x", "y"]},
    )


def middle(heard):
    """Samples away from the fades."""
    return heard.samples[480:-480]


@pytest.mark.parametrize("step", [1e-5, 2e-5, 1 / 30_011, 1e-4])
def test_a_sine_keeps_its_frequency_and_its_level(step):
    heard = sound.sound(tone(700.0, step=step))
    assert heard.duration == pytest.approx(0.2, abs=2e-4)
    inner = middle(heard)
    assert np.abs(inner).max() == pytest.approx(0.5, rel=0.01)  # full scale is 1 m/s
    assert np.sqrt(2 * np.mean(inner**2)) == pytest.approx(0.5, rel=0.01)
    assert float(dominant_frequency(inner, 1 / sound.RATE)) == pytest.approx(700.0, rel=1e-4)
    assert abs(inner.mean()) < 0.01  # the mean is no sound
    assert np.abs(heard.samples[[0, -1]]).max() < 1e-3  # no click


def test_the_reference_sets_the_level():
    one, two = (sound.sound(tone(700.0), reference=r) for r in (1.0, 2.0))
    np.testing.assert_allclose(one.samples, 2 * two.samples)
    assert one.rms == pytest.approx(two.rms) and one.peak == pytest.approx(two.peak)
    force = sound.sound(tone(700.0), quantity="normal_force")
    assert np.abs(middle(force)).max() == pytest.approx(3 / 20, rel=0.01)
    assert "full scale = 20 N/m" in force.describe()


def test_too_loud_is_said_and_not_clipped(tmp_path):
    heard = sound.sound(tone(700.0, amplitude=2.0))
    assert "6.0 dB above full scale" in heard.warning() and "--reference 2.1" in heard.warning()
    heard.write(tmp_path / "loud.wav")
    rate, stored = scipy.io.wavfile.read(tmp_path / "loud.wav")
    assert rate == 48_000 and stored.dtype == np.float32
    np.testing.assert_array_equal(stored, heard.samples.astype(np.float32))
    assert np.abs(stored).max() > 1.9
    assert sound.sound(tone(700.0, amplitude=2.0), reference=2.1).warning() == ""
    with pytest.raises(StoreError, match="exists already"):
        heard.write(tmp_path / "loud.wav")


def test_repeated_periods_join_without_a_click():
    run = tone(781.3)
    heard = sound.sound(run, seconds=1.5)
    assert heard.samples.size == 72_000
    inner = middle(heard)
    time = np.arange(inner.size) / sound.RATE
    basis = np.column_stack([f(2 * np.pi * 781.3 * time) for f in (np.sin, np.cos)])
    rest = inner - basis @ np.linalg.lstsq(basis, inner, rcond=None)[0]
    assert np.abs(rest).max() < 0.01  # one sine, to the end: no jump of phase at any joint
    assert np.abs(inner).max() == pytest.approx(0.5, rel=0.01)


def test_silence_stays_silent():
    heard = sound.sound(tone(700.0, amplitude=1e-30), seconds=0.5)
    assert heard.duration == 0.5 and heard.peak < 1e-15


def test_what_is_neither_quiet_nor_periodic_is_not_repeated():
    """A lip that collapses after 3 ms: again and again it would be a buzz of 330 Hz."""
    run = tone(700.0, seconds=3e-3)
    speed = 0.3 * np.exp(run["time"] / 1e-3)
    run = run.assign(velocity=run["velocity"] * 0 + speed, position=1e-3 * run["velocity"])
    with pytest.raises(ValueError, match="no period that could be repeated; leave out --seconds"):
        sound.sound(run, seconds=2.0)
    assert sound.sound(run).duration == pytest.approx(3e-3, abs=1e-4)
    heard = audio(run, 1.0, 2.0)
    assert "<audio controls preload" in heard and "once: it has no period" in heard
    assert "<audio controls loop" in audio(tone(700.0), 1.0, 2.0)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (
            {"quantity": "position"},
            "quantity must be one of velocity, normal_force, but was 'position'",
        ),
        ({"reference": 0.0}, "reference must be a finite number > 0, but was 0"),
        ({"seconds": 1e-5}, r"seconds must lie inside \[4.1667e-05, 3600\] s, but was 1e-05"),
        ({"seconds": 1.0, "start": 0.19, "stop": 0.196}, "holds no whole period"),
        ({"start": 0.3}, "at least 8 samples must lie between"),
    ],
)
def test_what_makes_no_sense_is_refused(options, line):
    with pytest.raises(ValueError, match=line):
        sound.sound(tone(700.0), **options)


def test_coarse_sampling_is_refused_with_what_would_do():
    with pytest.raises(ValueError, match="every 0.0005 s, too coarse for sound: it needs 8000"):
        sound.sound(tone(40.0, step=5e-4))
    with pytest.raises(ValueError, match="10 samples in each period of its 1600 Hz; .* = 6e-05"):
        sound.sound(tone(1600.0, step=1e-4))
    assert sound.sound(tone(1600.0, step=6e-5)).peak == pytest.approx(0.5, rel=0.02)


def test_scene_is_heard_at_its_pitch(squeal, tmp_path, capsys):
    write_dataset(squeal, tmp_path / "run.h5")
    output = tmp_path / "run.wav"
    assert main(["listen", str(tmp_path / "run.h5"), "-o", str(output), "--from", "0.1"]) == 0
    rate, stored = scipy.io.wavfile.read(output)
    assert stored.shape == (4801,) and rate == 48_000
    spectrum = np.abs(np.fft.rfft(stored * np.hanning(stored.size)))
    strongest = spectrum.argmax() * rate / stored.size
    assert strongest == pytest.approx(780.8, abs=rate / stored.size)
    speed = squeal.velocity.sel(axis="x", time=slice(0.1, 0.2))
    assert np.std(stored[480:-480]) == pytest.approx(float(speed.std()), rel=0.03)
    printed = capsys.readouterr().out
    assert "full scale = 1 m/s" in printed and "not sound pressure" in printed


@pytest.mark.parametrize(("blade", "whose"), [(1, "lip"), (0, "system")])
def test_the_note_says_whose_motion_is_heard(blade, whose, tmp_path, capsys):
    write_dataset(tone(700.0).assign_attrs(of_a_blade=blade), tmp_path / "run.h5")
    assert main(["listen", str(tmp_path / "run.h5")]) == 0
    assert f"note: motion of the {whose}, not sound pressure" in capsys.readouterr().out


def test_a_tone_that_nobody_hears_is_noted(tmp_path, capsys):
    below = "Hz, lies below 20 Hz: nobody hears it, at most its overtones\n"
    above = "3e+04 Hz, lies above 20000 Hz: the sound holds what lies below alone\n"
    for frequency, seconds, noted in ((5.0, 1.0, below), (700.0, 1.0, ""), (3e4, 0.01, above)):
        path = tmp_path / f"{frequency:g}.h5"
        write_dataset(tone(frequency, seconds=seconds, step=min(2e-5, 0.05 / frequency)), path)
        assert main(["listen", str(path)]) == 0
        said = capsys.readouterr().err
        assert said.endswith(noted) and ("Hz" in said) == bool(noted)


def test_command_line_refuses_what_is_no_run(tmp_path, capsys):
    write_dataset(xr.Dataset({"label": ("n", [0, 1])}), tmp_path / "map.h5")
    for words, line in (
        (["map.h5", "-o", "a.wav"], "map.h5: holds a map; only a run can be heard"),
        (["map.h5", "-o", "a.mp3"], "a.mp3: must end in .wav"),
        (["none.h5", "-o", "a.wav"], "none.h5: does not exist"),
    ):
        words = [str(tmp_path / word) if "." in word else word for word in words]
        assert main(["listen", *words]) == 1
        printed = capsys.readouterr()
        assert line in printed.err and printed.err.count("\n") == 1
    assert not (tmp_path / "a.wav").exists()


@pytest.mark.parametrize("interval", [2e-9, 5e-9, 1e-6, 1e-4 / 3])
def test_a_finely_sampled_run_sounds_as_long_as_it_is(interval):
    samples = np.zeros(round(2e-3 / interval))
    assert len(sound.resample(samples, interval)) == pytest.approx(2e-3 * sound.RATE, abs=1)


@pytest.mark.parametrize("lasts", [1e-9, 1e-6, 2e-5])
def test_what_is_shorter_than_two_samples_of_sound_is_refused(lasts):
    with pytest.raises(ValueError, match="must last 2.1e-05 s at least, two samples of sound, but"):
        sound.sound(tone(700.0, seconds=lasts, step=lasts / 2000))
    heard = sound.sound(tone(700.0, seconds=2.1e-5, step=2.1e-5 / 2000))
    assert heard.samples.size and np.isfinite(heard.samples).all()


def test_whole_numbers_are_read_as_they_are():
    wave = np.round(20_000 * np.sin(2 * np.pi * 700.0 * 2e-5 * np.arange(2000))).astype(np.int16)
    np.testing.assert_array_equal(sound.resample(wave, 2e-5), sound.resample(1.0 * wave, 2e-5))
    for wrong in (-1e-4, "a", np.nan):
        with pytest.raises(ValueError, match="^interval must be a finite number > 0, but was"):
            sound.resample(wave, wrong)


def test_two_sounds_can_be_compared_and_kept_in_a_set():
    one = sound.sound(tone(700.0))
    assert one == one and one != copy.copy(one) and len({one, copy.copy(one)}) == 2
