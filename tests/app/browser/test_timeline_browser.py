"""The timeline in a real Chromium: lanes, worst frames, a loop by keys, buttons and mouse."""

from __future__ import annotations

from pathlib import Path

from browsing import NEEDS_CHROMIUM, Page

pytestmark = NEEDS_CHROMIUM


def test_a_person_loops_the_deepest_part_and_finds_the_worst_frame(
    page: Page, tmp_path: Path
) -> None:
    page.open()
    page.page.click("[data-sequence=poke-01]")
    page.until(
        lambda: (
            page.held["view"]["sequence"] == "poke-01"
            and page.page.locator("#worst button").count() == 1
        )
    )
    page.page.keyboard.press("Home")
    page.page.click("#worst button")
    assert page.settled()["view"]["frame"] == 2
    assert page.page.get_attribute("#worst button", "aria-pressed") == "true"
    assert "raw 0.60 mm" in (page.page.get_attribute("#worst button", "title") or "")

    plot = page.page.locator("#plot").bounding_box()
    page.page.mouse.move(plot["x"] + plot["width"] / 2 + 15, plot["y"] + plot["height"] / 2)
    tip = page.page.inner_text("#plot-tip").replace("\N{NO-BREAK SPACE}", " ")
    assert "depth 3.00 mm" in tip and "force 0.50 N" in tip and "raw 0.60 mm" in tip

    page.page.keyboard.press("ArrowLeft")
    page.page.keyboard.press("i")
    page.page.keyboard.press("End")
    page.page.keyboard.press("ArrowLeft")
    page.page.click("#loop-to")
    assert page.page.evaluate(
        "import('/static/js/store.js').then(store => store.state().loop)"
    ) == [1, 3]
    page.page.select_option("#speed", "2")
    page.page.keyboard.press("Space")
    seen: set[int] = set()

    def looked() -> bool:
        seen.add(page.frame)
        return seen >= {1, 2}

    page.until(looked, 20)
    page.page.wait_for_timeout(1000)
    assert (
        page.page.evaluate("import('/static/js/store.js').then(store => store.state().playing)")
        is True
    )
    seen.add(page.frame)
    assert seen <= {1, 2, 3}
    page.page.keyboard.press("Space")
    page.page.screenshot(path=tmp_path / "light.png")
    page.page.click("#theme")
    page.page.screenshot(path=tmp_path / "dark.png")
    page.page.keyboard.press("l")
    assert (
        page.page.evaluate("import('/static/js/store.js').then(store => store.state().loop)")
        is None
    )


def test_a_part_dragged_with_shift_is_looped_and_the_cursor_stays(page: Page) -> None:
    page.open()
    plot = page.page.locator("#plot").bounding_box()
    inner, high = plot["width"] - 62, plot["y"] + plot["height"] / 2
    page.page.keyboard.down("Shift")
    page.page.mouse.move(plot["x"] + 46 + inner, high)
    page.page.mouse.down()
    page.page.mouse.move(plot["x"] + 46 + inner * 0.52, high, steps=4)
    page.page.mouse.up()
    page.page.keyboard.up("Shift")
    assert page.page.evaluate(
        "import('/static/js/store.js').then(store => store.state().loop)"
    ) == [2, 4]
    assert page.frame == 2
    page.page.keyboard.press("End")
    page.page.keyboard.press("Space")
    page.until(lambda: page.frame in (2, 3), 20)


def test_lanes_tell_forces_iterations_and_frames_without_equilibrium(page: Page) -> None:
    page.open()
    plot = page.page.locator("#plot").bounding_box()
    page.page.mouse.move(
        plot["x"] + 46 + (plot["width"] - 62) * 0.75, plot["y"] + plot["height"] / 2
    )
    tip = page.page.inner_text("#plot-tip").replace("\N{NO-BREAK SPACE}", " ")
    for text in (
        "raw force 0.30 N",
        "extended force 0.60 N",
        "raw iterations 6",
        "extended iterations 8",
        "raw model: no equilibrium; the reason was not recorded",
    ):
        assert text in tip
    page.page.mouse.move(plot["x"] + 46, plot["y"] + plot["height"] / 2)
    page.until(lambda: "no equilibrium" not in page.page.inner_text("#plot-tip"))
