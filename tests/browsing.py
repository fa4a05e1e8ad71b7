"""A page in a real Chromium, operated as by a person, for tests."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from typing import Any

import httpx
import pytest

__all__ = ["CHROMIUM", "FLAGS", "NEEDS_CHROMIUM", "Page"]

CHROMIUM = (
    shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
)
FLAGS = [
    *(
        "--headless=new",
        "--no-sandbox",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
        "--disable-dev-shm-usage",
    ),
    *(
        "--disable-background-timer-throttling",
        "--disable-renderer-backgrounding",
        "--disable-backgrounding-occluded-windows",
    ),
]
NODES = "() => Object.keys((window.__viserMutable || {}).nodeRefFromName || {})"
VISIBLE = """() => Object.entries(window.__viserMutable.nodeRefFromName).filter(([name, node]) => {
  for (let at = node; at; at = at.parent) if (!at.visible) return false;
  return true;
}).map(([name]) => name)"""
NEEDS_CHROMIUM = [
    pytest.mark.browser,
    pytest.mark.skipif(
        CHROMIUM is None, reason="no Chromium on this machine: install the package chromium"
    ),
]


class Page:
    """The page in a browser, and the server's state of it."""

    def __init__(self, page: Any, client: httpx.Client) -> None:
        self.page, self.client = page, client
        self.trouble: list[str] = []
        page.on("pageerror", lambda error: self.trouble.append(str(error)))
        page.on(
            "console",
            lambda message: self.trouble.append(message.text) if message.type == "error" else None,
        )

    def until(self, true: Callable[[], bool], seconds: float = 60.0) -> None:
        end = time.monotonic() + seconds
        while not true():
            assert time.monotonic() < end, f"waited in vain; trouble: {self.trouble}"
            self.page.wait_for_timeout(50)

    def open(self, path: str = "/") -> None:
        self.page.goto(f"{self.client.base_url}{path.lstrip('/')}")
        self.until(
            lambda: (
                self.viewer is not None
                and any(name.startswith("/mesh/") for name in self.viewer.evaluate(NODES))
            )
        )
        self.settled()

    @property
    def viewer(self) -> Any:
        return next((frame for frame in self.page.frames if "/viser/" in frame.url), None)

    @property
    def held(self) -> dict[str, Any]:
        """The server's state of this page."""
        identity = self.page.evaluate("sessionStorage.getItem('palpate.page')")
        answer = self.client.get(f"/api/sessions/{identity}/state")
        return answer.json() if answer.status_code == 200 else {"view": {}, "drawn": {}}

    @property
    def frame(self) -> int:
        return int(self.page.input_value("#scrub"))

    def settled(self) -> dict[str, Any]:
        """Wait until the server has the frame that the page shows."""
        found: dict[str, Any] = {}

        def there() -> bool:
            found.update(self.held)
            return (found["view"] or {}).get("frame") == self.frame

        self.until(there)
        return found

    def visible(self) -> set[str]:
        return {name for name in self.viewer.evaluate(VISIBLE) if name}
