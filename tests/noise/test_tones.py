"""The longest steady stretch of a vibration, by a search that needs no argument."""

import numpy as np
import pytest

from wiperjax.noise import tones
from wiperjax.noise.spectrum import strongest_lines


def by_trying(level, since, side, quiet):
    """First longest stretch of one cell inside one half stroke: (start, length)."""
    best = (0, 0)
    for start in range(level.size):
        stop = start
        while stop < level.size and np.sign(since[stop]) == side:
            if stop > start and since[stop] < since[stop - 1]:
                break
            part = level[start : stop + 1]
            if not (part.min() > quiet and part.max() <= tones.STEADY * part.min()):
                break
            stop += 1
        if stop - start > best[1]:
            best = (start, stop - start)
    return best


@pytest.mark.parametrize("samples", [8, 9, 15, 16, 17, 63, 100])
def test_the_longest_steady_stretch_is_found(monkeypatch, samples):
    """Levels that wander, strokes that begin anywhere, in blocks of any size; a cell that ended."""
    rng = np.random.default_rng(samples)
    cells, interval = 23, 1e-3
    wander = np.exp(0.3 * np.cumsum(rng.normal(size=(cells, samples)), axis=1))
    vibration = wander * rng.choice([-1.0, 1.0], size=(cells, samples))
    vibration[7, 3] = np.nan
    since = (np.arange(samples) * interval + rng.uniform(0, 0.1, (cells, 1))) % 0.04 - 0.02
    since[5, samples // 2] = 0.0
    quiet = np.where(np.arange(cells) % 3, 0.0, 0.5)
    monkeypatch.setattr(tones, "AVERAGE", interval)  # the level is that of each sample
    monkeypatch.setattr(tones, "CHUNK", 5 * samples)
    found = tones.tones(vibration, np.zeros_like(vibration), interval, since, quiet)
    for name, side in tones.SIDES.items():
        time, frequency = found[f"tone_time_{name}"], found[f"tone_frequency_{name}"]
        assert np.isnan(time[7]) and np.isnan(frequency[7])
        for k in (k for k in range(cells) if k != 7):
            start, length = by_trying(np.abs(vibration[k]), since[k], side, quiet[k])
            assert time[k] == length * interval
            if length < 8:
                assert np.isnan(frequency[k])
                continue
            part = vibration[k, start : start + length]
            alone = strongest_lines(part, interval, averaged=True, inner=np.zeros(length))
            np.testing.assert_array_equal(frequency[k], alone.frequency if alone.told else np.nan)
        assert np.nanmax(time) > 2 * interval
