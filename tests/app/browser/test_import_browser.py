"""The panel of imports in Chromium: from a bag to a dataset, the cut edited on the timeline."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from bench_recording import BenchRecording, bench_setup
from browsing import NEEDS_CHROMIUM, Page
from small_dataset import write_valid_dataset

from palpate.app.settings import Settings
from palpate.dataset import open_dataset

pytestmark = NEEDS_CHROMIUM
PICTURES = os.environ.get("PALPATE_PICTURES")
"""Folder for pictures of each step, where a person wants to look at them."""
LISTED = """() => [...document.querySelectorAll('.cut-line')].map(
    line => ['.name', '.value'].map(part => line.querySelector(part).textContent))"""
SIZES = {"wide": (1440, 900), "small": (1024, 768)}


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bench")
    bench_setup(folder)
    return BenchRecording(rate=25.0).write(folder / "bench.bag")


@pytest.fixture
def panel(browser: Any, serve: Any, tmp_path: Path) -> Iterator[ImportPanel]:
    settings = Settings(runs=tmp_path / "runs", datasets=tmp_path / "datasets", preload=())
    settings.datasets.mkdir()
    width, height = SIZES[os.environ.get("PALPATE_SIZE", "small")]
    with (
        serve(settings) as client,
        browser.new_context(
            viewport={"width": width, "height": height},
            color_scheme=os.environ.get("PALPATE_THEME", "light"),
        ) as context,
    ):
        found = ImportPanel(Page(context.new_page(), client))
        yield found
        assert found.page.trouble == []


class ImportPanel:
    """The panel as a person uses it."""

    def __init__(self, page: Page) -> None:
        self.page, self.tab = page, page.page

    def picture(self, name: str) -> None:
        if PICTURES:
            self.tab.wait_for_timeout(1500)
            self.tab.screenshot(path=f"{PICTURES}/{name}.png")

    def open(self) -> None:
        self.tab.goto(str(self.page.client.base_url))
        self.tab.click("#import")

    def idle(self) -> None:
        """Wait until no job of the panel is under way."""
        self.page.until(
            lambda: (
                self.tab.locator(".import-job").count() == 0
                and self.tab.locator(".import-streams").count() == 1
            )
        )

    def sequences(self) -> dict[str, tuple[float, float]]:
        """Start and end [s] of the listed sequences by name, from the recording's start."""
        rows = self.tab.evaluate(LISTED)
        found = {}
        for name, text in rows:
            start, end = re.findall(r"[\d.]+", text)
            found[name] = (float(start), float(end))
        return found

    def pixel(self, seconds: float) -> tuple[float, float]:
        """Place of a time [s] in the timeline's row of sequences, while all is in sight."""
        box = self.tab.locator("#look-plot").bounding_box()
        look = self.look()["recordings"][0]
        left, right, foot = 46, 14, 24
        share = seconds / (look["end"] - look["start"])
        return (
            box["x"] + left + share * (box["width"] - left - right),
            box["y"] + box["height"] - foot - 13,
        )

    def drag(self, start: float, end: float) -> None:
        self.tab.mouse.move(*self.pixel(start))
        self.tab.mouse.down()
        self.tab.mouse.move(*self.pixel((start + end) / 2), steps=3)
        self.tab.mouse.move(*self.pixel(end), steps=3)
        self.tab.mouse.up()

    def look(self) -> dict[str, Any]:
        """The look of the address; one that is being replaced is waited for."""
        found: dict[str, Any] = {}

        def there() -> bool:
            identity = re.search(r"look=([^&]+)", self.tab.url)
            answer = self.page.client.get(f"/api/looks/{identity[1] if identity else ''}")
            found.update(answer.json() if identity and answer.status_code == 200 else {})
            return bool(found)

        self.page.until(there)
        return found


