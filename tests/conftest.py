"""Shared by all tests: 64-bit numbers, which importing wiperjax switches on before any array."""

import pytest

import wiperjax  # noqa: F401


@pytest.fixture(scope="session")
def steady_scenes():
    """Columns of the scenes on a steady belt, their remedies and neighbours (`test_noises`)."""
    import test_noises

    return test_noises.evaluated(test_noises.STEADY, "squeal")
