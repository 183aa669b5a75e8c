"""The explorer in a real browser: what is clicked is what is shown, and nothing else happens."""

import base64
import io

import numpy as np
import pytest
import pyuff
import scipy.io.wavfile
from explorer_pages import Window, browser, servers, sixteen  # noqa: F401

from wiperjax.explorer.explored import explored
from wiperjax.explorer.notebook import explore
from wiperjax.explorer.static import write_static
from wiperjax.vocabulary.cf import flag_names

pytestmark = pytest.mark.long
EVIL = "<script>document.title='owned'</script><img src=x onerror=\"document.title='owned'\">"


@pytest.fixture(scope="module")
def cells():
    """The map, in memory."""
    return sixteen()


@pytest.fixture(scope="module")
def address(servers, cells):  # noqa: F811
    return servers(explored(cells, "sixteen.h5"))


@pytest.fixture
def window(browser, address):  # noqa: F811
    found = Window(browser, address)
    found.until(lambda: found.text(".noise"))
    yield found
    assert found.faults == []
    found.page.close()


def told(cells, place):
    """Class and frequency of a cell in the map, as the page writes them."""
    cell = cells.isel(place)
    return flag_names(cells["label"])[int(cell["label"])], float(cell["dominant_frequency"])


def agrees(window, cells, place):
    """Whether the page shows this cell, computed, as the map has it."""
    name, frequency = told(cells, place)
    if window.number("label") != name or window.number("label", "map") != name:
        return False
    shown = window.number("dominant_frequency")
    if name == "quiet":  # what moves by rounding alone has no tone
        return shown == "-"
    return shown not in ("", "-") and np.isclose(float(shown), frequency, rtol=1e-3)


def test_cells_clicked_moved_to_and_slid_to_are_those_of_the_map(window, cells):
    window.click(2, 1, 4, 2)
    place = {"attack_angle": 2, "belt_speed": 1, "normal_load": 1}
    assert told(cells, place)[0] == "squeal"
    window.until(
        lambda: agrees(window, cells, place) and "attack angle 5°" in window.text(".where")
    )
    for key, change in (("ArrowDown", {"belt_speed": 0}), ("ArrowLeft", {"attack_angle": 1})):
        window.page.keyboard.press(key)
        place |= change
        window.until(lambda: agrees(window, cells, place))  # noqa: B023
    assert "attack angle -5°" in window.text(".where")
    slider = window.page.locator(".noUi-handle").first
    slider.focus()
    slider.press("ArrowLeft")  # the slider's, not the map's
    window.until(lambda: "normal load 12 N/m" in window.text(".where"))
    window.until(lambda: agrees(window, cells, place | {"normal_load": 0}))


def lip_drawn(window):
    """Whether the lip in slow motion is there: an instant stands over it."""
    models = "Bokeh.documents.flatMap(d => [...d._all_models.values()])"
    return window.view.evaluate(f"() => {models}.some(m => /^The lip at/.test(m.text))")


def test_the_lip_of_a_motion_that_is_ready_is_drawn_when_a_window_opens(window, browser, address):  # noqa: F811
    window.until(lambda: window.says("computed and shown"))
    second = Window(browser, address)  # the motion is known by now
    second.until(lambda: lip_drawn(second), seconds=30)
    assert second.faults == []
    second.page.close()


def test_a_pointer_that_rests_is_not_told_of_another_plane(window, cells):
    window.page.mouse.move(*window.point(3, 0, 4, 2))
    name, _ = told(cells, {"attack_angle": 3, "normal_load": 1, "belt_speed": 0})
    said = f"attack angle 20 deg, belt speed 0.2 m/s: {name}"
    window.until(lambda: window.says(said))
    slider = window.page.locator(".noUi-handle").first
    slider.focus()
    slider.press("ArrowLeft")
    window.until(lambda: not window.says(said), seconds=30)


def test_the_sound_is_that_of_the_motion(window):
    window.click(2, 1, 4, 2)
    window.until(lambda: "belt speed 0.3" in window.text(".where") and window.text(".audio p"))
    sound = window.page.locator("audio").first
    window.until(lambda: sound.evaluate("audio => audio.duration > 1.9"))
    assert sound.evaluate("audio => audio.loop && audio.controls")
    data = sound.get_attribute("src").partition("base64,")[2]
    _, samples = scipy.io.wavfile.read(io.BytesIO(base64.b64decode(data)))
    assert np.abs(samples).max() > 0.01
    before = len(data), np.abs(samples).max()
    window.page.get_by_label("full scale of the sound").select_option(label="0.1 m/s")

    def louder():
        now = sound.get_attribute("src").partition("base64,")[2]
        _, samples = scipy.io.wavfile.read(io.BytesIO(base64.b64decode(now)))
        return np.isclose(np.abs(samples).max(), 10 * before[1], rtol=1e-3)

    window.until(lambda: louder() and "full scale = 0.1 m/s" in window.text(".audio p"))


