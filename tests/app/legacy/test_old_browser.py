"""What the page of version 0.1 kept in the browser is understood by the page of today."""

from __future__ import annotations

import json
from typing import Any

import pytest
from browsing import NEEDS_CHROMIUM, Page
from old_results import OldHome, unpack_old_results

from palpate.app.settings import Settings

pytestmark = NEEDS_CHROMIUM


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> OldHome:
    found = unpack_old_results(tmp_path_factory.mktemp("old"))
    (found.runs / "jobs.sqlite").unlink()  # the jobs that wait are not what is looked at
    return found


def test_the_page_opens_as_the_old_one_was_left(home: OldHome, browser: Any, serve: Any) -> None:
    stored = json.loads((home.expected / "browser.json").read_text())
    local = {key: value for key, value in stored["local"].items() if key.startswith("palpate.")}
    assert set(local) == {"palpate.view", "palpate.theme", "palpate.camera", "palpate.register"}
    settings = Settings(runs=home.runs, datasets=home.datasets, preload=())
    with (
        serve(settings) as client,
        browser.new_context(
            viewport={"width": 1440, "height": 900}, color_scheme="light"
        ) as context,
    ):
        fill = "values => { for (const key in values) localStorage.setItem(key, values[key]); }"
        first = context.new_page()
        first.goto(f"{client.base_url}/static/login.html")
        first.evaluate(fill, local)
        first.close()
        page = Page(context.new_page(), client)
        page.open()
        assert page.trouble == []
        now = page.page.evaluate("() => ({...localStorage})")
        view = json.loads(local["palpate.view"])
        assert {key: json.loads(now["palpate.view"])[key] for key in view} == view
        assert now["palpate.theme"] == page.page.evaluate("document.documentElement.dataset.theme")
        assert page.page.input_value("#speed") == str(view["speed"])
        assert page.page.input_value("#quantity") == view["quantity"]
        shown = page.held["view"]
        assert (shown["run"], shown["sequence"]) == (view["run"], view["sequence"])
        assert shown["quantity"] == view["quantity"]
