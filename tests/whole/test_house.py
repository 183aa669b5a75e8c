"""The house: which package may import which, and that nothing in it grows too large to be read."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parents[2]
FILES = sorted(
    file for folder in ("wiperjax", "wiperjax_bench") for file in (CHECKOUT / folder).rglob("*.py")
)
LONGEST_FILE, LONGEST_FUNCTION = 280, 80


def test_imports_point_down():
    # in a process of its own: the linter silences every logger that is there, those of the package
    code = (
        "from importlinter.cli import lint_imports; raise SystemExit(lint_imports(cache_dir=None))"
    )
    ran = subprocess.run([sys.executable, "-c", code], cwd=CHECKOUT, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout + ran.stderr


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(CHECKOUT)))
def test_files_and_functions_fit_a_reader(file):
    text = file.read_text()
    tree = ast.parse(text)
    assert ast.get_docstring(tree), "says nothing of what it is for"
    assert text.count("\n") <= LONGEST_FILE
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            assert node.end_lineno - node.lineno < LONGEST_FUNCTION, node.name


@pytest.mark.parametrize("folder", ["wiperjax", "wiperjax_bench"])
def test_no_module_takes_what_another_keeps_to_itself(folder):
    for file in (CHECKOUT / folder).rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ImportFrom) and node.level:
                private = [alias.name for alias in node.names if alias.name.startswith("_")]
                assert not private, f"{file}: {private}"
