"""What a person gives to a picture: the right kind of dataset, and options that can be meant.

Checked at the door, where `wiperjax.plots` hands its functions out; inside they call each other
without. An option of one name means the same in every picture, so its check stands here once.
"""

import functools
import inspect
from collections.abc import Callable, Mapping
from typing import Any, ParamSpec, TypeVar

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from ..datasets.map_starts import from_start
from ..datasets.run_fit import unfit
from ..vocabulary import checks
from ..vocabulary.pictures import DOTS, PLAYED
from ..vocabulary.products import PRODUCTS
from ..vocabulary.ranges import FINITE, POSITIVE, Range

P = ParamSpec("P")
R = TypeVar("R")

_NUMBERS = {
    "start": FINITE,
    "stop": FINITE,
    "seconds": Range(*PLAYED, unit="s"),
    "window": POSITIVE,
    "highest": POSITIVE,
    "component": Range(0, whole=True),
    "panels": Range(1, 36, whole=True),
    "dpi": Range(*DOTS, whole=True),
}
_TEXTS = ("x", "y", "along", "quantity", "name", "regime", "title", "picture")
_FLAGS = ("legend", "marks", "normalised", "force")
_DATASETS = ("borders", "curves", "branch", "brute", "transient", "whole")


def of(kind: str, *needs: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorator of a picture: its first argument must be a dataset of a kind that holds `needs`.

    Raises, when called: `ValueError`, one line that names the argument.
    """

    def wrap(draw: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(draw)
        first = next(iter(signature.parameters))

        @functools.wraps(draw)
        def checked(*args: P.args, **kwargs: P.kwargs) -> R:
            given = signature.bind(*args, **kwargs).arguments
            options = {key: value for key, value in given.items() if key != "options"}
            options |= given.get("options", {})
            dataset = options.pop(first)
            if dataset is not None or signature.parameters[first].default is not None:
                check_dataset(first, dataset, kind, needs)
            check_options(options)
            if kind != "map" or not isinstance(dataset, xr.Dataset):
                return draw(*args, **kwargs)
            dataset, options["at"] = at_start(dataset, options.get("at"))
            known = {key: value for key, value in options.items() if value is not None}
            return draw(dataset, **known)  # pyright: ignore[reportCallIssue]

        return checked

    return wrap


def at_start(ds: xr.Dataset, at: Mapping[str, Any] | None) -> tuple[xr.Dataset, Any]:
    """A map from the start that `at` names, and the rest of `at`; see `map_starts.from_start`."""
    cut = dict(at or {})
    return from_start(ds, cut.pop("start", None)), cut or None


def check_dataset(name: str, value: Any, kind: str, needs: tuple[str, ...]) -> None:
    """Raises `ValueError` unless `value` is a dataset that holds the variables `needs`."""
    such_as = PRODUCTS[kind].such_as
    checks.instance(name, value, xr.Dataset, such_as)
    if missing := [variable for variable in needs if variable not in value]:
        raise ValueError(f"{name} must be {such_as}, but has no {missing[0]}")
    if kind == "run" and (why := unfit(value)):
        raise ValueError(f"{name} must be {such_as}, but {why}")
    if kind == "run" and float(value["time"][-1]) < float(value["time"][0]):  # without its regimes
        raise ValueError("the time of the run must rise, but falls; run.sortby('time') sorts it")


def check_options(options: Mapping[str, Any]) -> None:
    """Raises `ValueError` for an option of a picture that cannot be meant; None leaves it open."""
    for name, value in options.items():
        if name in _FLAGS:
            checks.flag(name, value)
        if value is None:
            continue
        if name in _NUMBERS:
            checks.number(name, value, _NUMBERS[name])
        elif name in _TEXTS:
            checks.instance(name, value, str, "a name")
        elif name in _DATASETS:
            checks.instance(name, value, xr.Dataset, "a dataset")
        elif name == "ax":
            checks.instance(name, value, Axes, "axes of matplotlib")
        elif name == "axes":
            checks.instance(name, value, (np.ndarray, list, tuple), "an array of axes")
        elif name == "at":
            checks.instance(name, value, Mapping, "a mapping of axis to value")
            for axis, number in value.items():
                if axis != "start" or not isinstance(number, str):  # a start may have a name
                    checks.number(f"at of {axis}", number, FINITE)
