"""Maps that are explored: read plane by plane, and refused where they are none."""

import asyncio
import json
import re
import signal
import threading
import tomllib
import weakref
from dataclasses import replace
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import xarray as xr
from bokeh.document import Document
from bokeh.protocol import Protocol
from bokeh.server.protocol_handler import ProtocolHandler
from stub_sweep import evaluate, make_spec
from tornado.ioloop import IOLoop

from wiperjax.cli import main
from wiperjax.explorer import cells, motion, server, static
from wiperjax.explorer.box import BLOCK, FEWEST, MOST, Boxes, _finer, box_spec, compute
from wiperjax.explorer.cells import scene_of, toml_of
from wiperjax.explorer.content import content_of, thinned
from wiperjax.explorer.explored import EVERY, explored, open_explored, plain
from wiperjax.explorer.map_panel import MapPanel
from wiperjax.explorer.notebook import explore
from wiperjax.explorer.numbers import table
from wiperjax.explorer.page import Page
from wiperjax.explorer.scale import NOTHING, painted
from wiperjax.explorer.spectrogram import level_images
from wiperjax.explorer.static import nearest, write_static
from wiperjax.explorer.unpacked import MOST as HELD
from wiperjax.explorer.worker import Worker
from wiperjax.machine.files import StoreError
from wiperjax.maps import driver
from wiperjax.plots.maps.categories import category_legend
from wiperjax.plots.maps.numbers import TONE
from wiperjax.plots.runs.levels import Levels
from wiperjax.runs.scene import run_scene
from wiperjax.specs.load import parse_scene, parse_sweep
from wiperjax.store.whole import write_dataset
from wiperjax.vocabulary.codes import LABELS, NOT_COMPUTED, Event, Result
from wiperjax.vocabulary.ranges import FEWEST_SETTLED


@pytest.fixture(scope="module")
def whole():
    return explored(driver.sweep(make_spec(), evaluate=evaluate, progress=False), "stub.h5")


@pytest.fixture(scope="module")
def line():
    """A map of one axis."""
    spec = make_spec().document()
    spec["axes"] = {"belt_speed": spec["axes"]["belt_speed"]}
    return explored(driver.sweep(parse_sweep(spec), evaluate=evaluate, progress=False), "line.h5")


def test_a_port_that_is_taken_is_named(tmp_path, monkeypatch, capsys):
    def taken(host, port):
        raise OSError(98, "Address already in use")

    monkeypatch.setattr(server, "bind_sockets", taken)
    path = tmp_path / "map.h5"
    driver.sweep(make_spec(), path, evaluate=evaluate, progress=False).close()
    assert main(["explore", str(path), "--no-browser", "--port", "5006"]) == 1
    assert capsys.readouterr().err == (
        "wiperjax: --host and --port must be an address of this computer and a port that is free, "
        "but were 127.0.0.1 and 5006: Address already in use\n"
    )


@pytest.mark.parametrize(
    ("host", "says"),
    [
        ("", "--host must be an address, such as 127.0.0.1, but was empty"),  # was every address
        ("a" * 70, "free, but were a{70} and 0: no name of a host"),  # 'idna' codec failed
    ],
)
def test_a_host_that_is_none_is_one_line(host, says, tmp_path, capsys):
    path = tmp_path / "map.h5"
    driver.sweep(make_spec(), path, evaluate=evaluate, progress=False).close()
    assert main(["explore", str(path), "--no-browser", "--host", host]) == 1
    assert re.search(says, capsys.readouterr().err)


@pytest.mark.parametrize("option", [("--port", "5006"), ("--host", "0.0.0.0")])
def test_where_to_serve_is_refused_with_a_page_that_is_written(option, tmp_path, capsys):
    path, page = tmp_path / "map.h5", tmp_path / "page.html"
    driver.sweep(make_spec(), path, evaluate=evaluate, progress=False).close()
    assert main(["explore", str(path), "--static", str(page), *option]) == 1
    said = "wiperjax: --port and --host are for a page that is served, not for --static\n"
    assert capsys.readouterr().err == said
    assert not page.exists()


@pytest.mark.parametrize(("message", "found"), [("{}", "'events'"), ('{"events": [{}]}', "'kind'")])
def test_a_message_that_no_page_sends_is_one_line(message, found, caplog, monkeypatch):
    """A traceback of Bokeh's, in the terminal of who serves."""
    patch = Protocol().assemble('{"msgtype": "PATCH-DOC", "msgid": "1"}', "{}", message)
    handler = ProtocolHandler()
    handler._handlers["PATCH-DOC"] = lambda patch, _: patch.apply_to_document(Document())

    def handled():
        caplog.clear()
        asyncio.run(handler.handle(patch, SimpleNamespace(error=lambda message, text: text)))
        (record,) = caplog.records
        return record

    record = handled()
    said = record.getMessage()
    assert said.startswith("a window sent what means nothing here, or a bug: ")
    assert found in said and "\n" not in said
    assert ".py, line " in said  # a bug of one's own was told without its place
    assert record.exc_info is None
    monkeypatch.setenv("WIPERJAX_TRACEBACK", "1")
    assert handled().exc_info