@pytest.mark.parametrize("kind", ["CSV", "WAV", "UFF 55 (its modes)"])
def test_the_run_is_saved(window, kind, tmp_path):
    window.click(2, 1, 4, 2)
    window.until(lambda: "belt speed 0.3" in window.text(".where"))
    window.page.get_by_label("save the run as").select_option(label=kind)
    with window.page.expect_download(timeout=150_000) as download:  # it may compile
        window.page.get_by_role("button", name="save the run").click()
    content = download.value.path().read_bytes()
    if kind == "CSV":
        table = np.loadtxt(io.BytesIO(content), delimiter=",", skiprows=1)
        assert table[-1, 0] == pytest.approx(0.07) and np.ptp(table[:, 3]) > 0.3
    elif kind != "WAV":
        assert download.value.suggested_filename == "modes.uff"
        (tmp_path / "modes.uff").write_bytes(content)
        one = pyuff.UFF(str(tmp_path / "modes.uff")).read_sets()
        assert one["type"] == 55 and one["eig"].real > 0  # it squeals
    else:
        rate, samples = scipy.io.wavfile.read(io.BytesIO(content))
        assert rate == 48_000 and len(samples) == pytest.approx(0.07 * rate, abs=2)


def test_a_box_is_computed_again_finer_and_left_again(window):
    (x0, y0), (x1, y1) = window.point(0, 0, 4, 2), window.point(2, 1, 4, 2)
    window.page.mouse.move(x0, y0)
    window.page.mouse.down()
    window.page.wait_for_timeout(400)  # a careful hand; Bokeh by itself takes this for no drag
    window.page.mouse.move(0.5 * (x0 + x1), 0.5 * (y0 + y1))
    window.page.mouse.move(x1, y1)
    window.page.mouse.up()
    back = window.page.get_by_role("button", name="back to the whole map")
    window.until(lambda: back.is_visible())
    window.until(lambda: window.says("a part, computed again and finer"))
    window.click(47, 47, 48, 48)
    window.until(lambda: "attack angle 5°" in window.text(".where"))
    back.click()
    window.until(lambda: window.says("sixteen.h5") and not back.is_visible())


def test_two_windows_do_not_disturb_each_other_and_cells_are_held(window, browser, address, cells):  # noqa: F811
    other = Window(browser, address)
    other.until(lambda: other.text(".noise"))
    window.click(0, 0, 4, 2)
    other.click(3, 1, 4, 2)
    window.until(lambda: "attack angle -20°" in window.text(".where"))
    other.until(lambda: "attack angle 20°" in other.text(".where"))
    other.until(lambda: "computed" in other.text(".state p"))
    other.page.get_by_role("button", name="hold this cell beside").click()
    other.until(lambda: other.page.locator(".where").count() == 2 and other.text(".where", 1))
    other.click(0, 1, 4, 2)
    other.until(lambda: "attack angle -20°" in other.text(".where"))
    assert "attack angle 20°" in other.text(".where", 1)
    assert "belt speed 0.2" in window.text(".where")
    assert other.faults == []
    other.page.close()


def test_one_file_holds_the_map_and_motions(browser, cells, tmp_path):  # noqa: F811
    path, place = tmp_path / "page.html", {"attack_angle": 2, "normal_load": 0, "belt_speed": 1}
    chosen = [{"attack_angle": 5, "normal_load": 12, "belt_speed": 0.3}, {"attack_angle": -19}]
    assert write_static(explored(cells, "sixteen.h5"), path, chosen) == 2
    window = Window(browser, path.as_uri())
    window.until(lambda: window.says("2 motions are stored"))
    window.until(lambda: lip_drawn(window), seconds=30)
    window.click(0, 0, 4, 2)
    window.until(lambda: "attack angle -20°" in window.text(".where"))
    slider = window.page.locator(".noUi-handle").first
    slider.focus()
    slider.press("ArrowLeft")
    window.until(lambda: window.says("normal load: 12 N/m"))
    window.click(2, 1, 4, 2)
    window.until(lambda: agrees(window, cells, place))
    sound = window.page.locator("audio").first
    window.until(lambda: sound.evaluate("audio => audio.duration > 0.9"))
    window.page.mouse.move(*window.point(3, 0, 4, 2))
    name, _ = told(cells, {"attack_angle": 3, "normal_load": 0, "belt_speed": 0})
    said = f"attack angle 20 deg, belt speed 0.2 m/s: {name}"
    window.until(lambda: window.says(said))
    rms = explored(cells).variables["velocity_rms"]
    window.page.get_by_label("shown").select_option(label=rms)  # the pointer rests
    window.until(lambda: not window.says("attack angle 20 deg"), seconds=30)
    assert window.faults == []
    window.page.close()


