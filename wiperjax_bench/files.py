"""What every command of `wiperjax bench` does before it measures, and with what it found."""

import importlib.util
from pathlib import Path

from wiperjax.cli.options import configure


def begin(output: Path, cores: int | None, suffixes=(".h5", ".nc")) -> None:
    """Check what can be checked before minutes are spent, and set XLA up."""
    if importlib.util.find_spec("numba") is None:
        raise ValueError("bench needs numba: pip install numba")
    if output.suffix not in suffixes:
        raise ValueError(f"{output}: must end in {' or '.join(suffixes)}")
    if not output.parent.is_dir():
        raise ValueError(f"{output.parent}: is not a directory")
    configure(cores, keep=False)  # compilations are measured


def finish(output: Path, dataset, draw, words, pictures=()) -> None:
    """Write the picture and the text of a dataset beside it; say where they are, and `pictures`."""
    from .reports.words import save

    drawn = [*save(draw(dataset), output), *pictures]
    text = output.with_suffix(".md")
    text.write_text(words(dataset, output.with_suffix(".png").name))
    print(f"dataset  {output}\npicture  {', '.join(map(str, drawn))}\ntext     {text}")


def say(output: Path, text: str) -> None:
    """Write ``text`` to ``output`` and print it."""
    output.write_text(text)
    print(text)