def test_a_bag_is_looked_at_cut_by_hand_and_becomes_a_dataset(
    panel: ImportPanel, bag: Path, tmp_path: Path
) -> None:
    tab = panel.tab
    panel.open()
    tab.set_input_files("input[name=recordings]", bag)
    tab.wait_for_selector("[data-file='bench.bag'][data-state=there]")
    panel.picture("1-chosen")
    tab.click("text=Look at them")
    panel.idle()
    roles = {
        row.get_attribute("data-stream"): row.locator("select").input_value()
        for row in tab.locator("[data-stream]").all()
    }
    assert roles == {"/PSM1/measured_cp": "pose", "/camera/points": "cloud", "/ati": "wrench"}
    assert tab.get_by_role("button", name="Import", exact=True).is_disabled()
    assert "State the setup first" in tab.inner_text("#import-obstacle")
    panel.picture("2-without-setup")

    tab.set_input_files("input[name=setup]", bag.parent / "dataset.toml")
    panel.page.until(lambda: "drag-01" in panel.sequences())
    found = panel.sequences()
    assert list(found) == ["poke-top-01", "poke-top-02", "poke-side-01", "drag-01"]
    assert "State the axes of the forces first" in tab.inner_text("#import-obstacle")
    tab.select_option("[name=wrench-frame]", '"tool"')
    panel.picture("3-cut")

    move_in_time(panel)
    edit(panel, found)
    edited = panel.sequences()
    panel.picture("4-edited")
    tab.reload()
    panel.idle()
    assert panel.sequences() == edited

    tab.fill("[data-key=dataset-name]", "from-bag")
    tab.get_by_role("button", name="Import", exact=True).click()
    tab.wait_for_selector("#panel:visible >> text=Every file was read", timeout=60_000)
    panel.picture("5-dataset")
    assert "from-bag" in tab.inner_text("#datasets")
    made = open_dataset(tmp_path / "datasets" / "from-bag")
    assert set(made.sequences) == {"first", "poke-side-01", "drag-01", "sequence-01"}
    assert made.config.test == ("first",)
    for name in ("first", "sequence-01"):
        times = made.sequence(name).kinematics.time
        assert times[-1] - times[0] == pytest.approx(edited[name][1] - edited[name][0], abs=0.15)


def move_in_time(panel: ImportPanel) -> None:
    """Click a time, zoom by the wheel, and show all again: scene and clock follow."""
    tab = panel.tab
    x, y = panel.pixel(40.0)
    with tab.expect_request("**/looking") as asked:
        tab.mouse.click(x, y - 60)
    start = panel.look()["recordings"][0]["start"]
    assert asked.value.post_data_json["time"] - start == pytest.approx(40.0, abs=0.2)

    def clock() -> float:
        return float(tab.inner_text("#look-timeline .clock").removesuffix(" s"))

    panel.page.until(lambda: clock() == pytest.approx(40.0, abs=0.2))
    tab.mouse.move(panel.pixel(20.0)[0], y - 60)
    tab.mouse.wheel(0, -600)
    tab.wait_for_timeout(200)
    tab.mouse.click(x, y - 60)
    panel.page.until(lambda: 22.0 < clock() < 36.0)
    tab.keyboard.press("0")
    tab.mouse.click(x, y - 60)
    panel.page.until(lambda: clock() == pytest.approx(40.0, abs=0.2))


def edit(panel: ImportPanel, found: dict[str, tuple[float, float]]) -> None:
    """Drag an end, undo, redo; delete and draw a sequence; rename one and change its split."""
    tab = panel.tab
    start, end = found["poke-top-01"]
    panel.drag(end, end - 1.0)
    panel.page.until(lambda: panel.sequences()["poke-top-01"][1] < end - 0.5)
    tab.keyboard.press("Control+z")
    panel.page.until(lambda: panel.sequences() == found)
    tab.keyboard.press("Control+Shift+z")
    panel.page.until(lambda: panel.sequences()["poke-top-01"][1] < end - 0.5)
    tab.mouse.click(*panel.pixel(start + 0.5))
    tab.keyboard.press(".")
    tab.keyboard.press("Delete")
    panel.page.until(lambda: "poke-top-02" not in panel.sequences())
    panel.drag(29.0, 32.0)
    panel.page.until(lambda: "sequence-01" in panel.sequences())
    assert panel.sequences()["sequence-01"] == pytest.approx((29.0, 32.0), abs=0.2)
    tab.click("[data-sequence-cut=poke-top-01] .cut-line")
    name = tab.locator("[data-sequence-cut=poke-top-01] .wide input")
    name.fill("drag-01")
    name.press("Enter")
    tab.wait_for_selector(".import-field-problem >> text=Another sequence is called drag-01")
    field = tab.locator("li.chosen .wide input")
    field.fill("first")
    field.press("Tab")
    panel.page.until(lambda: "first" in panel.sequences())
    tab.locator("li.chosen select").nth(1).select_option("test")
    tab.wait_for_selector("li.chosen .tag.test")


