"""The page of jobs says how they stand now."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from playwright.sync_api import Page, Route, expect

OpenPage = Callable[..., Page]

RUNNING: dict[str, Any] = {
    "id": 4_711,
    "kind": "solve",
    "title": "Solve sample",
    "dataset": "sample",
    "state": "running",
    "done": 3,
    "total": 9,
    "sentence": "3 of 9 groups solved",
    "result": None,
    "problem": None,
    "created": "2030-01-01T00:00:00Z",
    "started": "2030-01-01T00:00:00Z",
    "ended": None,
    "actor": "local",
}


class TestNews:
    def test_a_job_that_ended_before_anybody_listened_is_over(self, open_page: OpenPage) -> None:
        """The list was read, the job ended, and only then the page began to hear of jobs."""
        page = open_page(None)
        answers = [RUNNING, {**RUNNING, "state": "done", "done": 9, "ended": RUNNING["started"]}]

        def answer(route: Route) -> None:
            job = answers.pop(0) if len(answers) > 1 else answers[0]
            route.fulfill(json={"items": [job], "next": None})

        page.route("**/api/v1/jobs?*", answer)
        page.goto("/jobs")
        card = page.get_by_role("region", name="Solve sample")
        expect(card.locator(".pill")).to_have_text("done")
        expect(card.locator(".meter")).to_have_count(0)


class TestTakenUp:
    def test_an_estimate_that_was_begun_before_a_reload_is_followed(
        self, open_page: OpenPage
    ) -> None:
        page = open_page(None)
        job = {**RUNNING, "kind": "pictures", "title": "Estimate the pictures"}

        def answer(route: Route) -> None:
            asked = route.request.url
            found = [job] if "kind=pictures" in asked and "state=open" in asked else []
            route.fulfill(json={"items": found, "next": None})

        page.route("**/api/v1/jobs?*", answer)
        page.route("**/api/v1/jobs/4711", lambda route: route.fulfill(json=job))
        page.goto("/datasets/sample/statistics")
        card = page.get_by_role("region", name="Stretched and cropped pictures")
        expect(card).to_contain_text("3 of 9 groups solved")


class TestHowFar:
    def test_nothing_looks_done_of_a_job_that_waits_or_cannot_say_how_far_it_is(
        self, open_page: OpenPage
    ) -> None:
        page = open_page(None)
        untold = {**RUNNING, "id": 4_712, "title": "Freeze sample", "done": 0, "total": None}
        waits = {
            **untold,
            "id": 4_713,
            "title": "Export sample",
            "state": "waiting",
            "sentence": "",
        }
        jobs = [RUNNING, untold, {**waits, "started": None}]
        page.route(
            "**/api/v1/jobs?*", lambda route: route.fulfill(json={"items": jobs, "next": None})
        )
        page.goto("/jobs")
        cards = [page.get_by_role("region", name=str(job["title"])) for job in jobs]
        shares = [card.get_by_role("progressbar") for card in cards]
        expect(shares[0]).to_have_attribute("aria-valuenow", "33")
        for share in shares[1:]:
            expect(share).to_be_empty()
            assert share.get_attribute("aria-valuenow") is None
        expect(cards[1]).to_contain_text("started")
        expect(cards[2]).to_contain_text("Waiting for: Solve sample (2 jobs before it)")
        expect(cards[2]).to_contain_text("requested")
