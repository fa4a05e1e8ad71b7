"""Manual registration in a real Chromium: clicked from a bad start to under half a millimetre, and everything around it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browsing import NEEDS_CHROMIUM, Page
from small_dataset import SIZE, ply_bytes, write_valid_dataset

from app.clicking import Phantom
from app.settings import Settings
from core.frames import Transform
from core.synthetic.camera import Scene, place_camera

pytestmark = NEEDS_CHROMIUM

X, Y, Z = SIZE[0] / 2, SIZE[1] / 2, SIZE[2]
CORNERS = [np.array([X, Y, Z]), np.array([-X, Y, Z]), np.array([-X, -Y, Z])]
READY = "() => ['/cloud', '/block'].every(name => window.__viserMutable?.nodeRefFromName?.[name])"
PIXEL = """([x, y, z]) => {
  const { nodeRefFromName, camera, canvas } = window.__viserMutable, block = nodeRefFromName['/block'];
  const place = block.localToWorld(new block.position.constructor(x, y, z)).project(camera);
  return [(place.x + 1) / 2 * canvas.clientWidth, (1 - place.y) / 2 * canvas.clientHeight];
}"""
NODES = "() => Object.keys(window.__viserMutable.nodeRefFromName)"


@dataclass
class Bench:
    """The panel of one page, with what a person does there; `true` is phantom_from_camera."""

    page: Page
    true: Transform

    @property
    def values(self) -> dict[str, Any]:
        """What the page keeps."""
        found = self.page.page.evaluate(
            "() => { const k = JSON.parse(localStorage.getItem('palpate.register')); return k.of[k.dataset]; }"
        )
        return dict(found)

    @property
    def text(self) -> str:
        return str(self.page.page.inner_text("#panel-register")).replace("\N{NO-BREAK SPACE}", " ")

    def open(self) -> None:
        self.page.page.goto(str(self.page.client.base_url))
        self.page.page.click("#tab-register")
        self.page.until(lambda: self.frame is not None and self.frame.evaluate(READY))

    @property
    def frame(self) -> Any:
        return next((frame for frame in self.page.page.frames if frame.url.endswith("-register")), None)

    def shown(self) -> Transform:
        """By which pose the cloud is drawn, as the server says it."""
        values = self.values
        asked = {"dataset": "small", "mode": values["mode"], "start": values["start"], "over": values["over"]}
        asked["pairs"] = [{"cloud": pair["cloud"], "mesh": pair["mesh"]} for pair in values["pairs"]]
        identity = self.page.page.evaluate("sessionStorage.getItem('palpate.page')")
        return Transform.from_matrix(self.page.client.post(f"/api/sessions/{identity}/registering", json=asked).json()["pose"])

    def click(self, place: Any) -> None:
        """A real click on a place [m] of the scene, once the camera stands still."""
        seen: list[tuple[float, float]] = []
        while len(seen) < 3 or np.ptp(seen[-3:], axis=0).max() > 0.2:
            seen.append(self.frame.evaluate(PIXEL, [float(x) for x in place]))
            self.page.page.wait_for_timeout(150)
        left, top = seen[-1]
        box = self.page.page.locator("#register-viewer").bounding_box()
        self.page.page.mouse.click(box["x"] + left, box["y"] + top)

    def pair(self, corner: Any, mesh: Any = None) -> None:
        """Click a corner on the cloud, a little inside of it, and then on the phantom."""
        count = len(self.values["pairs"])
        self.click(self.shown().apply(self.true.inverse().apply(corner * np.array([0.97, 0.97, 1.0]))))
        self.page.until(lambda: len(self.values["pairs"]) == count + 1 and self.values["mode"] == "mesh")
        self.click(corner if mesh is None else mesh)
        self.page.until(lambda: self.values["pairs"][-1]["mesh"] is not None)


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Transform]:
    """A dataset whose rest cloud a virtual depth camera took of the block as stated."""
    folder = tmp_path_factory.mktemp("by-hand")
    write_valid_dataset(folder / "datasets" / "small")
    rng = np.random.default_rng(5)
    block = Phantom(np.zeros((1, 3)), SIZE, {}, None)
    surface = (block.vertices, block.faces)
    camera = place_camera(rng, SIZE, surface, np.array([1.0, -1.0]), 2600, 0.7e-3)
    cloud = camera.cloud(Scene(surface, None, np.array([0.0, 0.0, -1.0]), 1.0), rng)
    (folder / "datasets" / "small" / "rest.ply").write_bytes(ply_bytes(cloud))
    return folder, camera.phantom_from_camera


@pytest.fixture
def bench(browser: Any, serve: Any, home: tuple[Path, Transform]) -> Iterator[Bench]:
    settings = Settings(runs=home[0] / "runs", datasets=home[0] / "datasets", preload=())
    with serve(settings) as client, browser.new_context(viewport={"width": 1440, "height": 900}) as context:
        found = Bench(Page(context.new_page(), client), home[1])
        found.open()
        yield found
        assert [text for text in found.page.trouble if "422" not in text and "409" not in text] == []


def off(found: Any, true: Transform) -> tuple[float, float]:
    """How far a pose puts the middle of the top from where it is [m], and by how much it is turned [degrees]."""
    motion = true @ Transform.from_matrix(found).inverse()
    top = np.array([0.0, 0.0, Z])
    return float(np.linalg.norm(motion.apply(top) - top)), float(np.degrees(np.linalg.norm(motion.rotation_vector)))


def test_three_clicked_pairs_lead_from_a_bad_start_to_half_a_millimetre_and_the_result_is_kept_and_offered(bench: Bench) -> None:
    page = bench.page.page
    page.select_option(".register-bar select", "camera")
    bench.page.until(lambda: bench.values["start"] == "camera")
    shift, turn = off(bench.shown().matrix, bench.true)
    assert shift > 0.05 and turn > 30.0
    page.wait_for_timeout(800)  # the camera turns
    for corner in CORNERS:
        bench.pair(corner)
    bench.page.until(lambda: "3 pairs fit to" in bench.text)
    assert all(0.0 < float(text) < 5.0 for text in page.locator("[data-residual]").all_inner_texts())
    bench.page.until(lambda: {"/pairs/0/cloud", "/pairs/2/mesh", "/lines/1"} <= set(bench.frame.evaluate(NODES)))
    page.keyboard.press("Enter")
    page.wait_for_selector("#register-after", timeout=120_000)
    before, after = (
        float(page.inner_text(f"#register-{name}").split("\N{NO-BREAK SPACE}")[0].split(" ")[0]) for name in ("before", "after")
    )
    assert after < before
    shift, turn = off(bench.values["found"]["registration"]["phantom_from_camera"], bench.true)
    assert shift < 0.5e-3 and turn < 0.5
    page.fill("#register-name", "clicked")
    page.get_by_role("button", name="Accept", exact=True).click()
    page.wait_for_selector(".note-card.good", timeout=120_000)
    kept = bench.page.client.get("/api/datasets/small/registrations/clicked").json()
    assert np.allclose(off(kept["registration"]["phantom_from_camera"], bench.true), (shift, turn), atol=1e-5)
    page.click("text=Open the dataset")
    page.select_option("#panel [name=registration]", "clicked")
    page.click("text=Register by hand")
    page.keyboard.press("Escape")
    bench.page.until(lambda: "Refine by ICP" in bench.text)


def test_pairs_are_moved_by_keys_undone_left_out_and_there_after_a_reload(bench: Bench) -> None:
    page = bench.page.page
    bench.pair(CORNERS[0])
    bench.pair(CORNERS[1], np.array([-X + 0.012, Y - 0.01, Z]))
    assert [pair["landmark"] for pair in bench.values["pairs"]] == ["corner_0", None]
    page.keyboard.press("m")
    page.keyboard.press("2")
    start = bench.values["pairs"][1]["mesh"]
    page.keyboard.press("ArrowRight")
    bench.page.until(lambda: bench.values["pairs"][1]["mesh"] != start)
    assert 1e-4 < np.linalg.norm(np.array(bench.values["pairs"][1]["mesh"]) - start) < 4e-4
    page.keyboard.press("Control+z")
    assert bench.values["pairs"][1]["mesh"] == start
    bench.click(np.array([-X + 0.02, Y - 0.01, Z]))  # the chosen end goes where it is clicked anew
    bench.page.until(lambda: abs(bench.values["pairs"][1]["mesh"][0] + X - 0.02) < 3e-4)
    pairs = bench.values["pairs"]
    bench.open()
    assert bench.values["pairs"] == pairs and "1 more pair" in bench.text
    page.keyboard.press("Delete")
    assert len(bench.values["pairs"]) == 1
    page.click("text=Clear")
    assert bench.values["pairs"] == []


def test_what_is_wrong_with_pairs_is_said_at_the_pair_and_mended_there(bench: Bench) -> None:
    page = bench.page.page
    for corner, mesh in zip(CORNERS, (CORNERS[1], CORNERS[0], CORNERS[2]), strict=True):
        bench.pair(corner, mesh)
    page.wait_for_selector("[data-pair='0'].bad")
    assert "mirrored" in bench.text and "exchanging the mesh points of pairs 1 and 2 would fit" in bench.text
    assert page.locator("tr[data-pair].bad").count() == 2
    assert page.get_by_role("button", name="Refine by ICP").is_disabled()
    page.click("text=Exchange them")
    bench.page.until(lambda: "3 pairs fit to" in bench.text)
    page.click("[data-landmark=corner_1]")
    bench.page.until(lambda: len(bench.values["pairs"]) == 4)
    bench.click(np.array([0.0, 0.0, Z]))
    bench.page.until(lambda: "There is nothing of the cloud under this click" in bench.text)
