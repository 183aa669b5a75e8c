"""A window shows of a cell what is its own: its motion or none, its frame, the start of a part."""

import threading
from types import SimpleNamespace

import pytest
from bokeh.document import Document
from bokeh.models import NoOverlap
from stub_sweep import evaluate, make_spec

from wiperjax.explorer import motion
from wiperjax.explorer.box import compute
from wiperjax.explorer.content import PICTURES, Content
from wiperjax.explorer.explored import explored
from wiperjax.explorer.motion_panel import MotionPanel
from wiperjax.explorer.page import Page
from wiperjax.explorer.scale import painted
from wiperjax.maps import driver
from wiperjax.specs.load import parse_sweep
from wiperjax.vocabulary.codes import LABELS


class AtOnce:
    """Does what a window wishes without a thread. `found` is what motions are."""

    found = Content(hidden=set(PICTURES))

    def wish(self, whose, what, work, done):
        done(self.found)

    def begin(self, spec, report, done):
        self.box = lambda: done(compute(spec, report, threading.Event(), ended))
        return threading.Event()


def page_of(ds):
    document, at_once = Document(), AtOnce()
    document.add_next_tick_callback = lambda call: call()
    return Page(document, explored(ds, "map.h5"), at_once, at_once), at_once


@pytest.fixture
def window():
    return page_of(driver.sweep(make_spec(), evaluate=evaluate, progress=False))


def drag(page, worker, **ends):
    page.finer.dragged(SimpleNamespace(final=True, geometry={"type": "rect"} | ends))
    worker.box()


@pytest.mark.long
def test_the_frame_of_a_held_cell_is_where_that_cell_is(window):
    page, worker = window
    held = page.map.held

    def frame():
        return [tuple(place) for place in zip(held.data["x"], held.data["y"], strict=True)]

    page.map.cursor.data = {"x": [2], "y": [7]}
    page._hold()
    assert (page.x, page.y) == ("attack_angle", "belt_speed") and frame() == [(2, 7)]
    page.map.cursor.data = {"x": [5], "y": [1]}
    assert frame() == [(2, 7)]
    page.across.value = "belt_speed"
    assert frame() == [(7, 2)]
    page.across.value = "normal_load"  # the plane of another belt speed, in which it is not
    assert page.at["belt_speed"] == 1 and frame() == []
    page.below.children[0].value = 7
    assert frame() == [(2, 2)]
    page.across.value = "attack_angle"
    page.up.value = "belt_speed"
    (load,) = page.below.children
    assert load.value == 2 and frame() == [(2, 7)]
    load.value = 3
    assert frame() == []
    load.value = 2
    drag(page, worker, x0=0.5, x1=2.5, y0=0.5, y1=4.5)
    assert frame() == []  # the part has other cells
    page.finer.back()
    assert frame() == [(2, 7)]
    page._hold()
    assert frame() == [] and not page.other.view.visible
    page._hold()
    assert frame() == [(page.place()["attack_angle"], page.place()["belt_speed"])]


def test_where_a_motion_cannot_be_computed_none_is_shown(window):
    page, worker = window
    assert page.motion.view.visible
    worker.found = ValueError("no steady slip exists")
    page.map.cursor.data = {"x": [1], "y": [1]}
    assert not page.motion.view.visible and "no steady slip exists" in page.status.text
    page._hold()
    assert not page.other.view.visible  # nor held, as if it were this cell's
    worker.found = AtOnce.found
    page.map.cursor.data = {"x": [2], "y": [1]}
    assert page.motion.view.visible


@pytest.mark.slow
def test_a_lip_that_collapses_at_once_is_told_and_not_drawn():
    document = make_spec().document()
    document["axes"]["attack_angle"] = {"values": [-60.0, 80.0]}
    document["axes"]["belt_speed"] = {"values": [0.05, 0.2]}
    found = explored(driver.sweep(document, evaluate=evaluate, progress=False))
    told = motion.motion_of(found, {"attack_angle": 1, "normal_load": 2, "belt_speed": 0})
    assert '<b class="noise">collapsed after 0.0' in told.texts["heading"]
    assert "#FFFFFF" in told.texts["heading"]  # as its cell is, in a map
    assert "at least 8 samples" in told.texts["audio"] and "<audio" not in told.texts["audio"]
    panel = MotionPanel("")
    panel.show(Content({"velocity": {"t": [0.0], "v": [1.0]}}))
    panel.show(told)
    assert not any(picture.visible for picture in panel.pictures.values())
    assert panel.sources["velocity"].data == {"t": [], "v": []}
    later = motion.motion_of(found, {"attack_angle": 0, "normal_load": 2, "belt_speed": 0})
    assert later.labels["ticks"][0] == "time (ms)" and 0.3 < later.ranges["whole"][1] < 2
    panel.show(later)
    assert all(picture.visible for picture in panel.pictures.values())


