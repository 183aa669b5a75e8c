"""The sweep and scene files that come with the package, to start one's own from.

They have one home, `sweeps/` of the checkout. A wheel carries that folder as `wiperjax/examples`
(`pyproject.toml`); an editable install reads the checkout.
"""

import difflib
import tomllib
from collections import ChainMap
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Annotated

import typer


def example(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="Which one.", show_default="list them")
    ] = None,
) -> None:
    """List the sweeps and scenes that come with wiperjax, or print one.

    wiperjax example squeal > squeal.toml
    """
    scenes, sweeps = examples()
    files = scenes | sweeps
    if name is None:
        width = max(map(len, files))
        for command, those in (("simulate", scenes), ("sweep", sweeps)):
            print(f"for 'wiperjax {command}':")
            for each, file in those.items():
                print(f"  {each:<{width}}  {tomllib.loads(_text(file))['title']}")
    elif name in files:
        print(_text(files[name]), end="")
    else:
        close = difflib.get_close_matches(name, files, cutoff=0.5)
        hint = f"did you mean {' or '.join(close)}? " if close else ""
        raise ValueError(
            f"there is no example {name}: {hint}'wiperjax example' lists all {len(files)}"
        )


def examples() -> tuple[dict[str, Traversable], dict[str, Traversable]]:
    """The shipped files by name: scenes (`squeal`) and sweeps (`reference`, `systems/flutter`)."""
    home: Traversable = resources.files("wiperjax") / "examples"
    if not home.is_dir():
        home = Path(__file__).parents[2] / "sweeps"
    further = (_below(home / folder, f"{folder}/") for folder in ("remedies", "systems"))
    return _below(home / "scenes"), _below(home) | dict(ChainMap(*further))


def _below(folder: Traversable, prefix: str = "") -> dict[str, Traversable]:
    found = sorted(folder.iterdir(), key=lambda file: file.name)
    return {
        prefix + file.name.removesuffix(".toml"): file
        for file in found
        if file.name.endswith(".toml")
    }


def _text(file: Traversable) -> str:
    return file.read_text(encoding="utf-8")
