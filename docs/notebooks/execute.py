"""Runs the notebooks from top to bottom and stores what they show, for readers who do not run them.

    .venv/bin/python docs/notebooks/execute.py [NAME.ipynb ...]      # extra `docs`; all by default

Each notebook keeps a digest of the code that its outputs are from, and of the measured table that
it tells of, so that a test can tell when one was changed and the notebook not run again.
"""

import hashlib
import sys
import tempfile
from pathlib import Path
from typing import Any

TABLE = Path(__file__).parents[2] / "wiperjax" / "maps" / "accuracy_table.json"


def digest(cells: list[Any]) -> str:
    """SHA-256 of the code of a notebook's cells, in order, and of the table of accuracies if that
    is asked; a source may be text or lines."""
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    asked = any("accuracy.choose" in source for source in code)
    texts = [*code, TABLE.read_text()] if asked else code
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()


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