@pytest.mark.parametrize(
    ("host", "shown"),
    [
        ("localhost", "localhost"),
        ("0.0.0.0", "127.0.0.1"),
        ("::1", "[::1]"),
        ("::", "[::1]"),  # there 127.0.0.1 does not answer
    ],
)
def test_the_address_that_is_shown_is_one_that_a_browser_opens(host, shown, whole, monkeypatch):
    monkeypatch.setattr(server, "bind_sockets", lambda host, port: ([], 5006))
    loop = IOLoop()  # made current
    try:
        served, address = server.serve(replace(whole, spec=None), host)
        served.stop()
    finally:
        loop.close(all_fds=True)
    assert address == f"http://{shown}:5006/"


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_ctrl_c_that_a_callback_drops_ends_the_server():
    loop = IOLoop()

    def press():
        dropped = weakref.WeakSet()  # any object
        ended = weakref.ref(dropped, lambda _: signal.raise_signal(signal.SIGINT))
        del dropped  # Python ignores what this callback raises
        assert ended() is None
        loop.call_later(10, loop.stop)

    stopped = []
    served = SimpleNamespace(
        io_loop=loop, run_until_shutdown=loop.start, stop=lambda: stopped.append(True)
    )
    loop.add_callback(press)
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may ignore it
    try:
        server.run(served, "", False, str)
    finally:
        signal.signal(signal.SIGINT, handler)
        loop.close()
    assert stopped


@pytest.mark.parametrize("height", ["tall", -5, None, 400.5])
def test_a_frame_has_a_height_in_pixels(whole, height):
    """It failed when it was shown, or was shown with none."""
    with pytest.raises(ValueError, match="^height must be a whole number .*pixels"):
        explore(whole.ds, height=height)


def test_a_map_of_one_axis_is_a_strip_with_its_borders_across(line):
    assert line.plane_axes() == ("belt_speed", "")
    growth = np.exp(-0.8 * np.arange(11)) - np.exp(-2.0)  # 0 at two and a half cells
    points = {
        "border_axis": ("border", np.zeros(1, np.int8), {"flag_meanings": "belt_speed"}),
        "border_belt_speed": ("border", line.ds["belt_speed"].values[[4]]),
    }
    ds = line.ds.assign(growth_rate=("belt_speed", growth)).assign_coords(points)
    shown, panel = replace(line, ds=ds.assign_attrs(border_on="label")), MapPanel()
    for variable, axis in (("label", False), ("velocity_rms", True), ("label", False)):
        panel.show(shown, shown.plane("belt_speed", "", {}, None, {variable}), *(
            "belt_speed", "", variable))  # fmt: skip
        assert panel.overlay.axis.visible == axis and not panel.upright.visible
        assert panel.plane.data["image"][0].shape == (1, 11)
        (boundary,) = panel.overlay.lines["boundary"].data["x"]
        np.testing.assert_allclose(boundary, 2.5, atol=0.02)  # a chord's zero: 2.6
    (border,) = panel.overlay.lines["border"].data["x"]
    np.testing.assert_allclose(border, 4.0, atol=1e-9)
    assert "steady slip loses stability" in panel.legend.text and "located" in panel.legend.text


def test_a_map_that_is_one_plane_is_not_kept_in_memory(tmp_path):
    path = tmp_path / "plane.h5"
    spec = make_spec().document()
    del spec["axes"]["normal_load"]
    driver.sweep(spec, path, evaluate=evaluate, progress=False).close()
    found, ds = open_explored(path)
    with ds:
        plane = found.plane("attack_angle", "belt_speed", {}, None, {"normal_force_max"})
        assert plane["normal_force_max"].any()
        assert not found.ds["normal_force_max"].variable._in_memory


def test_a_file_that_is_damaged_while_it_is_served_is_named(tmp_path):
    """A page showed what HDF5 says: "(wrong B-tree signature)"."""
    path = tmp_path / "map.h5"
    driver.sweep(make_spec(), path, evaluate=evaluate, progress=False).close()
    found, ds = open_explored(path)
    place, name = {"attack_angle": 1, "normal_load": 1, "belt_speed": 1}, "normal_force_max"
    with open(path, "r+b") as file:
        file.truncate(3000)
    with ds:
        for read in (
            lambda: found.plane("attack_angle", "belt_speed", place, None, {name}),
            lambda: found.cell(place, (name,)),
        ):
            with pytest.raises(StoreError, match=r"^map\.h5: cannot be read: "):
                read()


def test_variables_that_were_shown_last_are_held_open(tmp_path):
    """HDF5 keeps their unpacked pieces that long."""
    path = tmp_path / "map.h5"
    driver.sweep(make_spec(), path, evaluate=evaluate, progress=False).close()
    found, ds = open_explored(path)
    shown = list(found.variables)[: HELD + 3]
    with ds:
        for name in shown:
            at = {"normal_load": 1}
            plane = found.plane("attack_angle", "belt_speed", at, None, {name})
            np.testing.assert_array_equal(plane[name], ds[name].isel(at).T)
        held = [name for name in shown if name not in EVERY][-HELD:]
        assert list(found.unpacked._open) == held
        found.unpacked.close()
        loaded = explored(ds.load())
    assert loaded.plane("attack_angle", "belt_speed", at, None, {shown[-1]})[shown[-1]].size == 77
    with h5py.File(path, "r+"):  # nobody holds it
        pass


