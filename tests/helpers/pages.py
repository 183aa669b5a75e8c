"""The pages of the documentation, and the code in them."""

import re
from pathlib import Path

CHECKOUT = Path(__file__).parents[2]
DOCS = CHECKOUT / "docs"
PAGES = [CHECKOUT / "README.md", *sorted(DOCS.glob("**/*.md"))]
DOORS = ("wiperjax", "wiperjax.cycles", "wiperjax.remedy", "wiperjax.plots", "wiperjax.sound")


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(), re.MULTILINE | re.DOTALL)
