"""A sweep in a real Chromium: chosen, started, watched and stopped with the mouse and the
keyboard."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from swept import write_swept_phantom

from palpate.app.settings import Settings

playwright = pytest.importorskip("playwright.sync_api")

CHROMIUM = (
    shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
)
FLAGS = [
    "--headless=new",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage",
]
LONG = 600_000

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(
        CHROMIUM is None, reason="no Chromium on this machine: install the package chromium"
    ),
]


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folders of a server with one dataset, whose tool is larger than stated."""
    folder = tmp_path_factory.mktemp("swept")
    write_swept_phantom(folder / "datasets" / "phantom")
    return folder


@pytest.fixture
def page(home: Path, serve: Any) -> Iterator[Any]:
    settings = Settings(runs=home / "runs", datasets=home / "datasets", preload=())
    with serve(settings) as client, playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.trouble = []
        page.on("pageerror", lambda error: page.trouble.append(str(error)))
        page.client = client
        page.goto(str(client.base_url))
        page.click("#tab-sweep")
        page.wait_for_selector("text=Start the sweep")
        yield page
        assert not page.trouble
        browser.close()


def ask(page: Any, name: str, low: str, high: str, row: int = 0) -> None:
    """Choose a parameter and its bounds, as shown."""
    page.locator("select[aria-label=Parameter]").nth(row).select_option(name)
    page.fill(f"input[aria-label='from of {name}']", low)
    page.fill(f"input[aria-label='to of {name}']", high)


def begin_random(page: Any, points: int) -> None:
    """A random sweep over the tool's radius, until its first point is drawn."""
    ask(page, "tool_radius.radius", "4", "8")
    page.select_option("select[name=method]", "random")
    page.fill("input[name=points]", str(points))
    page.fill("input[name=frames]", "2")
    page.click("text=Start the sweep")
    page.wait_for_selector("#panel-sweep circle[data-point]", timeout=LONG)


def newest(client: httpx.Client) -> str:
    return str(client.get("/api/sweeps").json()[0]["id"])


def test_what_is_wrong_is_said_in_the_form_and_then_a_sweep_is_followed_to_its_end(
    page: Any,
) -> None:
    ask(page, "tool_radius.radius", "4", "0.0001")
    page.fill("input[name=frames]", "2")
    page.click("text=Start the sweep")
    assert "no range" in page.locator("#panel-sweep [role=alert]").inner_text()
    ask(page, "tool_radius.radius", "4", "8")
    page.fill("input[name=steps]", "5")
    page.press("input[name=steps]", "Enter")
    page.wait_for_selector("[data-direction]", timeout=LONG)
    headline = page.locator("#panel-sweep h1").inner_text()
    assert "tool radius 6.00" in headline and "as stated" in headline
    assert page.get_attribute("#panel-sweep [data-stated]", "data-stated") == "0.005"
    assert page.locator("#panel-sweep circle[data-point]").count() == 5
    assert page.get_attribute("[data-direction='tool_radius.radius']", "data-flat") == "false"


def test_two_parameters_are_a_map_and_a_flat_one_is_called_flat(page: Any) -> None:
    ask(page, "tool_radius.radius", "4", "8")
    page.click("text=Add a parameter")
    ask(page, "young_modulus.E", "2", "200", row=1)
    page.fill("input[name=steps]", "3")
    page.fill("input[name=frames]", "2")
    page.click("text=Start the sweep")
    page.wait_for_selector("[data-direction='young_modulus.E'][data-flat=true]", timeout=LONG)
    assert page.locator("#panel-sweep rect[data-point]").count() == 9
    assert "flat" in page.locator("[data-direction='young_modulus.E']").inner_text()
    headline = page.locator("#panel-sweep h1").inner_text()
    assert "cannot tell young modulus" in headline and "kPa" not in headline


def test_a_long_one_is_stopped_and_its_points_are_there_after_a_reload(page: Any) -> None:
    begin_random(page, 400)
    page.click("#panel-sweep >> text=Stop")
    page.wait_for_selector("[data-state=cancelled]")
    page.wait_for_timeout(1500)
    shown = page.locator("#panel-sweep circle[data-point]").count()
    identity = newest(page.client)
    page.reload()
    page.click("#tab-sweep")
    page.click(f"[data-sweep='{identity}']")
    page.wait_for_selector("#panel-sweep circle[data-point]")
    assert page.locator("#panel-sweep circle[data-point]").count() == shown < 400


