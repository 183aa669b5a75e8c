"""A run as sound: tip velocity or normal force as a WAV file, at a level that means something.

Full scale is a stated velocity (or force), the same for every run, so two runs can be compared by
ear. It is NOT a sound pressure: how much of the lip's motion is radiated by blade, arm and screen
is not modelled, so no level in dB(A) can be given. Files hold 32-bit floating point numbers:
nothing is clipped or rounded away in them; what lies beyond +-1 is clipped by a player only.
"""

import io
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
import scipy.interpolate
import scipy.io.wavfile
import scipy.signal
import xarray as xr

from .datasets.kinds import check_argument
from .datasets.run_dataset import between, is_quiet, is_steady, pitch, settled, signal
from .machine.files import check_output, write_bytes
from .noise.samples import finite, sample_interval
from .vocabulary import checks
from .vocabulary.ranges import FINITE, POSITIVE, Range

RATE = 48_000  # Hz
COARSEST = 1 / 8000  # s between samples: nothing above 4 kHz would be left
SAMPLES_PER_PERIOD = 10  # of the tone: corners of stick-slip need its harmonics
FADE = 0.005  # s at both ends, against clicks
REFERENCES = {"velocity": 1.0, "normal_force": 20.0}  # m/s, N/m
LONGEST = 3600.0  # s


@dataclass(frozen=True, eq=False)  # of arrays no equality is one answer
class Sound:
    """Samples at `RATE` relative to full scale, and what that is.

    Attributes:
        samples: shape (n,), float64; 1 is `reference`.
        quantity: name of the variable of the run.
        reference: value at full scale, in `units`.
        units: of the quantity.
    """

    samples: np.ndarray
    quantity: str
    reference: float
    units: str

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.samples.size / RATE

    @property
    def rms(self) -> float:
        """Root mean square, in `units`."""
        return self.reference * float(np.sqrt(np.mean(np.square(self.samples))))

    @property
    def peak(self) -> float:
        """Largest magnitude, in `units`."""
        return self.reference * float(np.abs(self.samples).max())

    def write(self, path: str | Path, force: bool = False) -> None:
        """Writes a mono WAV file of 32-bit floats, at once or not at all.

        Raises: `StoreError` if it exists (without `force`) or cannot be written.
        """
        checks.path("path", path)
        checks.flag("force", force)
        check_output(path, force)
        write_bytes(Path(path), self.wav(), force)

    def wav(self) -> bytes:
        """What the WAV file holds."""
        buffer = io.BytesIO()
        scipy.io.wavfile.write(buffer, RATE, self.samples.astype(np.float32))
        return buffer.getvalue()

    def describe(self) -> str:
        """Level and duration in one line."""
        words = self.quantity.replace("_", " ")
        text = f"{self.duration:.3g} s of {words} at {RATE / 1000:g} kHz, full scale = "
        text += f"{self.reference:g} {self.units}, "
        if self.peak == 0:
            return text + "silent"
        level = [20 * np.log10(value / self.reference) for value in (self.rms, self.peak)]
        return text + f"rms {level[0]:.1f} dB, peak {level[1]:.1f} dB re full scale"

    def warning(self) -> str:
        """That a player will clip it, and what to do; empty if it will not."""
        if self.peak <= self.reference:
            return ""
        over = float(20 * np.log10(self.peak / self.reference))
        better = float(f"{1.05 * self.peak:.2g}")
        return (
            f"peaks lie {over:.1f} dB above full scale, players will clip them; "
            f"--reference {better:g} makes room"
        )


