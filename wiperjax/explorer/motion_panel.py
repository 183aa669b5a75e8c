"""Where a motion is shown: figures that are built once, and filled by each `Content`."""

from collections.abc import Collection
from typing import Any

import numpy as np
from bokeh.events import DocumentReady
from bokeh.models import (
    Column,
    CustomJS,
    FactorRange,
    LinearScale,
    NoOverlap,
    Row,
    TextAreaInput,
)
from bokeh.plotting import figure
from matplotlib import colormaps
from matplotlib.colors import to_hex

from ..plots.style.palette import BELT
from .content import Content
from .slow_motion import drawn_sources, slow_motion
from .spectrogram import SHADES
from .style import SHEET, titled
from .widgets import source, span, toggle, words

WIDTH, HEIGHT = 322, 208  # of a picture
BELOW_TICKS, ROW = 54, 15  # heights: of their axis, and of a row of ticks
FLEX = f"1 1 {WIDTH + 8}px"  # a panel takes what is left of a row, at least one picture
SOURCES = {  # source -> its columns
    "velocity": ("t", "v"), "glass": ("t", "v"), "marks": ("t", "shape"),
    "bands": ("left", "right", "bottom", "top", "colour"),
    "orbit": ("x", "v", "colour"), "glass_speed": ("x", "v"),
    "lines": ("f", "a"), "quiet": ("f", "a"), "tone": ("f", "a", "text"),
    "classes": ("left", "right", "colour", "name"),
    "levels": ("image", "t", "f", "width", "height"), "ticks": ("t", "row"),
    "law": ("slip", "mu"), "force": ("slip", "mu", "colour"),
    "frames": ("x", "y", "hinge", "travel", "px", "py", "t", "when", "v", "at", "colour",
               "regime", "length"),
}  # fmt: skip
RANGES = (
    *("time", "velocity", "position", "speed", "frequency", "amplitude", "whole", "pitch"),
    *("slip", "mu", "along", "height"),
)

FIRST = {  # what a person looks at first
    *("velocity", "glass", "bands", "marks", "orbit", "glass_speed", "heading"),
    *("time", "position", "speed"),
}


