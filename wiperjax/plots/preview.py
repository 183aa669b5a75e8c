"""A dataset in a notebook: a small picture of it, and what it holds in a line or two."""

import base64
import html
import io
from collections.abc import Callable, Hashable, Iterable
from typing import Any, TypeVar

import numpy as np
import xarray as xr

from ..datasets.kinds import kind_of
from ..datasets.map_starts import from_start
from ..datasets.run_dataset import last_periods, usual_axis
from ..noise.class_counts import whole_codes
from ..vocabulary import checks
from .maps.categories import category_legend, category_panel
from .maps.line import along_axis
from .maps.planes import choose_plane, cut, map_dims
from .runs.history import time_history
from .style.axes import legend_below, page
from .style.caption import noise_text, start_text

DPI = 80
T = TypeVar("T")


class Preview:
    """What `preview` shows: a notebook draws it, elsewhere it is a line of text.

    Attributes:
        text: what the dataset holds.
        png: the picture, as the bytes of a file; empty where nothing can be drawn.
    """

    def __init__(self, text: str, png: bytes):
        self.text, self.png = text, png

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        data = base64.b64encode(self.png).decode()
        picture = f'<img alt="" src="data:image/png;base64,{data}">' if data else ""
        return f"<div>{html.escape(self.text)}<br>{picture}</div>"


def load_ipython_extension(shell: Any) -> None:
    """`%load_ext wiperjax` in a notebook: from then on maps and runs are shown by their `preview`,
    above what xarray shows of them.
    """
    shell.display_formatter.formatters["text/html"].for_type(xr.Dataset, _shown)


def unload_ipython_extension(shell: Any) -> None:
    """`%unload_ext wiperjax`: datasets are shown as xarray shows them."""
    shell.display_formatter.formatters["text/html"].pop(xr.Dataset)


def _shown(ds: xr.Dataset) -> str:
    """A dataset as HTML; with a picture if it is one of ours, and still can be drawn."""
    ours = str(ds.attrs.get("source", "")).startswith("wiperjax") and kind_of(ds) in PREVIEWS
    picture = _tried(lambda: preview(ds)._repr_html_(), "") if ours else ""
    return picture + ds._repr_html_()


def _tried(make: Callable[[], T], otherwise: T) -> T:
    """What `make` returns, `otherwise` if it cannot: anything may have been made of a dataset of
    ours (a mean, two variables of it, samples turned round), and what is shown must not raise.
    """
    try:
        return make()
    except Exception:
        return otherwise


def preview(ds: xr.Dataset) -> Preview:
    """A small picture of a map (its classes in the middle plane) or of a run (the velocity of its
    last periods), and a line that says what it is. Of what cannot be drawn the line alone.
    """
    checks.instance("ds", ds, xr.Dataset, "a map or a run, such as open_map(...)")
    title = str(ds.attrs.get("title", "")) or str(ds.attrs.get("system", "")) or "dataset"
    said, drawn = PREVIEWS.get(kind_of(ds), lambda ds: (_sizes(ds, ds.sizes), bytes))(ds)
    return Preview(f"{title}: {said}", _tried(drawn, b""))


def _of_run(ds: xr.Dataset) -> tuple[str, Callable[[], bytes]]:
    noise = _tried(lambda: noise_text(ds), "")
    time, moments = np.asarray(ds["time"]), np.asarray(ds.get("event_time", ()))
    first, last = time.min(), time.max()  # of a part, which keeps the events of the whole run
    events = np.count_nonzero((first <= moments) & (moments <= last))
    text = f"run of {last - first:.4g} s, {events:,} events"
    return text + (f"; {noise}" if noise else ""), lambda: _run(ds)


def _of_map(ds: xr.Dataset) -> tuple[str, Callable[[], bytes]]:
    starts = ds.sizes.get("start", 1)
    ds = from_start(ds)
    try:
        whole_codes(ds["label"])
    except ValueError as error:
        return f"no map any more: {error}", bytes
    size, sizes = ds["label"].size, _sizes(ds, map_dims(ds))
    text = f"map of {size:,} cell{'' if size == 1 else 's'}"
    text += f" ({sizes})" if sizes else ""
    text += f" of {starts} starts each" if starts > 1 else ""
    text += f"; {start}" if (start := start_text(ds)) else ""
    try:
        x, y = choose_plane(ds, None, None)
    except ValueError:
        return text, lambda: _png(along_axis(ds)[0].figure)
    plane, where = cut(ds, (x, y))
    text += f"; shown at {where}" if where else ""
    return text, lambda: _map(plane.load(), x, y)


PREVIEWS = {"map": _of_map, "run": _of_run}


def _sizes(ds: xr.Dataset, names: Iterable[Hashable]) -> str:
    return " x ".join(f"{ds.sizes[name]} {name}" for name in names)


def _map(plane: xr.Dataset, x: str, y: str) -> bytes:
    figure = page((5.0, 3.6))
    boundary = category_panel(plane, figure.subplots(), x, y)
    legend_below(figure, category_legend(plane, boundary=boundary), fontsize="small")
    return _png(figure)


def _run(run: xr.Dataset) -> bytes:
    figure = page((5.0, 2.2))
    component = usual_axis(run) if run["velocity"].ndim > 1 else None
    part = last_periods(run)
    time_history(part, figure.subplots(), component=component, legend=False)
    return _png(figure)


def _png(figure: Any) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=DPI, format="png")
    return buffer.getvalue()
