"""What a border lies between: the code of an answer, and the number whose threshold it may be."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...specs.refine import Refine
from ...vocabulary.codes import MECHANISMS, SETTLED
from ...vocabulary.columns import OF_STEADY_SLIP
from ...vocabulary.schema import OF_THE_WINDOW, SCHEMA
from .known import Facts

SIDES = {"below": 0, "above": 1, "no_number": 2}


class Criterion:
    """Codes and numbers of answers.

    Attributes:
        names: name -> code.
        needs: columns that it reads.
        thresholds: of the number.
        linear: whether no simulation is needed.
        of_window: whether answers of windows of unlike length do not compare.
    """

    def __init__(self, refine: Refine, classes: Any):
        """`classes`: thresholds of the noise classes of the map."""
        self.variable, self.threshold = refine.criterion()
        self.linear = self.variable in OF_STEADY_SLIP
        self.of_window = self.variable in OF_THE_WINDOW
        needs = {self.variable}
        if self.threshold is not None:
            self.names, self.thresholds = SIDES, [self.threshold]
        else:
            self.names = dict(SCHEMA[self.variable].flags or {})
            self.thresholds = []
        self._frequency = self.variable in ("label", "band")
        if self._frequency:
            ends = {*classes.squeal_band, *classes.chatter_band} - {0.0}
            self.thresholds = [float(np.log(end)) for end in sorted(ends)]
            needs |= {"dominant_frequency"}
        if not self.linear:
            needs |= {"mechanism", "settled"}
        self.needs = tuple(sorted(needs))

    def facts(self, columns: Mapping[str, np.ndarray]) -> Facts:
        """Of columns that hold `needs`, (points,) each; none of them is of a longer window."""
        values = np.asarray(columns[self.variable])
        number = np.full(values.shape, np.nan)
        if self.threshold is not None:
            number = values.astype(float)
            code = np.where(np.isnan(number), SIDES["no_number"], number > self.threshold)
        else:
            code = values
        if self._frequency:
            with np.errstate(divide="ignore"):
                number = np.log(np.asarray(columns["dominant_frequency"], dtype=float))
        if self.linear:
            mechanism, settled = np.zeros(values.shape, np.int8), np.ones(values.shape, bool)
        else:
            mechanism = np.asarray(columns["mechanism"])
            settled = np.asarray(columns["settled"]) != SETTLED["no"]
            settled |= self.of_window  # a longer window is no better answer, but another one
            number = np.where(mechanism == MECHANISMS["none"], np.nan, number)
            if self.threshold is not None:
                number = values.astype(float)  # of quiet cells too: it is what is asked about
        return Facts(code.astype(np.int64), number, mechanism, settled, np.zeros(len(values), bool))
