"""What samples tell: settling, strokes apart from reversals, vibration. On made-up signals."""

import numpy as np
import pytest

from wiperjax.noise import signals
from wiperjax.noise.spectrum import interval_means
from wiperjax.vocabulary.codes import SETTLED, TOLD
from wiperjax.vocabulary.kinds import since_reversal
from wiperjax.vocabulary.thresholds import Thresholds

INTERVAL = 1 / 4096
TIME = INTERVAL * np.arange(8192)  # 2 s: two periods at 1 Hz
TURN = 2 * np.pi
LIMITS = Thresholds()
SINCE = (TIME * 2 - np.round(TIME * 2)) / 2  # V = 0 at 0, 0.5, 1 s, ...


def columns(*rows, since=None, wiping=None, limits=LIMITS, quiet=1e-3, inner=0.0):
    return signals.signal_columns(np.array(rows), INTERVAL, limits, quiet, since, wiping, inner)


def tone(frequency, size=1.0):
    return size * np.sin(TURN * frequency * TIME)


@pytest.mark.parametrize(
    ("answer", "signal"),
    [
        ("yes", tone(700)),
        ("yes", tone(28)),
        ("no", tone(700) * np.exp(-TIME)),
        ("no", tone(700) * np.exp(0.2 * TIME)),
        ("yes", tone(700) * np.exp(0.05 * TIME)),  # 5 % in a second
        ("no", np.where(TIME < 1, tone(400), tone(500))),  # as loud, but another pitch
        ("yes", tone(700, 1e-4) * np.exp(-TIME)),  # dies out below what counts as quiet
        ("yes", np.full(TIME.size, 0.3)),
        ("no", np.where(TIME < 1, tone(700), 0.0)),
        # three and a half periods in each half, pulses in one and gaps in the other
        ("yes", np.where((3.52 * TIME + 0.3) % 1 < 0.12, 1.0, 0.0)),
        ("no", np.where((0.8 * TIME + 0.3) % 1 < 0.12, 1.0, 0.0)),  # of hardly two periods
        ("no", tone(0.5)),  # one period, of which each half has one side lobe
        ("no", 0.15 * TIME),  # a ramp
        ("unknown", np.full(TIME.size, np.nan)),
    ],
)
def test_settled(answer, signal):
    assert columns(signal)["settled"] == [SETTLED[answer]]


def test_a_steady_belt_is_all_stroke():
    found = columns(tone(40) + 0.3, tone(700))
    assert set(found) == {"dominant_frequency", "frequency_told", "settled"}
    assert found["dominant_frequency"] == pytest.approx([40, 700], abs=0.05)


def flips(ring=0.0):
    """The glass carries the tip for 40 ms around V = 0; then it rings at 300 Hz."""
    smooth = np.cos(TURN * SINCE / 0.08) ** 2 * np.sin(TURN * SINCE / 0.04)
    carried = np.where(np.abs(SINCE) < 0.02, 0.8 * smooth, 0.0)
    start = np.maximum(SINCE, 0.0)
    ringing = ring * np.exp(-start / 5e-3) * np.sin(TURN * 300 * start) * (SINCE > 0)
    return carried + ringing


def test_strokes_are_judged_without_the_reversal():
    slow = 0.05 * np.sin(TURN * TIME + 0.3)  # the drift of a sine stroke
    squeal = np.where(np.abs(SINCE) > 0.05, tone(700, 0.2), 0.0)
    found = columns(flips(), flips() + slow, flips() + squeal, since=SINCE, wiping=1.0)
    rms = found["velocity_rms_stroke"]
    assert rms[0] < 1e-6  # the flip itself is 0.8 m/s
    assert rms[1] < 2e-3  # nor does a drift of 0.05 m/s count
    # 0.45 of the 0.5 s of a stroke squeal, 0.444 of them counted beside the faded border
    assert rms[2] == pytest.approx(0.2 / np.sqrt(2), rel=0.07)
    assert found["dominant_frequency"][2] == pytest.approx(700, abs=0.5)
    assert found["settled"][2] == SETTLED["yes"]


