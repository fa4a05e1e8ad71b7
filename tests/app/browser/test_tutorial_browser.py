"""The tutorial of the page's help, walked in Chromium: from an archive to an accepted registration
and a sweep that uses it.
"""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browsing import NEEDS_CHROMIUM, Page
from register_panel import CORNERS, RegisterPanel, pose_errors

from palpate.app.settings import Settings
from palpate.foundation.frames import Transform
from palpate.synthetic import HiddenEffect, Scenario, make_dataset

pytestmark = [*NEEDS_CHROMIUM, pytest.mark.slow]
PICTURES = os.environ.get("PALPATE_PICTURES")
"""Folder for pictures of each step, where a person wants to look at them."""


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_help_leads_from_an_archive_to_a_registration_and_a_sweep(
    browser: Any, serve: Any, tmp_path: Path, theme: Any
) -> None:
    hidden = HiddenEffect("tool_radius", {"radius": 6e-3})
    made = tmp_path / "phantom"
    make_dataset(made, Scenario(effects=(hidden,), sequences=("poke-top-01",)), 3)
    truth = json.loads((tmp_path / "phantom.truth.json").read_text())
    archive = shutil.make_archive(str(tmp_path / "bench-07"), "zip", tmp_path, "phantom")
    settings = Settings(runs=tmp_path / "runs", datasets=tmp_path / "datasets", preload=())
    with (
        serve(settings) as client,
        browser.new_context(viewport={"width": 1440, "height": 900}, color_scheme=theme) as context,
    ):
        page = Page(context.new_page(), client)
        walk = Walk(page, theme)
        walk.help()
        walk.import_dataset(archive)
        walk.register(
            RegisterPanel(
                page,
                Transform.from_matrix(np.array(truth["registration"]["phantom_from_camera"])),
                "bench-07",
            )
        )
        walk.sweep()
        job = client.get("/api/jobs").json()[0]
        assert (job["kind"], job["state"]) == ("sweep", "done")
        assert page.trouble == []


class Walk:
    """The steps as the help says them."""

    def __init__(self, page: Page, theme: str) -> None:
        self.page, self.theme = page, theme

    def picture(self, name: str) -> None:
        if PICTURES:
            self.page.page.screenshot(path=f"{PICTURES}/{name}-{self.theme}.png")

    def help(self) -> None:
        self.page.page.goto(str(self.page.client.base_url))
        self.page.page.wait_for_selector(".empty-panel")
        self.page.page.keyboard.press("?")
        assert "ten minutes" in self.page.page.inner_text("#help h1")
        assert {"C, M", "Space"} <= set(self.page.page.locator("#help dt").all_inner_texts())
        self.picture("help")
        self.page.page.keyboard.press("Escape")

    def import_dataset(self, archive: str) -> None:
        page = self.page.page
        page.click("#import")
        page.click("text=Bring its archive or folder")
        page.set_input_files("input[name=file]", archive)
        assert page.input_value("input[name=name]") == "bench-07"
        self.picture("import")
        page.get_by_role("button", name="Import", exact=True).click()
        page.wait_for_selector("#datasets >> text=bench-07", timeout=120_000)
        page.click("#tab-jobs")
        page.click("[data-open=dataset]")
        page.wait_for_selector("text=Every file was read")
        self.picture("dataset")

    def register(self, bench: RegisterPanel) -> None:
        page = self.page.page
        page.click("text=Register by hand")
        self.page.until(bench.is_ready)
        page.select_option(".register-bar select", "camera")
        page.wait_for_timeout(1000)
        for corner in CORNERS:
            bench.pair(corner)
        self.page.until(lambda: "3 pairs fit to" in bench.text)
        self.picture("pairs")
        page.keyboard.press("Enter")
        page.wait_for_selector("#register-after", timeout=120_000)
        self.picture("icp")
        page.fill("#register-name", "clicked")
        page.get_by_role("button", name="Accept", exact=True).click()
        page.wait_for_selector(".note-card.good", timeout=120_000)
        shift, turn = pose_errors(
            bench.values["found"]["registration"]["phantom_from_camera"], bench.true
        )
        assert shift < 0.5e-3 and turn < 0.5

    def sweep(self) -> None:
        page = self.page.page
        page.click("#tab-sweep")
        page.select_option("#panel-sweep select[aria-label=Parameter]", "tool_radius.radius")
        page.fill("input[aria-label='from of tool_radius.radius']", "4")
        page.fill("input[aria-label='to of tool_radius.radius']", "8")
        page.fill("input[name=steps]", "5")
        page.fill("input[name=frames]", "4")
        page.select_option("#panel-sweep [name=registration]", "clicked")
        page.click("text=Start the sweep")
        page.wait_for_selector("[data-direction]", timeout=240_000)
        assert "radius 6 mm" in page.locator("#panel-sweep h1").inner_text()
        self.picture("sweep")
