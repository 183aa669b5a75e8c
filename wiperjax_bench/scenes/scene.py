"""What a scene is: cells of one motion, as every method is given them."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wiperjax import Wiper
from wiperjax.vocabulary.declared import SET_BY_THE_ENGINE
from wiperjax.vocabulary.parameters import PARAMETERS


@dataclass(frozen=True)
class Scene:
    """Cells of one motion: blades, starts and times. SI units, radians."""

    name: str
    about: str  # one line
    wiper: Wiper  # float64 leaves, () where all cells agree, else (cells,)
    start: np.ndarray  # (cells, 4): x, y, x', y' at t = 0
    duration: float  # s
    sample_times: np.ndarray  # (samples,) s, increasing, in (0, duration]
    scales: tuple  # (m, m/s), () or (cells,): absolute tolerances are rtol times these
    promise: str = ""  # of the engine there, one line: a scene at which methods fail has one

    @property
    def cells(self) -> int:
        """Number of trajectories."""
        return len(self.start)

    def head(self, cells: int) -> "Scene":
        """Return the scene of its first ``cells`` cells."""
        if cells >= self.cells:
            return self
        part = lambda x: x[:cells] if isinstance(x, np.ndarray) and x.ndim else x
        belt = dataclasses.replace(self.wiper.belt, **_fields(self.wiper.belt, part))
        blade = {name: part(value) for name, value in blade_fields(self.wiper).items()}
        wiper = dataclasses.replace(self.wiper, belt=belt, **blade)
        scales = tuple(part(s) for s in self.scales)
        return dataclasses.replace(self, wiper=wiper, start=self.start[:cells], scales=scales)

    def parameters(self) -> dict[str, np.ndarray]:
        """Return name -> (cells,) of every parameter of blade and belt (``belt_`` in front).

        Raises `ValueError` for a blade with a friction law of its own: numbers do not tell it.
        """
        if self.wiper.friction is not None:
            raise ValueError(f"scene {self.name}: its friction law is no list of numbers")
        full = lambda x: np.broadcast_to(np.asarray(x, float), (self.cells,)).copy()
        fields = blade_fields(self.wiper)
        blade = {name: full(value) for name, value in fields.items() if name in PARAMETERS}
        belt = _fields(self.wiper.belt, full)
        return blade | {f"belt_{name}": value for name, value in belt.items()}


def blade_fields(wiper: Wiper) -> dict:
    """Return the physical parameters of a wiper, without the belt and the engine's own fields."""
    engine = ("belt", *SET_BY_THE_ENGINE)
    names = [f.name for f in dataclasses.fields(wiper) if f.name not in engine]  # type: ignore
    return {name: getattr(wiper, name) for name in names}


def _fields(module, change: Callable) -> dict:
    return {f.name: change(getattr(module, f.name)) for f in dataclasses.fields(module)}
