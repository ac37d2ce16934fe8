"""Cameras over time in the browser: a shot is tracked, watched, and mended at a frame."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from playwright.sync_api import Page, Route, expect

from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.solving.jaccard import project_markings
from tests.e2e.screen import until
from tests.e2e.service import delete_dataset
from tests.e2e.tab_walk import faults_of
from tests.e2e.test_access import (
    BEYOND_ITS_FRAME,
    NESTED_SCROLLERS,
    SIZES,
    resize,
    serious_in_both,
    soon,
)
from tests.e2e.test_pages import TOO_WIDE
from tests.e2e.test_recordings import shows
from tests.tripod_films import Film, render_film
from tests.videos import write_pictures

OpenPage = Callable[..., Page]
FRAMES, SPOILED, LAST = 7, (3, 4), 6
SIZE = ImageSize(1280, 720)


@pytest.fixture(scope="module")
def tripod() -> Film:
    return render_film(FRAMES)


@pytest.fixture(scope="module")
def film(tripod: Film, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A pan in which two frames show nothing."""
    images, rng = list(tripod.images), np.random.default_rng(1)
    for number in SPOILED:
        images[number] = rng.integers(0, 255, images[number].shape, dtype=np.uint8)
    return write_pictures(tmp_path_factory.mktemp("pan") / "pan.avi", "MJPG", images)


@pytest.fixture
def recording(film: Path, server: str) -> Iterator[int]:
    """The film as a recording of one shot; ask before the page."""
    with httpx.Client(base_url=f"{server}/api/v1", timeout=60) as client:
        kind = {"Content-Type": "application/octet-stream"}
        sent = client.post(f"/uploads?name={film.name}", content=film.read_bytes(), headers=kind)
        body = {"dataset": "pans", "source": {"upload": sent.json()["id"]}}
        job = client.post("/recordings", json=body).json()
        while job["state"] not in ("done", "failed"):
            job = client.get(f"/jobs/{job['id']}").json()
        assert job["state"] == "done", job
        number = job["result"]["recording"]
        path = f"/recordings/{number}/shots"
        shots = [{"first": 0, "last": LAST, "kind": "main"}]
        tag = {"If-Match": client.get(path).headers["etag"]}
        assert client.put(path, json={"shots": shots}, headers=tag).status_code == 200
    yield number
    delete_dataset(server, "pans")


def tracked(open_page: OpenPage, recording: int) -> Page:
    """The page of the recording, its shot tracked by key."""
    page = open_page(f"/recordings/{recording}")
    shows(page, 0)
    page.keyboard.press("t")
    expect(page.get_by_role("region", name="Cameras over time")).to_be_visible(timeout=120_000)
    return page


def count(page: Page, name: str) -> list[str]:
    """The cells of a row of the counts."""
    row = page.get_by_role("region", name="Cameras", exact=True).get_by_role("row", name=name)
    return row.get_by_role("cell").all_inner_texts()


