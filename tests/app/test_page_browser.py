"""The page in a real Chromium, on a finished run; everything seen is compared with what the server holds."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.settings import Settings

playwright = pytest.importorskip("playwright.sync_api")

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = [
    *("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage"),
    *("--disable-background-timer-throttling", "--disable-renderer-backgrounding", "--disable-backgrounding-occluded-windows"),
]
NODES = "() => Object.keys((window.__viserMutable || {}).nodeRefFromName || {})"
VISIBLE = """() => Object.entries(window.__viserMutable.nodeRefFromName).filter(([name, node]) => {
  for (let at = node; at; at = at.parent) if (!at.visible) return false;
  return true;
}).map(([name]) => name)"""
OVERFLOWING = """names => names.filter(name => {
  const box = document.querySelector(name);
  return box.scrollWidth > box.clientWidth + 1;
})"""
POINTS = """() => {
  let count = 0;
  window.__viserMutable.nodeRefFromName['/cloud'].traverse(node => { count += node.geometry?.attributes.position?.count ?? 0; });
  return count;
}"""

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine: install the package chromium"),
]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as started:
        chromium = started.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield chromium
        chromium.close()


class Page:
    """The page with what a person does on it, and the server's side of it."""

    def __init__(self, page: Any, client: httpx.Client) -> None:
        self.page, self.client = page, client
        self.trouble: list[str] = []
        page.on("pageerror", lambda error: self.trouble.append(str(error)))
        page.on("console", lambda message: self.trouble.append(message.text) if message.type == "error" else None)

    def until(self, true: Callable[[], bool], seconds: float = 60.0) -> None:
        end = time.monotonic() + seconds
        while not true():
            assert time.monotonic() < end, f"waited in vain; trouble: {self.trouble}"
            self.page.wait_for_timeout(50)

    def open(self, path: str = "/") -> None:
        self.page.goto(f"{self.client.base_url}{path.lstrip('/')}")
        self.until(lambda: self.viewer is not None and any(name.startswith("/mesh/") for name in self.viewer.evaluate(NODES)))
        self.settled()

    @property
    def viewer(self) -> Any:
        return next((frame for frame in self.page.frames if "/viser/" in frame.url), None)

    @property
    def held(self) -> dict[str, Any]:
        """What the server holds for this page."""
        identity = self.page.evaluate("sessionStorage.getItem('palpate.page')")
        answer = self.client.get(f"/api/sessions/{identity}/state")
        return answer.json() if answer.status_code == 200 else {"view": {}, "drawn": {}}

    @property
    def frame(self) -> int:
        return int(self.page.input_value("#scrub"))

    def settled(self) -> dict[str, Any]:
        """Wait until the server holds the frame that the page shows."""
        self.until(lambda: self.held["view"].get("frame") == self.frame)
        return self.held

    def visible(self) -> set[str]:
        return {name for name in self.viewer.evaluate(VISIBLE) if name}


@pytest.fixture
def page(browser: Any, client: httpx.Client) -> Iterator[Page]:
    context = browser.new_context(viewport={"width": 1440, "height": 900}, color_scheme="light")
    page = Page(context.new_page(), client)
    yield page
    context.close()
    assert page.trouble == []


def test_page_opens_on_the_verdict_and_the_worst_frame(page: Page, tmp_path: Path) -> None:
    page.open()
    assert "The simulation misses a stiff lump" in page.page.inner_text(".verdict")
    assert page.settled()["view"]["sequence"] == "drag-01"
    assert page.frame == 2
    page.page.screenshot(path=tmp_path / "page.png")
    assert (tmp_path / "page.png").stat().st_size > 50_000


def test_panel_says_what_the_data_can_tell(page: Page) -> None:
    page.open()
    told = page.page.inner_text(".told").replace("\N{NO-BREAK SPACE}", " ")
    assert "Tool radius" in told and "0.12 mm" in told and "83 % like tool offset" in told
    assert "1.4 times at best; half of the places not at any size" in told and "like nothing else" in told
    assert "45 % of edge -x, extent 14 mm" in told


def test_panel_says_what_the_controls_gave_and_what_to_push_next(page: Page) -> None:
    page.open()
    shown = page.page.inner_text("#panel").replace("\N{NO-BREAK SPACE}", " ")
    assert "1 % of the gain left" in shown and "70 % of the gain left" in shown and "says nothing" in shown
    assert "Stiff inclusion: it may not come of the pushes" in shown
    assert "Press 6 mm deep on the top at (12, -8) mm" in shown and "94 % likely to decide" in shown
    assert "Measure the block with a calliper" in shown


