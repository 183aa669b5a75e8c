"""What the site adds to its pages: mathematics as MathML, which browsers draw without a script."""

import html
import re

from latex2mathml.converter import convert

# as pymdownx.arithmatex leaves it with `generic`
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)
FUNCTION = re.compile(r"<mi>(?:sin|cos|tan|exp)</mi>")  # set without the space before it


def on_page_content(content: str, **_) -> str:
    """Called by mkdocs with each page's HTML; raises for a formula that is no LaTeX."""
    return FORMULA.sub(_mathml, content)


def _mathml(found: re.Match[str]) -> str:
    display = "block" if found[2] == "[" else "inline"
    formula = convert(html.unescape(found[3]), display=display)
    return FUNCTION.sub(r'<mspace width="0.17em"/>\g<0>', formula)
