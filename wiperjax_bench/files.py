"""What every command of `wiperjax bench` does before it measures, and with what it found."""

import importlib.util
import os
from pathlib import Path

from wiperjax.cli.options import configure

# Instructions that machines without wider vectors have, as XLA and as LLVM (under numba) name them
ISAS = {"avx2": ("AVX2", "x86-64-v3"), "sse4_2": ("SSE4_2", "x86-64-v2")}


def begin(output: Path, cores: int | None, suffixes=(".h5", ".nc"), isa: str | None = None) -> None:
    """Check what can be checked before minutes are spent, and set XLA up.

    ``isa``: a key of `ISAS`. XLA and numba, neither of which may have been imported yet, then
    compile for machines of that kind, also in processes that this one starts.
    """
    if isa is not None and isa not in ISAS:
        raise ValueError(f"isa must be {' or '.join(ISAS)}, but was {isa!r}")
    if importlib.util.find_spec("numba") is None:
        raise ValueError("bench needs numba: pip install numba")
    if output.suffix not in suffixes:
        raise ValueError(f"{output}: must end in {' or '.join(suffixes)}")
    if not output.parent.is_dir():
        raise ValueError(f"{output.parent}: is not a directory")
    if isa is not None:
        limit, kind = ISAS[isa]
        flags = os.environ.get("XLA_FLAGS", "")
        os.environ["XLA_FLAGS"] = f"{flags} --xla_cpu_max_isa={limit}".strip()
        os.environ |= {"NUMBA_CPU_NAME": kind, "NUMBA_CPU_FEATURES": ""}
    configure(cores, keep=False)  # compilations are measured


def finish(output: Path, dataset, draw, words, pictures=()) -> None:
    """Write the picture and the text of a dataset beside it; say where they are, and `pictures`."""
    from .reports.words import save

    drawn = [*save(draw(dataset), output), *pictures]
    text = output.with_suffix(".md")
    text.write_text(words(dataset, output.with_suffix(".png").name), encoding="utf-8")
    print(f"dataset  {output}\npicture  {', '.join(map(str, drawn))}\ntext     {text}")


def say(output: Path, text: str) -> None:
    """Write ``text`` to ``output`` and print it."""
    output.write_text(text, encoding="utf-8")
    print(text)
