"""One address and one login in a real Chromium: two people come in by the token, and each keeps a
timeline of their own.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from browsing import NEEDS_CHROMIUM, Page

from palpate.app.server.tokens import Token

pytestmark = NEEDS_CHROMIUM


def test_two_people_log_in_each_with_a_timeline_of_their_own_and_one_leaves(
    browser: Any, serve: Any, place: Any, tmp_path: Path
) -> None:
    token = Token.make(place.runs)
    with serve(place.settings.model_copy(update={"host": "0.0.0.0"})) as client:
        client.headers["authorization"] = f"Bearer {token}"
        first, second = (Page(browser.new_context().new_page(), client) for _ in range(2))
        at, asked = first.page, set[str]()
        for page in (first, second):
            page.page.on(
                "request",
                lambda request: (
                    asked.add(urlsplit(request.url).netloc) if request.url[:4] == "http" else None
                ),
            )
            page.page.on("websocket", lambda opened: asked.add(urlsplit(opened.url).netloc))
        at.goto(str(client.base_url))
        assert at.url.endswith("/login")
        at.keyboard.type("a guess")
        at.keyboard.press("Enter")
        at.wait_for_selector("#problem >> text=This is not the token")
        at.screenshot(path=tmp_path / "login.png")
        for page in (first, second):
            page.page.goto(str(client.base_url))
            page.page.fill("#token", token)
            page.page.click("text=Log in")
            page.open()
        shown = second.frame
        at.locator("#scrub").press("End")
        first.until(lambda: first.frame != shown)
        assert first.settled()["view"]["frame"] == first.frame
        assert second.settled()["view"]["frame"] == second.frame == shown
        assert asked == {client.base_url.netloc.decode()}, (
            "all of it, the viewer's socket too, goes to one port"
        )
        at.click("#log-out")
        at.wait_for_url("**/login")
        at.goto(str(client.base_url))
        assert at.url.endswith("/login")
        second.page.locator("#scrub").press("Home")
        second.until(lambda: second.settled()["view"]["frame"] == 0)
        assert second.trouble == []


def test_where_no_login_is_needed_there_is_none_to_leave(
    browser: Any, serve: Any, place: Any
) -> None:
    with serve(place.settings) as client:
        page = Page(browser.new_context().new_page(), client)
        page.open()
        assert not page.page.locator("#log-out").is_visible()
