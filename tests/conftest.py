"""Shared by all tests: 64-bit numbers, which importing wiperjax switches on before any array."""

from pathlib import Path

import pytest

import wiperjax  # noqa: F401


@pytest.fixture(scope="session")
def squeal():
    """Run of the scene that squeals: 0.2 s, stick-slip at 780.8 Hz."""
    from wiperjax import scene
    from wiperjax.spec import load_scene

    return scene.run(load_scene(Path(__file__).parents[1] / "sweeps" / "scenes" / "squeal.toml"))


@pytest.fixture(scope="session")
def steady_scenes():
    """Columns of the scenes on a steady belt, their remedies and neighbours (`test_noises`)."""
    import test_noises

    return test_noises.evaluated(test_noises.STEADY, "squeal")
