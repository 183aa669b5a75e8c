"""Sums and products that leave out what is known to be zero when the program is written.

A compiler may not drop ``0.0 * x``: x could be infinite. In a batch of small systems half of the
mass matrix is such zeros, so the Python number 0 stands for them and never becomes an array.
"""

from typing import Any


def absent(value) -> bool:
    """Whether ``value`` is the Python number 0: known to be zero, whatever the lane."""
    return isinstance(value, int | float) and value == 0


def times(*factors) -> Any:
    """Product of ``factors``; the Python number 0 if one of them is."""
    if any(absent(x) for x in factors):
        return 0.0
    product = factors[0]
    for x in factors[1:]:
        product = product * x
    return product


def plus(*terms) -> Any:
    """Sum of ``terms`` without the absent ones."""
    there = [x for x in terms if not absent(x)]
    if not there:
        return 0.0
    total = there[0]
    for x in there[1:]:
        total = total + x
    return total