def test_a_slider_that_moves_asks_for_a_motion_when_it_rests(whole):
    wishes = []
    worker = SimpleNamespace(wish=lambda *wish: wishes.append(wish))
    document = Document()
    page = Page(document, whole, worker, Boxes(evaluate))
    assert len(wishes) == 1  # the cell that is shown first
    (slider,) = page.below.children
    for place in (1, 2, 3):
        slider.value = place
        expected = whole.ds["label"].isel(normal_load=place).transpose("belt_speed", ...)
        np.testing.assert_array_equal(page.map.plane.data["values"][0], expected.values.ravel())
    assert len(wishes) == 1
    (rest,) = document.session_callbacks
    rest.callback()
    assert len(wishes) == 2 and wishes[1][1][1] == tuple(page.place().items())
    assert page.place()["normal_load"] == 3


def test_a_plane_holds_what_is_shown_and_no_more(whole):
    plane = whole.plane("attack_angle", "belt_speed", {"normal_load": 3}, None, {"velocity_rms"})
    assert plane["velocity_rms"].dims == ("belt_speed", "attack_angle")
    expected = whole.ds["velocity_rms"].isel(normal_load=3).transpose("belt_speed", "attack_angle")
    np.testing.assert_array_equal(plane["velocity_rms"], expected)
    assert set(plane.data_vars) == {"velocity_rms", "label"}
    assert whole.name == "stub.h5"


def test_colours_stand_for_the_classes_and_numbers_of_a_plane(whole):
    names = {"label", "normal_force_max"}
    plane = whole.plane("attack_angle", "belt_speed", {"normal_load": 0}, None, names)
    paint = painted(plane, "label")
    assert paint.palette[0] == "#E3EAF0"  # quiet, as in every picture
    codes = np.array(list(paint.names))[paint.shades]
    np.testing.assert_array_equal(codes, plane["label"])
    assert paint.values.dtype == np.int8  # a byte a cell is sent
    numbers = painted(plane, "normal_force_max")
    order = np.argsort(plane["normal_force_max"].values.ravel())
    order = order[plane["label"].values.ravel()[order] != LABELS["failed"]]
    assert (np.diff(numbers.shades.ravel()[order].astype(int)) >= 0).all()
    lost = plane.assign(normal_force_max=plane["normal_force_max"] * np.nan)
    assert (painted(lost, "normal_force_max").shades == NOTHING).all()


def test_a_page_has_the_shares_of_the_picture(whole):
    """Of cells that are there: the page counted those that `ds.where` had taken out, and called
    them not computed."""
    plane = whole.plane("attack_angle", "belt_speed", {"normal_load": 0}, None, {"label"}).load()
    both = 1 << LABELS["quiet"] | 1 << LABELS["squeal"]
    plane["class_set"] = xr.full_like(plane["label"], both, np.int16).drop_attrs()
    plane["label"][:], plane["label"][-1] = LABELS["quiet"], LABELS["squeal"]
    rows = plane.sizes["belt_speed"]
    left = plane.where(plane["belt_speed"] > plane["belt_speed"][rows - 3])
    texts = re.findall("</i>([^<]*)</span>", painted(left, "label").legend)
    shares = ["quiet (50.0%)", "squeal (50.0%)", "depends on the start (100.0%)"]
    assert [entry.get_label() for entry in category_legend(left)] == shares
    assert texts == [*shares, "no value"]


def test_frequencies_below_one_hertz_have_colours_of_their_own(whole):
    plane = whole.plane("attack_angle", "belt_speed", {"normal_load": 0}, None, {TONE}).load()
    plane["label"][:] = LABELS["squeal"]
    plane[TONE][:] = np.geomspace(0.03, 0.15, plane[TONE].size).reshape(plane[TONE].shape)
    paint = painted(plane, TONE)
    assert len(np.unique(paint.shades)) == plane[TONE].size and 0.05 < paint.values.mean() < 0.1
    assert paint.legend.count("tick") >= 3 and "grey" not in paint.legend


@pytest.mark.parametrize("scale", [4e-3, 1e-31])
def test_numbers_below_a_bar_do_not_lie_over_each_other(whole, scale):
    """Those beside zero did, where a scale is logarithmic on either side of it."""
    plane = whole.plane("attack_angle", "belt_speed", {"normal_load": 0}, None, {TONE})
    plane["label"][:] = LABELS["squeal"]
    sizes = scale * np.geomspace(1e-3, 1, plane[TONE].size) ** 1.5
    signs = np.where(np.arange(sizes.size) % 2, 1, -1)
    plane["velocity_mean"] = plane[TONE].copy(data=(signs * sizes).reshape(plane[TONE].shape))
    legend = painted(plane, "velocity_mean").legend
    marks = re.findall(r'left:([-.0-9]+)%">([^<]+)<', legend)
    assert len(marks) >= 3 and "0" in [text for _, text in marks]
    for (left, one), (right, other) in zip(marks, marks[1:], strict=False):
        assert 480 * (float(right) - float(left)) / 100 > 3 * (len(one) + len(other))
    assert float(marks[-1][0]) - float(marks[0][0]) > 50


def test_what_stands_still_has_the_lowest_colour(whole):
    plane = whole.plane("attack_angle", "belt_speed", {"normal_load": 0}, None, {"velocity_rms"})
    plane = plane.load()
    plane["label"][:], plane["velocity_rms"][:] = LABELS["squeal"], 0.3
    plane["velocity_rms"][0], plane["velocity_rms"][0, 0] = 0.0, 1e-9
    paint = painted(plane, "velocity_rms")
    assert (paint.shades[0] == 0).all() and "no number" not in paint.legend


