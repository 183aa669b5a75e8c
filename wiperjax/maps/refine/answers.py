"""Answers to the requests of a search: from the bank as far as it goes, else computed."""

from collections.abc import Callable

import numpy as np

from ..starts import Columns
from .bank import Bank
from .criterion import Criterion
from .search import Answer, Request

Compute = Callable[[np.ndarray, int], Columns]
"""Columns of points, by their number, with so many times as long a window as the map's."""


class Answers:
    """What a search is told. Only what is computed for it counts against its budget: what is asked
    twice, and after a kill again, is in the bank or in the store of what was computed.

    Attributes:
        computed: simulations of which this search has the first answer.
    """

    def __init__(
        self,
        bank: Bank,
        criterion: Criterion,
        lengthen: int,
        compute: Compute | None = None,
        most: int = 0,
    ):
        """`lengthen`: times as long a window for requests of a longer one; `compute`: what the bank
        lacks, `most` points in all.
        """
        self._bank, self._criterion, self._lengthen = bank, criterion, lengthen
        self._compute, self._most, self.computed = compute, most, 0

    def __call__(self, request: Request) -> Answer:
        bank, index = self._bank, request.index
        factor = self._lengthen if request.longer else 1
        place = bank.find(index)
        there = place >= 0
        if request.longer or self._criterion.of_window:
            there[there] = bank.factor[place[there]] == factor
        lacking, room = index[~there], self._most - self.computed
        if len(lacking) > room:  # spread over all that was asked for
            lacking = lacking[np.linspace(0, len(lacking) - 1, room).astype(int)]
        if len(lacking) and self._compute is not None:
            bank.put(lacking, self._compute(lacking, factor), factor)
            self.computed += len(lacking)
        told = np.union1d(index[there], lacking)
        return told, self._criterion.facts(bank.take(bank.find(told)))
