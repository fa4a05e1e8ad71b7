"""The panel of manual registration in a real Chromium, for tests."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from browsing import Page
from small_dataset import SIZE

from palpate.foundation.frames import Transform

__all__ = ["CORNERS", "NODES", "RegisterPanel", "X", "Y", "Z", "pose_errors"]

X, Y, Z = SIZE[0] / 2, SIZE[1] / 2, SIZE[2]
CORNERS = [np.array([X, Y, Z]), np.array([-X, Y, Z]), np.array([-X, -Y, Z])]
READY = "() => ['/cloud', '/block'].every(name => window.__viserMutable?.nodeRefFromName?.[name])"
PIXEL = """([x, y, z]) => {
  const { nodeRefFromName, camera, canvas } = window.__viserMutable;
  const block = nodeRefFromName['/block'];
  const place = block.localToWorld(new block.position.constructor(x, y, z)).project(camera);
  return [(place.x + 1) / 2 * canvas.clientWidth, (1 - place.y) / 2 * canvas.clientHeight];
}"""
NODES = "() => Object.keys(window.__viserMutable.nodeRefFromName)"


@dataclass
class RegisterPanel:
    """The panel of one page, operated as by a person; `true` is phantom_from_camera."""

    page: Page
    true: Transform
    dataset: str = "small"

    @property
    def values(self) -> dict[str, Any]:
        """Values that the page stores."""
        found = self.page.page.evaluate(
            "() => { const k = JSON.parse(localStorage.getItem('palpate.register'));"
            " return k.of[k.dataset]; }"
        )
        return dict(found)

    @property
    def text(self) -> str:
        return str(self.page.page.inner_text("#panel-register")).replace("\N{NO-BREAK SPACE}", " ")

    def open(self) -> None:
        self.page.page.goto(str(self.page.client.base_url))
        self.page.page.click("#tab-register")
        self.page.until(self.is_ready)

    def is_ready(self) -> bool:
        """Whether cloud and phantom are drawn."""
        return self.frame is not None and bool(self.frame.evaluate(READY))

    @property
    def frame(self) -> Any:
        return next(
            (frame for frame in self.page.page.frames if frame.url.endswith("-register")), None
        )

    def shown(self) -> Transform:
        """Pose of the drawn cloud, by the server."""
        values = self.values
        view = {
            "dataset": self.dataset,
            "mode": values["mode"],
            "start": values["start"],
            "over": values["over"],
        }
        view["pairs"] = [{"cloud": pair["cloud"], "mesh": pair["mesh"]} for pair in values["pairs"]]
        identity = self.page.page.evaluate("sessionStorage.getItem('palpate.page')")
        return Transform.from_matrix(
            self.page.client.post(f"/api/sessions/{identity}/registering", json=view).json()["pose"]
        )

    def click(self, place: Any) -> None:
        """Click a place [m] of the scene, once the camera is at rest."""
        self.page.page.mouse.click(*self.pixel(place))

    def drag(self, start: Any, end: Any) -> None:
        """Drag from one place [m] of the scene to another."""
        mouse = self.page.page.mouse
        (x, y), (to_x, to_y) = self.pixel(start), self.pixel(end)
        mouse.move(x, y)
        self.page.page.wait_for_timeout(300)
        mouse.down()
        for share in np.linspace(0.1, 1.0, 10):
            mouse.move(x + share * (to_x - x), y + share * (to_y - y))
            self.page.page.wait_for_timeout(60)
        mouse.up()

    def pixel(self, place: Any) -> tuple[float, float]:
        """Position of a place [m] of the scene on the page, once the camera is at rest."""
        seen: list[tuple[float, float]] = []
        while len(seen) < 3 or np.ptp(seen[-3:], axis=0).max() > 0.2:
            seen.append(self.frame.evaluate(PIXEL, [float(x) for x in place]))
            self.page.page.wait_for_timeout(150)
        left, top = seen[-1]
        box = self.page.page.locator("#register-viewer").bounding_box()
        return float(box["x"] + left), float(box["y"] + top)

    def pair(self, corner: Any, mesh: Any = None, inside: float = 0.97) -> None:
        """Click a corner on the cloud, slightly inside of it, and then on the phantom."""
        count = len(self.values["pairs"])
        self.click(
            self.shown().apply(self.true.inverse().apply(corner * np.array([inside, inside, 1.0])))
        )
        self.page.until(
            lambda: len(self.values["pairs"]) == count + 1 and self.values["mode"] == "mesh"
        )
        self.click(corner if mesh is None else mesh)
        self.page.until(lambda: self.values["pairs"][-1]["mesh"] is not None)


def pose_errors(found: Any, true: Transform) -> tuple[float, float]:
    """Errors of a pose: of the middle of the top [m], and of the rotation [degrees]."""
    motion = true @ Transform.from_matrix(found).inverse()
    top = np.array([0.0, 0.0, Z])
    return float(np.linalg.norm(motion.apply(top) - top)), float(
        np.degrees(np.linalg.norm(motion.rotation_vector))
    )
