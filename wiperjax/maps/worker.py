"""What a worker of a cluster does with a block (`cluster`): whether it may compute it, and how."""

import contextlib
import functools
import os
import re
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..machine import provenance
from ..machine.files import StoreError
from ..machine.jax_settings import configure
from ..machine.lock import acquire
from ..machine.phases import account
from ..specs.errors import Fault
from ..specs.imported import findable, is_path
from . import block


class ClusterError(RuntimeError):
    """Workers that cannot be reached, differ, or keep dying; its text is one line."""


class Own(NamedTuple):
    """The system of a sweep and its law, as the process that was started has them."""

    meaning: dict[str, Any]  # `specs.family.Family.meaning`: the sources of one's own among it
    folders: list[str]  # in which modules of one's own lie

    @classmethod
    def of(cls, spec: Any) -> "Own":
        meaning = spec.family.meaning(spec)
        names = [str(meaning[key]) for key in ("system", "friction") if key in meaning]
        return cls(meaning, [_folder(name) for name in names if is_path(name)])


def _folder(path: str) -> str:
    """Where the module of an import path was found: the folder that holds all its packages."""
    name = path.partition(":")[0]
    file = Path(getattr(sys.modules[name], "__file__", None) or "here")  # of a session: none
    return str(file.resolve().parents[name.count(".") + (file.name == "__init__.py")])


class Answer(NamedTuple):
    columns: dict[str, np.ndarray]
    occupancy: float | None
    seconds: float
    phases: dict[str, float]
    made_by: dict[str, str]
    host: str


_one_block = threading.Lock()
_claimed = []  # locks of accelerators, until this process ends


def compute(spec: Any, own: Own, start: int, stop: int, evaluate: block.Evaluate | None) -> Answer:
    """One block. A worker of many threads computes one block at a time, on as many cores."""
    with _one_block:
        made = made_by(spec, own, evaluate)
        begun = time.perf_counter()
        evaluate = evaluate or block.engine()[0]
        with account() as spent:
            columns, occupancy = block.evaluate_block(spec, np.arange(start, stop), evaluate)
        seconds, phases = time.perf_counter() - begun, spent.seconds()
        return Answer(columns, occupancy, seconds, phases, made, provenance.host_kind())


def made_by(spec: Any, own: Own, evaluate: block.Evaluate | None) -> dict[str, str]:
    """What must agree between blocks of one map, as this worker has it. Raises: as `check_own`."""
    made = block.made_by(spec)
    if evaluate is None:
        _prepare()  # before a module of one's own starts a device
        made |= block.engine()[1]
    check_own(spec, own)
    return made


def check_own(spec: Any, own: Own) -> None:
    """Raises `ClusterError` where this worker would compute another system than was meant: its
    module lies here too in another version, or was changed since this worker imported it.
    """
    for folder in own.folders:
        findable(Path(folder))
    try:
        mine = spec.family.meaning(spec)
    except Fault as fault:
        raise ClusterError(f"a worker lacks what is swept: {fault}") from None
    for key, theirs in own.meaning.items():
        name = str(own.meaning[key.removesuffix("_source")])
        if str(mine.get(key, "none")) != str(theirs):
            raise ClusterError(
                f"a worker has another {name} than this process: its module lies there in another "
                "version, or was changed since the worker imported it; start the workers anew"
            )


@functools.cache
def _prepare() -> None:
    """Settings of JAX for a worker, before it starts a device: its cores, or its accelerator."""
    from distributed import get_worker

    configure(get_worker().state.nthreads)
    claim_accelerator()


def claim_accelerator(folder: Path = Path("/dev")) -> str | None:
    """Choose one of the accelerators that this process sees, if there are several: the first that
    no other worker on this machine holds. It is held until the process ends.
    """
    if sys.platform == "win32":
        return None  # JAX runs on none there
    listed = os.environ.get("CUDA_VISIBLE_DEVICES")
    if listed is None:
        found = [re.fullmatch(r"nvidia(\d+)", entry.name) for entry in folder.iterdir()]
        devices = sorted((match[1] for match in found if match), key=int)
    else:
        devices = [name.strip() for name in listed.split(",") if name.strip()]
    if len(devices) < 2:
        return None
    scope = f"{os.getuid()}-{os.environ.get('SLURM_JOB_ID', '')}"  # a job numbers its own from 0
    for device in devices:
        with contextlib.suppress(StoreError):
            name = f"wiperjax-accelerator-{scope}-{device}.lock"
            _claimed.append(acquire(Path(tempfile.gettempdir()) / name))
            os.environ["CUDA_VISIBLE_DEVICES"] = device
            return device
    raise ClusterError(f"this machine has more workers than accelerators ({len(devices)})")
