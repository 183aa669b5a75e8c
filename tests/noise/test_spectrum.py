"""Dominant frequency: waveforms whose repetition rate is known, and a zero-padded periodogram of
scipy.
"""

import numpy as np
import pytest
import scipy.signal

from wiperjax.noise import spectrum
from wiperjax.noise.spectrum import dominant_frequency, strongest_lines

WINDOW = 0.2
SAMPLES = 2048
TIME = np.arange(SAMPLES) * WINDOW / SAMPLES
INTERVAL = WINDOW / SAMPLES


def waves(shape, frequencies):
    """Signals (frequencies, samples) of `shape(phase in [0, 1))`, each with a phase of its own."""
    offset = np.random.default_rng(0).random(len(frequencies))
    return shape((TIME * np.asarray(frequencies)[:, None] + offset[:, None]) % 1)


def sine(phase):
    return np.sin(2 * np.pi * phase)


def stick_slip(phase, duty=0.2, speed=0.3):
    """Stick at belt speed, then a half-sine slip back; no net displacement."""
    slip = (phase - (1 - duty)) / duty
    return np.where(slip < 0, speed, speed - speed / duty * np.pi / 2 * np.sin(np.pi * slip))


def asymmetric(phase, duty=0.3):
    """Stick, then a slip that starts steeply and dies slowly."""
    slip = (phase - (1 - duty)) / duty
    return np.where(slip < 0, 0.3, 0.3 - 2 * np.exp(-4 * slip) * (1 - np.exp(-30 * slip)))


def pulses(phase, duty=0.2):
    return (phase < duty).astype(float)


@pytest.mark.parametrize("shape", [sine, stick_slip, asymmetric, pulses])
def test_few_cycles_in_the_window(shape):
    exact = np.linspace(26, 60, 201)  # 28.2 Hz: 5.6 cycles
    found = dominant_frequency(waves(shape, exact), INTERVAL)
    worst = np.max(np.abs(found / exact - 1))
    assert worst < {sine: 2e-4, stick_slip: 2e-4, asymmetric: 5e-4, pulses: 2e-3}[shape]


def test_two_cycles_are_the_least_that_can_be_told():
    exact = np.linspace(11, 16, 51)
    assert dominant_frequency(waves(sine, exact), INTERVAL) == pytest.approx(exact, rel=0.02)


@pytest.mark.parametrize("shape", [sine, stick_slip])
def test_squeal_to_a_tenth_of_a_hertz(shape):
    exact = np.array([674.4, 780.8, 906.5])
    found = dominant_frequency(waves(shape, exact), INTERVAL)
    assert np.max(np.abs(found - exact)) < (1e-5 if shape is sine else 0.1)


def test_narrow_pulses_between_bins_do_not_turn_into_their_harmonics():
    exact = np.arange(12.3, 16.1, 0.1) / WINDOW  # through all places between two bins
    found = dominant_frequency(waves(lambda phase: pulses(phase, 0.1), exact), INTERVAL)
    assert found == pytest.approx(exact, rel=3e-3)


@pytest.mark.parametrize("shape", [sine, stick_slip, asymmetric, pulses])
def test_single_precision_tells_the_same_frequency(shape):
    """To a millionth of a bin, which is 5 Hz here: a thousandth of what the window can tell."""
    exact = np.r_[np.linspace(26, 60, 101), np.linspace(300, 950, 101)]
    single = waves(shape, exact).astype(np.float32)
    found = dominant_frequency(single, INTERVAL)
    np.testing.assert_allclose(
        found, dominant_frequency(single.astype(float), INTERVAL), rtol=0, atol=5e-6
    )


def brute_force(power, start, resolution):
    """`_highest` and `_fundamental` as their definition says it, bin by bin."""
    tops, lines = [], []
    for row in power:
        is_peak = np.zeros(len(row), bool)
        for k in range(start, len(row) - 1):
            is_peak[k] = row[k] >= row[k - 1] and row[k] >= row[k + 1]
        top = max(np.flatnonzero(is_peak), key=lambda k, row=row: row[k])
        enough, lowest = 0.25 * row[top], top
        for n in range(2, 41):
            near = round(top / n) + np.arange(-np.ceil(resolution / 2), np.ceil(resolution / 2) + 1)
            found = [int(k) for k in near if k >= 0 and is_peak[int(k)] and row[int(k)] >= enough]
            comb = [max(row[round(top * m / n) + np.arange(-1, 2)]) for m in range(2, n)]
            if found and (n <= 6 or min(comb) >= enough):
                lowest = min(lowest, *found)
        tops.append(top)
        lines.append(lowest)
    return tops, lines


