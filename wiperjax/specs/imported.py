"""Classes that a file names by an import path, `module:Class`: systems and friction laws of one's
own. They are imported when their file is read; here no jax is (their modules do).
"""

import dataclasses
import hashlib
import importlib
import inspect
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ..vocabulary.checks import is_number
from .errors import Fault, show


def named(default: Any, kinds: Iterable[str]) -> str:
    """Name in files of a law or belt that comes with the package, one of some `kinds`; empty of one
    of one's own, also where that is made of another and has inherited its name."""
    cls = type(default)
    kind = vars(cls).get("kind", "")
    return kind if kind in kinds and cls.__module__.split(".")[0] == "wiperjax" else ""


def path_of(value: Any) -> Any:
    """Import path of a class, what is given as such; anything else unchanged."""
    return f"{value.__module__}:{value.__qualname__}" if isinstance(value, type) else value


def is_path(name: str) -> bool:
    """Whether a name in a file is an import path."""
    return ":" in name


def no_name(name: str, names: Iterable[str]) -> str:
    """What is wrong with a name that is none of some and no import path."""
    listed = ", ".join(repr(each) for each in names)
    return f"must be {listed} or an import path 'module:Class', was {show(name)}"


def findable(folder: Path) -> None:
    """Let import paths be found in a folder, and in the working directory, after all else."""
    for place in (str(folder.resolve()), str(Path.cwd())):
        if place not in sys.path:
            sys.path.append(place)


def paths_in(data: Any) -> dict[str, str]:
    """Key -> import path, of those that a mapping shaped like a sweep or scene file names."""
    found = {}
    for table, key in (("", "system"), ("blade", "friction"), ("parameters", "friction")):
        held = data.get(table) if table and isinstance(data, dict) else data
        path = held.get(key) if isinstance(held, dict) else None
        if isinstance(path, str) and is_path(path):
            found[f"{table}.{key}".lstrip(".")] = path
    return found


def check_beside(key: str, path: str, folder: Path) -> None:
    """Raises: Fault, of the key, where the module of an import path, or one with a class that its
    class inherits from, lies in the folder of the file, and Python has another of that name: of
    its library, of the working directory, or imported for a file elsewhere.
    """
    module_name, class_name = _parts(key, path)
    found = getattr(_module(key, module_name), class_name, None)
    names = [module_name, *(each.__module__ for each in getattr(found, "__mro__", ()))]
    for name in dict.fromkeys(name for name in names if name.split(".")[0] not in _KNOWN):
        place = folder.resolve().joinpath(*name.split("."))
        own = next(filter(Path.is_file, (place / "__init__.py", Path(f"{place}.py"))), None)
        has = getattr(sys.modules.get(name), "__file__", None)
        if own is not None and (has is None or Path(has).resolve() != own.resolve()):
            must = f"module {show(name)} must be that beside the file, {own}"
            why = "rename one of them, for a process has one module of a name"
            raise Fault(key, f"{must}, was {has or 'one built into Python'}: {why}")


def imported(key: str, path: str) -> type:
    """The class of an import path. Raises: Fault, of the key, one line, where there is none."""
    module_name, class_name = _parts(key, path)
    module = _module(key, module_name)
    found = getattr(module, class_name, None)
    if not isinstance(found, type):
        had = "has no class" if found is None else "has no class but something else named"
        where = f" (in {module.__file__})" if getattr(module, "__file__", None) else ""
        raise Fault(key, f"module {show(module_name)} {had} {show(class_name)}{where}")
    return found


def _parts(key: str, path: str) -> tuple[str, str]:
    """Names of module and class."""
    module_name, _, class_name = path.partition(":")
    named = re.fullmatch(r"[^./\\]+([.][^./\\]+)*(?<![.]py)", module_name)
    if not named or not class_name.isidentifier():
        must = "must be an import path such as 'my_module:MyClass' (no folder, no .py)"
        raise Fault(key, f"{must} of a class at the top of its module, was {show(path)}")
    return module_name, class_name


