"""Widgets in the style of the page. They are `Any` to type checkers: Bokeh's properties are made
when it runs.
"""

from collections.abc import Iterable
from typing import Any

from bokeh import models

from .style import SHEET

LIVE = {"role": "status", "aria-live": "polite"}  # a screen reader says what changes there


def source(syncable: Any = True, **columns: Any) -> Any:
    """Columns of numbers for glyphs; unless `syncable`, what a browser does to them stays there."""
    return models.ColumnDataSource(columns, syncable=syncable)


def span(start: float, end: float) -> Any:
    """The ends of an axis."""
    return models.Range1d(start=start, end=end)


def words(width: int | None, text: str = "", **options: Any) -> Any:
    """HTML on the page; formulas are not looked for in it."""
    return models.Div(
        text=text, width=width, disable_math=True, stylesheets=[SHEET], **options
    )  # fmt: skip


def beside(*parts: Any, **styles: str) -> Any:
    """Parts in a row; below each other where the window (or a notebook's frame) is too narrow."""
    look: Any = {"gap": "16px", "flex-wrap": "wrap"} | styles
    return models.Row(children=list(parts), styles=look, sizing_mode="stretch_width")


def choice(title: str, value: str, options: Iterable[tuple[str, str]], width: int) -> Any:
    """One of several values, each with its words."""
    return models.Select(
        title=title, value=value, options=list(options), width=width, stylesheets=[SHEET]
    )


def toggle(label: str, width: int) -> Any:
    """A button that works in the browser alone."""
    return models.Toggle(label=label, width=width, syncable=False, stylesheets=[SHEET])


def button(label: str) -> Any:
    """A button."""
    return models.Button(label=label, width=170, stylesheets=[SHEET])


def slider(title: str, texts: list[str], value: int, width: int, **options: Any) -> Any:
    """One of several places, each with its words; of a single one it is not shown."""
    code = "return texts[Math.round(tick)]"  # a slider counts in fractions that are nearly whole
    names = models.CustomJSTickFormatter(args={"texts": texts}, code=code)
    return models.Slider(
        start=0, end=max(1, len(texts) - 1), step=1, value=value, title=title, width=width,
        format=names, visible=len(texts) > 1, stylesheets=[SHEET], **options,
    )  # fmt: skip