def test_derivatives_have_two_colours_that_part_at_zero_whatever_their_signs(whole):
    """As in the picture `value`: one that is positive everywhere says so by its colour."""
    place = {"attack_angle": 0, "normal_load": 0, "belt_speed": 0}
    plane = whole.plane("attack_angle", "belt_speed", place, None, set()).copy(deep=True)
    plane["label"][:] = LABELS["squeal"]
    name = "d_velocity_mean_d_belt_speed"
    plane[name] = (plane["label"].dims, np.ones(plane["label"].shape))
    paint = painted(plane, name)
    assert paint.palette[0] != paint.palette[-1] and (paint.shades == len(paint.palette) - 1).all()
    assert paint.palette == painted(plane.assign({name: -plane[name]}), name).palette
    assert (painted(plane.assign({name: -plane[name]}), name).shades == 0).all()


def test_cells_that_ended_early_have_no_numbers_and_say_so(whole):
    """They hold what was counted until they failed."""
    place = {"attack_angle": 0, "normal_load": 0, "belt_speed": 0}
    names = {"impact_count", "final_time", TONE}
    plane = whole.plane("attack_angle", "belt_speed", place, None, names).load()
    plane["label"][:] = LABELS["squeal"]
    plane["label"][0] = LABELS["failed"]
    plane["label"][1, 0] = LABELS["collapsed"]
    plane["label"][2, 0] = LABELS["quiet"]
    plane[TONE][:] = 500.0
    for name in names & set(plane):
        paint = painted(plane, name)
        lost = np.isin(plane["label"], [LABELS["failed"], LABELS["collapsed"]])
        lost |= (plane["label"].values == LABELS["quiet"]) & (name == TONE)
        np.testing.assert_array_equal(paint.shades == NOTHING, lost)
        said = ("quiet, " if name == TONE else "") + "failed, collapsed<"
        assert np.isnan(paint.values[lost]).all() and said in paint.legend
    ds = whole.ds.copy(deep=True)
    ds["label"][0, 0, 0] = LABELS["failed"]
    told = replace(whole, ds=ds).cell(place, ("label", "impact_count", "velocity_rms", "mechanism"))
    assert told == {"label": LABELS["failed"]}
    ds["label"][0, 0, 0] = LABELS["other"]
    assert "velocity_rms" in replace(whole, ds=ds).cell(place, ("label", "velocity_rms"))


@pytest.mark.parametrize("name", ["mechanism", "band"])
def test_cells_that_ended_early_have_no_name_of_a_quiet_noise(whole, name):
    """They were pale, and told as "none", as quiet ones are."""
    place = {"attack_angle": 0, "normal_load": 0, "belt_speed": 0}
    plane = whole.plane("attack_angle", "belt_speed", place, None, {name}).load()
    plane["label"][:], plane[name][:] = LABELS["quiet"], 0
    plane["label"][0], plane["label"][1, 2:4] = LABELS["failed"], LABELS["collapsed"]
    panel = MapPanel()
    panel.show(whole, plane, "attack_angle", "belt_speed", name)
    words = dict(zip(panel.names.data["code"], panel.names.data["name"], strict=True))
    told = [words[code] for code in panel.plane.data["values"][0]]
    assert told[:7] == ["failed"] * 7 and told[7:11] == ["quiet"] * 2 + ["collapsed"] * 2
    shades = panel.plane.data["image"][0].ravel()
    assert [panel.mapper.palette[shades[k]] for k in (0, 7, 9)] == ["#000000", "#E3EAF0", "#FFFFFF"]
    assert panel.overlay.hatched["////"].data["left"].tolist() == [1.5]
    assert "collapsed (2.6%)" in panel.legend.text


def test_a_cell_without_a_value_is_not_told_as_one_that_is_not_computed(whole):
    """Its legend said "no value", and the words below the pointer "not computed"."""
    plane = whole.plane("attack_angle", "belt_speed", {"normal_load": 0}, None, {"label"}).load()
    plane["label"][0] = NOT_COMPUTED
    panel = MapPanel()
    left = plane.where(plane["attack_angle"] > 0)
    panel.show(whole, left, "attack_angle", "belt_speed", "label")
    words = dict(zip(panel.names.data["code"], panel.names.data["name"], strict=True))
    assert words[NOT_COMPUTED] == "not computed" and "no value" in panel.legend.text
    assert panel.names.tags[2] == "no value"  # told of what has no name


def test_coordinates_that_are_near_read_differently(whole):
    near = whole.ds.assign_coords(
        attack_angle=("attack_angle", 5 + 2e-4 * np.arange(7), whole.ds["attack_angle"].attrs)
    )
    shown, panel = replace(whole, ds=near), MapPanel()
    plane = shown.plane("attack_angle", "belt_speed", {"normal_load": 0}, None, {"label"})
    panel.show(shown, plane, "attack_angle", "belt_speed", "label")
    assert panel.axes.data["x"][0][:2] == ["5 deg", "5.0002 deg"]
    marks = list(panel.picture.xaxis[0].major_label_overrides.values())
    assert len(marks) > 2 and len(set(marks)) == len(marks)
    place = {"attack_angle": 1, "normal_load": 0, "belt_speed": 0}
    assert "attack angle 5.0002°" in scene_of(shown, place)["title"]


def test_the_scene_of_a_cell_is_a_scene_file_of_its_parameters(whole):
    place = {"attack_angle": 1, "normal_load": 4, "belt_speed": 7}
    scene = tomllib.loads(toml_of(scene_of(whole, place)))
    cell = whole.spec.cells(np.ravel_multi_index(tuple(place.values()), whole.spec.shape))
    stated = parse_scene(scene).parameters()
    assert {name: float(value) for name, value in cell.items()} == pytest.approx(stated, rel=1e-15)
    assert parse_scene(scene).run.solver == whole.spec.settings.solver
    assert parse_scene(scene).transient == whole.spec.run.transient  # judged as in the map


