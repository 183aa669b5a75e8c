"""The pages of the documentation, and the code in them."""

import re
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parents[2]
DOCS = CHECKOUT / "docs"
PAGES = [CHECKOUT / "README.md", *sorted(DOCS.glob("**/*.md"))]
DOORS = ("wiperjax", "wiperjax.cycles", "wiperjax.remedy", "wiperjax.plots", "wiperjax.sound")


def as_params(pages: list[Path], *, run: bool = False) -> list:
    """Pages for `parametrize`; where what they show is to `run`, all but README's take long."""
    return [
        pytest.param(
            page,
            id=str(page.relative_to(CHECKOUT)),
            marks=[pytest.mark.long] * (run and page.name != "README.md"),
        )
        for page in pages
    ]


def write_files(page: Path, folder: Path) -> None:
    """Writes the files that a page shows: code or a table that begins with a line `# NAME`."""
    for language in ("python", "toml", "csv"):
        for block in blocks(page, language):
            if name := re.match(r"# (\w+\.\w+)\n", block):
                (folder / name[1]).write_text(block)


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(), re.MULTILINE | re.DOTALL)
