"""The specification of a scene."""

import numpy as np
from pydantic import model_validator

from ..vocabulary.kinds import STEADY_KINDS, usual_transient
from .laws import law_notes
from .system import System
from .tables import Classes, SceneRun
from .windows import check_strokes, flip_notes, flip_time, longest_window, settled_notes


class SceneSpec(System):
    """One trajectory of one system. Made by `load_scene` or `parse_scene`."""

    run: SceneRun
    classes: Classes = Classes()

    @model_validator(mode="after")
    def _is_consistent(self) -> "SceneSpec":
        self._check_system({})
        if (frequency := self.parameters().get("belt_frequency")) is not None:
            check_strokes(self.thresholds().reversal_window, frequency)
        return self

    def parameters(self) -> dict[str, float]:
        """Every parameter of the system, its law and its belt, in SI units and radians."""
        return self._fixed_si({})

    @property
    def transient(self) -> float:
        """Time [s] from which on its motion is judged."""
        if self.run.transient is not None:
            return self.run.transient
        return usual_transient(self.run.duration, self.belt_kind or "")

    def thresholds(self) -> Classes:
        """Thresholds of its noise class. Unless the file says another, the reversal window is twice
        the time in which the glass carries the lip over (`flip_time`), if that is longer than the
        default.
        """
        if self.belt_kind in STEADY_KINDS or "reversal_window" in self.classes.model_fields_set:
            return self.classes
        known = self.parameters()
        frequency = known["belt_frequency"]
        time = flip_time(
            self.belt_kind,
            abs(known["belt_speed"]),
            frequency,
            known.get("belt_ramp", 0.0),
            known.get("lip_length", 0.0),
        )
        window = min(max(2 * time, self.classes.reversal_window), longest_window(frequency))
        return self.classes.model_copy(update={"reversal_window": window})

    def notes(self) -> list[str]:
        """Lines on what is allowed but rarely meant, for a person to see."""
        known = {name: np.atleast_1d(value) for name, value in self.parameters().items()}
        window, classes = self.run.duration - self.transient, self.thresholds()
        named = "run.duration less run.transient"
        lines = settled_notes(self.transient, window, named, classes, known)
        lines += [*classes.notes(), *law_notes(self.family.law(self), known)]
        return lines + flip_notes(self.belt_kind, known, classes.reversal_window)