def test_lines_are_chosen_as_defined():
    random = np.random.default_rng(3)
    power = random.random((60, 400)) ** 8
    power[::3, ::9] += random.uniform(0.2, 1.0, (20, 45))  # combs
    power[1::6] += 3 * np.exp(-np.arange(400) / 4)  # skirts of a drift
    tops, lines = brute_force(power, 6, 4.0)
    highest = spectrum._highest(power, 6)
    np.testing.assert_array_equal(highest, tops)
    np.testing.assert_array_equal(spectrum._fundamental(power, highest, 6, 4.0), lines)
    assert np.sum(np.array(lines) < np.array(tops)) > 10


def test_noise():
    exact = np.full(100, 674.4)
    noise = np.random.default_rng(1).standard_normal((100, SAMPLES))
    found = dominant_frequency(waves(sine, exact) + 0.5 * noise, INTERVAL)
    assert np.abs(found - exact).max() < 0.3  # Cramer-Rao bound: 0.04 Hz standard deviation or so
    found = dominant_frequency(waves(stick_slip, exact) + 0.1 * noise, INTERVAL)
    assert np.abs(found - exact).max() < 0.3


def test_small_oscillation_on_a_large_mean():
    found = dominant_frequency(0.3 + 1e-9 * waves(sine, [123.4]), INTERVAL)
    assert found == pytest.approx([123.4], rel=1e-4)


def test_strongest_line_wins_in_a_period_doubled_motion():
    time = TIME[None]
    main, half = np.sin(2 * np.pi * 80 * time), np.sin(2 * np.pi * 40 * time + 1)
    assert dominant_frequency(main + 0.3 * half, INTERVAL) == pytest.approx([80], rel=1e-3)
    assert dominant_frequency(0.3 * main + half, INTERVAL) == pytest.approx([40], rel=1e-3)


def test_two_close_lines_are_not_averaged():
    signal = np.sin(2 * np.pi * 300 * TIME) + 0.8 * np.sin(2 * np.pi * 330 * TIME)
    assert dominant_frequency(signal, INTERVAL) == pytest.approx(300, rel=2e-3)


def test_agrees_with_a_zero_padded_periodogram():
    random = np.random.default_rng(2)
    exact = random.uniform(60, 2000, 40)
    signals = waves(asymmetric, exact) + 0.05 * random.standard_normal((40, SAMPLES))
    grid, power = scipy.signal.periodogram(
        signals, 1 / INTERVAL, window="hann", nfft=128 * SAMPLES, detrend="constant"
    )
    found = dominant_frequency(signals, INTERVAL)
    assert np.abs(found - grid[np.argmax(power, axis=1)]).max() < 0.15


def test_what_falls_from_the_first_bin_on_has_no_line():
    """The skirt of what is slower than can be told went on as a parabola, to -304 Hz."""
    time = 0.025 / 128 * (0.5 + np.arange(128))
    decaying = [
        np.sin(2 * np.pi * f * time + phase) * np.exp(-100 * time)
        for f in np.linspace(5, 70, 100)
        for phase in range(7)
    ]
    found = strongest_lines(np.array(decaying), 0.025 / 128, averaged=True)
    assert np.isnan(found.frequency).any()
    assert np.nanmin(found.frequency) * 0.025 > 1.0  # else no line of less than a period


