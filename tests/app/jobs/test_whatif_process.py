"""What if over REST and in a real Chromium, on a push whose tool is larger than stated."""

from __future__ import annotations

import json
import os
import shutil
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from browsing import Page
from recorded_run import RADIUS, SEQUENCE, write_recorded_run
from websockets.sync.client import connect

from palpate.app.jobs.whatif_process import FrameSolver
from palpate.app.settings import Settings
from palpate.app.storage.run_store import Run
from palpate.foundation.errors import RunError

playwright = pytest.importorskip("playwright.sync_api")
CHROMIUM = (
    shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
)
URL = f"/api/runs/large-tool-1/sequences/{SEQUENCE}/whatif"
LONG = 300_000
"""Longest wait for the page [ms], also on a machine that does other things."""
LARGER = {"effect": "tool_radius", "parameters": {"radius": RADIUS}}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("whatif")
    return write_recorded_run(place / "datasets", place / "runs")


@pytest.fixture(scope="module")
def there(run: Path, serve: Any) -> Iterator[httpx.Client]:
    with serve(
        Settings(runs=run.parent, datasets=run.parent.parent / "datasets", preload=())
    ) as client:
        yield client


def deepest(run: Path) -> int:
    return int(Run(run).replay(SEQUENCE)["tool_raw"][:, 2].argmin())


def test_beginnings_are_the_models_effects_and_the_catalogue(there: httpx.Client) -> None:
    found = there.get(URL).json()
    assert found["model"] == [LARGER]
    assert {"gravity", "stiff_inclusion"} <= {one["effect"] for one in found["beginnings"]}
    known = {
        one["name"]: [item["name"] for item in one["parameters"]]
        for one in there.get("/api/effects").json()
    }
    assert all(list(one["parameters"]) == known[one["effect"]] for one in found["beginnings"])
    assert "surface is stated" in found["impossible"]["geometry_local"]
    low, high = found["spans"]["stiff_inclusion"]["x"]
    assert low == -high < 0


def test_a_frame_is_solved_with_any_causes(there: httpx.Client, run: Path) -> None:
    frame = deepest(run)
    stated, larger = (
        there.post(URL, json={"frame": frame, "effects": rows}).json() for rows in ([], [LARGER])
    )
    assert stated["distance"] == pytest.approx(stated["distance_raw"], rel=5e-3)
    assert larger["distance"] == pytest.approx(larger["distance_extended"], rel=5e-3)
    assert larger["distance"] < stated["distance"] and larger["converged"]


@pytest.mark.parametrize(
    ("body", "status"),
    [
        ({"frame": 9999}, 404),
        ({"frame": -1}, 422),
        ({"frame": 1, "effects": [{"effect": "magic", "parameters": {}}]}, 422),
        ({"frame": 1, "effects": [{"effect": "tool_radius", "parameters": {"radius": 9.0}}]}, 422),
        (
            {"frame": 1, "effects": [{"effect": "tool_radius", "parameters": {"radius": "wide"}}]},
            422,
        ),
        ({"frame": 1, "effects": [LARGER] * 13}, 422),
        ({"frame": 1, "page": "nobody"}, 404),
        ({}, 422),
    ],
)
def test_what_cannot_be_solved_is_refused(
    there: httpx.Client, body: dict[str, Any], status: int
) -> None:
    answer = there.post(URL, json=body)
    assert answer.status_code == status
    assert set(answer.json()) == {"kind", "message", "where"}


def test_it_is_drawn_in_the_page_that_asked_and_taken_back(there: httpx.Client, run: Path) -> None:
    frame = deepest(run)
    view = {
        "run": "large-tool-1",
        "sequence": SEQUENCE,
        "frame": frame,
        "layers": ["extended", "tool"],
        "colour": "extended",
    }
    for page in ("this-page", "that-page"):
        there.post(f"/api/sessions/{page}/view", json=view)
    drawn = [
        there.get(f"/api/sessions/{page}/state").json()["drawn"]["checksum"]
        for page in ("this-page", "that-page")
    ]
    assert drawn[0] == drawn[1]
    softer = {"effect": "tool_radius", "parameters": {"radius": 0.004}}
    there.post(URL, json={"frame": frame, "effects": [softer], "page": "this-page"})
    changed = [
        there.get(f"/api/sessions/{page}/state").json()["drawn"]["checksum"]
        for page in ("this-page", "that-page")
    ]
    assert changed[0] != drawn[0] and changed[1] == drawn[1]
    other = there.post("/api/sessions/this-page/view", json={**view, "frame": 0}).json()["drawn"][
        "checksum"
    ]
    assert (
        other
        == there.post("/api/sessions/that-page/view", json={**view, "frame": 0}).json()["drawn"][
            "checksum"
        ]
    )
    there.delete("/api/sessions/this-page/whatif")
    assert (
        there.post("/api/sessions/this-page/view", json=view).json()["drawn"]["checksum"]
        == drawn[0]
    )