def test_a_frame_of_a_notebook_shows_the_page(browser, cells, tmp_path):  # noqa: F811
    """The frame is of another origin than what is around it, and narrow."""
    shown, path = explore(cells), tmp_path / "notebook.html"
    path.write_text(f"<body><div style='width: 828px'>{shown._repr_html_()}</div></body>")
    window = Window(browser, path.as_uri())
    window.until(lambda: len(window.page.frames) == 2)
    window.view = window.page.frames[1]
    window.until(lambda: window.text(".noise"))
    place = {"attack_angle": 2, "belt_speed": 1, "normal_load": 1}
    window.click(2, 1, 4, 2)
    window.until(lambda: agrees(window, cells, place))
    window.page.keyboard.press("ArrowDown")
    window.until(lambda: agrees(window, cells, place | {"belt_speed": 0}))
    width = window.view.evaluate("[document.documentElement.scrollWidth, innerWidth]")
    assert width[0] <= width[1]  # nothing is cut off at the side
    assert window.faults == []
    window.page.close()
    shown.stop()


def test_a_page_whose_explorer_was_stopped_says_so(browser, cells):  # noqa: F811
    """It went on saying "computed and shown", and the notebook showed a dead frame."""
    shown = explore(cells)
    window = Window(browser, shown.address)
    window.until(lambda: window.text(".noise"))
    shown.stop()
    window.until(window.page.get_by_text("connection was lost").count, seconds=20)
    assert shown._repr_html_() == f"the explorer at {shown.address}, stopped"
    shown.stop()  # a second time does nothing
    window.page.close()


def test_a_map_of_one_axis_is_clicked_like_any_other(browser, servers, tmp_path):  # noqa: F811
    line = sixteen(normal_load={"values": [12]}, belt_speed={"values": [0.3]})
    window = Window(browser, servers(explored(line, "line.h5")))
    window.until(lambda: window.text(".noise"))
    places = [{"attack_angle": k, "normal_load": 0, "belt_speed": 0} for k in range(4)]
    window.click(1, 0, 4, 1)
    window.until(lambda: agrees(window, line, places[1]))
    window.page.keyboard.press("ArrowUp")  # there is nothing above
    window.page.keyboard.press("ArrowRight")
    window.until(lambda: agrees(window, line, places[2]))
    assert window.faults == []
    path = tmp_path / "page.html"
    assert write_static(explored(line, "line.h5"), path, [{"attack_angle": 20}]) == 1
    window.page.goto(path.as_uri())
    window.click(2, 0, 4, 1)
    window.until(lambda: agrees(window, line, places[3]))
    assert window.faults == []
    window.page.close()


def test_words_in_a_map_are_words_on_the_page(browser, servers, cells):  # noqa: F811
    evil = cells.assign_attrs(title=EVIL)
    evil["attack_angle"].attrs["long_name"] = EVIL + "$$x^2$$"
    evil["label"].attrs["long_name"] = EVIL
    for hostile, says in ((evil, "squeal"), (evil.assign_attrs(specification="[]"), "cannot be")):
        window = Window(browser, servers(explored(hostile, EVIL)))
        window.until(lambda: window.says(says))  # noqa: B023
        assert "<script>" in window.page.locator("h1").first.inner_text()
        assert "owned" not in window.page.title().replace(EVIL, "").replace("title='owned'", "")
        assert window.page.evaluate("document.querySelectorAll('img').length") == 0
        assert window.faults == []
        window.page.close()


def test_a_count_below_the_pointer_is_told_whole(browser, servers, cells):  # noqa: F811
    """Four digits of it read as another count."""
    many = cells.assign(steps=cells["steps"].copy(data=0 * cells["steps"].values + 123_456))
    found = explored(many, "many.h5")
    window = Window(browser, servers(found))
    window.until(lambda: window.text(".noise"))
    window.page.get_by_label("shown").select_option(label=found.variables["steps"])
    window.until(lambda: window.text(".bar .tick"), seconds=30)
    window.page.mouse.move(*window.point(3, 0, 4, 2))
    window.until(lambda: window.text(".readout div"), seconds=30)
    assert window.text(".readout div").strip().endswith("m/s: 123456")
    assert window.faults == []
    window.page.close()
