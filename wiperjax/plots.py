"""Pictures of maps: a dataset in, axes out. Colours of the classes are fixed, also for colour-blind
readers.

No jax here. Pictures of one trajectory are in `plots_run`.
"""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from .dataset import LABELS, flag_names
from .labels import class_table
from .plots_axes import edges, set_axis, short_unit
from .plots_run import run_figure
from .storage import StoreError, check_output, open_map, replacing

CLASS_COLOURS = {  # Okabe and Ito: told apart with every common kind of colour blindness
    "quiet": "#E3EAF0",
    "squeal": "#D55E00",
    "chattering": "#0072B2",
    "reversal": "#CC79A7",
    "other": "#F0C94A",
    "collapsed": "#FFFFFF",
    "failed": "#000000",
    "not_computed": "#BBBBBB",
}
CLASS_HATCHES = {
    "collapsed": ("////", "#666666"),
    "failed": ("xxxx", "#FFFFFF"),
    "not_computed": ("....", "#FFFFFF"),
}
BOUNDARY = "#000000"


def _plane(ds: xr.Dataset, x: str | None, y: str | None) -> tuple[str, str]:
    """Dimensions across and up: attack angle across and belt speed up if they are there."""
    long = [str(dim) for dim in ds.sizes if ds.sizes[dim] > 1] or [str(dim) for dim in ds.sizes]
    if x is None:
        x = next((dim for dim in ("attack_angle", *long) if dim in long and dim != y), long[0])
    if y is None:
        y = next((dim for dim in ("belt_speed", *long[::-1]) if dim in long and dim != x), None)
    if y is None or x == y:
        raise ValueError(
            "a map needs at least two axes of more than one value to be drawn as a plane"
        )
    return x, y


def _middle(ds: xr.Dataset, keep: tuple[str, ...]) -> tuple[xr.Dataset, str]:
    """Slice at the middle value of every dimension but `keep`, and the text that says so."""
    chosen = {dim: ds.sizes[dim] // 2 for dim in ds.sizes if dim not in keep}
    words = [_value_text(ds[dim][place]) for dim, place in chosen.items()]
    return ds.isel(chosen), ", ".join(words)


def _value_text(value: xr.DataArray) -> str:
    name = value.attrs.get("long_name", value.name)
    return f"{name} {value.item():.4g} {short_unit(str(value.attrs.get('units', '1')))}".strip()


# --- one plane ------------------------------------------------------------------------------------


def class_panel(ds: xr.Dataset, ax: Axes, x: str, y: str) -> None:
    """Draws the classes of a map of the dimensions `x` and `y` into `ax`, with the stability
    boundary.
    """
    codes = ds["label"].transpose(y, x).values
    across, up = edges(ds[x].values), edges(ds[y].values)
    names = flag_names(ds["label"])
    values = sorted(names)
    colours = ListedColormap([CLASS_COLOURS.get(names[value], "#00FF00") for value in values])
    borders = BoundaryNorm([value - 0.5 for value in values] + [values[-1] + 0.5], len(values))
    ax.pcolormesh(across, up, codes, cmap=colours, norm=borders, rasterized=True)
    for value, name in names.items():
        if name in CLASS_HATCHES and (codes == value).any():
            hatch, colour = CLASS_HATCHES[name]
            row, column = np.nonzero(codes == value)
            corners = [
                (across[column + a], up[row + b]) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))
            ]
            # One polygon a cell: hatches take the colour of the edge, whose own width 0 leaves no
            # grid.
            ax.add_collection(
                PolyCollection(
                    list(np.stack([np.stack(c, axis=-1) for c in corners], axis=1)),
                    facecolor="none",
                    edgecolor=colour,
                    hatch=hatch,
                    linewidth=0.0,
                ),
                autolim=False,
            )
    set_axis(ax, "x", ds[x])
    set_axis(ax, "y", ds[y])
    stability_boundary(ds, ax, x, y)


