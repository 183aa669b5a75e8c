"""Runs the notebooks from top to bottom and stores what they show, for readers who do not run them.

    .venv/bin/python docs/notebooks/execute.py [NAME.ipynb ...]      # extra `docs`; all by default

Each notebook keeps a digest of the code that its outputs are from, so that a test can tell when a
cell was changed and not run again.
"""

import hashlib
import sys
import tempfile
from pathlib import Path
from typing import Any


def digest(cells: list[Any]) -> str:
    """SHA-256 of the code of a notebook's cells, in order; a source may be text or lines."""
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    return hashlib.sha256("\0".join(code).encode()).hexdigest()


def execute(path: Path) -> None:
    """Run a notebook in an empty folder and store it with its outputs."""
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        where = {"metadata": {"path": folder}}
        NotebookClient(notebook, record_timing=False, timeout=600, resources=where).execute()
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    notebook.metadata = {"kernelspec": kernel, "code_sha256": digest(notebook.cells)}
    nbformat.write(notebook, path)


if __name__ == "__main__":
    everything = sorted(Path(__file__).parent.glob("*.ipynb"))
    for chosen in [Path(name) for name in sys.argv[1:]] or everything:
        print(chosen)
        execute(chosen)
