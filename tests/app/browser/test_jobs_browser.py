"""The list of jobs in a real Chromium: watched, cancelled, retried, and its log read."""

from __future__ import annotations

import sqlite3
from typing import Any

from browsing import NEEDS_CHROMIUM, Page

pytestmark = NEEDS_CHROMIUM


def test_a_job_is_watched_cancelled_and_retried_with_the_mouse(
    browser: Any, serve: Any, place: Any
) -> None:
    with serve(place.settings, {"diagnosis": "job_functions:linger"}) as client:
        page = Page(browser.new_context(viewport={"width": 1440, "height": 900}).new_page(), client)
        at = page.page
        at.set_default_timeout(120_000)
        at.goto(str(client.base_url))
        at.click("#datasets >> text=small")
        at.click("#panel >> text=Diagnose")
        at.wait_for_selector("#jobs [data-state=running]")
        at.click("#jobs >> text=Details")
        at.wait_for_selector("#panel-jobs .log .warning >> text=cloud 7 is dark")
        at.wait_for_selector("#panel-jobs .sub >> text=left")
        at.click("#panel-jobs [title=Cancel]")
        at.wait_for_selector("#panel-jobs [data-state=cancelled]")
        at.click("#panel-jobs >> text=Retry")
        at.wait_for_selector("#panel-jobs [data-state=running]")
        (place.runs / "go").touch()
        at.wait_for_selector("#panel-jobs [data-state=done]")
        assert at.locator("#jobs [data-job]").count() == 0
        at.click("#panel-jobs summary")
        at.wait_for_selector("#panel-jobs .log >> text=started, attempt 2")
        at.reload()
        at.click("#tab-jobs")
        assert (
            at.locator("#panel-jobs [data-state=done]").inner_text().startswith("Diagnosis · small")
        )
        assert client.get("/api/jobs").headers["x-total-count"] == "1"
        assert page.trouble == []


def test_trouble_of_the_job_queue_is_told_until_it_is_over(
    browser: Any, serve: Any, place: Any
) -> None:
    with serve(place.settings, {"diagnosis": "job_functions:linger"}) as client:
        with sqlite3.connect(place.runs / "jobs.sqlite") as database:
            database.execute(
                "create trigger broken before insert on log when new.text like 'started%' and "
                "not exists (select 1 from log where text like 'put back%') "
                "begin select raise(fail, 'broken'); end"
            )
        page = Page(browser.new_context(viewport={"width": 1440, "height": 900}).new_page(), client)
        at = page.page
        at.set_default_timeout(120_000)
        at.goto(str(client.base_url))
        assert not at.locator("#trouble").is_visible()
        at.click("#datasets >> text=small")
        at.click("#panel >> text=Diagnose")
        at.wait_for_selector("#trouble >> text=The job queue stopped at small")
        assert client.get("/health").status_code == 503
        assert page.trouble == []  # later the page asks for the run that the made-up job lacks
        (place.runs / "go").touch()
        at.wait_for_selector("#trouble", state="hidden")
        assert client.get("/health").json() == {"status": "ok"}
        assert client.get("/api/jobs").json()[0]["state"] == "done"
