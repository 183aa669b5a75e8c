"""Moreau-Jean time-stepping by Siconos, where it is installed.

Siconos comes as distribution packages (Debian: `python3-siconos`) for the distribution's own
Python, so it runs in a process of that Python: `siconos_worker`. The environment variable
WIPERJAX_SICONOS_PYTHON names it; else it is `python3` and `/usr/bin/python3` that are asked.
"""

import json
import os
import shutil
import subprocess
import weakref
from functools import lru_cache
from pathlib import Path

import numpy as np

from ..harness.batching import at_samples
from ..harness.interface import Answer, NotForThisScene
from ..scenes.scene import Scene

VARIABLE = "WIPERJAX_SICONOS_PYTHON"


@lru_cache(maxsize=1)
def interpreter() -> str | None:
    """Return a Python that can import siconos.kernel, or None."""
    named = os.environ.get(VARIABLE)
    for python in [named] if named else [shutil.which("python3"), "/usr/bin/python3"]:
        command = [python or "", "-c", "import siconos.kernel"]
        try:
            # -c of another Python: the path of this one would give it the wrong packages
            done = subprocess.run(command, env=_plain(), capture_output=True, timeout=60)
        except (OSError, subprocess.TimeoutExpired):
            continue
        if done.returncode == 0:
            return python
    return None


def _plain() -> dict[str, str]:
    return {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}


def _end(worker: subprocess.Popen) -> None:
    worker.kill()
    worker.communicate()  # closes its pipes


class Siconos:
    """Siconos; the setting is the step as a fraction of the duration."""

    name = "Siconos (Moreau-Jean)"
    setting_name = "step / duration"
    settings = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4)
    cells = 2

    def available(self):
        if interpreter() is None:
            return f"no Python with siconos found (Debian: python3-siconos, or set {VARIABLE})"

    def prepare(self, scene: Scene, setting: float):
        scene = scene.head(self.cells)
        if np.any(np.asarray(scene.wiper.hinge_mass)):
            raise NotForThisScene("written for a constant mass matrix: no hinge mass")
        blocks = min(len(scene.sample_times), round(1 / setting))
        keep = round(1 / setting / blocks)
        parameters = scene.parameters()
        request = []
        for i in range(scene.cells):
            cell = {name: float(value[i]) for name, value in parameters.items()}
            belt = {k.removeprefix("belt_"): v for k, v in cell.items() if k.startswith("belt_")}
            numbers = dict(duration=scene.duration, steps=keep * blocks, keep=keep)
            request.append(dict(w=cell, belt=belt, start=scene.start[i].tolist(), **numbers))
        text = json.dumps(request)
        worker = subprocess.Popen(
            [str(interpreter()), str(Path(__file__).with_name("siconos_worker.py"))],
            env=_plain(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        requests, answers = worker.stdin, worker.stdout
        assert requests and answers
        answers.readline()  # ready
        ends = scene.duration * np.arange(blocks + 1) / blocks

        def answer() -> Answer:
            print(text, file=requests, flush=True)
            # no line: it crashed, as it may on bad numbers
            found = json.loads(answers.readline() or "[]")
            found += [[]] * (scene.cells - len(found))
            states = np.full((scene.cells, blocks + 1, 4), np.nan)
            states[:, 0] = scene.start
            for i, rows in enumerate(found):
                states[i, 1 : len(rows) + 1] = np.array(rows).reshape(-1, 4)
            q, v = (at_samples(ends, states[..., k : k + 2], scene.sample_times) for k in (0, 2))
            stopped = np.array([len(rows) < blocks for rows in found])
            steps = np.array([len(rows) * keep for rows in found])
            return Answer(scene.sample_times, q, v, None, None, stopped, steps)

        weakref.finalize(answer, _end, worker)
        return answer


RIVALS = (Siconos(),)