def _module(key: str, name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name and (name + ".").startswith(error.name + "."):
            where = "beside the file or in the working directory"
            raise Fault(key, f"module {show(name)} is not found, {where} either") from None
        raise Fault(key, f"module {show(name)} cannot be imported: {error}") from None
    except (Exception, SystemExit) as error:  # whatever the module does wrong
        what = f"{type(error).__name__}: {error}"
        raise Fault(key, f"module {show(name)} cannot be imported: {what}") from None


def needs(key: str, found: type, methods: tuple[str, ...], what: str) -> None:
    """Raises: Fault, of the key, unless a class has some methods, and every one that its own base
    asks for."""
    missing = [name for name in methods if not hasattr(found, name)]
    missing += sorted(getattr(found, "__abstractmethods__", ()))
    missing += sorted(getattr(found, "__abstractvars__", ()))
    if missing:
        raise Fault(key, f"{found.__name__} is no {what}: it lacks {', '.join(missing)}")


@cache
def fingerprint(key: str, found: type) -> str:
    """SHA-256 of the sources that a class stands in: its module's, or in a session its own, and
    those of the classes it inherits from; and of the tables in these, for what they were read from
    may change while the source does not. (What functions call or read elsewhere is not seen.) Read
    once: a source that is changed meanwhile is not what this process computes with.

    Raises: Fault, of the key, where there is no source.
    """
    bases = [each for each in found.__mro__ if each.__module__.split(".")[0] not in _KNOWN]
    found_in = [_source(key, each) for each in (found, *bases)]
    digest = hashlib.sha256("".join(dict.fromkeys(found_in)).encode())
    for name, value in (pair for each in bases for pair in _held(each)):
        for table in _tables(value):
            digest.update(name.encode() + table)
    return digest.hexdigest()


_KNOWN = ("builtins", "abc", "equinox", "wiperjax")  # whose versions a map has by themselves
_DEEPEST = 8  # tables in tables: one may hold itself


def _source(key: str, found: type) -> str:
    try:
        return inspect.getsource(_file_of(found) or found)
    except (OSError, TypeError):
        must = "must stand in a file, so that a map can be told from one of another version"
        raise Fault(key, f"{found.__name__} {must}") from None


def _file_of(found: type) -> ModuleType | None:
    """The module of a class; None in a session, which has more in it than the class."""
    module = inspect.getmodule(found)
    return module if getattr(module, "__file__", None) is not None else None


def _held(found: type) -> Iterator[tuple[str, Any]]:
    """Names and values in the module of a class, in the class, and of its fields by default."""
    module = _file_of(found)
    for part in (found,) if module is None else (module, found):
        yield from (pair for pair in vars(part).items() if not pair[0].startswith("__"))
    for field in dataclasses.fields(found) if dataclasses.is_dataclass(found) else ():
        if field.default_factory is not dataclasses.MISSING:
            yield field.name, field.default_factory()


def _tables(value: Any, depth: int = 0) -> Iterator[bytes]:
    """The arrays, tuples and lists of numbers in a value: itself, its fields, its entries. A single
    number is none: it is a parameter, which a map has by itself, or stands in the source.
    """
    if isinstance(value, type | ModuleType) or depth > _DEEPEST:
        return
    parts: Iterable[Any] = ()
    listed = isinstance(value, tuple | list)
    if is_number(value) or (listed and all(is_number(each, arrays=False) for each in value)):
        if np.size(value) and np.ndim(value):
            with np.errstate(over="ignore"):  # the last digits of an exp are each machine's own
                table = np.asarray(value, float).astype(np.float32)
            yield f"{table.shape}".encode() + table.tobytes()
    elif dataclasses.is_dataclass(value):
        parts = [getattr(value, field.name, None) for field in dataclasses.fields(value)]
    elif isinstance(value, Mapping):
        parts = value.values()
    elif listed:
        parts = value
    for part in parts:
        yield from _tables(part, depth + 1)