class MotionPanel:
    """Pictures, numbers and sound of one motion.

    Attributes:
        view: what is put on a page.
        sources, ranges, texts: what `show` fills, by name.
        pictures: that may be hidden, by name.
        scene: the scene as text, to copy.
    """

    def __init__(self, title: str):
        self.sources = {
            name: source(**{column: [] for column in columns}) for name, columns in SOURCES.items()
        }
        drawn = drawn_sources()
        self.ranges: dict[str, Any] = {name: span(0, 1) for name in RANGES}
        self.ranges["row"] = FactorRange()
        self.texts = {
            name: words(None, css_classes=[name]) for name in ("heading", "table", "audio")
        }
        self.scene = TextAreaInput(
            title="The scene of this cell (wiperjax simulate SCENE.toml -o RUN.h5)",
            rows=9, width=WIDTH, max_length=100_000, stylesheets=[SHEET],
        )  # fmt: skip
        lip, self._draw = slow_motion(
            self._figure(
                "The lip", "along the glass (mm)", "height (mm)", height=226,
                x_range=self.ranges["along"], y_range=self.ranges["height"],
            ),
            self.sources["frames"], drawn,
        )  # fmt: skip
        self.pictures = {
            "friction": self._friction(), "lip": lip, "history": self._history(drawn),
            "portrait": self._portrait(drawn), "spectrum": self._spectrum(),
            "spectrogram": self._spectrogram(), "ticks": self._ticks(),
        }  # fmt: skip
        below = Column(
            children=[self.pictures["spectrogram"], self.pictures["ticks"]], width=WIDTH, spacing=0
        )
        numbers = Column(children=[self.texts["table"]], width=WIDTH)
        flow = [
            numbers, *(self.pictures[name] for name in ("history", "portrait", "spectrum")),
            below, self.pictures["friction"], lip, self._scene_box(),
        ]  # fmt: skip
        self.view = Column(
            children=[
                words(None, f"<h2>{title}</h2>"),
                self.texts["heading"],
                self.texts["audio"],
                Row(children=flow, styles={"flex-wrap": "wrap", "gap": "8px"}),
            ],
            css_classes=["motion"],
            sizing_mode="stretch_width",
            styles={"min-width": f"{WIDTH + 8}px", "flex": FLEX},
        )

    def listen(self, document: Any) -> None:
        """Has the lip drawn of the motion that a document opens with, if it has one."""
        document.js_on_event(DocumentReady, self._draw)

    def show(self, content: Content, only: Collection[str] = ()) -> None:
        """Fills the panel; of it `only` what bears one of these names, if any are given."""
        for name, one in self.sources.items():
            if only and name not in only:
                continue
            given = content.columns.get(name, {})
            one.data = {column: given.get(column, []) for column in SOURCES[name]}
        if not only:
            rows = content.columns.get("rows", {"row": []})["row"]
            self.ranges["row"].factors = rows
            self.pictures["ticks"].height = BELOW_TICKS + ROW * len(rows)
        for name, (start, end) in content.ranges.items():
            if not only or name in only:
                self.ranges[name].update(start=start, end=end)
        for name, picture in self.pictures.items():
            picture.visible = name not in content.hidden
            if name in content.labels:
                picture.xaxis.axis_label, picture.yaxis.axis_label = content.labels[name]
        for name, text in content.texts.items():
            if only and name not in only:
                continue
            if name == "scene":
                self.scene.value = text
            else:
                self.texts[name].text = text

    def parts(self) -> list[tuple[Any, tuple[str, ...]]]:
        """What `show` changes: models, and which of their properties."""
        return [
            *((one, ("data",)) for one in self.sources.values()),
            *((self.ranges[name], ("start", "end")) for name in RANGES),
            (self.ranges["row"], ("factors",)),
            (self.pictures["ticks"], ("height",)),
            *((picture, ("visible",)) for picture in self.pictures.values()),
            *((text, ("text",)) for text in self.texts.values()),
            (self.scene, ("value",)),
        ]

    def _figure(self, title: str, x: str, y: str, height: int = HEIGHT, **options: Any) -> Any:
        return figure(
            title=title, x_axis_label=x, y_axis_label=y, width=WIDTH, height=height,
            tools="", toolbar_location=None, **titled(), **options,
        )  # fmt: skip

    def _history(self, drawn: Any) -> Any:
        picture = self._figure(
            "Velocity, regimes behind it", "time (ms)", "velocity (m/s)",
            x_range=self.ranges["time"], y_range=self.ranges["velocity"],
            height=262,  # as the table beside it
        )  # fmt: skip
        picture.extra_y_ranges = {"share": span(0, 1)}
        picture.quad(
            left="left", right="right", bottom="bottom", top="top", color="colour", alpha=0.4,
            line_width=0, source=self.sources["bands"], y_range_name="share",
        )  # fmt: skip
        picture.line("t", "v", source=self.sources["glass"], color=BELT, line_width=1.6)
        picture.line("t", "v", source=self.sources["velocity"], color="black", line_width=1.2)
        picture.scatter(
            "t", 0.96, marker="shape", size=7, color="black", source=self.sources["marks"],
            y_range_name="share",
        )  # fmt: skip
        picture.scatter(
            "t", "v", size=9, source=drawn["now"], fill_color="white", line_color="black"
        )
        return picture

    def _portrait(self, drawn: Any) -> Any:
        picture = self._figure(
            "Phase portrait", "position along the glass (mm)", "velocity (m/s)",
            x_range=self.ranges["position"], y_range=self.ranges["speed"],
        )  # fmt: skip
        picture.xaxis.ticker.desired_num_ticks = 4  # a small motion has long numbers
        picture.line(
            "x", "v", source=self.sources["glass_speed"], color=BELT, line_dash="dashed",
            line_width=1.4,
        )  # fmt: skip
        picture.multi_line(
            "x", "v", color="colour", line_width=2, source=self.sources["orbit"], line_cap="round"
        )
        picture.scatter(
            "x", "v", size=9, source=drawn["here"], fill_color="white", line_color="black"
        )
        return picture

    def _spectrum(self) -> Any:
        picture = self._figure(
            "Spectrum", "frequency (Hz)", "velocity, rms of line (m/s)",
            x_axis_type="log", y_axis_type="log", x_range=self.ranges["frequency"],
            y_range=self.ranges["amplitude"],
        )  # fmt: skip
        picture.xaxis.major_label_policy = NoOverlap()  # of less than a decade it has many marks
        picture.extra_y_ranges = {"share": span(0, 1)}
        picture.extra_y_scales = {"share": LinearScale()}
        bands = self.sources["classes"]
        picture.quad(
            left="left", right="right", bottom=0, top=1, color="colour", alpha=0.16,
            line_width=0, source=bands, y_range_name="share",
        )  # fmt: skip
        picture.text(
            "left", 0.99, text="name", source=bands, y_range_name="share", x_offset=2,
            text_baseline="top", text_font_size="11px", text_color="#444444",
        )  # fmt: skip
        picture.line("f", "a", source=self.sources["lines"], color="black", line_width=0.9)
        picture.line("f", "a", source=self.sources["quiet"], color="#666666", line_dash="dotted")
        picture.scatter("f", "a", source=self.sources["tone"], color="black", size=6)
        picture.text(
            "f", "a", text="text", source=self.sources["tone"], x_offset=7, y_offset=-4,
            text_font_size="12px", text_font_style="bold",
        )  # fmt: skip
        return picture

    def _spectrogram(self) -> Any:
        picture = self._figure(
            "Spectrogram (60 dB), events", "", "frequency (Hz)", height=150,
            x_range=self.ranges["whole"], y_range=self.ranges["pitch"],
        )  # fmt: skip
        shades = [to_hex(colour) for colour in colormaps["magma"](np.linspace(0, 1, SHADES))]
        picture.image(
            image="image", x="t", y="f", dw="width", dh="height", palette=shades,
            source=self.sources["levels"],
        )  # fmt: skip
        mapper = picture.renderers[0].glyph.color_mapper
        mapper.update(low=0, high=SHADES - 1)
        picture.xaxis.visible = False
        return picture

    def _ticks(self) -> Any:
        """A row of ticks for each kind of event, below the spectrogram."""
        ticks = self._figure(
            "", "time (ms)", "", x_range=self.ranges["whole"], y_range=self.ranges["row"]
        )
        ticks.title.visible = False
        ticks.scatter("t", "row", marker="dash", source=self.sources["ticks"], angle=np.pi / 2,
                      size=11,
                   color="black", line_width=0.8)  # fmt: skip
        ticks.ygrid.visible = False
        return ticks

    def _friction(self) -> Any:
        picture = self._figure(
            "Friction", "slip speed (m/s)", "friction / normal force",
            x_range=self.ranges["slip"], y_range=self.ranges["mu"],
        )  # fmt: skip
        picture.line("slip", "mu", source=self.sources["law"], color="black", line_width=1.2)
        picture.scatter(
            "slip", "mu", source=self.sources["force"], color="colour", size=5, line_width=0
        )
        return picture

    def _scene_box(self) -> Any:
        """The scene as text, with a button that saves it as a file."""
        save = toggle("save as scene.toml", 150)
        save.js_on_change("active", CustomJS(args={"scene": self.scene}, code=SAVE))
        return Column(children=[self.scene, save], width=WIDTH)


SAVE = """
const link = document.createElement('a');
link.href = URL.createObjectURL(new Blob([scene.value], {type: 'text/plain'}));
link.download = 'scene.toml';
link.click();
setTimeout(() => URL.revokeObjectURL(link.href), 1000);
"""