@pytest.mark.parametrize(("transient", "window"), [(1.0, 1e-3), (100.0, 5e-3), (0.2, 0.2)])
def test_the_scene_of_a_cell_has_the_samples_that_a_short_window_is_judged_by(
    whole, transient, window
):
    data = whole.spec.document()
    run = data["run"] | {"transient": transient, "window": window}
    short = SimpleNamespace(spec=parse_sweep(data | {"run": run}), ds=whole.ds)
    place = {"attack_angle": 1, "normal_load": 4, "belt_speed": 7}
    run = parse_scene(scene_of(short, place)).run
    assert window / run.sample_interval > FEWEST_SETTLED
    assert run.sample_interval <= 2e-5 * max(1.0, transient / 20.0) * (1 + 1e-3)  # as it ever was


def test_a_box_is_finer_and_lies_where_it_was_dragged(whole):
    ends = {"attack_angle": (0.5, 2.0), "belt_speed": (-3.0, 4.0)}
    spec = box_spec(whole, ends, {"normal_load": 2}, None)
    axes = spec.axes_values()
    assert len(axes["attack_angle"]) == len(axes["belt_speed"]) == 48
    np.testing.assert_allclose(axes["attack_angle"][[0, -1]], [-40 + 0.5 * 80 / 6, -40 + 160 / 6])
    assert axes["belt_speed"][0] == pytest.approx(0.02)  # the map ends there
    np.testing.assert_allclose(np.diff(np.log(axes["belt_speed"])), 0.4 * np.log(50) / 47)
    assert axes["normal_load"].tolist() == [whole.ds["normal_load"].values[2]]
    with pytest.raises(ValueError, match="more than one cell"):
        box_spec(whole, ends | {"attack_angle": (1.0, 1.0)}, {"normal_load": 2}, None)


def test_a_box_has_twice_the_density_or_as_many_cells_as_it_may_and_is_else_refused():
    axis = xr.DataArray(np.linspace(0.1, 1.0, 1000), attrs={"long_name": "belt speed"})
    for over, count in ((20, 48), (30, 61), (63, 127), (100, 128), (126.5, 128)):
        found = _finer(axis, 3, 3 + over, FEWEST, MOST)
        assert len(found) == count and len(found) - 1 > over  # finer than the map
    for count, over in ((MOST, 127), (MOST, 999), (BLOCK, BLOCK)):
        axis = xr.DataArray(np.linspace(0.1, 1.0, 4000), attrs={"long_name": "belt speed"})
        with pytest.raises(ValueError, match=f"{over} cells along belt speed, and its {count}"):
            _finer(axis, 0, over, FEWEST, count)


@pytest.mark.slow
def test_a_box_is_shown_over_the_axes_it_was_dragged_over(whole):
    """However the page was turned while it was computed."""
    held = {}

    class Later:
        def begin(self, spec, report, done):
            held.update(spec=spec, done=done)
            return threading.Event()

    document = Document()
    document.add_next_tick_callback = lambda call: call()
    page = Page(document, whole, SimpleNamespace(wish=lambda *wish: None), Later())
    corners = {"type": "rect", "x0": 0.5, "x1": 2.5, "y0": 0.5, "y1": 4.5}
    page.finer.dragged(SimpleNamespace(final=True, geometry=corners))
    page.across.value = "normal_load"
    assert (page.x, page.y) == ("normal_load", "belt_speed")
    held["done"](compute(held["spec"], lambda *counts: None, threading.Event(), evaluate))
    assert (page.x, page.y) == ("attack_angle", "belt_speed")
    assert page.map.plane.data["image"][0].shape == (48, 48)
    page.finer.back()
    assert (page.x, page.y) == ("normal_load", "belt_speed")  # as it was left


def test_a_box_is_computed_whole_whatever_its_size(whole):
    """Its last block overlaps another: 48 x 48 cells are no multiple of a block."""
    ends = {"attack_angle": (0.5, 2.0), "belt_speed": (0.0, 10.0)}
    spec = box_spec(whole, ends, {"normal_load": 2}, None)
    told = []
    found = compute(spec, lambda *counts: told.append(counts), threading.Event(), evaluate)
    assert told[0] == (0, spec.size) and told[-1] == (spec.size, spec.size)
    assert spec.size % BLOCK and len(told) == 2 + spec.size // BLOCK
    expected = evaluate(spec, np.arange(spec.size))["velocity_rms"].reshape(found.ds["label"].shape)
    np.testing.assert_array_equal(found.ds["velocity_rms"], expected)


def test_a_box_of_a_trusted_map_is_trusted(whole):
    document = whole.spec.document() | {"blade": {"friction": "own_systems:Falling"}}
    ds = driver.sweep(document, evaluate=evaluate, progress=False)
    ends = {"attack_angle": (0.5, 2.0), "belt_speed": (-3.0, 4.0)}
    spec = box_spec(explored(ds, trusted=True), ends, {"normal_load": 2}, None)
    found = compute(spec, lambda *counts: None, threading.Event(), evaluate)
    assert found.unable == "" and found.spec.blade.friction == "own_systems:Falling"