def stability_boundary(ds: xr.Dataset, ax: Axes, x: str, y: str) -> bool:
    """Draws the line growth_rate = 0 over a plane; returns whether there is one."""
    if "growth_rate" not in ds or min(ds.sizes[x], ds.sizes[y]) < 2:
        return False
    growth = np.ma.masked_invalid(ds["growth_rate"].transpose(y, x).values.astype(float))
    if growth.count() == 0 or not (growth.min() < 0 < growth.max()):
        return False
    # Growth rates span decades; an odd compression keeps the zero line in place and interpolates it
    # smoothly.
    scale = np.median(np.abs(growth.compressed())) or 1.0
    lines = np.arcsinh(growth / scale)
    ax.contour(ds[x], ds[y], lines, levels=[0.0], colors="white", linewidths=3.2)
    ax.contour(ds[x], ds[y], lines, levels=[0.0], colors=BOUNDARY, linewidths=1.4)
    return True


def class_legend(ds: xr.Dataset, boundary: bool = True, shares: bool = True) -> list[Any]:
    """Legend entries of the classes that occur in a map, with their shares, and of the stability
    boundary.
    """
    handles: list[Any] = []
    for name, count, share in class_table(ds):
        if count == 0:
            continue
        text = f"{name.replace('_', ' ')} ({share:.1%})" if shares else name.replace("_", " ")
        hatch, colour = CLASS_HATCHES.get(name, (None, "#444444"))
        handles.append(
            Patch(
                facecolor=CLASS_COLOURS.get(name, "#00FF00"),
                edgecolor=colour,
                linewidth=0.6,
                hatch=hatch,
                label=text,
            )
        )
    if boundary:
        handles.append(
            Line2D(
                [], [], color=BOUNDARY, linewidth=1.4, label="steady slip loses stability (linear)"
            )
        )
    return handles


# --- whole pictures -------------------------------------------------------------------------------


