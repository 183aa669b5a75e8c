"""Classes that a file names by an import path, `module:Class`: systems and friction laws of one's
own. They are imported when their file is read; here no jax is (their modules do).
"""

import hashlib
import importlib
import inspect
import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

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


def imported(key: str, path: str) -> type:
    """The class of an import path. Raises: Fault, of the key, one line, where there is none."""
    module_name, _, class_name = path.partition(":")
    must = "must be an import path such as 'my_module:MyClass'"
    if not module_name or not class_name.isidentifier():
        raise Fault(key, f"{must} of a class at the top of its module, was {show(path)}")
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        if error.name and (module_name + ".").startswith(error.name + "."):
            where = "beside the file or in the working directory"
            raise Fault(key, f"module {show(module_name)} is not found, {where} either") from None
        raise Fault(key, f"module {show(module_name)} cannot be imported: {error}") from None
    except Exception as error:  # whatever the module does wrong
        what = f"{type(error).__name__}: {error}"
        raise Fault(key, f"module {show(module_name)} cannot be imported: {what}") from None
    found = getattr(module, class_name, None)
    if not isinstance(found, type):
        had = "has no class" if found is None else "has no class but something else named"
        raise Fault(key, f"module {show(module_name)} {had} {show(class_name)}")
    return found


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
    those of the classes it inherits from. (What their functions call elsewhere is not seen.) Read
    once: a source that is changed meanwhile is not what this process computes with.

    Raises: Fault, of the key, where there is no source.
    """
    bases = [each for each in found.__mro__ if each.__module__.split(".")[0] not in _KNOWN]
    found_in = [_source(key, each) for each in (found, *bases)]
    return hashlib.sha256("".join(dict.fromkeys(found_in)).encode()).hexdigest()


_KNOWN = ("builtins", "abc", "equinox", "wiperjax")  # whose versions a map has by themselves


def _source(key: str, found: type) -> str:
    try:
        module = inspect.getmodule(found)
        whole = module is not None and getattr(module, "__file__", None) is not None
        return inspect.getsource(module if whole and module is not None else found)
    except (OSError, TypeError):
        must = "must stand in a file, so that a map can be told from one of another version"
        raise Fault(key, f"{found.__name__} {must}") from None
