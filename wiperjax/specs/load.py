"""Sweep and scene files: what they mean, and one clear line when they are wrong.

`load_sweep` and `load_scene` read a TOML file into a frozen specification. Each table is checked by
itself in `tables.py`; what concerns two tables at once in `system.py`, `sweep.py`, `scene.py` and
the families. Every fault becomes a `SpecError` whose text names the file, the key, what it must be
and what it was. Imports no jax.
"""

import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from ..machine.files import log
from ..machine.paths import oddity
from ..vocabulary import checks
from ..vocabulary.wording import shorten
from .errors import Fault, SpecError, sentence, show
from .imported import check_beside, findable, paths_in
from .scene import SceneSpec
from .sweep import MOST_BYTES, SweepSpec

__all__ = ["SceneSpec", "SpecError", "SweepSpec", "load_scene", "load_sweep"]
__all__ += ["parse_scene", "parse_sweep"]


_Spec = TypeVar("_Spec", SweepSpec, SceneSpec)


def load_sweep(path: str | Path, model: str | None = None) -> SweepSpec:
    """Sweep of a TOML file, on the rung ``model`` instead of the file's own if given.

    Raises: SpecError, one line that names file and key.
    """
    return _load(SweepSpec, path, model)


def load_scene(path: str | Path, model: str | None = None) -> SceneSpec:
    """Scene of a TOML file, on the rung ``model`` instead of the file's own if given.

    Raises: SpecError, one line that names file and key.
    """
    return _load(SceneSpec, path, model)


def parse_sweep(data: Mapping[str, Any], source: str = "sweep") -> SweepSpec:
    """Sweep of a mapping shaped like a sweep file. Raises: SpecError that begins with `source`."""
    return _parse(SweepSpec, data, source)


def parse_scene(data: Mapping[str, Any], source: str = "scene") -> SceneSpec:
    """Scene of a mapping shaped like a scene file. Raises: SpecError that begins with `source`."""
    return _parse(SceneSpec, data, source)


def spec_of(kind: type[_Spec], given: _Spec | Mapping[str, Any] | str | os.PathLike[str]) -> _Spec:
    """The specification that a mapping is shaped like, or that the file of a path holds, its notes
    logged as warnings; what is neither as it is: whoever calls says what else may be given.

    Raises: SpecError, one line.
    """
    if isinstance(given, Mapping):
        spec = _parse(kind, given, _word(kind))
    elif isinstance(given, str | os.PathLike):
        spec = _load(kind, Path(given), None)
    else:
        return given
    for note in spec.notes():
        log.warning("note: %s", note)
    return spec


def _word(kind: type[_Spec]) -> str:
    return "scene" if kind is SceneSpec else "sweep"


def _load(kind: type[_Spec], path: str | Path, model: str | None) -> _Spec:
    checks.path("path", path)
    text = _read(Path(path))
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SpecError(f"{path}: is not valid TOML: {shorten(str(error))}") from None
    except (RecursionError, ValueError):  # of its parser: tables in tables, numbers without end
        must = "must be written with fewer brackets within brackets, and shorter numbers"
        raise SpecError(f"{path}: {must}") from None
    needed = f"what is needed here is a {_word(kind)}"
    only_sweeps = SweepSpec.model_fields.keys() - SceneSpec.model_fields.keys()
    if kind is SceneSpec and (told := [key for key in data if key in only_sweeps]):
        raise SpecError(f"{path}: has [{told[0]}], so it is a sweep; {needed}")
    run = data.get("run")
    if kind is SweepSpec and "axes" not in data and isinstance(run, dict) and "duration" in run:
        raise SpecError(f"{path}: has a run.duration and no [axes], so it is a scene; {needed}")
    if model is not None:
        data["model"] = model
    folder = Path(path).parent
    findable(folder)
    try:
        for key, named in paths_in(data).items():
            check_beside(key, named, folder)
    except Fault as fault:
        raise SpecError(f"{path}: {fault}") from None
    spec = _parse(kind, data, str(path))
    spec._text = text
    return spec


def _read(path: Path) -> str:
    """Text of a file of a bearable size. Raises: SpecError."""
    try:
        odd, size = oddity(path), path.stat().st_size
        text = "" if odd or size > MOST_BYTES else path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise SpecError(f"{path}: is not a text file (UTF-8)") from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        why = getattr(error, "strerror", None) or error
        raise SpecError(f"{path}: cannot be read: {why}") from None
    if odd:
        raise SpecError(f"{path}: cannot be read: it is {odd}, and no regular file")
    if size > MOST_BYTES:
        most, was = MOST_BYTES / 1e6, size / 1e6
        raise SpecError(f"{path}: must have at most {most:g} MB, had {was:.3g} MB")
    return text


def _parse(model: type[_Spec], data: Mapping[str, Any], source: str) -> _Spec:
    if not isinstance(data, Mapping):
        raise SpecError(f"{source}: must be a mapping shaped like a file, was {show(data)}")
    findable(Path())
    try:
        return model.model_validate(dict(data))
    except ValidationError as error:
        raise SpecError(f"{source}: {sentence(model, error)}") from None