def test_solver_that_dies_is_started_again(run: Path) -> None:
    solver, recorded = FrameSolver(), Run(run)
    try:
        solver.solve(recorded, SEQUENCE, 0, [], True)
        assert solver._pool is not None
        (process,) = solver._pool._processes
        os.kill(process, signal.SIGKILL)
        end = time.monotonic() + 30
        while time.monotonic() < end:
            try:
                assert solver.solve(recorded, SEQUENCE, 0, [], True).converged
                break
            except RunError as error:
                assert "ended" in error.message
    finally:
        solver.close()


def test_solve_that_takes_too_long_is_given_up(run: Path) -> None:
    solver = FrameSolver(patience=0.01)
    with pytest.raises(RunError, match="was not solved within"):
        solver.solve(Run(run), SEQUENCE, 0, [], True)
    solver.close()


def test_run_that_does_not_say_where_its_data_are_is_told(run: Path, tmp_path: Path) -> None:
    other = Path(shutil.copytree(run, tmp_path / "other"))
    (other / "origin.json").write_text(json.dumps({}))
    with pytest.raises(RunError, match="does not say where its dataset is"):
        FrameSolver().solve(Run(other), SEQUENCE, 0, [], True)


LIVE = f"/api/runs/large-tool-1/sequences/{SEQUENCE}/live"


def test_a_hand_leads_the_tool_and_the_page_shows_what_it_feels(
    there: httpx.Client, run: Path
) -> None:
    view = {
        "run": "large-tool-1",
        "sequence": SEQUENCE,
        "frame": deepest(run),
        "colour": "extended",
        "layers": ["measured", "extended", "tool"],
    }
    recorded = there.post("/api/sessions/led-page/view", json=view).json()["drawn"]
    shallow, deep = (
        there.post(
            LIVE,
            json={
                "at": [0.0, 0.0, 0.0358 + 0.0075 - depth],
                "effects": [LARGER],
                "page": "led-page",
            },
        ).json()
        for depth in (1e-3, 4e-3)
    )
    assert (shallow["depth"], deep["depth"]) == (
        pytest.approx(1e-3, abs=1e-6),
        pytest.approx(4e-3, abs=1e-6),
    )
    assert 0 < shallow["force"][2] < deep["force"][2] and deep["converged"]
    drawn = there.get("/api/sessions/led-page/state").json()["drawn"]
    assert drawn["quantity"] == "displacement" and drawn["points"] == 0
    assert drawn["tool"] == pytest.approx(deep["tool"], abs=1e-6)
    there.delete("/api/sessions/led-page/live")
    assert there.get("/api/sessions/led-page/state").json()["drawn"] == recorded


def test_over_a_socket_the_newest_place_wins_and_what_is_wrong_is_told(
    there: httpx.Client, run: Path
) -> None:
    address = f"ws://{there.base_url.netloc.decode()}/api/sessions/held-page/live"
    wish = {
        "run": "large-tool-1",
        "sequence": SEQUENCE,
        "effects": [],
        "tuned": False,
        "shown": "raw",
    }
    view = {
        "run": "large-tool-1",
        "sequence": SEQUENCE,
        "frame": 0,
        "layers": ["raw"],
        "colour": "raw",
    }
    there.post("/api/sessions/held-page/view", json=view)
    with connect(address) as socket:
        for depth in range(40):
            socket.send(json.dumps({**wish, "at": [0.0, 0.0, 0.0408 - 1e-4 * depth]}))
        answers = [json.loads(socket.recv(timeout=60))]
        while answers[-1]["depth"] < 3.89e-3:
            answers.append(json.loads(socket.recv(timeout=60)))
        assert len(answers) < 40
        assert answers[-1]["drawn"]["quantity"] == "displacement"
        for bad in (
            {"at": [0, 0, 0], "run": "nobody", "sequence": SEQUENCE},
            {"at": [0, 0]},
            {**wish, "at": [0, 0, "deep"]},
        ):
            socket.send(json.dumps(bad))
            assert json.loads(socket.recv(timeout=60))["problem"]["message"]


@pytest.mark.parametrize(
    "body",
    [{}, {"at": [0.0, 0.0]}, {"at": [0, 0, 0], "effects": [{"effect": "magic", "parameters": {}}]}],
)
def test_what_cannot_be_led_is_refused(there: httpx.Client, body: dict[str, Any]) -> None:
    answer = there.post(LIVE, json=body)
    assert answer.status_code == 422 and set(answer.json()) == {"kind", "message", "where"}


