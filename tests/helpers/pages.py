"""The pages of the documentation, and the code in them."""

import re
from pathlib import Path

CHECKOUT = Path(__file__).parents[2]
DOCS = CHECKOUT / "docs"
PAGES = [CHECKOUT / "README.md", *sorted(DOCS.glob("**/*.md"))]
DOORS = ("wiperjax", "wiperjax.cycles", "wiperjax.remedy", "wiperjax.plots", "wiperjax.sound")


def write_files(page: Path, folder: Path) -> None:
    """Writes the files that a page shows: code or a table that begins with a line `# NAME`."""
    for language in ("python", "toml", "csv"):
        for block in blocks(page, language):
            if name := re.match(r"# (\w+\.\w+)\n", block):
                (folder / name[1]).write_text(block)


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(), re.MULTILINE | re.DOTALL)