def test_constant_and_non_finite_signals_have_no_line():
    signals = np.stack(
        [np.full(SAMPLES, 0.3), np.zeros(SAMPLES), sine(TIME * 500 % 1), sine(TIME * 500 % 1)]
    )
    signals[2, 7] = np.nan
    found = dominant_frequency(signals.astype(np.float32), INTERVAL)
    assert np.isnan(found[:3]).all() and found[3] == pytest.approx(500, rel=1e-5)


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("samples", [96, 500, SAMPLES])
def test_each_signal_is_alone_to_the_bit_and_shapes_are_kept(samples, precision):
    signals = waves(stick_slip, np.linspace(30, 900, 130))[:, :samples].astype(precision)
    inner = np.linspace(0, 0.1, 130)[:, None]
    settings = {"averaged": True, "minimum_cycles": 1.0}
    shaped = signals.reshape(10, 13, samples), INTERVAL
    together = strongest_lines(*shaped, inner=inner.reshape(10, 13, 1), **settings)
    assert together.frequency.shape == together.told.shape == (10, 13)
    for k, signal in enumerate(signals):
        alone = strongest_lines(signal, INTERVAL, inner=inner[k], **settings)
        np.testing.assert_array_equal(together.frequency.ravel()[k], alone.frequency)
        assert together.told.ravel()[k] == alone.told
    assert dominant_frequency(np.zeros((0, SAMPLES)), INTERVAL).shape == (0,)


PHASES = np.linspace(0, 2 * np.pi, 72, endpoint=False)[:, None]
DRIFTS = (TIME / WINDOW, (TIME / WINDOW) ** 2, np.exp(-TIME / 0.1), np.exp(-TIME / 0.04))


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("cycles", [0.02, 0.1, 0.5, 0.9, 1.0, 1.2, 1.4])
def test_side_lobes_of_slow_motion_are_no_line(cycles, precision):
    """A sine of one period in the window was told at 3.4 times its frequency at any phase."""
    slow = np.sin(2 * np.pi * cycles * TIME / WINDOW + PHASES).astype(precision)
    found = dominant_frequency(slow, INTERVAL, averaged=True) * WINDOW
    assert np.isnan(found).sum() > 10
    assert not np.any(found > 1.6)  # symmetrical about the middle it may pass for one of 1.4
    drifts = np.array(DRIFTS).astype(precision)
    assert np.isnan(dominant_frequency(drifts, INTERVAL, averaged=True)).all()


@pytest.mark.parametrize("window", [0.81, 0.9, 1.0, 1.15])
def test_overtones_of_a_motion_slower_than_the_window_are_no_line(window):
    """Relaxation: sharp corners, whose overtones fall more slowly than the side lobes."""
    phase = (window * TIME / WINDOW + PHASES / (2 * np.pi)) % 1
    corners = np.where(phase < 0.5, phase, 1 - phase)
    found = dominant_frequency(corners, INTERVAL, averaged=True) * WINDOW
    assert np.isnan(found).sum() > 40 and not np.any(found > 1.6)


@pytest.mark.parametrize("drift", DRIFTS)
@pytest.mark.parametrize(
    ("cycles", "size", "error"),
    [(8, 10, 4e-3), (10, 100, 0.015), (20, 1000, 0.015), (130, 100, 1e-5), (240, 1000, 1e-5)],
)
def test_a_weak_tone_beside_a_large_drift_stays_told(drift, cycles, size, error):
    """40 to 1200 Hz. Beside 100 times as large a drift its side lobe was told in place of it."""
    tone = np.sin(2 * np.pi * cycles * TIME / WINDOW + PHASES)
    large = size * drift / (0.5 * np.ptp(drift))
    found = strongest_lines(large + tone, INTERVAL, averaged=True, inner=np.full((72, 1), 1e-9))
    assert found.told.all()
    assert found.frequency * WINDOW == pytest.approx(cycles, rel=error)


def test_noise_beside_slow_motion_is_no_line():
    noise = np.random.default_rng(4).standard_normal((72, SAMPLES))
    slow = np.sin(2 * np.pi * 0.8 * TIME / WINDOW + PHASES) + 1e-3 * noise
    assert not np.any(dominant_frequency(slow, INTERVAL) * WINDOW > 1.6)


def test_bad_arguments():
    with pytest.raises(ValueError, match="at least 8 samples"):
        dominant_frequency(np.zeros((3, 4)), INTERVAL)
    with pytest.raises(ValueError, match="sample_interval must be > 0"):
        dominant_frequency(np.zeros(100), 0.0)


