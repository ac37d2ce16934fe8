"""The ball in the browser: one click follows it, keys lead to what is uncertain, accept it and take it back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests.drawn_balls import FRAMES, SIZE, WALL, place, write_film
from tests.e2e.conftest import Console
from tests.e2e.screen import until
from tests.e2e.service import delete_dataset
from tests.e2e.test_access import SIZES, resize, serious_in_both, soon
from tests.e2e.test_pages import TOO_WIDE
from tests.e2e.test_recordings import shows

OpenPage = Callable[..., Page]


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_film(tmp_path_factory.mktemp("ball") / "ball.avi")


@pytest.fixture
def recording(film: Path, server: str) -> Iterator[int]:
    """The film as a recording of one shot, two of its frames groups; ask before the page."""
    with httpx.Client(base_url=f"{server}/api/v1", timeout=60) as client:
        kind = {"Content-Type": "application/octet-stream"}
        sent = client.post(f"/uploads?name={film.name}", content=film.read_bytes(), headers=kind)
        body = {"dataset": "balls", "source": {"upload": sent.json()["id"]}}

        def ended(path: str, body: object) -> dict[str, object]:
            job = client.post(path, json=body).json()
            while job["state"] not in ("done", "failed"):
                job = client.get(f"/jobs/{job['id']}").json()
            assert job["state"] == "done", job
            found: dict[str, object] = job["result"]
            return found

        number = ended("/recordings", body)["recording"]
        path = f"/recordings/{number}/shots"
        shots = [{"first": 0, "last": FRAMES - 1, "kind": "main"}]
        tag = {"If-Match": client.get(path).headers["etag"]}
        assert client.put(path, json={"shots": shots}, headers=tag).status_code == 200
        ended(f"/recordings/{number}/groups", {"frames": [4, 20], "propose": False})
    yield int(str(number))
    delete_dataset(server, "balls")


def click(page: Page, frame: int) -> None:
    """Click the ball where it is in a frame that is on screen."""
    layer = page.locator(".ball__layer")
    expect(layer).to_have_attribute("data-frame", str(frame))
    box = layer.bounding_box()
    assert box is not None
    scale = min(box["width"] / SIZE[0], box["height"] / SIZE[1])
    left = box["x"] + (box["width"] - SIZE[0] * scale) / 2
    top = box["y"] + (box["height"] - SIZE[1] * scale) / 2
    x, y = place(frame)
    page.mouse.click(left + (x + 0.5) * scale, top + (y + 0.5) * scale)


def test_one_click_follows_and_keys_accept_and_take_back(
    recording: int, open_page: OpenPage
) -> None:
    page = open_page(f"/recordings/{recording}")
    shows(page, 0)
    click(page, 0)
    card = page.get_by_role("region", name="Ball", exact=True)
    expect(card).to_contain_text(f"frames 0 to {FRAMES - 1}", timeout=120_000)
    expect(page.locator(".ball__mark")).to_have_count(2)
    expect(card).to_contain_text("Frame 0: followed")
    page.keyboard.press("v")
    shows(page, WALL[0])
    expect(card).to_contain_text("uncertain")
    expect(page.locator(".ball__layer g")).to_have_attribute("data-state", "uncertain")
    page.keyboard.press("o")
    expect(card).to_contain_text("confirmed")
    page.keyboard.press("y")
    expect(card).to_contain_text("the ball was added to 2 views")
    page.keyboard.press("Delete")
    expect(card.get_by_role("button", name="Delete the accepted ball?")).to_be_visible()
    page.keyboard.press("u")
    expect(card).not_to_contain_text("Accepted")
    page.keyboard.press("Delete")
    expect(card.get_by_role("button", name="Delete the corrected ball?")).to_be_visible()
    page.keyboard.press("Delete")
    expect(card).to_contain_text("Click the ball in the picture")


def test_a_click_while_it_plays_follows_from_the_frame_that_was_seen(
    recording: int, open_page: OpenPage
) -> None:
    page = open_page(f"/recordings/{recording}")
    shows(page, 0)
    # The next frames never come: the page is waiting for one, as in playback.
    page.route("**/frames/**", lambda route: None)
    page.keyboard.press("l")
    expect(page.locator(".film__coming")).to_be_visible()
    frame = int(page.locator(".ball__layer").get_attribute("data-frame") or "")
    click(page, frame)
    card = page.get_by_role("region", name="Ball", exact=True)
    expect(card).to_contain_text(f"frames 0 to {FRAMES - 1}", timeout=120_000)
    (run,) = page.request.get(f"/api/v1/recordings/{recording}/ball-runs").json()["items"]
    found = page.request.get(f"/api/v1/recordings/{recording}/ball-runs/{run['id']}").json()
    assert [clicked["frame"] for clicked in found["clicks"]] == [frame]
    expect(page.get_by_role("button", name="Play Space")).to_be_visible()


def test_a_cross_clicks_by_keyboard(recording: int, open_page: OpenPage) -> None:
    page = open_page(f"/recordings/{recording}")
    shows(page, 0)
    page.keyboard.press("f")
    expect(page.locator(".ball__cross")).to_have_count(1)
    across, down = place(0)
    for key, way in (
        ("Left", SIZE[0] / 2 - across),
        ("Up", SIZE[1] / 2 - down),
    ):
        for _ in range(int(way // 8)):
            page.keyboard.press(f"Arrow{key}")
        for _ in range(round(way % 8)):
            page.keyboard.press(f"Alt+Arrow{key}")
    page.keyboard.press("Enter")
    card = page.get_by_role("region", name="Ball", exact=True)
    expect(card).to_contain_text(f"frames 0 to {FRAMES - 1}", timeout=120_000)
    expect(page.locator(".ball__cross")).to_have_count(0)


def test_a_page_that_is_loaded_again_shows_what_a_click_was_followed_to(
    recording: int, open_page: OpenPage
) -> None:
    page = open_page(f"/recordings/{recording}")
    shows(page, 0)
    runs = f"/api/v1/recordings/{recording}/ball-runs"
    click(page, 0)
    until(page, lambda: page.request.get(runs).json()["following"] == [0])
    page.reload()
    card = page.get_by_role("region", name="Ball", exact=True)
    expect(card).to_contain_text(f"frames 0 to {FRAMES - 1}", timeout=120_000)
    assert len(page.request.get(runs).json()["items"]) == 1


def test_a_cross_clicks_where_its_button_has_the_focus(
    recording: int, open_page: OpenPage, console: Console
) -> None:
    # Nothing there looks like a ball: that is what the server says of the place of the cross.
    console.expect("400")
    page = open_page(f"/recordings/{recording}")
    shows(page, 0)
    button = page.get_by_role("button", name="Cross F")
    button.focus()
    page.keyboard.press("Enter")
    expect(page.locator(".ball__cross")).to_have_count(1)
    page.keyboard.press("ArrowLeft")
    with page.expect_response("**/ball-runs") as answered:
        page.keyboard.press("Enter")
    assert answered.value.request.method == "POST"
    assert answered.value.request.post_data_json["x"] == SIZE[0] / 2 - 8
    expect(button).to_be_focused()


def test_it_is_usable_by_everybody_in_every_size(recording: int, open_page: OpenPage) -> None:
    page = open_page(f"/recordings/{recording}")
    shows(page, 0)
    click(page, 0)
    card = page.get_by_role("region", name="Ball", exact=True)
    expect(card).to_contain_text(f"frames 0 to {FRAMES - 1}", timeout=120_000)
    assert serious_in_both(page) == []
    for width, height in SIZES:
        resize(page, width, height)
        assert soon(page, TOO_WIDE) == []
