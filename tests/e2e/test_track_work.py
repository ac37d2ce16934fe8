"""Working through tracks: lists and batches, balls that contradict, and what an edit makes of the frames around."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.flown import COUNT, SLIP
from tests.e2e.homes import build_flights
from tests.e2e.screen import holding
from tests.e2e.service import serving
from tests.e2e.test_access import serious_in_both
from tests.e2e.test_tracks import shows
from tests.flights import FIRST
from tests.homes import copy_home, once_for_all

OpenPage = Callable[..., Page]


@pytest.fixture(scope="module")
def flights_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a server with the dataset *flights*."""
    built = once_for_all(tmp_path_factory, "flights", build_flights)
    with serving(copy_home(built, tmp_path_factory)) as address:
        yield address


@pytest.fixture
def flights(flights_server: str, open_page: OpenPage) -> Iterator[Page]:
    """A page of it; what a test says of its tracks is taken back."""
    page = open_page("/datasets/flights/tracks", address=flights_server)
    page.wait_for_selector(".table")
    yield page
    api = f"{flights_server}/api/v1"
    for track in tracks(page):
        headers = {"If-Match": page.request.get(f"{api}/tracks/{track['id']}").json()["etag"]}
        page.request.patch(f"{api}/tracks/{track['id']}", headers=headers, data={"verdict": "none"})
    for batch in page.request.get(f"{api}/datasets/flights/batches").json()["items"]:
        page.request.delete(f"{api}/batches/{batch['id']}")


def tracks(page: Page) -> list[dict[str, Any]]:
    """The tracks as the server lists them."""
    items: list[dict[str, Any]] = page.request.get("/api/v1/datasets/flights/tracks").json()[
        "items"
    ]
    return items


def slipped(page: Page) -> int:
    """Id of the group with another ball."""
    query = {"dataset": "flights", "q": "finding:track_disagrees"}
    (found,) = page.request.get("/api/v1/groups", params=query).json()["items"]
    return int(found["id"])


class TestList:
    def test_is_ordered_and_filtered_by_its_address(self, flights: Page) -> None:
        names = flights.locator(".table tbody th a")
        expect(names).to_have_text(["early", "late"])
        flights.get_by_label("Order").select_option("worst")
        flights.wait_for_url("**/tracks?sort=worst")
        first = max(tracks(flights), key=lambda track: track["summary"]["p95_px"])
        expect(names.first).to_have_text(first["key"])
        flights.get_by_label("Show").select_option("rejected")
        expect(flights.get_by_text("No track matches this filter.")).to_be_visible()
        flights.get_by_label("Show").select_option("")
        expect(names).to_have_count(2)
        assert serious_in_both(flights) == []

    def test_a_verdict_leads_to_the_next_one_that_waits(self, flights: Page) -> None:
        early, late = tracks(flights)
        flights.get_by_label("Order").select_option("worst")
        flights.wait_for_url("**/tracks?sort=worst")
        flights.get_by_role("link", name="early", exact=True).click()
        flights.wait_for_selector(".track__band")
        flights.keyboard.press("a")
        flights.wait_for_url(re.compile(rf"/tracks/{late['id']}\?sort=worst"))
        expect(flights.get_by_role("banner")).to_contain_text("late")
        flights.wait_for_selector(".track__band")
        flights.keyboard.press("x")
        expect(flights.get_by_text("No other track of this list waits")).to_be_visible()
        assert [track["verdict"] for track in tracks(flights)] == ["accepted", "rejected"]
        assert early["id"] != late["id"]

    def test_a_key_between_two_tracks_says_nothing_of_the_one_that_was_left(
        self, flights: Page
    ) -> None:
        early, late = tracks(flights)
        flights.get_by_role("link", name="early", exact=True).click()
        flights.wait_for_selector(".track__band")
        flights.keyboard.press("ArrowRight")
        with holding(flights, f"**/api/v1/tracks/{late['id']}") as asked:
            flights.keyboard.press("f")
            flights.wait_for_url(re.compile(rf"/tracks/{late['id']}"))
            asked.arrive()
            flights.keyboard.press("x")
            flights.keyboard.press("1")
            # As long as it takes until the address tells the frame.
            flights.wait_for_timeout(500)
            assert "frame=" not in flights.url
            expect(flights.get_by_text("Reading the track")).to_be_visible()
        flights.wait_for_selector(".track__band")
        assert [track["verdict"] for track in tracks(flights)] == [None, None]
        left = flights.request.get(f"/api/v1/tracks/{early['id']}").json()
        assert left["etag"] == early["etag"]

    def test_nothing_is_assigned_of_a_list_that_is_still_awaited(self, flights: Page) -> None:
        assign = flights.get_by_role("button", name="Assign…")
        with holding(flights, "**/datasets/flights/tracks?*sort=worst*") as asked:
            flights.get_by_label("Order").select_option("worst")
            asked.arrive()
            expect(assign).to_have_attribute("aria-disabled", "true")
        expect(assign).to_have_attribute("aria-disabled", "false")