def test_the_strongest_tone_of_a_stroke_is_told_wherever_the_window_begins():
    """A window of one period, whose ends are as good as its middle: the motion goes round."""
    since = TIME - np.round(TIME)  # V = 0 at 0, 1, 2 s: a belt of 0.5 Hz
    squeal = np.where((TIME > 0.05) & (TIME < 0.4), tone(700), 0.0)
    weaker = np.where((TIME > 0.7) & (TIME < 0.95), tone(900, 0.6), 0.0)
    moved = [np.roll(squeal + weaker, TIME.size // 2 * k) for k in (0, 1)]
    found = columns(*moved, since=since, wiping=0.5)
    assert found["dominant_frequency"] == pytest.approx([700, 700], abs=0.5)


@pytest.mark.parametrize("samples", [4096, 32768])
@pytest.mark.parametrize("wiping", [0.7, 4.0, 7.6])
def test_the_level_of_strokes_is_that_of_their_tone(wiping, samples):
    """However much of the period the window of the turn takes, wherever the signal ends, and
    however fine its samples are."""
    seconds = 1.63 / wiping  # ends in mid-stroke
    step = seconds / samples
    time = step * (0.5 + np.arange(samples))
    tone = 0.3 * np.sin(TURN * 440 * time + 1.0)[None]
    since = since_reversal(time, wiping, 0.0)
    found = signals.signal_columns(tone, step, LIMITS, 1e-3, since, wiping)
    for name in ("velocity_rms_stroke", "vibration_stroke", "vibration_reversal"):
        assert found[name] == pytest.approx(0.3 / np.sqrt(2), rel=0.04), name
    assert found["dominant_frequency"] == pytest.approx(440, rel=0.02)


def test_every_passage_of_zero_is_counted_once():
    step, period = 1e-3, 0.2  # a window of one period, wherever it begins, has two
    for start in (0.0, 1e-4, 4.999e-4, 5e-4, 0.0999, 0.1 - 5e-4, 0.1, 0.1234):
        middles = start + step * (0.5 + np.arange(round(period / step)))
        assert signals.passages(since_reversal(middles, 1 / period, 0.0), step) == 2


def test_vibration_of_a_reversal():
    found = columns(flips(0.0), flips(0.5), tone(300, 0.1), since=SINCE, wiping=1.0)
    after, stroke = found["vibration_reversal"], found["vibration_stroke"]
    # integral of (0.5 exp(-t/5 ms))^2/2 over 25 ms, that is 0.25 * 2.5 ms / 2 / 25 ms
    ring = np.sqrt(0.25 * 2.5e-3 / 2 / 25e-3)
    assert after[1] == pytest.approx(ring, rel=0.05)
    assert after[0] < 0.25 * after[1]  # what a smooth flip leaves above 100 Hz
    assert stroke[1] < 0.05 * after[1]
    assert after[2] == pytest.approx(stroke[2], rel=0.1)  # a tone is no reversal noise


def burst(frequency, start, stop, size=0.2, fall=0.0):
    """A tone from `start` to `stop` s after each V = 0, its size falling by `fall` 1/s."""
    inside = (SINCE >= start) & (SINCE < stop)
    return size * inside * np.exp(-fall * (SINCE - start)) * np.sin(TURN * frequency * SINCE)


@pytest.mark.parametrize(
    ("before", "after", "signal"),
    [
        (0.0, 0.020, burst(700, 0.002, 0.022)),
        (0.018, 0.0, burst(900, -0.02, -0.002)),
        (0.0, 0.012, burst(700, 0.002, 0.014)),
        # however loud, what rings down leaves 6 dB behind in 0.7 time constants
        (0.0, 0.7 * 0.008, burst(700, 0.002, 0.2, 2.0, fall=1 / 0.008)),
        # a click beside it hides no tone
        (0.0, 0.020, burst(700, 0.01, 0.03) + 20 * burst(400, 0.002, 0.0035)),
        (0.0, 0.0, burst(700, 0.002, 0.022, 1e-4)),  # quieter than quiet
        # both sides, and a stroke that sings throughout ends in mid-stroke on either
        (0.010, 0.030, burst(700, 0.0, 0.03) + burst(800, -0.01, 0.0)),
        (0.25, 0.25, tone(700, 0.2)),
        # one of four turns is enough
        (0.0, 0.020, np.where(TIME < 0.7, burst(700, 0.002, 0.022), 0.0)),
    ],
)
def test_a_tone_at_the_turn_is_what_lasts(before, after, signal):
    found = columns(signal, flips() + signal, since=SINCE, wiping=1.0)
    # the level is taken over 5 ms: a border is smeared by half of that at most
    for k in (0, 1) if before else (0,):
        assert found["tone_time_before"][k] == pytest.approx(before, abs=5e-3)
    assert found["tone_time_after"][0] == pytest.approx(after, abs=5e-3)
    assert found["reversal_count"].tolist() == [4, 4]  # V = 0 at the start is one, at the end none


def test_a_tone_at_the_turn_has_a_pitch():
    low = burst(430, 0.002, 0.034)
    high = burst(900, -0.02, -0.001)
    found = columns(low + high, low, high, 0 * low, since=SINCE, wiping=1.0)
    assert found["tone_frequency_after"][:2] == pytest.approx([430, 430], rel=0.02)
    assert found["tone_frequency_before"][[0, 2]] == pytest.approx([900, 900], rel=0.02)
    assert np.isnan(found["tone_frequency_before"][3]) and found["tone_time_before"][3] == 0
    # the strokes are silent, so the pitch of a cell is that of its longest tone
    assert found["dominant_frequency"][:3] == pytest.approx([430, 430, 900], rel=0.02)
    sounding = columns(np.where(np.abs(SINCE) > 0.1, tone(300), low), since=SINCE, wiping=1.0)
    assert sounding["dominant_frequency"] == pytest.approx(300, rel=0.01)


def test_halves_of_a_wipe_compare_only_if_each_holds_whole_periods():
    both = tone(700), tone(700)
    found = columns(*both, since=np.stack([SINCE, SINCE]), wiping=np.array([1.0, 0.7]))
    assert found["settled"].tolist() == [SETTLED["yes"], SETTLED["unknown"]]


def test_cells_that_ended_are_unknown():
    lost = np.where(TIME < 1, tone(700), np.nan)
    found = columns(lost, tone(700), since=SINCE, wiping=1.0)
    assert np.isnan(found["dominant_frequency"][0]) and found["settled"][0] == SETTLED["unknown"]
    assert np.isfinite(found["dominant_frequency"][1])


def fast(frequency, where, size=0.2):
    """Means over each sample of a tone that sounds ``where``, and the variance inside them."""
    x = np.sinc(frequency * INTERVAL)
    mean = np.where(where, size * x * np.sin(TURN * frequency * TIME), 0.0)
    return mean, np.where(where, size**2 / 2 * (1 - x**2), 0.0)


@pytest.mark.parametrize(("frequency", "told"), [(700.0, "yes"), (3400.0, "no"), (4796.0, "no")])
def test_strokes_tell_a_tone_only_below_half_the_sampling_rate(frequency, told):
    """3400 and 4796 Hz are folded to 696 and 700 Hz: squeal, if nobody looked."""
    mean, inner = fast(frequency, np.abs(SINCE) > 0.05)
    found = columns(mean + flips(), since=SINCE, wiping=1.0, inner=inner[None])
    assert found["frequency_told"] == TOLD[told]
    assert found["velocity_rms_stroke"] == pytest.approx(0.2 / np.sqrt(2), rel=0.07)


@pytest.mark.parametrize(("frequency", "told"), [(700.0, "yes"), (3400.0, "no")])
def test_a_tone_at_the_turn_is_told_or_not(frequency, told):
    mean, inner = fast(frequency, (SINCE > 0.002) & (SINCE < 0.034))
    found = columns(mean, since=SINCE, wiping=1.0, inner=inner[None])
    assert found["frequency_told"] == TOLD[told]
    assert found["tone_time_after"] == pytest.approx(0.032, abs=5e-3)
    assert np.isnan(found["tone_frequency_after"][0]) == (told == "no")


def test_a_tip_that_rides_along_has_no_vibration_and_no_nan():
    """The glass itself, 4 Hz, with places 25 millionths off as a solver's are: the variances inside
    the samples sum up below zero, and the root of that made a finished run `failed`."""
    interval, phase = 5e-5, np.deg2rad(200)
    time = interval * np.arange(10_001)
    angle = TURN * 4 * time + phase
    place, speed = -2.5e-3 * np.cos(angle), 2.5e-3 * TURN * 4 * np.sin(angle)
    mean, inner = interval_means(place * (1 + 2.5e-5), speed, interval)
    halves = 8 * (time[:-1] + interval / 2) + phase / np.pi
    since = (halves - np.round(halves)) / 8
    found = signals.signal_columns(mean[None], interval, LIMITS, 4e-4, since, 4.0, inner[None])
    for name in ("vibration_reversal", "vibration_stroke", "velocity_rms_stroke"):
        assert 0 <= found[name][0] < 5e-3, name


def test_slow_motion_is_no_vibration_however_long_the_samples():
    """The slope of a stroke within a sample was counted as if it were faster than 100 Hz."""
    interval, frequency = 5e-4, 4.0
    time = interval * (np.arange(2000) + 0.5)
    speed = 0.4 * np.sin(TURN * frequency * time)
    slope = 0.4 * TURN * frequency * np.cos(TURN * frequency * time)
    inner, since = (slope * interval) ** 2 / 12, since_reversal(time, frequency, 0.0)
    given = LIMITS, 1e-4, since, frequency, inner[None]
    found = signals.signal_columns(speed[None], interval, *given)
    assert found["vibration_reversal"][0] < 0.05 * np.sqrt(inner.max())
    lasting = max(found["tone_time_before"][0], found["tone_time_after"][0])
    assert lasting < 0.5 * LIMITS.tone_time
