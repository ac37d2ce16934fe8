"""Cameras over time in the browser: a shot is tracked, watched, and mended at a frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest
from playwright.sync_api import Page, Route, expect

from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.solving.jaccard import project_markings
from tests.e2e.screen import until
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
    charts = page.get_by_role("region", name="Cameras over time").get_by_role("img")
    expect(charts).to_have_count(4)
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
    expect(card).to_contain_text("Frame 3 has lines since")
    page.get_by_role("button", name="Track again").click()
    expect(card.get_by_role("columnheader", name="before")).to_be_visible(timeout=120_000)
    assert count(page, "lost")[0] == "2" and int(count(page, "lost")[1]) < 2
    expect(card).not_to_contain_text("has lines since")
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
    button = page.get_by_role("button", name="Turn by half")
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
    expect(dialog).to_contain_text("Next frames that are lost or bridged")


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
    expect(card).to_contain_text("A match gets a pitch with its first group")
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