class TestBatch:
    def test_of_tracks_is_assigned_and_worked_through_by_key(self, flights: Page) -> None:
        flights.get_by_role("button", name="Assign…").click()
        flights.get_by_label("Name").fill("Balls of today")
        assert serious_in_both(flights) == []
        flights.keyboard.press("Enter")
        expect(flights.locator(".table tbody td").last).to_have_text("all reviewers")
        flights.goto("/work")
        mine = flights.locator(".work__item").first
        expect(mine).to_contain_text("0 of 2 tracks done")
        flights.get_by_role("button", name="Continue: 2 tracks").click()
        flights.wait_for_selector(".track__band")
        flights.keyboard.press("a")
        flights.wait_for_url(re.compile(rf"/tracks/{tracks(flights)[1]['id']}\?batch="))
        flights.wait_for_selector(".track__band")
        flights.goto("/work")
        expect(mine).to_contain_text("1 of 2 tracks done")
        expect(flights.get_by_role("button", name="Continue: 1 track")).to_be_visible()


class TestFinding:
    def test_moves_the_ball_to_its_track_and_back(self, flights: Page) -> None:
        group = slipped(flights)
        flights.goto(f"/review/{group}")
        titles = flights.get_by_text("contradicts its track")
        expect(titles.first).to_be_visible()
        move = flights.get_by_role("button", name="Move the ball there")
        expect(move.first).to_be_visible()
        expect(flights.locator(".track-card")).to_contain_text(f"Frame {SLIP} of early")
        move.first.click()
        expect(titles).to_have_count(0)
        around = flights.locator(f'.track-card [data-around="{SLIP}"]')
        expect(around).to_be_visible()
        expect(flights.locator(".track-card")).to_contain_text("No ball in this frame contradicts")
        expect(flights.locator(".track-card")).to_have_attribute("data-stale", "true")
        flights.keyboard.press("Control+z")
        expect(titles.first).to_be_visible()
        assert slipped(flights) == group

    def test_leads_to_the_track_at_its_frame(self, flights: Page) -> None:
        flights.goto(f"/review/{slipped(flights)}")
        expect(flights.locator(".track-card")).to_be_visible()
        flights.keyboard.press("Shift+V")
        flights.wait_for_url(f"**/tracks/*?frame={SLIP}")
        shows(flights, SLIP)
        expect(flights.get_by_text("px off")).to_be_visible()
        against = flights.get_by_role("list", name="Balls that contradict the track")
        expect(against.get_by_title(f"in frame {SLIP}")).to_be_visible()
        flights.keyboard.press("ArrowRight")
        shows(flights, SLIP + 1)
        flights.get_by_role("button", name="contradicts the track").click()
        shows(flights, SLIP)
        flights.evaluate("document.activeElement.blur()")
        flights.keyboard.press("Enter")
        flights.wait_for_url("**/review/*")

    def test_goes_with_a_rejected_track(self, flights: Page) -> None:
        group = slipped(flights)
        early, _ = tracks(flights)
        flights.goto(f"/tracks/{early['id']}")
        flights.wait_for_selector(".track__band")
        flights.keyboard.press("x")
        expect(flights.get_by_role("banner")).to_contain_text("late")
        query = {"dataset": "flights", "q": "finding:track_disagrees"}
        assert flights.request.get("/api/v1/groups", params=query).json()["items"] == []
        flights.goto(f"/tracks/{early['id']}")
        flights.wait_for_selector(".track__band")
        flights.keyboard.press("u")
        expect(flights.get_by_text("no verdict yet")).to_be_visible()
        assert slipped(flights) == group


class TestAround:
    def test_an_edit_made_elsewhere_is_told_on_the_page_of_the_track(self, flights: Page) -> None:
        late = tracks(flights)[1]
        at = FIRST + COUNT // 2
        flights.goto(f"/tracks/{late['id']}?frame={at}")
        shows(flights, at)
        frames = flights.request.get(f"/api/v1/tracks/{late['id']}/frames").json()
        group = flights.request.get(f"/api/v1/groups/{frames['group'][COUNT // 2]}").json()
        x, y = group["views"][0]["balls"][0]["point"]
        edit, etag = {"point": [x + 2, y]}, {"If-Match": group["etag"]}
        view = f"/api/v1/views/{group['views'][0]['id']}/ball"
        answer = flights.request.patch(view, data=edit, headers=etag)
        assert answer.ok, answer.text()
        now = flights.locator(f'[data-around="{at}"]')
        expect(now).to_contain_text("With the present groups")
        expect(flights.get_by_role("button", name="Accept")).to_have_attribute(
            "aria-disabled", "true"
        )
        assert serious_in_both(flights) == []
        undone = flights.request.post(
            f"/api/v1/groups/{group['id']}/undo", headers={"If-Match": answer.headers["etag"]}
        )
        assert undone.ok, undone.text()
        expect(now).to_have_count(0)