def test_a_box_of_one_axis_is_one_block(line):
    spec = box_spec(line, {"belt_speed": (1.0, 3.0)}, {}, None)
    assert spec.shape == (BLOCK,)
    values = line.ds["belt_speed"].values
    np.testing.assert_allclose(spec.axes_values()["belt_speed"][[0, -1]], values[[1, 3]])
    found = compute(spec, lambda *counts: None, threading.Event(), evaluate)
    assert found.plane_axes() == ("belt_speed", "")


@pytest.mark.parametrize(
    ("label", "result"), [("quiet", Result.FINISHED), ("collapsed", Result.COLLAPSED)]
)
def test_a_cell_is_told_alike_by_its_run_and_by_the_map(whole, label, result):
    """Rounding has no tone, whatever is measured in it; what ended early has a class alone."""
    attrs = {"steps": 1, "rejected_steps": 0, "result_message": ""}
    run = xr.Dataset({"result": int(result)}, attrs=attrs)
    stored = {"label": LABELS[label]}
    told = stored | {"dominant_frequency": 1057.8} if label == "quiet" else {}
    rows = table(run, told, told or stored, whole.ds)
    for name, says in (("label", label), ("dominant_frequency", "-")):
        row = re.search(rf'<tr data-name="{name}">.*?</tr>', rows)[0]
        assert re.findall(r'<td class="(?:here|map)">(.*?)</td>', row) == [says, says]


@pytest.mark.parametrize(("label", "says"), [("quiet", "quiet"), ("other", "none")])
def test_a_quiet_cell_has_no_mechanism_in_the_table_either(whole, label, says):
    """The table said "none" where the map, and the pointer over it, say "quiet"."""
    run = xr.Dataset({"result": 0}, attrs={"steps": 1, "rejected_steps": 0})
    told = {"label": LABELS[label], "mechanism": 0, "band": 0}
    rows = table(run, told, told, whole.ds)
    for name in ("mechanism", "band"):
        row = re.search(rf'<tr data-name="{name}">.*?</tr>', rows)[0]
        assert re.findall(r'<td class="(?:here|map)">(.*?)</td>', row) == [says, says]


@pytest.mark.parametrize(("columns", "inner"), [(1, 0), (2, 0), (9, 7), (900, 400)])
def test_a_spectrogram_is_where_the_windows_are(columns, inner):
    """Those at both ends are wider: one image would draw all columns equally wide."""
    time = 1e-3 * np.concatenate([[0.0], 4.5 + np.arange(columns - 1), [columns + 8.0]])
    levels = Levels(time, 50.0 * np.arange(10), np.zeros((10, columns)), 0.0, 8e-3)
    levels.decibels[:] = np.linspace(-50, 0, columns)
    found = level_images(levels)
    widths = [image.shape[1] for image in found["image"]]
    assert widths == [n for n in (1, inner, int(columns > 1)) if n]
    ends = np.add(found["t"], found["width"])
    np.testing.assert_allclose(found["t"], [time[0], *ends[:-1]])
    assert ends[-1] == pytest.approx(time[-1])
    assert columns == 1 or found["t"][1] == time[1]
    assert (np.diff(np.concatenate([image[0] for image in found["image"]])) >= 0).all()
    assert set(found["f"]) == {-25.0} and set(found["height"]) == {500.0}  # rows around their own


