"""Cells of a sweep computed: plainly, or with derivatives if the sweep asks for them."""

from collections.abc import Mapping
from typing import Any

import jax
import numpy as np

from ...numerics.arrays import check_settings
from . import batch
from .sensitivity.evaluate import evaluate as with_derivatives


def identity() -> dict[str, str]:
    """What of this process has a part in the numbers, beside the versions: the kind of device.
    Raises ValueError as `check_settings` does, before anything is stored."""
    check_settings()
    return {"device": jax.devices()[0].device_kind}


def evaluate(
    spec: Any,
    index: np.ndarray,
    finer: int = 1,
    room: int | None = None,
    ended: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Return the columns of the cells ``index`` of a `SweepSpec`, each of shape (len(index),).

    ``finer``, ``room`` and ``ended`` as of `batch.evaluate`.
    """
    if spec.sensitivities is not None:  # and so one start a cell: none has `ended`
        return with_derivatives(spec, index, finer, room)
    return batch.evaluate(spec, index, finer, room, ended)