def test_rows_of_events_do_not_lie_over_each_other():
    panel = MotionPanel("")
    heights = []
    for count in (1, 5, 2):
        panel.show(Content({"rows": {"row": [f"kind {n}" for n in range(count)]}}))
        heights.append(panel.pictures["ticks"].height)
    assert heights[1] - heights[2] == 3 * (heights[2] - heights[0]) > 3 * 12


@pytest.mark.long
@pytest.mark.parametrize(
    ("starts", "chosen", "says"),
    [
        (None, None, "finer"),
        ({"names": ["at_rest", "steady_slip"]}, "", "finer, start: at_rest"),
        ({"names": ["at_rest", "steady_slip"]}, "steady_slip", "finer, start: steady_slip"),
        ({"random": 3, "x": [1e-3, 2e-3], "vx": [0.0, 1.0]}, "2", "finer, start: 2"),
    ],
)
def test_a_finer_part_says_where_its_cells_start(starts, chosen, says):
    document = make_spec(angles=3, loads=2).document() | ({"starts": starts} if starts else {})
    page, worker = page_of(driver.sweep(parse_sweep(document), evaluate=ended, progress=False))
    if starts:
        usual = "first of most frequent class" if "random" in starts else starts["names"][0]
        assert page.start.options[0] == ("", f"the usual one ({usual})")
    if chosen:
        page.start.value = chosen
    for _ in range(2):  # and of a part of it
        drag(page, worker, x0=0.5, x1=1.5, y0=0.5, y1=1.5)
        assert page.explored.name == f"a part, computed again and {says}"


def ended(spec, index, finer=1, room=None, ended=None):
    """The cells of the stub, however they begin."""
    return evaluate(spec, index, finer, room)


def test_a_legend_has_the_pattern_that_its_cells_have(window):
    page, _ = window
    plane = page.explored.plane("attack_angle", "belt_speed", page.at, None, {"label"})
    plane["label"][0, :2] = [LABELS["failed"], LABELS["collapsed"]]
    keys = {
        key.partition("</i>")[2].partition(" ")[0]: key.count("repeating-linear-gradient")
        for key in painted(plane, "label").legend.split('<span class="key">')[1:]
    }
    assert (keys["failed"], keys["collapsed"], keys["squeal"]) == (2, 1, 0)  # crossed, and not


def test_the_page_says_that_a_file_is_being_made(window):
    """Modes took 8 s on a busy machine, and nothing happened meanwhile."""
    page, worker = window
    worker.wish = lambda *wished: setattr(worker, "done", wished[-1])
    page.downloads.kind.value = "modes.uff"
    page.downloads._wish()
    assert "making modes.uff ..." in page.status.text
    worker.done(b"modes")
    assert "modes.uff is made" in page.status.text


def test_the_key_of_the_lip_says_what_its_thin_line_is():
    """It read as a second link of the lip."""
    key = MotionPanel("Cell").pictures["lip"].children[-1].text
    assert '<i class="line"></i>contact force' in key and "stick" in key


def test_a_plane_that_cannot_be_shown_is_not_taken_for_the_one_before(window, monkeypatch):
    """The cells before stayed under the new choices, and the motion's line came over the reason."""
    page, _ = window
    with monkeypatch.context() as few:
        few.setattr("wiperjax.explorer.explored.MOST_PLANE", 10)
        page.up.value = "normal_load"
        page._look()
        assert "cells cannot be shown" in page.map.legend.text
        assert (
            not len(page.map.plane.data["image"])
            and not page.map.overlay.lines["boundary"].data["x"]
        )
        assert page.map.upright.axis_label.startswith("normal load")
    page.up.value = "belt_speed"
    assert len(page.map.plane.data["image"]) == 1 and "cannot" not in page.map.legend.text


def test_averaged_codes_are_refused_and_not_taken_for_the_variable_before(window):
    """The plane before stayed, under the name of what had been chosen."""
    ds = window[0].explored.ds
    page, _ = page_of(ds.assign(band=(ds["label"] + 0.5).assign_attrs(ds["label"].attrs)))
    page.variable.value = "band"
    page._look()
    assert "band must be whole codes" in page.map.legend.text
    assert not len(page.map.plane.data["image"])
    page.variable.value = "label"
    page._look()
    assert len(page.map.plane.data["image"]) == 1


def test_the_marks_of_a_spectrum_do_not_lie_over_each_other():
    """Those of a lip that collapsed at once did: its spectrum is of less than a decade."""
    axis = MotionPanel("Cell").pictures["spectrum"].xaxis
    assert isinstance(axis.major_label_policy, NoOverlap)