@pytest.mark.parametrize(("rows", "columns"), [(257, 10), (700, 1001), (4097, 500)])
def test_a_tone_is_seen_where_a_spectrogram_has_more_rows_than_a_screen(rows, columns):
    """It is one row: of 700 rows, 444 were not drawn. So is a click of one column."""
    for row in (0, 1, rows // 2, rows - 1):
        levels = np.full((rows, columns), -60.0)
        levels[:, columns // 3], levels[row] = -20.0, 0.0
        time = 1e-3 * np.arange(columns + 1.0)
        found = level_images(Levels(time, 50.0 * np.arange(rows), levels, 0.0, 1e-3))
        for image in found["image"]:
            assert len(image) == 256 and image.shape[1] <= 400
            (place,) = np.flatnonzero((image == 249).all(axis=1))
            assert abs(place - row * 256 / rows) <= 1
        assert ((found["image"][1] > 0).all(axis=0)).sum() == 1  # the click


def test_a_thinned_curve_keeps_its_peaks():
    curve = np.sin(np.linspace(0, 300, 100_000))
    curve[54_321] = 7.0
    chosen = thinned(curve, most=500)
    assert len(chosen) <= 500 and curve[chosen].max() == 7.0 and curve[chosen].min() == curve.min()
    assert chosen[0] == 0 and chosen[-1] == 99_999
    logs = np.log(np.arange(1, 100_001))
    chosen = thinned(curve, most=500, along=logs)  # half of the points in half of the axis
    assert len(chosen) <= 500 and curve[chosen].max() == 7.0 and {0, 99_999} <= set(chosen)
    assert np.array_equal(chosen[:10], np.arange(10))


@pytest.mark.slow
def test_a_strip_of_events_says_what_happened_that_it_does_not_draw():
    """The table counts these events, too."""
    run = run_scene(parse_scene({"blade": {"attack_angle": 5.0}, "run": {"duration": 0.02}}))
    run["event_kind"][:] = int(Event.KINK)
    assert content_of(run).columns["rows"]["row"] == [f"only kink ({run.sizes['event']})"]
    assert content_of(run.isel(event=[])).columns["rows"]["row"] == ["no events"]


@pytest.mark.long
def test_a_slow_system_is_sampled_and_shown_by_its_own_time():
    spec = {
        "system": "own_systems:Oscillator",
        "axes": {"tilt": {"values": [0.0, 1.0]}, "load": {"values": [1.0, 2.0]}},
        "run": {"transient": 30.0, "window": 30.0},
        "classes": {"squeal_band": [0.05, 1.0], "chatter_band": [0.001, 0.05]},
    }
    ds = driver.sweep(spec, evaluate=still, progress=False)
    found = motion.motion_of(explored(ds, trusted=True), {"tilt": 0, "load": 1})
    assert found.labels["history"][0] == "time (s)" and found.ranges["time"][1] == 60
    assert found.labels["ticks"][0] == "time (s)" and found.ranges["whole"] == (0, 60)
    assert found.ranges["frequency"][1] == pytest.approx(25, rel=0.01)  # a 50th of a period each
    assert found.ranges["pitch"][1] == pytest.approx(2, rel=0.1)
    assert "stick-slip" in found.texts["table"] and "too slow" in found.texts["audio"]


def still(spec, index, finer=1, room=None):
    """Cells of any system, at rest."""
    nothing = np.zeros(len(index))
    names = ("velocity_rms", "stick_fraction", "flight_fraction", "normal_force_max", "steps")
    signal = np.zeros((len(index), finer * spec.samples), np.float32)
    return {"result": nothing.astype(int), "slip_fraction": nothing + 1, "signal": signal} | {
        name: nothing for name in (*names, "belt_speed_rms")
    }


def broken(ds, how):
    """A map of which one thing is wrong."""
    if how == "no classes":
        return ds.drop_vars("label")
    if how == "no names":
        bad = ds.copy()
        bad["label"].attrs["flag_meanings"] = "quiet"
        return bad
    if how == "axis of nan":
        return ds.assign_coords(belt_speed=np.full(ds.sizes["belt_speed"], np.nan))
    if how == "one cell":
        return ds.isel({name: [0] for name in ds["label"].dims})
    if how == "axis without values":
        return ds.drop_vars("belt_speed")
    return ds.isel(belt_speed=[0, 2, 1])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "says"),
    [
        ("no classes", "holds something else; only a map can be explored"),
        ("no names", "names do not fit (label)"),
        ("axis of nan", "no finite numbers (belt_speed)"),
        ("axis without values", "without values (belt_speed)"),
        ("one cell", "has one cell alone"),
        ("axis to and fro", "neither rise nor fall (belt_speed)"),
    ],
)
def test_a_broken_map_is_refused_in_one_line(whole, how, says, tmp_path, capsys):
    path = tmp_path / "bad.h5"
    write_dataset(broken(whole.ds, how), path)
    assert main(["explore", str(path), "--no-browser"]) == 1
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and str(path) in line and says in line


def test_what_would_fill_the_memory_is_refused_unread(tmp_path):
    path = tmp_path / "large.h5"
    count = 30_000
    label = xr.Dataset(
        {"label": (("x", "y"), np.zeros((2, 2), np.int8),
                   {"flag_values": np.array([0], np.int8), "flag_meanings": "quiet"})},
        coords={"x": np.arange(2.0), "y": np.arange(2.0)},
    )  # fmt: skip
    label.to_netcdf(path, engine="h5netcdf")
    with h5py.File(path, "r+") as file:
        attrs = dict(file["label"].attrs)
        for name in ("x", "y", "label"):
            del file[name]
        for name in ("x", "y"):
            file[name] = np.arange(count, dtype=float)
            file[name].make_scale(name)
        found = file.create_dataset("label", (count, count), "i1", chunks=(100, 100))
        for key in ("flag_values", "flag_meanings"):
            found.attrs[key] = attrs[key]
        for k, name in enumerate(("x", "y")):
            found.dims[k].attach_scale(file[name])
    huge, ds = open_explored(path)
    with ds, pytest.raises(ValueError, match="30,000 x 30,000 cells cannot be shown"):
        huge.plane("x", "y", {}, None, set())


def test_a_slice_of_joined_maps_is_simulated_only_with_its_own_parameters():
    """The attributes of maps that are joined are those of the first."""
    document, parts = make_spec().document(), {}
    del document["axes"]["normal_load"]
    for load in (10.0, 25.0):
        spec = parse_sweep(document | {"blade": {"normal_load": load}})
        parts[load] = driver.sweep(spec, evaluate=evaluate, progress=False)
    along = xr.DataArray(list(parts), dims="normal_load", name="normal_load")
    both = xr.concat(parts.values(), along, combine_attrs="override")
    own, other = (explored(both.sel(normal_load=load)) for load in parts)
    place = motion.first_place(own)
    assert scene_of(own, place)["blade"]["normal_load"] == 10
    assert "normal_load is not the 10 that" in other.unable
    with pytest.raises(ValueError, match="cannot be simulated: normal_load is not"):
        scene_of(other, place)


def test_a_cell_that_was_masked_has_no_numbers(whole):
    masked = explored(whole.ds.where(whole.ds["belt_speed"] > whole.ds["belt_speed"][0]))
    place = motion.first_place(masked)
    assert masked.cell(place, ["label", "velocity_rms"])
    assert masked.cell(place | {"belt_speed": 0}, ["label", "velocity_rms"]) == {}