def sound(
    run: xr.Dataset,
    *,
    quantity: str = "velocity",
    reference: float | None = None,
    start: float | None = None,
    stop: float | None = None,
    seconds: float | None = None,
) -> Sound:
    """Return a run as it would be heard if its velocity (or normal force) were the sound pressure.

    Arguments:

    - `run`: a run (`wiperjax.simulate`) with at least 8000 samples a second.
    - `quantity`: `velocity` of the tip along the glass (of a system of one's own its output), or
        `normal_force`. The mean is taken off: it cannot be heard.
    - `reference`: value at full scale; 1 m/s or 20 N/m if None.
    - `start`, `stop`: part of the run (s).
    - `seconds`: length of the sound; whole periods of the settled part (on a wiping belt: of the
        belt) are repeated until it is reached. None: the run, once.

    Raises: `ValueError` for another quantity, a reference or length that is not positive, a run
        that is sampled too coarsely, or has no whole period to repeat.
    """
    check_argument("run", run, ["run"])
    checks.choice("quantity", quantity, REFERENCES)
    full = REFERENCES[quantity]
    if reference is not None:
        full = checks.number("reference", reference, POSITIVE)
    if seconds is not None:
        checks.number("seconds", seconds, Range(2 / RATE, LONGEST, unit="s"))
    for name, value in (("start", start), ("stop", stop)):
        if value is not None:
            checks.number(name, value, FINITE)
    part = between(run, start, stop)
    _check_sampling(part)
    asked = start is not None or stop is not None
    if seconds is not None and not asked:
        part = settled(part)
    values = signal(part, None if quantity == "velocity" else quantity)
    numbers = finite(values)
    samples = resample(numbers - numbers.mean(), sample_interval(part)) / full
    if seconds is not None:
        samples = _repeat(samples, max(1, round(seconds * RATE)), RATE * _period(part))
    fade = min(round(FADE * RATE), samples.size // 2)
    ramp = np.sin(0.5 * np.pi * (np.arange(fade) + 0.5) / max(fade, 1)) ** 2
    samples[:fade] *= ramp
    samples[samples.size - fade :] *= ramp[::-1]
    return Sound(samples, quantity, full, str(values.attrs.get("units", "1")))


def resample(values: np.ndarray, interval: float) -> np.ndarray:
    """Samples at `RATE` of a signal sampled every `interval` (s), band-limited (polyphase filter).

    Its length in time is that of the signal to within one sample. Raises: `ValueError` for what is
    no signal, or no interval, or shorter than two samples of sound, of which the filter makes NaN.
    """
    values = checks.array("values", values, FINITE)
    interval = checks.number("interval", interval, POSITIVE)
    if (lasts := (values.size - 1) * interval) < 1 / RATE:
        least = f"must last {1 / RATE:.2g} s at least, two samples of sound"
        raise ValueError(f"what is heard {least}, but lasted {max(lasts, 0.0):.3g} s")
    while RATE * interval < 1 / 8 and values.size > 1:  # ratios of small numbers: halves first
        values = scipy.signal.resample_poly(values, 1, 2, padtype="line")
        interval *= 2
    ratio = Fraction(RATE * interval).limit_denominator(4000)
    return scipy.signal.resample_poly(values, ratio.numerator, ratio.denominator, padtype="line")


def _check_sampling(run: xr.Dataset) -> None:
    """Raises: `ValueError` if a run is sampled too coarsely for its tone, or for any sound."""
    step, tone = sample_interval(run), pitch(run)
    finest = COARSEST
    words = "8000 samples a second"
    if tone > 0 and 1 / (SAMPLES_PER_PERIOD * tone) < finest:
        finest = 1 / (SAMPLES_PER_PERIOD * tone)
        words = f"{SAMPLES_PER_PERIOD} samples in each period of its {tone:.4g} Hz"
    if step > finest * (1 + 1e-9):
        raise ValueError(
            f"the run is sampled every {step:g} s, too coarse for sound: it needs {words}; "
            f"simulate it again with sample_interval = {float(f'{0.995 * finest:.1g}'):g} or less"
        )


def _period(run: xr.Dataset) -> float:
    """Period (s) of a run: of its tone, or of a belt that is not steady; NaN if it is quiet.

    Raises: `ValueError` for a run that is none of these: repeated, its length would be its tone.
    """
    if not is_steady(run):
        return 1 / float(run.attrs["belt_frequency"])
    period = 1 / pitch(run)
    if not period > 0 and not is_quiet(settled(run)):
        raise ValueError("the run has no period that could be repeated; leave out --seconds")
    return period


def _repeat(samples: np.ndarray, length: int, period: float) -> np.ndarray:
    """The end of a signal, as many whole periods as it has, again and again up to `length` samples.

    A period is no whole number of samples, so the repeated piece is read between them. Before each
    repetition it fades over into what came before the piece: of a periodic motion that is the same
    again, of another it avoids a click.
    """
    fade = round(FADE * RATE)
    count = int((samples.size - 1 - fade) * (1 + 1e-9) / period) if period > 0 else 0
    if count == 0:
        if not period > 0:  # quiet
            return np.resize(samples, length)
        raise ValueError(
            f"the part to repeat lasts {samples.size / RATE:.3g} s and holds no whole period of "
            f"{period / RATE:.3g} s; simulate longer, or leave out --seconds"
        )
    piece = count * period
    curve = scipy.interpolate.CubicSpline(np.arange(samples.size), samples)
    start = samples.size - 1 - piece
    place = np.arange(length) % piece
    weight = np.clip((piece - place) / fade, 0.0, 1.0)  # 1, and falling to 0 before the repetition
    before = curve(start + np.where(weight < 1, place - piece, place))
    return weight * curve(start + place) + (1 - weight) * before
