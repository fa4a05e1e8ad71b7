"""The scene in a real Chromium: layers and their looks, models side by side, a section, views, a
still and a clip; all kept.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from browsing import NEEDS_CHROMIUM, Page
from PIL import Image

pytestmark = NEEDS_CHROMIUM
CAMERA = "() => window.__viserMutable.camera.position.toArray()"


def figures(page: Page) -> set[str]:
    return set(page.held["drawn"]["figures"])


def layer(page: Page, name: str) -> Any:
    return page.page.locator(f"[data-row={name}]")


def test_a_person_looks_at_everything_and_finds_it_so_on_the_next_visit(
    page: Page, tmp_path: Path
) -> None:
    page.open()
    page.page.click("#layers-button")
    for name in ("path", "lump", "extended"):
        layer(page, name).get_by_role("switch").check()
    page.until(
        lambda: {"path", "lump-0", "lump-0-interval", "extended-lines", "base"} <= figures(page)
    )
    assert "no stiff" not in (layer(page, "lump").get_attribute("title") or "")
    assert layer(page, "landmarks").get_by_role("switch").is_disabled()
    assert "does not say which landmarks" in (layer(page, "landmarks").get_attribute("title") or "")
    energy = layer(page, "raw").locator("option[value=energy]")
    assert energy.is_disabled() and "make it again" in (energy.get_attribute("title") or "")
    layer(page, "extended").locator("select").select_option("displacement")
    page.until(lambda: {"raw-displacement-00", "extended-displacement-00"} <= figures(page))
    assert "Displacement, mm" in page.page.inner_text("#legend")
    layer(page, "extended").get_by_label("Opacity of the extended model").fill("40")
    page.until(lambda: page.held["view"]["looks"]["extended"]["opacity"] == 0.4)
    page.page.screenshot(path=tmp_path / "layers.png")
    page.page.keyboard.press("Escape")
    assert page.page.is_hidden("#layers-panel")

    page.page.keyboard.press("b")
    page.until(lambda: {"/cloud-raw", "/cloud-extended", "/names/name-raw"} <= page.visible())
    page.page.screenshot(path=tmp_path / "side.png")
    page.page.keyboard.press("x")
    page.until(lambda: page.page.is_visible("#section-bar"))
    before = sum(page.held["drawn"]["triangles"].values())
    page.page.click("[data-axis=x]")
    page.page.locator("#section-bar input").fill("-20")
    page.until(lambda: page.held["view"]["section"] == {"axis": "x", "at": -0.02, "flip": False})
    assert sum(page.held["drawn"]["triangles"].values()) < before

    box = page.page.locator("#viewer").bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.page.mouse.move(*middle)
    page.page.mouse.down()
    page.page.mouse.move(middle[0] + 120, middle[1] - 30, steps=5)
    page.page.mouse.up()
    page.until(lambda: page.page.evaluate("localStorage.getItem('palpate.camera')") is not None)
    turned = page.viewer.evaluate(CAMERA)
    page.open()
    page.until(lambda: "/cloud-raw" in page.visible())
    page.until(lambda: page.viewer.evaluate(CAMERA) == pytest.approx(turned, abs=2e-3))
    assert (
        page.held["view"]["section"]["at"] == -0.02
        and page.held["view"]["looks"]["extended"]["opacity"] == 0.4
    )
    page.page.click("#layers-button")
    page.page.get_by_role("button", name="As at first").click()
    page.until(lambda: page.held["view"]["looks"] == {} and page.held["view"]["section"] is None)


def test_views_stills_and_clips(page: Page, tmp_path: Path) -> None:
    page.open()
    places = []
    for key in "1230":
        before = page.viewer.evaluate(CAMERA)
        page.page.keyboard.press(key)
        page.until(lambda before=before: page.viewer.evaluate(CAMERA) != before)  # type: ignore[misc]
        places.append(page.viewer.evaluate(CAMERA))
    top, front, side, _ = (
        places  # the viewer looks along its own axes: y is upwards, the front is +x
    )
    assert top[1] > 5 * abs(top[0]) and front[0] > 5 * abs(front[2]) and -side[2] > 5 * abs(side[0])

    with page.page.expect_download(timeout=60_000) as download:
        page.page.click("#still")
    assert download.value.suggested_filename == "palpate-drag-01-3.png"
    download.value.save_as(tmp_path / "still.png")
    box = page.page.locator("#viewer").bounding_box()
    with Image.open(tmp_path / "still.png") as still:
        assert still.size == (round(box["width"]), round(box["height"]))
        assert len(still.convert("RGB").getcolors(2**20) or ()) > 50

    page.page.keyboard.press("i")
    page.page.keyboard.press("End")
    page.page.keyboard.press("o")
    page.page.keyboard.press("Home")
    with page.page.expect_download(timeout=60_000) as download:
        page.page.click("#clip")
    download.value.save_as(tmp_path / "clip.gif")
    with Image.open(tmp_path / "clip.gif") as clip:
        assert (getattr(clip, "n_frames", 1), clip.info["duration"]) == (3, 200)
    page.until(lambda: page.frame == 0)
    held: list[Any] = []

    def hold(route: Any) -> None:
        """A picture that takes long."""
        held.append(route)

    page.page.route("**/still.png*", hold)
    page.page.click("#clip")
    page.until(lambda: bool(held))
    page.page.get_by_role("button", name="Cancel").click()
    page.until(lambda: page.page.is_hidden("#clip-bar") and page.frame == 0)