def test_a_map_that_does_not_say_what_it_was_made_from_is_shown_only(whole):
    for attrs in ({}, {"specification": "[" * 5000}, {"specification": '{"axes": 3}'}):
        bare = explored(whole.ds.drop_attrs(deep=False).assign_attrs(attrs))
        assert bare.spec is None and bare.unable
        with pytest.raises(ValueError, match="cannot be simulated"):
            scene_of(bare, {"attack_angle": 0, "normal_load": 0, "belt_speed": 0})
    with pytest.raises(StoreError, match="holds something else; only a map"):
        explored(xr.Dataset())


def test_a_file_for_a_browser_takes_cells_of_the_map_only(whole, tmp_path):
    assert nearest(whole, {"attack_angle": 14}) == {
        "attack_angle": 4, "normal_load": 2, "belt_speed": 5,
    }  # fmt: skip
    for cell, says in (({"attack": 3}, "must be an axis"), ({"attack_angle": 41}, "-40 ... 40")):
        with pytest.raises(ValueError, match=says):
            write_static(whole, tmp_path / "page.html", [cell])
    assert not list(tmp_path.iterdir())


def test_a_file_for_a_browser_says_why_it_holds_no_motion(whole, tmp_path, caplog):
    """One that was asked for is not left out without a word."""
    bare, path = explored(whole.ds.drop_attrs(deep=False)), tmp_path / "page.html"
    with pytest.raises(ValueError, match="cells of this map cannot be simulated"):
        write_static(bare, path, [{}])
    assert not path.exists() and write_static(bare, path) == 0
    assert f"holds no motions: cells of this map cannot be simulated: {bare.unable}" in caplog.text
    page = path.read_text(encoding="utf-8")  # which a colleague sees without that line
    assert f"No motions are stored: cells cannot be simulated, {bare.unable}." in page
    assert "a dashed frame is" not in page


@pytest.mark.slow
def test_a_file_for_a_browser_leaves_out_what_cannot_be_shown(whole, tmp_path, monkeypatch, caplog):
    """There may be no steady slip to begin at: the others are kept."""
    known = []

    def shown(explored_, place, **options):
        known.append(place)
        if len(known) == 1:
            raise ValueError("no steady slip exists")
        return content

    scene = {"blade": {"attack_angle": 5.0}, "run": {"duration": 0.02}}
    content = content_of(run_scene(parse_scene(scene)))
    monkeypatch.setattr(static, "motion_of", shown)
    assert write_static(whole, tmp_path / "page.html", [{}, {}, {}]) == 2
    assert "cell 1 is left out: no steady slip exists" in caplog.text


def test_a_module_that_a_map_names_is_not_imported(whole, tmp_path, monkeypatch):
    (tmp_path / "hostile_module.py").write_text("raise SystemExit('imported')")
    monkeypatch.syspath_prepend(tmp_path)
    for change in ({"system": "hostile_module:X"}, {"blade": {"friction": "hostile_module:X"}}):
        document = whole.spec.document() | change
        found = explored(whole.ds.assign_attrs(specification=json.dumps(document)))
        assert found.spec is None and "only --trust imports" in found.unable


def test_all_cells_of_a_map_are_asked_of_one_program(whole, monkeypatch):
    asked = []
    failed = {"result": 1}
    monkeypatch.setattr(cells, "run_scene", lambda _, varied: asked.append(varied) or failed)
    cells.simulated(whole, scene_of(whole, motion.first_place(whole)))
    assert asked == [whole.dims]
    assert whole.ds["attack_angle"][motion.first_place(whole)["attack_angle"]] == 0  # the middle


def test_words_are_one_plain_line():
    assert plain("a\n\x1b[31mb $$x$$ \\(y\\)") == "a [31mb  x   y\\)"
    assert len(plain("x" * 10_000)) == 200


def test_the_first_motion_is_computed_once_before_a_window_asks(whole, monkeypatch):
    computed, shown = [], []
    monkeypatch.setattr(motion, "motion_of", lambda *asked: computed.append(asked) or "motion")
    worker, place = Worker(), motion.first_place(whole)
    motion.wish_ahead(worker, whole)
    worker._pool.submit(lambda: None).result(60)
    assert len(computed) == 1  # no window yet
    motion.wish_motion(worker, "window", whole, place, shown.append)
    worker._pool.submit(lambda: None).result(60)
    assert (len(computed), shown) == (1, ["motion"])
    worker.stop()


@pytest.mark.parametrize(("bug", "lines"), [(NameError, 1), (ValueError, 0)])
def test_a_bug_in_a_system_has_its_traceback_where_it_is_served(bug, lines, caplog):
    """On the page it is its words alone: nobody saw where it was."""

    def compute():
        raise bug("misspelt")

    worker, shown = Worker(), []
    worker.wish("window", "cell", compute, shown.append)
    worker._pool.submit(lambda: None).result(60)
    worker.stop()
    assert [str(error) for error in shown] == ["misspelt"]
    assert caplog.text.count("in compute") == len(caplog.records) == lines


@pytest.mark.long
def test_a_cell_of_another_map_at_the_same_place_is_another_motion(whole, monkeypatch):
    monkeypatch.setattr(motion, "motion_of", lambda asked, *rest: asked.name)
    worker, place, shown = Worker(), motion.first_place(whole), []
    for name in ("one box", "another box"):  # which may take the memory of the first
        box = replace(whole, name=name)
        motion.wish_motion(worker, "window", box, place, shown.append)
        worker._pool.submit(lambda: None).result(60)
        del box
    worker.stop()
    assert shown == ["one box", "another box"]
