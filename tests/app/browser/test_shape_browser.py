"""The page on a liver whose phantom frame is not in its middle, in a real Chromium: scene, layers,
section and timeline; the report; the pad of Live; registration by clicks.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from browsing import NEEDS_CHROMIUM, Page
from register_panel import RegisterPanel
from shape_run import LIVER, camera_over, liver, write_shape_dataset, write_shape_run

from palpate.app.drawing.free_surface import FreeSurface
from palpate.app.settings import Settings
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform

pytestmark = NEEDS_CHROMIUM
POINTS = """name => {
  const found = [];
  window.__viserMutable.nodeRefFromName[name].traverse(node => {
    found.push(...(node.geometry?.attributes.position?.array ?? []));
  });
  return found;
}"""
PROJECTED = """([x, y, z]) => {
  const { nodeRefFromName, camera } = window.__viserMutable;
  const node = nodeRefFromName['/mesh/raw-cut'];
  const place = node.localToWorld(new node.position.constructor(x, y, z)).project(camera);
  return [place.x, place.y];
}"""
CIRCLE = "c => [c.cx.baseVal.value, c.cy.baseVal.value]"
MARKS = [(0.02, -0.005), (-0.02, -0.008), (0.004, 0.012)]
"""Places from the middle of the body that the page's first view of Register shows [m]."""


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("liver")
    write_shape_dataset(folder / "datasets" / "liver")
    write_shape_run(folder / "runs" / LIVER, folder / "datasets" / "liver")
    return folder


@pytest.fixture(scope="module")
def client(serve: Any, home: Path) -> Iterator[httpx.Client]:
    settings = Settings(runs=home / "runs", datasets=home / "datasets", preload=())
    with serve(settings) as found:
        yield found


def points(page: Page, name: str) -> FloatArray:
    """Vertices (n, 3) of a node as the browser has them [m]."""
    return np.array(page.viewer.evaluate(POINTS, name)).reshape(-1, 3)


def test_section_hatching_and_view_are_those_of_the_body(page: Page) -> None:
    page.open()
    body = liver()
    page.page.click("#layers-button")
    for name in ("base", "lump"):
        page.page.locator(f"[data-row={name}]").get_by_role("switch").check()
    page.page.keyboard.press("Escape")
    page.page.click("[data-colour=plain]")
    page.page.keyboard.press("x")
    page.until(lambda: {"/mesh/raw-cut", "/mesh/lump-0", "/lines/base"} <= page.visible())
    face = points(page, "/mesh/raw-cut")
    assert np.ptp(face[:, 1]) < 1e-6 and np.ptp(face[:, 0]) > 0.9 * body.size[0]
    assert body.outside(face).max() < 1e-3
    # The body stands in the middle of the view, and not where its frame begins.
    middle = [float(x) for x in (body.low + body.high) / 2]
    page.until(lambda: np.abs(page.viewer.evaluate(PROJECTED, middle)).max() < 0.15)


def test_push_depth_is_on_the_timeline(client: httpx.Client) -> None:
    series = client.get(f"/api/runs/{LIVER}/sequences/p1").json()
    assert max(series["depth"]) == pytest.approx(4e-3, rel=0.02)
    assert series["touching"] == [[0, 4]]


def test_report_states_the_place_in_the_frame_of_the_file(page: Page, tmp_path: Path) -> None:
    page.open()
    page.until(lambda: "(12.3, -45.6, 78.9) mm" in page.page.inner_text("#panel"))
    with page.page.expect_download() as download:
        page.page.get_by_role("link", name="Save as one file").click()
    download.value.save_as(tmp_path / "report.html")
    assert "(12.3, -45.6, 78.9) mm" in (tmp_path / "report.html").read_text()


def test_pad_of_live_is_the_body_from_above_and_keeps_the_tool_over_it(page: Page) -> None:
    page.open()
    page.page.get_by_role("tab", name="Live").click()
    pad = page.page.locator("#live-pad")
    pad.wait_for()
    surface = liver().surface(2.5e-3)
    seen = FreeSurface.of(surface.vertices, surface.faces).height_map
    empty = np.isnan(seen.heights).mean()
    assert 0.1 < empty < 0.5  # a liver fills no rectangle
    box, drawn = pad.bounding_box(), page.page.locator("#live-pad .outline").bounding_box()
    ratio = drawn["width"] / drawn["height"]
    assert ratio == pytest.approx(np.divide(*liver().size[:2]), rel=0.05)
    places = []
    for share in (0.02, 0.5, 0.98):
        pad.click(position={"x": share * box["width"], "y": share * box["height"]})
        places.append(page.page.locator("#live-pad circle").evaluate(CIRCLE))
    for (x, y), share in zip(places, (0.02, 0.5, 0.98), strict=True):
        # The middle is kept, the corners become the nearest places of the outline.
        away = np.hypot(x - share * box["width"], y - share * box["height"])
        assert (away < 2.0) if share == 0.5 else (away > 20.0)
    depth = page.page.inner_text("#live-below")
    pad.focus()
    page.page.keyboard.press("ArrowLeft")
    assert page.page.inner_text("#live-below") == depth


def test_three_clicked_pairs_register_the_cloud_of_a_body_without_corners(
    browser: Any, client: httpx.Client
) -> None:
    with browser.new_context(viewport={"width": 1440, "height": 900}) as context:
        true = camera_over().phantom_from_camera
        found = RegisterPanel(Page(context.new_page(), client), true, "liver")
        found.open()
        page = found.page.page
        body = liver()
        page.wait_for_timeout(800)  # the camera turns
        middle = (body.low + body.high)[:2] / 2
        for x, y in middle + np.array(MARKS):
            place = np.array([x, y, float(body.heights(np.array([[x, y]]))[0])])
            found.pair(place, inside=1.0)
        found.page.until(lambda: "3 pairs fit to" in found.text)
        page.keyboard.press("Enter")
        page.wait_for_selector("#register-after", timeout=120_000)
        pose = Transform.from_matrix(found.values["found"]["registration"]["phantom_from_camera"])
        corners = body.vertices[::50]
        missed = np.linalg.norm((pose @ true.inverse()).apply(corners) - corners, axis=1)
        assert missed.max() < 1e-3
        assert found.page.trouble == []