def test_what_cannot_be_looked_at_is_said_at_the_files(panel: ImportPanel, tmp_path: Path) -> None:
    tab = panel.tab
    panel.open()
    (tmp_path / "empty.bag").touch()
    tab.set_input_files("input[name=recordings]", tmp_path / "empty.bag")
    tab.wait_for_selector("[data-file='empty.bag'][data-state=failed] >> text=is empty")
    tab.click("[aria-label='Leave empty.bag out']")
    tab.fill("input[name=path]", str(tmp_path / "none.bag"))
    tab.get_by_role("button", name="Add", exact=True).click()
    tab.click("text=Look at them")
    tab.wait_for_selector("[data-problem=files] >> text=does not exist")
    panel.page.trouble[:] = [text for text in panel.page.trouble if "422" not in text]


@pytest.mark.more
def test_another_role_and_another_meaning_repeat_the_look(panel: ImportPanel, bag: Path) -> None:
    tab = panel.tab
    panel.open()
    tab.set_input_files("input[name=recordings]", [bag, bag.parent / "dataset.toml"])
    tab.wait_for_selector("[data-file='dataset.toml'][data-state=there]")
    tab.click("text=Look at them")
    panel.page.until(lambda: "drag-01" in panel.sequences())
    tab.locator("[data-key='tip z']").fill("2")
    tab.locator("[data-key='tip z']").press("Tab")
    tab.click("text=Look again with these")
    panel.page.until(lambda: "tool_tip = [0.0, 0.0, 0.002]" in panel.look()["mapping"])
    tab.wait_for_selector("text=Look again with these", state="detached")
    tab.select_option("[aria-label='Role of /ati']", "")
    panel.page.until(lambda: panel.look()["recordings"][0]["force"] is None)
    panel.idle()
    assert tab.locator("[name=wrench-frame]").count() == 0
    assert tab.get_by_role("button", name="Import", exact=True).is_enabled()
    tab.select_option("[aria-label='Role of /PSM1/measured_cp']", "")
    tab.wait_for_selector("[data-problem=streams]")
    assert tab.get_by_role("button", name="Import", exact=True).is_disabled()
    panel.picture("6-no-pose")
    rows = panel.page.client.get("/api/looks")
    assert [one["source"] is not None for one in rows.json()].count(True) == 1


@pytest.mark.more
def test_a_dataset_is_looked_at_without_being_changed(panel: ImportPanel, tmp_path: Path) -> None:
    write_valid_dataset(tmp_path / "datasets" / "small")
    tab = panel.tab
    tab.goto(str(panel.page.client.base_url))
    tab.click("[aria-label='Look at small']")
    panel.idle()
    assert "A look at small" in tab.inner_text("#panel-import h1")
    assert set(panel.sequences()) == {"poke-01", "drag-01"}
    assert tab.locator("#panel-import select, #panel-import input").count() == 0
    assert tab.locator("#look-timeline [data-act=add]").count() == 0
    tab.reload()
    panel.idle()
    tab.click(".cut-line >> text=poke-01")
    panel.page.until(lambda: tab.input_value("[data-act=recording]") == "poke-01")
    tab.click("text=Open the dataset")
    tab.wait_for_selector("#panel:visible >> text=Every file was read")
    assert "look=" not in tab.url