def class_map(
    ds: xr.Dataset,
    ax: Axes | None = None,
    *,
    x: str | None = None,
    y: str | None = None,
    panel: str | None = None,
    panels: int = 6,
) -> np.ndarray:
    """Noise classes over two axes, as small multiples over a third.

    Arguments:

    - `ds`: a map.
    - `ax`: draw one plane here, at the middle of all other axes.
    - `x`, `y`: dimensions across and up; attack angle and belt speed if there.
    - `panel`: dimension of the small multiples; the first of the others. What is left stays at its
        middle value.
    - `panels`: most small multiples; they are spread over the values, both ends included.

    Returns: axes, shape (panels,).
    """
    x, y = _plane(ds, x, y)
    if ax is not None:
        plane, where = _middle(ds, (x, y))
        class_panel(plane, ax, x, y)
        ax.set_title(where, fontsize="medium")
        return np.array([ax])
    rest = [str(dim) for dim in ds.sizes if dim not in (x, y)]
    panel = panel or next((dim for dim in rest if ds.sizes[dim] > 1), None)
    count = min(panels, ds.sizes[panel]) if panel else 1
    columns = count if count < 4 else -(-count // 2)
    rows = -(-count // columns)
    figure = _new_figure((3.6 * columns + 0.6, 3.0 * rows + 1.3))
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    _class_panels(ds, axes, x, y, panel, count)
    figure.suptitle(str(ds.attrs.get("title", "")), fontweight="bold")
    figure.legend(handles=class_legend(ds), loc="outside lower center", ncols=4, frameon=False)
    return axes.ravel()[:count]


def _class_panels(
    ds: xr.Dataset, axes: np.ndarray, x: str, y: str, panel: str | None, count: int
) -> None:
    places = (
        np.unique(np.linspace(0, ds.sizes[panel] - 1, count).round().astype(int)) if panel else [0]
    )
    for number, ax in enumerate(axes.ravel()):
        if number >= len(places):
            ax.set_visible(False)
            continue
        part = ds.isel({panel: places[number]}) if panel else ds
        plane, where = _middle(part, (x, y))
        class_panel(plane, ax, x, y)
        words = ([_value_text(plane[panel])] if panel else []) + ([where] if where else [])
        ax.set_title(", ".join(words), fontsize="medium")
        ax.label_outer()


def value_map(
    ds: xr.Dataset,
    name: str,
    ax: Axes | None = None,
    *,
    x: str | None = None,
    y: str | None = None,
    norm: Normalize | None = None,
    cmap: str = "viridis",
    title: str | None = None,
) -> Axes:
    """One stored quantity over two axes, at the middle of the others, with a colour bar.

    Cells without a number (failed, collapsed, constant) stay grey. `title` is its long name if
    None.
    """
    x, y = _plane(ds, x, y)
    if ax is None:
        ax = _new_figure((5.2, 4.2)).subplots()
    plane, where = _middle(ds, (x, y))
    values = np.ma.masked_invalid(plane[name].transpose(y, x).values.astype(float))
    ended = np.isin(plane["label"].transpose(y, x).values, [LABELS["failed"], LABELS["collapsed"]])
    values = np.ma.masked_where(ended, values)
    ax.set_facecolor("#BBBBBB")
    mesh = ax.pcolormesh(
        edges(ds[x].values), edges(ds[y].values), values, norm=norm, cmap=cmap, rasterized=True
    )
    set_axis(ax, "x", ds[x])
    set_axis(ax, "y", ds[y])
    stability_boundary(plane, ax, x, y)
    bar = ax.figure.colorbar(mesh, ax=ax, pad=0.02)
    bar.set_label(short_unit(str(ds[name].attrs.get("units", ""))))
    if isinstance(norm, LogNorm):
        bar.ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        bar.ax.yaxis.set_minor_formatter(NullFormatter())
    title = title or str(ds[name].attrs.get("long_name", name))
    ax.set_title(f"{title}\n{where}" if where else title, fontsize="medium")
    return ax


def fraction_map(
    ds: xr.Dataset, regime: str = "stick", ax: Axes | None = None, **options: Any
) -> Axes:
    """Share of the settled window spent in `stick`, `slip` or `flight`; see `value_map`."""
    return value_map(
        ds,
        f"{regime}_fraction",
        ax,
        norm=Normalize(0.0, 1.0),
        cmap="cividis",
        **{"title": f"share of time in {regime}"} | options,
    )


def frequency_map(ds: xr.Dataset, ax: Axes | None = None, **options: Any) -> Axes:
    """Dominant frequency of the cells that are not quiet, on a logarithmic scale; see
    `value_map`.
    """
    frequency = ds["dominant_frequency"]
    loud = frequency.where(ds["label"] != LABELS["quiet"])
    loud.attrs = dict(frequency.attrs)
    top = float(np.nanmax(loud)) if np.isfinite(loud).any() else 1000.0
    low = float(np.nanmin(loud.where(loud > 0))) if np.isfinite(loud).any() else 10.0
    norm = LogNorm(max(min(low, 0.9 * top), 1.0), max(top, 2.0))
    options = {"title": "dominant frequency (grey: quiet)"} | options
    ax = value_map(
        ds.assign(dominant_frequency=loud), "dominant_frequency", ax, norm=norm, **options
    )
    bar = ax.collections[0].colorbar
    assert bar is not None  # value_map drew it
    bands = [
        ds.attrs[name] for name in ("class_squeal_band", "class_chatter_band") if name in ds.attrs
    ]
    for limit in np.unique(np.concatenate([np.atleast_1d(band) for band in bands] or [[]])):
        if norm.vmin < limit < norm.vmax:
            bar.ax.axhline(limit, color="white", linewidth=2.4)
            bar.ax.axhline(limit, color="black", linewidth=1.0)
    return ax


def class_bars(ds: xr.Dataset, ax: Axes) -> Axes:
    """Share of each class, in words and numbers; also the result codes of what failed."""
    table = [row for row in class_table(ds) if row[1] > 0][::-1]
    names = [name.replace("_", " ") for name, _, _ in table]
    bars = ax.barh(
        names,
        [share for *_, share in table],
        color=[CLASS_COLOURS.get(n, "#00FF00") for n, *_ in table],
    )
    for bar, (name, count, share) in zip(bars, table, strict=True):
        hatch, colour = CLASS_HATCHES.get(name, (None, "#444444"))
        bar.set(edgecolor=colour, hatch=hatch, linewidth=0.6)
        ax.text(
            bar.get_width() + 0.01,
            bar.get_y() + bar.get_height() / 2,
            f"{share:.1%}  ({count:,})",
            va="center",
        )
    ax.set_xlim(0, 1.35 * max((share for *_, share in table), default=1.0))
    ax.set_xticks([])
    ax.spines[["top", "right", "bottom"]].set_visible(False)
    ax.set_title("share of cells (number)", fontsize="medium")
    return ax


def overview(ds: xr.Dataset, panels: int = 6) -> Figure:
    """One page: the classes as small multiples, then frequency, stick and level at the middle, and
    the shares.
    """
    x, y = _plane(ds, None, None)
    rest = [str(dim) for dim in ds.sizes if dim not in (x, y) and ds.sizes[dim] > 1]
    panel = rest[0] if rest else None
    count = min(panels, ds.sizes[panel]) if panel else 1
    columns = 3 if count > 3 else count
    rows = -(-count // columns)
    figure = _new_figure((13.0, 3.0 * rows + 5.1))
    upper, lower = figure.subfigures(
        2, 1, height_ratios=[3.0 * rows + 1.0, 3.5], squeeze=False
    ).ravel()
    _class_panels(
        ds,
        upper.subplots(rows, columns, sharex=True, sharey=True, squeeze=False),
        x,
        y,
        panel,
        count,
    )
    upper.legend(handles=class_legend(ds), loc="outside lower center", ncols=8, frameon=False)
    figure.suptitle(
        str(ds.attrs.get("title", "")) or "noise classes", fontweight="bold", fontsize="x-large"
    )
    axes = lower.subplots(1, 4, width_ratios=[1, 1, 1, 0.85])
    frequency_map(ds, axes[0])
    fraction_map(ds, "stick", axes[1])
    speed = np.asarray(ds["velocity_rms"], dtype=float)
    speed = speed[np.isfinite(speed) & (speed > 0)]
    top = float(speed.max()) if speed.size else 1.0
    value_map(
        ds,
        "velocity_rms",
        axes[2],
        norm=LogNorm(1e-3 * top, top),
        cmap="magma",
        title="tip velocity (std)",
    )
    for ax in axes[1:3]:
        ax.set_ylabel("")
    class_bars(ds, axes[3])
    lower.supxlabel(_footnote(ds), fontsize="small", color="#555555")
    return figure


def _footnote(ds: xr.Dataset) -> str:
    attrs = ds.attrs
    pieces = [f"start: {attrs['start']}"] if "start" in attrs else []
    if "class_squeal_band" in attrs and "class_chatter_band" in attrs:
        squeal, chatter = (
            np.atleast_1d(attrs["class_squeal_band"]),
            np.atleast_1d(attrs["class_chatter_band"]),
        )
        pieces.append(
            f"squeal {squeal[0]:g}-{squeal[-1]:g} Hz, chattering below {chatter[-1]:g} Hz"
        )
    if "class_quiet_velocity_ratio" in attrs:
        pieces.append(f"quiet below {attrs['class_quiet_velocity_ratio']:g} of belt speed")
    if "run_window" in attrs:
        pieces.append(
            f"settled window {attrs['run_window']:g} s after {attrs.get('run_transient', 0):g} s"
        )
    pieces.append(str(attrs.get("source", "")))
    return "; ".join(piece for piece in pieces if piece)


def _new_figure(size: tuple[float, float]) -> Figure:
    """Figure outside pyplot: needs no display, and is freed with its last reference."""
    return Figure(figsize=size, layout="constrained")


def plot_file(path: str | Path, output: str | Path, *, force: bool = False, dpi: int = 150) -> None:
    """Draws the picture that suits a file (map or run) into `output`; its ending says the format
    (png, pdf, svg).

    Raises: `StoreError` if `path` is neither a map nor a run, or `output` cannot be written.
    """
    output = Path(output)
    kinds = sorted(Figure().canvas.get_supported_filetypes())
    if output.suffix[1:].lower() not in kinds:
        raise StoreError(f"{output}: its ending must be one of {', '.join(kinds)}")
    check_output(output, force)
    with open_map(path) as ds:
        if "label" in ds:
            figure = overview(ds)
        elif "regime" in ds and "time" in ds.sizes:
            figure = run_figure(ds)
        else:
            raise StoreError(f"{path}: is neither a map nor a run; there is nothing to draw")
    with replacing(output) as temporary:
        figure.savefig(temporary, dpi=dpi, format=output.suffix[1:].lower())
