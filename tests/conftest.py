"""Shared by all tests: 64-bit numbers, which importing wiperjax switches on before any array."""

import wiperjax  # noqa: F401