def wait_for(true: Callable[[], bool], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.1)


def test_a_browser_that_is_killed_in_the_middle_of_a_sweep_loses_no_point(
    page: Any, tmp_path: Path
) -> None:
    other = subprocess.Popen(
        [
            str(CHROMIUM),
            *FLAGS,
            "--remote-debugging-port=0",
            f"--user-data-dir={tmp_path}",
            "about:blank",
        ],
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        port = tmp_path / "DevToolsActivePort"
        wait_for(lambda: port.exists() and len(port.read_text().split()) == 2)
        # The same playwright: only one may run in a thread.
        doomed = page.context.browser.browser_type.connect_over_cdp(
            f"http://127.0.0.1:{port.read_text().split()[0]}"
        ).new_page()
        doomed.goto(str(page.client.base_url))
        doomed.click("#tab-sweep")
        begin_random(doomed, 24)
        identity = newest(page.client)
    finally:
        os.killpg(other.pid, signal.SIGKILL)
        other.wait()
    wait_for(lambda: page.client.get(f"/api/jobs/{identity}").json()["state"] == "done", 600.0)
    page.reload()
    page.click("#tab-sweep")
    page.click(f"[data-sweep='{identity}']")
    page.wait_for_selector("[data-state=done]")
    kept = page.client.get(f"/api/sweeps/{identity}/points").json()["points"]
    assert sum(point["kind"] == "search" for point in kept) == 24
    shown = page.locator("#panel-sweep circle[data-point]").evaluate_all(
        "all => all.map((one) => +one.dataset.point)"
    )
    assert sorted(shown) == sorted(point["number"] for point in kept if point["values"])


def test_what_loads_late_does_not_take_the_front(page: Any) -> None:
    def answer_late(route: Any) -> None:
        time.sleep(0.5)
        route.continue_()

    page.route("**/api/runs", answer_late)
    page.reload()
    page.click("#tab-sweep")
    page.wait_for_selector("#panel .empty-panel", state="attached")
    page.wait_for_selector("#panel-sweep >> text=Start the sweep", state="visible")
    assert page.get_attribute("#tab-sweep", "aria-selected") == "true"


def test_a_swept_place_is_of_a_lump_and_its_point_is_replayed(page: Any, home: Path) -> None:
    page.locator("select[aria-label=Parameter]").select_option("stiff_inclusion.x")
    ends = [
        float(page.input_value(f"input[aria-label='{end} of stiff_inclusion.x']"))
        for end in ("from", "to")
    ]
    size = page.client.get("/api/datasets/phantom").json()["size"]
    assert ends == pytest.approx([-size[0] * 500, size[0] * 500], rel=1e-3)
    held = page.locator("input[aria-label^='Held: ']")
    assert held.count() == 4
    page.fill("input[aria-label='Held: stiff_inclusion.stiffness_ratio']", "9")
    page.fill("input[name=steps]", "2")
    page.fill("input[name=frames]", "1")
    page.click("text=Start the sweep")
    page.wait_for_selector("[data-direction='stiff_inclusion.x']", timeout=LONG)
    assert "stiffness ratio 9" in page.locator("#panel-sweep").inner_text()
    assert "Stiff inclusion: x:" in page.locator("[data-direction]").inner_text()
    point = page.locator("#panel-sweep circle[data-point]").first
    number = point.get_attribute("data-point")
    point.click()
    page.wait_for_selector(f"[data-chosen='{number}']")
    page.click("text=Replay this point")
    page.wait_for_selector("#panel-jobs:not([hidden])")
    jobs = page.client.get("/api/jobs").json()
    assert jobs[0]["kind"] == "replay"
    wait_for(lambda: page.client.get(f"/api/jobs/{jobs[0]['id']}").json()["state"] == "done", 600.0)
    model = json.loads((home / "runs" / jobs[0]["id"] / "model.json").read_text())
    lump = model["effects"][0]["parameters"]
    assert lump["stiffness_ratio"] == 9.0 and abs(lump["x"]) == size[0] / 2