def draw(page: Page, group: int, film: Film, frame: int) -> None:
    """Draw the lines of a frame where they are, as the editor saves them."""
    answer = page.request.get(f"/api/v1/groups/{group}")
    shown = project_markings(film.cameras[frame], Pitch(), SIZE)
    lines = {
        name: [{"x": x, "y": y} for x, y in line[:: max(len(line) // 6, 1)].round(2).tolist()]
        for name, line in shown.items()
        if len(line) > 5
    }
    saved = page.request.patch(
        f"/api/v1/views/{answer.json()['views'][0]['id']}/lines",
        data={"lines": lines},
        headers={"If-Match": answer.headers["etag"]},
    )
    assert saved.ok, saved.text()


def test_a_shot_is_tracked_and_lines_follow_its_frames(recording: int, open_page: OpenPage) -> None:
    page = tracked(open_page, recording)
    assert count(page, "tracked") == ["5"] and count(page, "lost") == ["2"]
    lines = page.locator(".camera__lines")
    expect(lines).to_have_attribute("data-frame", "0")
    page.keyboard.press("n")
    shows(page, SPOILED[0])
    expect(lines).to_have_count(0)
    card = page.get_by_role("region", name="Cameras", exact=True)
    curves = page.get_by_role("region", name="Cameras over time")
    expect(curves).to_contain_text("Frame 3 is lost")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    shows(page, 5)
    expect(lines).to_have_attribute("data-frame", "5")
    page.keyboard.press("w")
    worst = page.request.get(f"/api/v1/recordings/{recording}/cameras").json()["items"][0]
    shows(page, worst["summary"]["worst_frame"])
    page.keyboard.press("p")
    expect(lines).to_have_count(0)
    page.keyboard.press("p")
    expect(lines).to_have_count(1)
    outcomes = page.get_by_role("list", name="Outcomes").get_by_role("listitem")
    expect(outcomes).to_have_count(3)
    expect(outcomes.nth(1)).to_contain_text("frames 3 to 4: lost")
    charts = curves.get_by_role("img")
    expect(charts).to_have_count(0)
    curves.get_by_role("button", name="Curves").click()
    expect(charts).to_have_count(5)
    charts.first.locator(".u-over").click()
    assert page.locator(".film__time").inner_text().split("frame ")[1].startswith("3")
    with page.expect_download() as saved:
        card.get_by_role("link", name="SoccerNet JSON").click()
    assert saved.value.suggested_filename == "pan_0-6-soccernet.zip"


def test_lines_of_a_frame_mend_the_shot(recording: int, open_page: OpenPage, tripod: Film) -> None:
    page = tracked(open_page, recording)
    page.keyboard.press("n")
    shows(page, SPOILED[0])
    page.keyboard.press("e")
    page.wait_for_url("**/calibration?**")
    group = int(page.url.partition("/review/")[2].partition("/")[0])
    draw(page, group, tripod, SPOILED[0])
    page.get_by_role("link", name="‹ Recording").click()
    shows(page, SPOILED[0])
    card = page.get_by_role("region", name="Cameras", exact=True)
    expect(card).to_contain_text("Lines were drawn in frame 3")
    page.get_by_role("button", name="Track again").click()
    expect(card.get_by_role("columnheader", name="before")).to_be_visible(timeout=120_000)
    assert count(page, "lost")[0] == "2" and int(count(page, "lost")[1]) < 2
    expect(card).not_to_contain_text("Lines were drawn")
    curves = page.get_by_role("region", name="Cameras over time")
    expect(curves).to_contain_text("Key frame")
    page.keyboard.press("b")
    expect(page.get_by_text("These are the cameras before the last change.")).to_be_visible()
    expect(curves).to_contain_text("Frame 3 is lost")
    page.keyboard.press("b")
    expect(curves).not_to_contain_text("Frame 3 is lost")


def test_cameras_are_turned_by_half_and_back_by_key(recording: int, open_page: OpenPage) -> None:
    page = tracked(open_page, recording)

    def place() -> list[float]:
        answer = page.request.get(f"/api/v1/recordings/{recording}/cameras/0")
        found: list[float] = answer.json()["camera"][0][:3]
        return found

    before = place()
    button = page.get_by_role("button", name="Turn to the other side")
    expect(button).to_have_attribute("aria-pressed", "false")
    page.keyboard.press("Shift+t")
    expect(button).to_have_attribute("aria-pressed", "true")
    assert place() == [-before[0], -before[1], before[2]]
    expect(page.get_by_text("Shift T turns them back.")).to_be_visible()
    button.click()
    expect(button).to_have_attribute("aria-pressed", "false")
    assert place() == before


def test_groups_have_the_cameras_of_their_frames(recording: int, open_page: OpenPage) -> None:
    page = tracked(open_page, recording)
    page.keyboard.press("i")
    card = page.get_by_role("region", name="Instants")
    card.get_by_role("button", name="Make 1 group").click()
    card.get_by_role("link", name="1 group of this recording").click()
    found: list[int] = []

    def made() -> bool:
        items = page.request.get("/api/v1/groups?dataset=pans").json()["items"]
        found[:] = [item["id"] for item in items]
        return bool(found)

    until(page, made)
    page.goto(f"/review/{found[0]}/calibration")
    camera = page.get_by_role("region", name="Camera", exact=True)
    expect(camera.get_by_role("button", name="Given camera")).to_have_attribute(
        "aria-pressed", "true"
    )
    expect(camera).to_contain_text("±")


def test_the_page_is_usable_by_everybody_and_fits(recording: int, open_page: OpenPage) -> None:
    page = tracked(open_page, recording)
    found = {"axe": serious_in_both(page)}
    for width, height in SIZES:
        resize(page, width, height)
        found[f"too wide at {width}"] = soon(page, TOO_WIDE)
        found[f"scrolls twice at {width}"] = soon(page, NESTED_SCROLLERS)
        found[f"cut off at {width}"] = soon(page, BEYOND_ITS_FRAME)
    assert {name: what for name, what in found.items() if what} == {}
    page.keyboard.press("?")
    dialog = page.get_by_role("dialog")
    expect(dialog).to_contain_text("Track the camera of the shot")
    expect(dialog).to_contain_text("Next frame that is bridged or lost")


@pytest.mark.parametrize(("width", "height"), [(390, 800), (700, 900), (800, 1000), (720, 450)])
def test_the_picture_of_a_tracked_shot_stands_above_the_strip_in_a_narrow_window(
    recording: int, open_page: OpenPage, width: int, height: int
) -> None:
    page = tracked(open_page, recording)
    resize(page, width, height)
    boxes = []
    for name in (".film__picture", ".film__strip", ".camera__curves", ".film__rail"):
        box = page.locator(name).bounding_box()
        assert box is not None and box["height"] > 50, name
        boxes.append((box["y"], box["y"] + box["height"]))
    assert all(end < start for (_, end), (start, _) in pairwise(boxes))
    assert page.locator(".film__rail").evaluate("it => it.scrollHeight === it.clientHeight")
    page.keyboard.press("ArrowRight")
    shows(page, 1)
    box = page.locator(".film__picture").bounding_box()
    assert box is not None and box["y"] == boxes[0][0]


def test_the_picture_has_one_size_in_every_frame(recording: int, open_page: OpenPage) -> None:
    page = tracked(open_page, recording)
    heights = set()
    for frame in range(LAST + 1):
        shows(page, frame)
        heights.add(page.locator(".film__picture").evaluate("it => it.clientHeight"))
        page.keyboard.press("ArrowRight")
    assert len(heights) == 1


def test_the_pitch_that_a_shot_shows_is_taken_for_its_match(
    recording: int, open_page: OpenPage
) -> None:
    page = tracked(open_page, recording)
    here = f"/api/v1/recordings/{recording}"

    def other_pitch(route: Route) -> None:
        """The film is drawn on 105 x 68 m: as if it was not."""
        if route.request.method != "GET":
            route.continue_()
            return
        answer = route.fetch()
        cameras = answer.json()
        sigma = {"length": 0.2, "width": None, "crown": 0.01, "inward": 0.01, "tripod": 0.1}
        shown = {"length": 101.2, "width": None, "crown": 0.0, "inward": 0.0, "frames": 24}
        shown |= {"sigma": sigma, "tripod": [0, 90, -20], "other": {"length": 101.2, "width": 68.0}}
        for stretch in cameras["items"]:
            stretch["summary"]["pitch"] = shown
        route.fulfill(response=answer, json=cameras)

    page.route(f"**{here}/cameras", other_pitch)
    page.reload()
    card = page.get_by_role("region", name="Cameras", exact=True)
    expect(card).to_contain_text("length 101.2 ± 0.2 m, width unknown")
    button = card.get_by_role("button", name="Use 101.2 × 68 m for this match")
    expect(button).to_have_attribute("aria-disabled", "true")
    expect(card).to_contain_text("The match has no group yet")
    page.keyboard.press("i")
    page.get_by_role("button", name="Make 1 group").click()
    expect(button).to_have_attribute("aria-disabled", "false")
    runs = page.request.get(f"{here}/cameras").json()["items"][0]["revision"]
    button.click()

    def tracked_again() -> bool:
        return page.request.get(f"{here}/cameras").json()["items"][0]["revision"] > runs

    until(page, tracked_again)
    frames = page.request.get(f"{here}/cameras/0").json()
    assert frames["pitch"] == [101.2, 68.0]
    pitch = page.request.get("/api/v1/datasets/pans/pitches").json()["items"][0]
    assert (pitch["length"], pitch["width"]) == (101.2, 68.0)
    assert pitch["previous"] == {"length": 105.0, "width": 68.0}


def queued(page: Page, address: str, body: dict[str, Any] | None) -> dict[str, Any]:
    """A job that somebody begins elsewhere."""
    begun = page.request.post(address, data=body)
    assert begun.status == 202, begun.text()
    job: dict[str, Any] = begun.json()
    return job


def ends_all(page: Page, jobs: list[dict[str, Any]]) -> None:
    """Cancel jobs, the last first, and wait until they are over."""
    for job in reversed(jobs):
        page.request.delete(f"/api/v1/jobs/{job['id']}")
    open_jobs = "/api/v1/jobs?state=open&dataset=pans"
    until(page, lambda: page.request.get(open_jobs).json()["items"] == [])


def linked(page: Page, recording: int) -> int:
    """A link of the end of the film, as a replay, to its beginning."""
    here = f"/api/v1/recordings/{recording}"
    tag = {"If-Match": page.request.get(f"{here}/shots").headers["etag"]}
    live, replay = {"first": 0, "last": 3}, {"first": 4, "last": LAST}
    shots = [{**live, "kind": "main"}, {**replay, "kind": "replay"}]
    assert page.request.put(f"{here}/shots", data={"shots": shots}, headers=tag).ok
    both = {"live": live, "replay": {"recording": recording, **replay}}
    made = page.request.post(f"{here}/links", data=both)
    return int(made.json()["id"])


class TestBegunBefore:
    """A page that is opened, or loaded again, shows what is at work on it, and can end it."""

    def test_a_job_on_one_shot_leaves_the_others_to_be_tracked(
        self, recording: int, open_page: OpenPage
    ) -> None:
        page = open_page(f"/recordings/{recording}")
        shows(page, 0)
        linked(page, recording)
        here = f"/api/v1/recordings/{recording}"
        tracking = [queued(page, f"{here}/cameras", {"first": 0, "last": 3}) for _ in range(4)]
        page.reload()
        shows(page, 0)
        button = page.get_by_role("button", name="Track this shot")
        expect(button).to_have_attribute("title", "A job is running on this shot")
        page.keyboard.press("ArrowDown")
        shows(page, 4)
        expect(button).to_have_attribute("aria-disabled", "false")
        ends_all(page, tracking)

    def test_all_shots_are_tracked_by_one_button(self, recording: int, open_page: OpenPage) -> None:
        page = open_page(f"/recordings/{recording}")
        shows(page, 0)
        linked(page, recording)
        page.reload()
        shows(page, 0)
        page.get_by_role("button", name="Track all 2 shots without cameras").click()
        here = f"/api/v1/recordings/{recording}/cameras"
        until(page, lambda: len(page.request.get(here).json()["items"]) == 2)
        expect(page.get_by_role("button", name="Track all")).to_have_count(0)

    def test_a_recording_shows_tracking_shots_and_groups(
        self, recording: int, open_page: OpenPage
    ) -> None:
        page = open_page(f"/recordings/{recording}")
        shows(page, 0)
        here = f"/api/v1/recordings/{recording}"
        # One runs at a time: the first ones keep the others waiting.
        tracking = [queued(page, f"{here}/cameras", {"first": 0, "last": LAST}) for _ in range(4)]
        finding = queued(page, f"{here}/shots", None)
        grouping = queued(page, f"{here}/groups", {"frames": [0], "propose": False})
        page.reload()
        shows(page, 0)
        for card, job in (
            ("Cameras", tracking[0]),
            ("Shot", finding),
            ("Instants", grouping),
        ):
            at_work = page.get_by_role("region", name=card, exact=True).locator(".job")
            expect(at_work).to_contain_text(job["title"])
            expect(at_work.get_by_role("progressbar")).to_be_visible()
        button = page.get_by_role("button", name="Track this shot")
        expect(button).to_have_attribute("aria-disabled", "true")
        ends_all(page, [*tracking, finding, grouping])
        expect(page.get_by_role("progressbar")).to_have_count(0)
        expect(page.get_by_role("region", name="Shot", exact=True)).to_contain_text("cancelled")

    def test_a_link_shows_the_search_for_its_times(
        self, recording: int, open_page: OpenPage
    ) -> None:
        page = open_page("/recordings")
        here = f"/api/v1/recordings/{recording}"
        shots = page.request.get(f"{here}/shots")
        both = [
            {"first": 0, "last": 3, "kind": "main"},
            {"first": 4, "last": LAST, "kind": "replay"},
        ]
        tag = {"If-Match": shots.headers["etag"]}
        assert page.request.put(f"{here}/shots", data={"shots": both}, headers=tag).ok
        sides = {"live": {"first": 0, "last": 3}, "replay": {"recording": recording}}
        sides["replay"] |= {"first": 4, "last": LAST}
        link = page.request.post(f"{here}/links", data=sides).json()["id"]
        tracking = [queued(page, f"{here}/cameras", {"first": 0, "last": 3}) for _ in range(4)]
        looking = queued(page, f"{here}/links/{link}/ball", {})
        page.goto(f"/recordings/{recording}/links/{link}")
        at_work = page.get_by_role("region", name="Ball").locator(".job")
        expect(at_work).to_contain_text(looking["title"])
        button = page.get_by_role("button", name="Find the times from the ball")
        expect(button).to_have_attribute("aria-disabled", "true")
        at_work.get_by_role("button", name="Cancel").click()
        expect(at_work).to_contain_text("cancelled")
        expect(button).to_have_attribute("aria-disabled", "false")
        ends_all(page, tracking)

    def test_the_list_shows_what_is_being_indexed(
        self, recording: int, open_page: OpenPage
    ) -> None:
        page = open_page("/recordings")
        here = f"/api/v1/recordings/{recording}"
        tracking = [queued(page, f"{here}/cameras", {"first": 0, "last": LAST}) for _ in range(4)]
        finding = queued(page, f"{here}/shots", None)
        page.reload()
        at_work = page.get_by_role("region", name="Add a recording").locator(".job")
        expect(at_work).to_contain_text(finding["title"])
        at_work.get_by_role("button", name="Cancel").click()
        expect(at_work).to_contain_text("cancelled")
        ends_all(page, tracking)


class TestKeyboardAlone:
    @pytest.mark.parametrize("size", SIZES[:2])
    def test_leads_through_a_recording(
        self, recording: int, open_page: OpenPage, size: tuple[int, int]
    ) -> None:
        page = tracked(open_page, recording)
        page.keyboard.press("i")
        link = linked(page, recording)
        clocks = {"clocks": [{"frame": 0, "half": 1, "seconds": 760}]}
        assert page.request.patch(f"/api/v1/recordings/{recording}", data=clocks).ok
        page.reload()
        shows(page, 0)
        expect(page.get_by_role("link", name=re.compile("frames 4 to"))).to_be_visible()
        resize(page, *size)
        assert faults_of(page) == []
        page.goto(f"/recordings/{recording}/links/{link}")
        page.wait_for_selector(".linking__side[data-frame] img >> nth=1")
        page.keyboard.press("i")
        expect(page.get_by_role("region", name="Instants")).to_contain_text("1 instant")
        assert faults_of(page) == []

    def test_leads_through_the_list(self, recording: int, open_page: OpenPage) -> None:
        page = open_page("/recordings")
        expect(page.get_by_role("link", name="pan")).to_be_visible()
        assert faults_of(page) == []

    def test_leads_through_the_practice_on_a_recording(self, open_page: OpenPage) -> None:
        page = open_page("/help/practice")
        expect(page.get_by_role("button", name="Make the recording")).to_be_visible()
        assert faults_of(page) == []
