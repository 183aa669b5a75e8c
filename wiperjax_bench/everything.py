"""`wiperjax bench all`: all measurements but `sweep` and `random`, one after the other."""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import typer


def everything(
    folder: Annotated[Path, typer.Argument(help="Where the files go.")] = Path("docs/bench"),
    quick: Annotated[bool, typer.Option("--quick", help="A small form of it, minutes.")] = False,
    again: Annotated[bool, typer.Option("--again", help="Also what is there already.")] = False,
) -> None:
    """All but sweep and random, one part after the other, each in a process of its own.

    A part whose text is there is kept: a run that was stopped goes on where it was.
    """
    from .harness.measure import time_of_children

    folder.mkdir(parents=True, exist_ok=True)
    begun = time.perf_counter()
    environment = os.environ | {"PYTHONUNBUFFERED": "1"}
    # compilations are measured, and none may come from a cache; only the quick run saves its time
    environment.pop("JAX_COMPILATION_CACHE_DIR", None)
    cache = tempfile.TemporaryDirectory()
    if quick:
        environment["JAX_COMPILATION_CACHE_DIR"] = cache.name
    for name in ("chart", "failures", "limits", "smoothing", "borders", "maps", "speed", "profile"):
        text = folder / f"{name}.md"
        if text.exists() and not again:
            print(f"{name}: kept {text}", flush=True)
            continue
        output = text if name == "profile" else text.with_suffix(".h5")
        command = [sys.executable, "-m", "wiperjax", "bench", name, "-o", str(output)]
        command += ["--quick"] if quick else []
        started, before = time.perf_counter(), time_of_children()
        print(f"--- {name}", flush=True)
        status = subprocess.run(command, check=False, env=environment).returncode
        if status:
            raise typer.Exit(status)
        spent = time_of_children() - before
        print(
            f"--- {name}: {time.perf_counter() - started:.0f} s, {spent:.0f} s of processor time",
            flush=True,
        )
    cache.cleanup()
    print(f"everything in {folder}: {(time.perf_counter() - begun) / 60:.1f} minutes")
    print(f"next: wiperjax bench rule {folder / 'chart.h5'}")