def test_scrubbing_stepping_and_playing_move_the_scene(page: Page) -> None:
    page.open()
    sums = set()
    for key, frame in (("Home", 0), ("ArrowRight", 1), ("ArrowRight", 2), ("ArrowLeft", 1), ("End", 4)):
        page.page.keyboard.press(key)
        assert page.frame == frame
        sums.add(page.settled()["drawn"]["checksum"])
    assert len(sums) == 4
    page.page.fill("#scrub", "3")
    assert page.settled()["view"]["frame"] == 3
    box = page.page.locator("#plot").bounding_box()
    page.page.mouse.click(box["x"] + 50, box["y"] + box["height"] / 2)
    assert page.settled()["view"]["frame"] == 0
    page.page.select_option("#speed", "0.5")
    page.page.keyboard.press("Space")
    page.until(lambda: 0 < page.frame < 4, 10)
    page.until(lambda: page.frame == 4, 10)
    assert page.settled()["view"]["frame"] == 4
    page.page.wait_for_timeout(200)
    assert page.page.get_attribute("#play", "title") == "Play or pause (Space)"


def test_layers_and_colours_are_the_same_in_page_server_and_browser(page: Page) -> None:
    page.open()
    assert {"/cloud", "/tool/ball"} <= page.visible()
    bands = {f"/mesh/{name}" for name in page.held["drawn"]["triangles"]}
    page.until(lambda: {name for name in page.visible() if name.startswith("/mesh/")} == bands)
    assert page.viewer.evaluate(POINTS) >= page.held["drawn"]["points"] > 50
    for layer, node in (("measured", "/cloud"), ("tool", "/tool/ball")):
        page.page.click(f"[data-layer={layer}]")
        page.until(lambda node=node: node not in page.visible())  # type: ignore[misc]
        assert layer not in page.held["view"]["layers"]
    page.page.click("[data-layer=extended]")
    page.page.click("[data-colour=plain]")
    page.until(lambda: "/mesh/extended" in page.visible())
    assert page.page.is_hidden("#legend")
    page.page.click("[data-colour=extended]")
    page.until(lambda: page.held["view"]["colour"] == "extended" and page.page.is_visible("#legend"))
    page.page.click("#legend >> text=Fixed")
    page.page.fill("#legend input", "0.25")
    page.page.keyboard.press("Enter")
    page.until(lambda: page.held["drawn"]["limit"] == 0.00025)
    page.until(lambda: "+0.25" in page.page.inner_text("#legend"))


def test_choices_outlive_a_reload_and_the_scene_comes_back(page: Page) -> None:
    page.open()
    page.page.click("#theme")
    page.page.click("[data-layer=tool]")
    page.page.select_option("#speed", "2")
    page.page.click("[data-sequence=poke-01]")
    page.until(lambda: page.held["view"]["sequence"] == "poke-01")
    page.open()
    assert page.page.evaluate("document.documentElement.dataset.theme") == "dark"
    assert page.page.get_attribute("[data-layer=tool]", "aria-pressed") == "false"
    assert page.page.input_value("#speed") == "2"
    assert page.held["view"]["sequence"] == "poke-01"


def test_nothing_lies_over_anything_and_nothing_is_cut_off(page: Page) -> None:
    page.open()
    for width, height in ((1440, 900), (1280, 720), (1920, 1080)):
        page.page.set_viewport_size({"width": width, "height": height})
        page.page.wait_for_timeout(150)
        boxes = [page.page.locator(name).bounding_box() for name in (".rail", ".toolbar", ".scene", ".timeline", ".panel")]
        for i, a in enumerate(boxes):
            for b in boxes[i + 1 :]:
                apart = a["x"] + a["width"] <= b["x"] + 0.5 or b["x"] + b["width"] <= a["x"] + 0.5
                assert apart or a["y"] + a["height"] <= b["y"] + 0.5 or b["y"] + b["height"] <= a["y"] + 0.5
        assert page.page.evaluate(OVERFLOWING, [".toolbar", ".transport", ".panel", ".rail-body"]) == []


def test_broken_dataset_is_told_where_it_is_chosen(page: Page, shared_place: Any) -> None:
    shutil.copytree(shared_place.datasets / "small", shared_place.datasets / "worse", dirs_exist_ok=True)
    (shared_place.datasets / "worse" / "touches.csv").unlink()
    page.open()
    page.page.click("#datasets >> text=worse")
    page.page.wait_for_selector(".note-card.bad")
    assert "touches.csv" in page.page.inner_text(".note-card.bad")
    page.trouble = [text for text in page.trouble if "422" not in text]


def test_empty_server_says_what_to_do(browser: Any, serve: Any, tmp_path: Path) -> None:
    with serve(Settings(runs=tmp_path / "runs", datasets=tmp_path / "datasets", preload=())) as client:
        context = browser.new_context()
        page = context.new_page()
        page.goto(str(client.base_url))
        page.wait_for_selector(".empty-panel")
        assert "palpate demo" in page.inner_text(".empty-panel")
        assert "None yet" in page.inner_text("#runs")
        context.close()
