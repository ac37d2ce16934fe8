"""Tracks of the ball in the browser: made, looked at by key, corrected and judged."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import Page, expect

from app.formats.issia_writer import write_issia
from tests.e2e.screen import holding, until
from tests.e2e.service import delete_dataset
from tests.e2e.test_access import (
    BEYOND_ITS_FRAME,
    NESTED_SCROLLERS,
    SIZES,
    resize,
    serious_in_both,
    soon,
)
from tests.e2e.test_pages import TOO_WIDE
from tests.flights import FIRST, KICK, flight_groups

OpenPage = Callable[..., Page]
ANOTHER_FRAME = """(frame) => Number(document.querySelector('.track__rail [data-frame]').dataset.frame) > frame"""
COUNT = 70


def ended(client: httpx.Client, answer: httpx.Response) -> dict[str, Any]:
    """The job that an answer started, once it is over."""
    job: dict[str, Any] = answer.json()
    while job["state"] not in ("done", "failed"):
        job = client.get(f"/jobs/{job['id']}").json()
    assert job["state"] == "done", job
    return job


@pytest.fixture
def flight(server: str, tmp_path: Path) -> Iterator[str]:
    """A dataset of a ball in flight, solved; ask before the page."""
    (tmp_path / "flight").mkdir()
    groups = [replace(group, match="issia") for group in flight_groups(COUNT)]
    write_issia(tmp_path / "flight", groups)
    packed = Path(shutil.make_archive(str(tmp_path / "flight"), "zip", tmp_path / "flight"))
    with httpx.Client(base_url=f"{server}/api/v1") as client:
        kind = {"Content-Type": "application/octet-stream"}
        address = "/uploads?name=flight.zip"
        sent = client.post(address, content=packed.read_bytes(), headers=kind).json()
        options = {"options": {"size": [1280, 720]}}
        body = {"dataset": "flight", "format": "issia", "source": {"upload": sent["id"]}, **options}
        ended(client, client.post("/imports", json=body))
        ended(client, client.post("/datasets/flight/solve"))
    yield "flight"
    delete_dataset(server, "flight")


def shows(page: Page, frame: int) -> None:
    """Wait until a frame is the one at hand."""
    page.wait_for_selector(f'.track__rail [data-frame="{frame}"]')


@pytest.fixture
def track(flight: str, open_page: OpenPage) -> Page:
    """The page of its track, which was made in the browser."""
    page = open_page(f"/datasets/{flight}/tracks")
    page.get_by_role("button", name="Track the ball").click()
    page.get_by_role("link", name="issia", exact=True).click()
    page.wait_for_selector(".track__band")
    return page


class TestTracks:
    def test_a_list_follows_a_job_that_was_begun_elsewhere(
        self, server: str, flight: str, open_page: OpenPage
    ) -> None:
        page = open_page(f"/datasets/{flight}/tracks")
        expect(page.get_by_role("button", name="Track the ball")).to_be_enabled()
        with httpx.Client(base_url=f"{server}/api/v1") as client:
            ended(client, client.post(f"/datasets/{flight}/tracks", json={}))
        expect(page.get_by_role("link", name="issia", exact=True)).to_be_visible()
        expect(page.get_by_role("button", name="Recompute the tracks")).to_be_visible()

    def test_are_looked_at_corrected_and_judged_by_key(self, track: Page) -> None:
        page = track
        expect(page.get_by_text("no verdict yet")).to_be_visible()
        page.keyboard.press("w")
        worst = page.locator(".track__rail [data-frame]").get_attribute("data-frame")
        page.keyboard.press("Shift+ArrowLeft")
        before_it = max(int(worst or 0) - 25, FIRST)
        shows(page, before_it)
        page.keyboard.press("ArrowRight")
        shows(page, before_it + 1)

        events = page.get_by_role("list", name="List of events").get_by_role("button")
        kick = events.filter(has_text="kick").first
        kick.click()
        frame = int(kick.inner_text().split()[0])
        assert abs(frame - FIRST - KICK) <= 2
        before = events.count()
        page.keyboard.press("d")
        expect(events).to_have_count(before - 1)
        page.keyboard.press("1")
        expect(events).to_have_count(before)

        page.keyboard.press("a")
        accept = page.get_by_role("button", name="Accept")
        expect(accept).to_have_attribute("aria-pressed", "true")
        page.reload()
        expect(accept).to_have_attribute("aria-pressed", "true")
        page.keyboard.press("x")
        expect(page.get_by_role("button", name="Reject")).to_have_attribute("aria-pressed", "true")
        page.keyboard.press("u")
        expect(page.get_by_text("no verdict yet")).to_be_visible()

    def test_what_was_said_of_one_is_undone_and_removed_events_are_restored(
        self, track: Page
    ) -> None:
        page = track
        events = page.get_by_role("list", name="List of events").get_by_role("button")
        removed = page.get_by_role("list", name="Removed events").get_by_role("listitem")
        before = events.count()
        events.filter(has_text="kick").first.click()
        page.keyboard.press("d")
        expect(removed).to_contain_text("removed: kick")
        expect(events).to_have_count(before - 1)
        page.keyboard.press("Control+z")
        expect(removed).to_have_count(0)
        expect(events).to_have_count(before)
        page.keyboard.press("d")
        removed.get_by_role("button", name="Restore").click()
        expect(events).to_have_count(before)
        page.keyboard.press("a")
        accept = page.get_by_role("button", name="Accept")
        expect(accept).to_have_attribute("aria-pressed", "true")
        page.keyboard.press("Control+z")
        expect(accept).to_have_attribute("aria-pressed", "false")
        for _ in range(3):
            page.keyboard.press("Control+z")
        expect(page.get_by_text("nothing to undo")).to_be_visible()
        expect(events).to_have_count(before)

    def test_corrections_in_a_row_build_on_each_other(self, track: Page) -> None:
        number = track.url.split("/tracks/")[1].split("?")[0]
        track.goto(f"/tracks/{number}?frame={FIRST + 5}")
        shows(track, FIRST + 5)
        with holding(track, f"**/api/v1/tracks/{number}") as sent:
            track.keyboard.press("2")
            sent.arrive()
            track.keyboard.press("Shift+ArrowRight")
            shows(track, FIRST + 30)
            track.keyboard.press("3")
        path = f"/api/v1/tracks/{number}"
        until(track, lambda: len(track.request.get(path).json()["corrections"]) == 2)

    def test_a_verdict_that_is_answered_late_leads_nobody_away(self, track: Page) -> None:
        number = track.url.split("/tracks/")[1].split("?")[0]
        with holding(track, f"**/api/v1/tracks/{number}") as sent:
            track.keyboard.press("a")
            sent.arrive()
            track.get_by_role("link", name="Tracks", exact=True).click()
            track.wait_for_url("**/datasets/flight/tracks")
        expect(track.locator("[aria-live]").filter(has_text="accepted")).to_have_count(1)
        track.wait_for_timeout(500)
        assert track.url.endswith("/datasets/flight/tracks")
        expect(track.get_by_text("No other track of this list waits")).to_have_count(0)

    def test_a_verdict_is_shown_though_the_next_track_is_not_known(
        self, track: Page, console: Any
    ) -> None:
        console.expect("500")
        listed = re.compile(r"/api/v1/datasets/\w+/tracks")
        track.route(listed, lambda route: route.fulfill(status=500, json={"detail": "no list"}))
        track.keyboard.press("a")
        expect(track.get_by_role("alert")).to_contain_text("The next track is not known: no list")
        accept = track.get_by_role("button", name="Accept")
        expect(accept).to_have_attribute("aria-pressed", "true")

    def test_a_frame_leads_to_its_group(self, track: Page) -> None:
        track.keyboard.press("ArrowRight")
        frame = track.locator(".track__rail [data-frame]").get_attribute("data-frame")
        track.keyboard.press("Enter")
        track.wait_for_url("**/review/*")
        expect(track.get_by_role("banner")).to_contain_text(str(frame))

    def test_is_played_by_the_keys_of_recordings(self, track: Page) -> None:
        frame = track.locator(".track__rail [data-frame]")
        track.keyboard.press("w")
        track.keyboard.press("Shift+ArrowLeft")
        begun = int(frame.get_attribute("data-frame") or 0)
        track.keyboard.press("l")
        track.wait_for_function(ANOTHER_FRAME, arg=begun)
        track.keyboard.press("k")
        expect(track.get_by_role("button", name="Play")).to_be_visible()
        stood = int(frame.get_attribute("data-frame") or 0)
        assert stood > begun
        track.wait_for_url(f"**/tracks/*?frame={stood}")
        track.reload()
        shows(track, stood)
        track.keyboard.press("Space")
        expect(track.get_by_role("button", name="Stop")).to_be_visible()
        # At its end it stands by itself.
        shows(track, FIRST + COUNT - 1)
        expect(track.get_by_role("button", name="Play")).to_be_visible()

    def test_the_address_leads_to_a_frame(self, track: Page) -> None:
        track.goto(f"{track.url.partition('?')[0]}?frame={FIRST + 31}")
        shows(track, FIRST + 31)

    def test_its_pages_are_accessible_in_every_size(self, track: Page) -> None:
        for selector in (".track__band", ".table"):
            if selector == ".table":
                track.goto("/datasets/flight/tracks")
            track.wait_for_selector(selector)
            found: dict[str, list[str]] = {"axe": serious_in_both(track)}
            for width, height in SIZES:
                resize(track, width, height)
                for faults in (TOO_WIDE, BEYOND_ITS_FRAME, NESTED_SCROLLERS):
                    found.setdefault(f"{width}", []).extend(soon(track, faults))
            assert not any(found.values()), found
