"""A map of sixteen cells, computed; servers of maps in a thread; the browser of this machine."""

import gc
import shutil

import pytest
from stub_sweep import evaluate as stub

from wiperjax.explorer.notebook import Served
from wiperjax.maps import driver

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
AXES = {
    "attack_angle": {"values": [-20, -5, 5, 20]},
    "normal_load": {"values": [12, 18]},
    "belt_speed": {"values": [0.2, 0.3]},
}


def sixteen(path=None, title="sixteen cells", **axes):
    """Sweep of `AXES`, four cells at a time: the program of the sweep in tests/whole. `axes` take
    the place of some of them.
    """
    spec = {"title": title, "axes": AXES | axes, "run": {"transient": 0.02, "window": 0.05}}
    return driver.sweep(spec, path, block=4, progress=False)


class Servers:
    """Serves maps, each from a thread of its own."""

    def __init__(self):
        self._served = []

    def __call__(self, explored):
        """The address of a page of this map; its boxes are those of the stub."""
        self._served.append(Served(explored, evaluate=stub))
        return self._served[-1].address

    def stop(self):
        """Ends them all."""
        for served in self._served:
            served.stop()


class Window:
    """A page in the browser; `view` is where the explorer is in it, a frame perhaps; `faults`
    gathers what no page may do.
    """

    def __init__(self, browser, address, width=1280, height=900):
        self.page = self.view = browser.new_page(viewport={"width": width, "height": height})
        self.faults = []
        self.page.on("pageerror", lambda error: self.faults.append(f"error: {error}"))
        self.page.on("console", self._heard)
        self.page.on("request", self._asked)
        self.page.set_default_timeout(30_000)
        self.page.goto(address, timeout=150_000)  # the first program is compiled meanwhile

    def _heard(self, message):
        if message.type in ("error", "warning"):
            self.faults.append(f"{message.type}: {message.text}")

    def _asked(self, request):
        own = ("http://127.0.0.1:", "data:", "blob:", "file:")
        if not request.url.startswith(own):
            self.faults.append(f"request: {request.url}")

    def until(self, what, seconds=150):
        """Waits for `what()` to be true, while the page goes on: a busy machine may compile."""
        for _ in range(int(seconds / 0.05)):
            if found := what():
                return found
            self.page.wait_for_timeout(50)
        raise AssertionError(f"nothing came; the page says {self.text('.state p')!r}")

    def text(self, place, which=0):
        """Text of an element, empty if it is not there."""
        found = self.view.locator(place)
        return found.nth(which).inner_text() if found.count() > which else ""

    def says(self, words):
        """Whether these words can be seen."""
        found = self.view.get_by_text(words)
        return found.count() > 0 and found.first.is_visible()

    def number(self, name, column="here"):
        """What the table of numbers says."""
        return self.text(f"tr[data-name={name}] .{column}")

    def point(self, i, j, columns, rows):
        """Where a cell of the map is on the page."""
        frame = self.view.locator(".bk-Figure").first.bounding_box()
        inner = self.view.evaluate(
            """() => { const view = Object.values(Bokeh.index.roots ? [...Bokeh.index.roots] :
               Object.values(Bokeh.index))[0];
               const find = v => v.frame ? v : (v.child_views || []).map(find).find(x => x);
               const b = find(view).frame.bbox; return [b.left, b.top, b.width, b.height] }"""
        )
        left, top, width, height = inner
        return (
            frame["x"] + left + width * (i + 0.5) / columns,
            frame["y"] + top + height * (rows - j - 0.5) / rows,
        )

    def click(self, i, j, columns, rows):
        """Clicks a cell."""
        self.page.mouse.click(*self.point(i, j, columns, rows))


@pytest.fixture(scope="module")
def servers():
    """Servers that end with the module."""
    found = Servers()
    yield found
    found.stop()


@pytest.fixture(scope="module")
def browser():
    """Chromium without a display."""
    from playwright.sync_api import sync_playwright

    if CHROMIUM is None:
        pytest.skip("no Chromium is installed (Debian: apt install chromium)")
    # Bokeh seeks garbage twice for each page that was closed, and the others wait meanwhile:
    # half a minute in a process that holds the programs of a hundred tests
    gc.freeze()
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield found
        found.close()
    gc.unfreeze()