@pytest.mark.browser
@pytest.mark.skipif(
    CHROMIUM is None, reason="no Chromium on this machine: install the package chromium"
)
def test_error_changes_as_a_slider_is_moved(there: httpx.Client) -> None:
    with playwright.sync_playwright() as started:
        chromium = started.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox", "--use-angle=swiftshader"]
        )
        page = chromium.new_page(viewport={"width": 1440, "height": 900})
        page.set_default_timeout(LONG)
        trouble: list[str] = []
        page.on("pageerror", lambda error: trouble.append(str(error)))
        page.goto(f"{there.base_url}?run=large-tool-1")
        page.get_by_role("tab", name="What if").click()
        error = page.locator('[data-model="corrected"]')
        error.wait_for()
        raw, extended = (
            page.locator(f'[data-model="{name}"]').inner_text() for name in ("raw", "extended")
        )
        assert error.inner_text() == extended != raw

        def until(text: str) -> None:
            page.wait_for_function(
                "text => document.querySelector('[data-model=corrected]')?.innerText === text",
                arg=text,
            )

        page.get_by_role("switch", name="Tool radius").uncheck()
        page.get_by_role("switch", name="Registration as the diagnosis fitted it").uncheck()
        until(raw)
        page.get_by_role("button", name="As diagnosed").click()
        until(extended)
        frame = page.locator("#scrub").input_value()
        slider = page.get_by_label("Tool radius: radius", exact=True)
        slider.focus()
        for _ in range(60):
            page.keyboard.press("ArrowLeft")
        page.wait_for_function(
            "before => document.querySelector('[data-model=corrected]')?.innerText !== before",
            arg=extended,
        )
        assert page.locator("#scrub").input_value() == frame  # the keys are the slider's
        page.get_by_label("Add a cause").select_option("gravity")
        page.get_by_role("switch", name="Gravity").wait_for()
        page.get_by_role("button", name="Take gravity away").click()
        _move_a_lump_out(page, there)
        while page.get_by_role("button", name="Undo").is_enabled():
            page.get_by_role("button", name="Undo").click()
        until(extended)
        page.get_by_label("Tool radius: radius in mm").fill("500")
        page.get_by_label("Tool radius: radius in mm").blur()
        assert not page.get_by_label("Tool radius: radius in mm").evaluate(
            "box => box.validity.valid"
        )
        page.get_by_role("tab", name="Report").click()
        assert trouble == []
        chromium.close()


def _move_a_lump_out(page: Any, there: httpx.Client) -> None:
    """The slider of a place ends where the phantom ends; a place outside is typed, and noted."""
    spans = there.get(URL).json()["spans"]["stiff_inclusion"]
    page.get_by_label("Add a cause").select_option("stiff_inclusion")
    page.get_by_label("Stiff inclusion: x", exact=True).focus()
    page.keyboard.press("End")
    typed = page.get_by_label("Stiff inclusion: x in mm")
    assert float(typed.input_value()) == pytest.approx(1e3 * spans["x"][1], rel=1e-3)
    typed.fill("200")
    typed.blur()
    page.get_by_text("The lump lies outside the phantom").wait_for()
    page.get_by_role("button", name="Take stiff inclusion away").click()


APART = """async place => {
  const { onScreen } = await import('/static/js/drag.js');
  return onScreen(document.getElementById('viewer').contentWindow, place);
}"""


@pytest.mark.browser
@pytest.mark.skipif(
    CHROMIUM is None, reason="no Chromium on this machine: install the package chromium"
)
def test_a_person_pushes_the_block_with_the_mouse(
    there: httpx.Client, browser: Any, tmp_path: Path
) -> None:
    with browser.new_context(viewport={"width": 1440, "height": 900}) as context:
        page = Page(context.new_page(), there)
        page.open("?run=large-tool-1")
        page.page.get_by_role("tab", name="Live").click()
        page.page.locator("#live-push").wait_for(timeout=60_000)
        page.page.get_by_role("button", name="Above the middle").click()
        page.until(lambda: page.page.inner_text("#live-push").startswith("0.00"))
        page.page.locator("#live-depth").fill("2")
        page.until(lambda: page.page.inner_text("#live-push").startswith("2.00"))
        assert page.page.inner_text("#live-force") != "0.000 N"
        assert "Displacement" in page.page.inner_text("#legend")
        page.page.locator("#live-pad").click(position={"x": 90, "y": 70})
        page.until(lambda: page.held["drawn"]["tool"][0] < -0.01)
        x, y = tool_on_screen(page)
        page.page.mouse.move(x, y)
        page.page.mouse.down()
        for step in range(1, 9):
            page.page.mouse.move(x + 3 * step, y + 2 * step)
        page.until(lambda: float(page.page.inner_text("#live-push").split()[0]) > 2.5)
        page.page.mouse.up()
        page.until(lambda: tool_on_screen(page) == pytest.approx((x + 24, y + 16), abs=1.0))
        page.page.screenshot(path=tmp_path / "live.png")
        page.page.select_option("[aria-label='Model that answers']", "raw")
        page.until(lambda: any(name.startswith("/mesh/raw") for name in page.visible()))
        page.page.get_by_role("tab", name="Report").click()
        page.until(lambda: "Measured" in page.page.inner_text("#legend"))
        assert page.trouble == []


def tool_on_screen(page: Page) -> tuple[float, float]:
    """Where the middle of the tool is in the window."""
    apart = page.page.evaluate(APART, page.held["drawn"]["tool"])
    frame = page.page.locator("#viewer").bounding_box()
    return frame["x"] + apart[0], frame["y"] + apart[1]
