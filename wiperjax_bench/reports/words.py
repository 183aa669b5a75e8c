"""What the texts and pictures share: times with units, versions, the files of a figure."""

import json
from pathlib import Path

import xarray as xr


def duration(seconds: float) -> str:
    """Return a time with a unit that suits it."""
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-6:.3g} \u00b5s"


def versions(dataset: xr.Dataset) -> str:
    """Return the sentence that says with which libraries ``dataset`` was measured."""
    found = json.loads(dataset.attrs["versions"])
    return "Versions: " + ", ".join(f"{k} {v}" for k, v in found.items()) + "."


def save(figure, output: Path, suffixes: tuple[str, ...] = (".png", ".svg")) -> list[Path]:
    """Write a figure beside ``output``; return the files. Bytes do not depend on the date."""
    files = [output.with_suffix(suffix) for suffix in suffixes]
    for file in files:
        figure.savefig(file, dpi=120, metadata={"Date": None} if file.suffix == ".svg" else None)
    return files
