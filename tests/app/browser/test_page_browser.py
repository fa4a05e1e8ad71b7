"""The page in a real Chromium, on a finished run; everything seen is compared with what the server
holds.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
from browsing import NEEDS_CHROMIUM, Page

from palpate.app.settings import Settings

OVERFLOWING = """names => names.filter(name => {
  const box = document.querySelector(name);
  return box.scrollWidth > box.clientWidth + 1;
})"""
POINTS = """() => {
  let count = 0;
  window.__viserMutable.nodeRefFromName['/cloud'].traverse(node => {
    count += node.geometry?.attributes.position?.count ?? 0;
  });
  return count;
}"""

pytestmark = NEEDS_CHROMIUM


def test_page_opens_on_the_verdict_and_the_worst_frame(page: Page, tmp_path: Path) -> None:
    page.open()
    assert "The simulation misses a stiff lump" in page.page.inner_text(".verdict")
    assert page.settled()["view"]["sequence"] == "drag-01"
    assert page.frame == 2
    page.page.screenshot(path=tmp_path / "page.png")
    assert (tmp_path / "page.png").stat().st_size > 50_000


def test_page_opens_where_naming_the_cause_changes_most_not_where_the_sensor_is_noisiest(
    browser: Any, serve: Any, place: Any, run_name: str
) -> None:
    path = place.runs / run_name / "replays" / "drag-01.npz"
    with np.load(path) as stored:
        kept = {name: stored[name] for name in stored.files}
    noisy, without = np.array([1, 6, 1, 4, 2]) * 1e-4, np.array([1, 6, 1, 1, 2]) * 1e-4
    np.savez(path, **{**kept, "distance_raw": noisy, "distance_extended": without})
    with serve(place.settings) as client, browser.new_context() as context:
        page = Page(context.new_page(), client)
        page.open()
        assert page.settled()["view"]["sequence"] == "drag-01"
        assert page.frame == 3


def test_panel_says_what_the_data_can_tell(page: Page) -> None:
    page.open()
    told = page.page.inner_text(".told").replace("\N{NO-BREAK SPACE}", " ")
    assert "Tool radius" in told and "0.12 mm" in told and "like tool offset (83 %)" in told
    assert (
        "1.4 times where it shows best, at half of the places not at any size" in told
        and "like nothing else" in told
    )
    assert "45 % of the change by edge -x, extent 14 mm" in told


def test_panel_says_what_the_controls_gave_and_what_to_push_next(page: Page) -> None:
    page.open()
    shown = page.page.inner_text("#panel").replace("\N{NO-BREAK SPACE}", " ")
    assert (
        "1 % of the gain left" in shown
        and "70 % of the gain left" in shown
        and "says nothing" in shown
    )
    assert "Stiff inclusion: it may not come of the pushes" in shown
    assert "Press 6 mm deep on the top at (12, -8) mm" in shown and "94 % likely to decide" in shown
    assert "Measure the block with a calliper" in shown


def test_report_is_saved_as_one_file_and_shows_every_sequence(
    page: Page, run_name: str, tmp_path: Path
) -> None:
    page.open()
    rows = page.page.locator(".comparison tbody tr")
    page.until(lambda: rows.count() == 2)
    assert rows.nth(1).inner_text().split()[:2] == ["drag-01", "test"]
    with page.page.expect_download() as download:
        page.page.get_by_role("link", name="Save as one file").click()
    assert download.value.suggested_filename == f"{run_name}.html"
    download.value.save_as(tmp_path / "report.html")
    page.page.goto((tmp_path / "report.html").as_uri())
    assert page.page.locator("h1").inner_text().startswith("The simulation misses a stiff lump")
    assert page.page.locator("svg").first.bounding_box()["width"] > 300
    assert page.trouble == []


def test_another_diagnosis_of_the_same_data_is_put_beside_it(
    browser: Any, serve: Any, place: Any, run_name: str
) -> None:
    shutil.copytree(place.runs / run_name, place.runs / "another")
    with serve(place.settings) as client, browser.new_context() as context:
        page = Page(context.new_page(), client)
        page.open()
        page.page.get_by_label("Compare with another diagnosis").select_option(index=1)
        heads = page.page.locator(".comparison thead th")
        page.until(
            lambda: (
                heads.all_inner_texts()[2:]
                == ["this: stiff inclusion", "the other: stiff inclusion", "floor"]
            )
        )
        assert page.trouble == []


def test_scrubbing_stepping_and_playing_move_the_scene(page: Page) -> None:
    page.open()
    sums = set()
    for key, frame in (
        ("Home", 0),
        ("ArrowRight", 1),
        ("ArrowRight", 2),
        ("ArrowLeft", 1),
        ("End", 4),
    ):
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
    page.until(lambda: page.page.is_hidden("#legend"))
    page.page.click("[data-colour=extended]")
    page.until(
        lambda: page.held["view"]["colour"] == "extended" and page.page.is_visible("#legend")
    )
    page.page.select_option("#legend select", "manual")
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
        boxes = [
            page.page.locator(name).bounding_box()
            for name in (".rail", ".toolbar", ".scene", ".timeline", "#panel")
        ]
        for i, a in enumerate(boxes):
            for b in boxes[i + 1 :]:
                apart = a["x"] + a["width"] <= b["x"] + 0.5 or b["x"] + b["width"] <= a["x"] + 0.5
                assert (
                    apart
                    or a["y"] + a["height"] <= b["y"] + 0.5
                    or b["y"] + b["height"] <= a["y"] + 0.5
                )
        assert (
            page.page.evaluate(OVERFLOWING, [".toolbar", ".transport", ".panel", ".rail-body"])
            == []
        )


def test_broken_dataset_is_told_where_it_is_chosen(page: Page, shared_place: Any) -> None:
    shutil.copytree(
        shared_place.datasets / "small", shared_place.datasets / "worse", dirs_exist_ok=True
    )
    (shared_place.datasets / "worse" / "touches.csv").unlink()
    page.open()
    page.page.click("#datasets >> text=worse")
    page.page.wait_for_selector(".note-card.bad")
    assert "touches.csv" in page.page.inner_text(".note-card.bad")
    page.trouble = [text for text in page.trouble if "422" not in text]


def test_empty_server_says_what_to_do(browser: Any, serve: Any, tmp_path: Path) -> None:
    with serve(
        Settings(runs=tmp_path / "runs", datasets=tmp_path / "datasets", preload=())
    ) as client:
        context = browser.new_context()
        page = context.new_page()
        page.goto(str(client.base_url))
        page.wait_for_selector(".empty-panel")
        assert "palpate demo" in page.inner_text(".empty-panel")
        assert "None yet" in page.inner_text("#runs")
        context.close()
