"""Scenes and remedies in few compilations: cells of several sweep files as one list of cases."""

from pathlib import Path

import numpy as np

from wiperjax.maps.block import evaluate_block
from wiperjax.maps.cells import batch
from wiperjax.specs.load import load_scene, load_sweep
from wiperjax.vocabulary.codes import BANDS, LABELS, MECHANISMS, SETTLED
from wiperjax.vocabulary.parameters import PARAMETERS

SWEEPS = Path(__file__).parents[2] / "sweeps"
NAMES = {"label": LABELS, "mechanism": MECHANISMS, "band": BANDS, "settled": SETTLED}


class Cases:
    """Blades on one kind of belt, run alike: what `cells.evaluate` needs of a sweep."""

    def __init__(self, like, cases):
        """`cases`: name -> parameters in SI units; all else is as in the sweep `like`."""
        self.like, self.sensitivities, self.starts = like, None, None
        self.names, self.cases = list(cases), list(cases.values())

    def __getattr__(self, name):
        return getattr(self.__dict__["like"], name)

    def cells(self, index):
        columns = {}
        for name in self.parameter_names:
            values = np.array([case[name] for case in self.cases])
            same = np.all(values == values[0])
            columns[name] = float(values[0]) if same else values[np.asarray(index)]
        return columns

    def evaluate(self):
        """Name of the case -> its columns, with codes as names."""
        found, _ = evaluate_block(self, np.arange(len(self.cases)), batch.evaluate)
        for column, codes in NAMES.items():
            words = {code: word for word, code in codes.items()}
            found[column] = np.array([words[int(code)] for code in found[column]])
        return {
            name: {column: values[k] for column, values in found.items()}
            for k, name in enumerate(self.names)
        }


def parameters(file, model=None):
    return load_scene(SWEEPS / "scenes" / f"{file}.toml", model).parameters()


def changed(case, **values):
    """`case` with some parameters (edge units) changed."""
    return case | {name: float(PARAMETERS[name].to_si(x)) for name, x in values.items()}


def remedies(file):
    """Sweep of a remedies file."""
    return load_sweep(SWEEPS / "remedies" / f"{file}.toml")


def first_cell(spec):
    """Parameters of the first cell of a sweep."""
    return {name: float(np.ravel(x)[0]) for name, x in spec.cells(np.array([0])).items()}