def test_repetition_rate_of_narrow_pulses_whose_harmonics_are_higher():
    # slow stick-slip: 4 % of the period, and a weak second pulse half a period later, which lifts
    # the even harmonics to 1.3 and lowers the odd lines to 0.7
    exact = np.array([23.7, 53.1, 61.4, 110.3])
    phase = (exact[:, None] * TIME) % 1.0
    second = (phase + 0.5) % 1.0
    pulse = np.where(phase < 0.04, np.sin(np.pi * phase / 0.04), 0.0)
    pulse += 0.3 * np.where(second < 0.04, np.sin(np.pi * second / 0.04), 0.0)
    assert dominant_frequency(pulse, INTERVAL) == pytest.approx(exact, rel=5e-3)


@pytest.mark.parametrize(("spacing", "duty"), [(5.7, 0.02), (7.9, 0.04), (10.0, 0.046)])
def test_a_flat_comb_repeats_at_its_spacing_however_high_its_strongest_line(spacing, duty):
    """Slip pulses of a slow belt: the strongest line is the eleventh or so, by a few per cent."""
    samples, window = 2048, 0.8
    time = np.arange(samples) * window / samples
    phase = (spacing * time + 0.3) % 1.0
    pulse = np.where(phase < duty, np.sin(2 * np.pi * phase / duty), 0.0)  # no mean: a high comb
    power = np.abs(np.fft.rfft(pulse * np.hanning(samples)))
    assert np.argmax(power) / window > 7 * spacing  # else the test says nothing
    pulse += np.where(phase < 4 * duty, 0.5 * np.sin(np.pi * phase / duty / 4), 0.0)
    assert dominant_frequency(pulse, window / samples) == pytest.approx(spacing, rel=0.02)


def test_two_lines_far_apart_are_no_comb():
    signal = np.sin(2 * np.pi * 700 * TIME) + 0.6 * np.sin(2 * np.pi * 70 * TIME)
    assert dominant_frequency(signal, INTERVAL) == pytest.approx(700, rel=1e-4)


RATE = SAMPLES / WINDOW  # 10240 Hz


def means(*lines):
    """Means over each sample and mean variance inside, of sines (frequency, size), both exact."""
    edges = np.append(TIME, WINDOW)[None]
    omega, size = (np.array(column)[:, None] for column in zip(*lines, strict=True))
    omega = 2 * np.pi * omega
    place = np.sum(-size / omega * np.cos(omega * edges + size), axis=0)
    mean = np.diff(place) / INTERVAL
    return mean, max(np.sum(size**2) / 2 - np.var(mean), 0.0)


@pytest.mark.parametrize("frequency", np.linspace(0.01, 0.48, 25) * RATE)
def test_a_line_below_half_the_sampling_rate_is_told(frequency):
    mean, inner = means((frequency, 1.0))
    found = strongest_lines(mean, INTERVAL, averaged=True, inner=[inner])
    assert found.told and found.frequency == pytest.approx(frequency, rel=1e-4)


@pytest.mark.parametrize("frequency", np.r_[0.51:0.99:30j, 1.03:3.9:31j] * RATE)
def test_a_folded_line_is_not_taken_for_what_it_seems(frequency):
    mean, inner = means((frequency, 1.0))
    found = strongest_lines(mean, INTERVAL, averaged=True, inner=[inner])
    assert not found.told


@pytest.mark.parametrize(("size", "told"), [(0.2, True), (0.5, True), (1.0, False), (2.0, False)])
def test_a_hidden_line_matters_when_it_may_be_the_stronger(size, told):
    mean, inner = means((700.0, 1.0), (1.25 * RATE + 33, size))
    found = strongest_lines(mean, INTERVAL, averaged=True, inner=[inner])
    assert found.told == told


def test_means_weaken_lines_and_that_is_undone():
    """The higher of two lines stays the strongest, though its mean comes down to 0.81."""
    mean, inner = means((400.0, 0.9), (0.35 * RATE, 1.0))
    assert abs(np.sinc(0.35)) < 0.9 < 1.0
    found = strongest_lines(mean, INTERVAL, averaged=True, inner=[inner])
    assert found.frequency == pytest.approx(0.35 * RATE, rel=1e-4)


def test_of_values_at_instants_nothing_more_is_known():
    folded = np.sin(2 * np.pi * 0.7 * RATE * TIME)
    found = strongest_lines(folded, INTERVAL)
    assert found.told and found.frequency == pytest.approx(0.3 * RATE, rel=1e-4)
