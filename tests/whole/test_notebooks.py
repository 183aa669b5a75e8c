"""Every notebook runs from top to bottom, and is stored with its outputs."""

import json
import re
import runpy
from pathlib import Path

import matplotlib
import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "docs" / "notebooks").glob("*.ipynb"))
EXECUTE = NOTEBOOKS[0].parent / "execute.py"
DRAWS = re.compile(r"\bplots\.\w+\(|\bplt\.subplots\(")  # a cell that is to show a picture


@pytest.mark.slow
@pytest.mark.parametrize(
    "path",
    [pytest.param(p, marks=[pytest.mark.long] * (p.stem[0] != "1")) for p in NOTEBOOKS],
    ids=lambda p: p.stem,
)
def test_runs_from_top_to_bottom(path, tmp_path, monkeypatch):
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plt, "show", lambda: plt.close("all"))
    names: dict = {"__name__": "__main__"}
    for cell in json.loads(path.read_text())["cells"]:
        if cell["cell_type"] == "code":
            lines = "".join(cell["source"]).splitlines()
            source = "\n".join(line for line in lines if not line.startswith("%"))
            exec(compile(source, str(path), "exec"), names)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_is_stored_with_what_its_code_shows(path):
    """Outputs of one run from top to bottom, of the code that stands there, without its traces:
    `docs/notebooks/execute.py` makes them."""
    notebook = json.loads(path.read_text())
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert all(cell["id"] and set(cell["metadata"]) <= {"tags"} for cell in notebook["cells"])
    assert notebook["metadata"]["code_sha256"] == runpy.run_path(str(EXECUTE))["digest"](code), (
        f"run {EXECUTE.name} again: the code, or a table it tells of, has changed since"
    )
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    for cell in code:
        if DRAWS.search("".join(cell["source"])):
            assert any("image/png" in output.get("data", {}) for output in cell["outputs"])
    outputs = [output for cell in code for output in cell["outputs"]]
    assert not any(output["output_type"] == "error" for output in outputs)
    for output in outputs:
        said = "".join(output.get("text", ())) + "".join(
            output.get("data", {}).get("text/plain", ())
        )
        assert str(Path.home()) not in said and "/tmp/" not in said
        assert output.get("name") != "stderr", said


def test_there_are_notebooks():
    assert NOTEBOOKS
