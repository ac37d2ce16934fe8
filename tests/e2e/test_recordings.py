"""A recording in the browser: added, watched, cut into shots, and made groups of."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import httpx
import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.e2e.screen import holding, jobs_end, until
from tests.e2e.service import delete_dataset, free_port, killable
from tests.e2e.test_access import (
    BEYOND_ITS_FRAME,
    NESTED_SCROLLERS,
    SIZES,
    resize,
    serious_in_both,
    soon,
)
from tests.e2e.test_pages import TOO_WIDE
from tests.videos import write_pictures

OpenPage = Callable[..., Page]
SHOTS = ((40, 120, 40), (160, 90, 60), (60, 60, 150))
"""Colours of three shots of forty frames, blue green red."""
LONG = 40


def pictures() -> Iterator[np.ndarray]:
    """Frames that tell their number, in shots of one colour each."""
    for shot, colour in enumerate(SHOTS):
        for number in range(LONG):
            picture = np.full((360, 640, 3), colour, np.uint8)
            cv2.line(picture, (0, 60 * shot + 40), (640, 200 + shot * 40), (250, 250, 250), 4)
            cv2.circle(picture, (40 + 12 * number, 180), 20, (230, 230, 230), -1)
            text = str(shot * LONG + number)
            cv2.putText(picture, text, (250, 330), cv2.FONT_HERSHEY_SIMPLEX, 2, (255, 255, 255), 3)
            yield picture


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_pictures(tmp_path_factory.mktemp("film") / "cup final.mp4", "mp4v", pictures())


@pytest.fixture
def recording(film: Path, server: str) -> Iterator[int]:
    """The film as a recording of the dataset *cup*, cut into its three shots; ask before the page."""
    with httpx.Client(base_url=f"{server}/api/v1") as client:
        sent = client.post(
            f"/uploads?name={film.name}",
            content=film.read_bytes(),
            headers={"Content-Type": "application/octet-stream"},
        ).json()
        body = {"dataset": "cup", "source": {"upload": sent["id"]}}
        job = client.post("/recordings", json=body).json()
        while job["state"] not in ("done", "failed"):
            job = client.get(f"/jobs/{job['id']}").json()
        assert job["state"] == "done", job
        number = job["result"]["recording"]
        path = f"/recordings/{number}/shots"
        starts = range(0, LONG * len(SHOTS), LONG)
        shots = [{"first": at, "last": at + LONG - 1, "kind": "other"} for at in starts]
        tag = {"If-Match": client.get(path).headers["etag"]}
        assert client.put(path, json={"shots": shots}, headers=tag).status_code == 200
    yield number
    delete_dataset(server, "cup")


def opened(open_page: OpenPage, recording: int, **more: Any) -> Page:
    """The page of a recording, its first frame seen."""
    page = open_page(f"/recordings/{recording}", **more)
    shows(page, 0)
    return page


def shows(page: Page, frame: int) -> None:
    """Wait until a frame is seen, and not only wanted."""
    page.wait_for_selector(f'.film__stage[data-frame="{frame}"] img')


def shots_of(page: Page, recording: int) -> list[dict[str, Any]]:
    """The shots as the server has them."""
    found: list[dict[str, Any]] = page.request.get(f"/api/v1/recordings/{recording}/shots").json()[
        "items"
    ]
    return found


class TestAdding:
    def test_a_video_is_sent_indexed_and_opened(
        self, film: Path, open_page: OpenPage, server: str
    ) -> None:
        page = open_page("/recordings")
        page.get_by_label("Dataset", exact=True).fill("sent")
        page.set_input_files("#import-file", film)
        pill = page.get_by_role("list", name="Uploads").locator(".pill").first
        expect(pill).to_have_text("uploaded")
        page.get_by_role("button", name="Add and find its shots").click()
        page.get_by_role("link", name="Open cup final").click()
        shows(page, 0)
        expect(page.get_by_text("120 frames")).to_be_visible()
        page.get_by_role("link", name="Recordings").first.click()
        row = page.get_by_role("row", name="cup final")
        expect(row).to_contain_text("640 × 360 · 25 frames a second")
        row.get_by_role("button", name="Remove").click()
        row.get_by_role("button", name="Remove with its shots").click()
        expect(row).to_have_count(0)
        delete_dataset(server, "sent")

    def test_a_picture_is_no_recording_and_a_video_no_import(
        self, film: Path, tmp_path: Path, open_page: OpenPage
    ) -> None:
        cv2.imwrite(str(tmp_path / "a.png"), next(pictures()))
        page = open_page("/recordings")
        page.set_input_files("#import-file", tmp_path / "a.png")
        expect(page.get_by_role("alert")).to_contain_text("a.png is not a video")
        page.goto("/import")
        page.set_input_files("#import-file", film)
        expect(page.get_by_role("alert")).to_contain_text("Add it on the page Recordings")


SLOW = {"downloadThroughput": -1, "uploadThroughput": 4e6, "latency": 0}
"""A network as Chromium imitates it: bytes a second."""


class TestSending:
    """Uploads go on where they were."""

    @pytest.fixture(autouse=True)
    def _without_uploads_of_others(self, server: str) -> None:
        """The page shows all that are under way, and tests share the server."""
        uploads = f"{server}/api/v1/uploads"
        for one in httpx.get(uploads).json()["items"]:
            if not one["kept"]:
                gone = httpx.delete(f"{uploads}/{one['id']}")
                assert gone.is_success, gone.text

    @pytest.fixture
    def films(self, film: Path, tmp_path: Path) -> list[Path]:
        """Two videos, the first of 30 MB: readers pass over what follows its boxes."""
        long, short = tmp_path / "long.mp4", tmp_path / "short.mp4"
        short.write_bytes(film.read_bytes())
        rest = 30_000_000
        head = (rest + 8).to_bytes(4, "big") + b"free"
        long.write_bytes(film.read_bytes() + head + bytes(rest))
        return [long, short]

    def test_several_are_dropped_and_each_becomes_a_recording_when_it_is_here(
        self, films: list[Path], open_page: OpenPage, server: str
    ) -> None:
        page = open_page("/recordings")
        uploads = page.get_by_role("list", name="Uploads")
        page.get_by_label("Dataset", exact=True).fill("sent")
        page.set_input_files("#import-file", films)
        expect(uploads).to_contain_text("MB")
        expect(page.get_by_label("Dataset", exact=True)).to_have_value("sent")
        # Before they are here.
        page.get_by_role("button", name="Add and find its shots").click()
        page.get_by_role("link", name="Open long").wait_for()
        page.get_by_role("link", name="Open short").wait_for()
        expect(uploads.get_by_role("listitem")).to_have_count(2)
        expect(page.get_by_role("row", name="short")).to_contain_text("640 × 360")
        delete_dataset(server, "sent")

    def test_one_goes_on_after_the_page_was_closed(
        self, films: list[Path], open_page: OpenPage, server: str
    ) -> None:
        page = open_page("/recordings")
        network = page.context.new_cdp_session(page)
        network.send("Network.enable")
        network.send("Network.emulateNetworkConditions", {**SLOW, "offline": False})
        uploads = page.get_by_role("list", name="Uploads")
        page.set_input_files("#import-file", films[0])
        expect(uploads.get_by_role("progressbar")).not_to_have_attribute("aria-valuenow", "0")
        until(page, lambda: half_sent(page) > 0)
        network.detach()
        page.reload()
        expect(uploads).to_contain_text("Choose the file again to continue")
        there = half_sent(page)
        page.set_input_files("#import-file", films[0])
        expect(uploads.locator(".pill").first).to_have_text("uploaded")
        expect(uploads.get_by_role("listitem")).to_have_count(1)
        assert 0 < there < films[0].stat().st_size
        uploads.get_by_role("button", name="Remove").click()
        expect(uploads).to_have_count(0)
        items = page.request.get("/api/v1/uploads").json()["items"]
        # The server is shared: other tests leave uploads of their own.
        assert films[0].name not in [one["name"] for one in items if not one["kept"]]

    def test_one_goes_on_after_the_server_was_killed(
        self, films: list[Path], tmp_path: Path, open_page: OpenPage, console: Any
    ) -> None:
        console.expect("Failed to load resource")
        home = tmp_path / "home"
        home.mkdir()
        port = free_port()
        with killable(home, port) as server:
            page = open_page("/recordings", address=f"http://127.0.0.1:{port}")
            network = page.context.new_cdp_session(page)
            network.send("Network.enable")
            network.send("Network.emulateNetworkConditions", {**SLOW, "offline": False})
            uploads = page.get_by_role("list", name="Uploads")
            page.set_input_files("#import-file", films[0])
            until(page, lambda: half_sent(page) > 0)
            server.kill()
            expect(uploads).to_contain_text("it continues by itself")
        with killable(home, port):
            network.detach()
            expect(uploads.locator(".pill").first).to_have_text("uploaded")
            (sent,) = page.request.get(f"http://127.0.0.1:{port}/api/v1/uploads").json()["items"]
            content = next((home / "uploads").glob("*/content/long.mp4")).read_bytes()
            assert (sent["bytes"], content) == (sent["size"], films[0].read_bytes())


def half_sent(page: Page) -> int:
    """Bytes of the upload that the server has not all of."""
    address = page.url.removesuffix("/recordings")
    items = page.request.get(f"{address}/api/v1/uploads").json()["items"]
    return sum(int(one["bytes"]) for one in items if one["bytes"] < one["size"])


class TestWatching:
    def test_keys_step_jump_and_play(self, recording: int, open_page: OpenPage) -> None:
        page = opened(open_page, recording)
        for key, frame in (
            ("ArrowRight", 1),
            ("ArrowRight", 2),
            ("ArrowLeft", 1),
            ("Shift+ArrowRight", 26),
            ("ArrowDown", 40),
            ("ArrowDown", 80),
            ("ArrowUp", 40),
        ):
            page.keyboard.press(key)
            shows(page, frame)
        expect(page.locator("[data-timecode]")).to_have_text("00:01.15")
        page.keyboard.press("l")
        until(page, lambda: int(page.locator(".film__stage").get_attribute("data-frame") or 0) > 44)
        page.keyboard.press("k")
        expect(page.get_by_role("button", name="Play Space")).to_be_visible()
        page.keyboard.press("j")
        until(page, lambda: int(page.locator(".film__stage").get_attribute("data-frame") or 0) < 40)
        page.keyboard.press("Space")
        expect(page.get_by_role("button", name="Play Space")).to_be_visible()

    def test_the_time_of_the_match_stands_beside_the_timecode(
        self, recording: int, open_page: OpenPage
    ) -> None:
        page = opened(open_page, recording)
        page.keyboard.press("Shift+ArrowRight")
        shows(page, 25)
        card = page.get_by_role("region", name="Time of the match")
        card.get_by_label("What the clock shows in this frame").fill("12:40")
        card.get_by_role("button", name="Set for this frame").click()
        expect(page.locator("[data-match-time]")).to_have_text("1st half 12:40")
        page.locator("body").press("Shift+ArrowRight")
        shows(page, 50)
        expect(page.locator("[data-match-time]")).to_have_text("1st half 12:41")
        found = page.request.get(f"/api/v1/recordings/{recording}").json()["clocks"]
        assert found == [{"frame": 25, "half": 1, "seconds": 760.0}]
        card.get_by_role("button", name="Remove the clock of frame 25").click()
        expect(page.locator("[data-match-time]")).to_have_count(0)

    def test_the_strip_leads_to_its_shots(self, recording: int, open_page: OpenPage) -> None:
        page = opened(open_page, recording)
        strip = page.get_by_role("region", name="Shots")
        expect(strip.get_by_role("button")).to_have_count(3)
        strip.get_by_role("button", name="Shot 3: other, 1.6 s").click()
        shows(page, 80)
        slider = page.get_by_role("slider", name="Frame")
        slider.focus()
        slider.press("End")
        shows(page, 119)


class TestCutting:
    def test_shots_are_split_merged_named_and_dropped_by_keys(
        self, recording: int, open_page: OpenPage
    ) -> None:
        page = opened(open_page, recording)

        def has(*wanted: tuple[int, int, str, bool | None]) -> None:
            until(
                page,
                lambda: (
                    [
                        (one["first"], one["last"], one["kind"], one["kept"])
                        for one in shots_of(page, recording)
                    ]
                    == [*wanted]
                ),
            )

        last = (80, 119, "other", None)
        page.keyboard.press("1")
        page.keyboard.press("a")
        has((0, 39, "main", True), (40, 79, "other", None), last)
        page.keyboard.press("ArrowDown")
        shows(page, 40)
        page.keyboard.press("Shift+ArrowRight")
        shows(page, 65)
        page.keyboard.press("s")
        page.keyboard.press("2")
        page.keyboard.press("x")
        has((0, 39, "main", True), (40, 64, "other", None), (65, 79, "replay", False), last)
        expect(page.get_by_role("button", name="Shot 3: replay, dropped, 0.6 s")).to_be_visible()
        page.keyboard.press("m")
        has((0, 39, "main", True), (40, 64, "other", None), (65, 119, "replay", False))
        page.keyboard.press("Control+z")
        has((0, 39, "main", True), (40, 64, "other", None), (65, 79, "replay", False), last)

    def test_all_are_found_again_and_taken_back(self, recording: int, open_page: OpenPage) -> None:
        page = opened(open_page, recording)
        mine = [(one["first"], one["kind"]) for one in shots_of(page, recording)]
        page.keyboard.press("m")
        strip = page.get_by_role("region", name="Shots").get_by_role("button")
        expect(strip).to_have_count(2)
        page.get_by_role("button", name="Find all shots again").click()
        expect(strip).to_have_count(3)
        page.keyboard.press("Control+z")
        expect(strip).to_have_count(2)
        page.keyboard.press("Control+z")
        expect(strip).to_have_count(3)
        until(
            page, lambda: [(one["first"], one["kind"]) for one in shots_of(page, recording)] == mine
        )

    def test_a_file_that_has_changed_is_indexed_again(
        self, recording: int, open_page: OpenPage, home: Path
    ) -> None:
        for film in (home / "uploads").glob("*/content/cup final.mp4"):
            film.touch()
        page = open_page(f"/recordings/{recording}")
        expect(page.get_by_role("alert")).to_contain_text("has changed since it was indexed")
        page.get_by_role("button", name="Index the recording again").click()
        expect(page.get_by_role("region", name="Shots").get_by_role("button")).to_have_count(3)

    def test_what_somebody_else_changed_is_not_overwritten(
        self, recording: int, open_page: OpenPage, console: Any
    ) -> None:
        console.expect("412 (Precondition Failed)")
        page = opened(open_page, recording)
        path = f"/api/v1/recordings/{recording}/shots"
        tag = page.request.get(path).headers["etag"]
        theirs = {"shots": [{"first": 0, "last": 119, "kind": "closeup"}]}
        assert page.request.put(path, data=theirs, headers={"If-Match": tag}).ok
        page.keyboard.press("1")
        expect(page.get_by_text("The shots changed in another window")).to_be_visible()
        expect(page.get_by_role("region", name="Shots").get_by_role("button")).to_have_count(1)
        assert shots_of(page, recording)[0]["kind"] == "closeup"

    def test_what_waits_behind_a_refused_change_falls_with_it(
        self, recording: int, open_page: OpenPage, console: Any
    ) -> None:
        console.expect("412 (Precondition Failed)")
        page = opened(open_page, recording)
        path = f"/api/v1/recordings/{recording}/shots"
        tag = page.request.get(path).headers["etag"]
        theirs = {"shots": [{"first": 0, "last": 119, "kind": "closeup"}]}
        with holding(page, f"**{path}") as sent:
            page.keyboard.press("1")
            sent.arrive()
            page.keyboard.press("2")
            page.keyboard.press("x")
            assert page.request.put(path, data=theirs, headers={"If-Match": tag}).ok
        shots = page.get_by_role("region", name="Shots").get_by_role("button")
        expect(shots).to_have_count(1)
        page.keyboard.press("a")
        until(page, lambda: shots_of(page, recording)[0]["kept"] is True)
        assert [one["kind"] for one in shots_of(page, recording)] == ["closeup"]
        expect(shots).to_have_count(1)


class TestInstants:
    def test_chosen_frames_become_groups(self, recording: int, open_page: OpenPage) -> None:
        page = opened(open_page, recording)
        page.keyboard.press("i")
        card = page.get_by_role("region", name="Instants")
        expect(card).to_contain_text("1 frame chosen")
        page.keyboard.press("ArrowDown")
        shows(page, 40)
        card.get_by_label("Every").fill("20")
        card.get_by_role("button", name="Choose", exact=True).click()
        expect(card).to_contain_text("3 frames chosen")
        card.get_by_label("Propose cameras afterwards").uncheck()
        card.get_by_role("button", name="Make 3 groups").click()
        card.get_by_role("link", name="3 groups of this recording").click()
        # With their heading.
        expect(page.locator(".queue-row")).to_have_count(4)
        jobs_end(page)
        rows = page.request.get("/api/v1/groups?dataset=cup").json()["items"]
        assert [row["key"] for row in rows] == [f"cup final/{n}.png" for n in (0, 40, 60)]

    def test_frame_and_choice_outlive_a_reload_and_the_header_names_the_dataset(
        self, recording: int, open_page: OpenPage
    ) -> None:
        page = opened(open_page, recording)
        expect(page.locator(".header__dataset-name")).to_have_text("cup")
        page.keyboard.press("i")
        page.keyboard.press("ArrowDown")
        shows(page, 40)
        page.wait_for_url("**/recordings/*?frame=40")
        page.reload()
        shows(page, 40)
        expect(page.get_by_role("region", name="Instants")).to_contain_text("1 frame chosen")

    def test_keys_that_can_do_nothing_say_why(self, recording: int, open_page: OpenPage) -> None:
        page = opened(open_page, recording)
        for key, why in [
            ("s", "begins with this frame"),
            ("Control+z", "nothing to undo"),
            ("w", "No frame is tracked."),
            ("n", "This shot has no cameras yet."),
            ("b", "This shot has no previous cameras."),
            ("v", "No ball is followed in this shot."),
            *((key, "No ball is followed in this frame.") for key in ("o", "u", "y", "Delete")),
        ]:
            page.keyboard.press(key)
            expect(page.locator(".explained")).to_contain_text(why)
        page.keyboard.press("ArrowDown")
        shows(page, 40)
        page.keyboard.press("ArrowDown")
        shows(page, 80)
        page.keyboard.press("m")
        expect(page.get_by_text("This is the last shot")).to_be_visible()

    def test_what_is_chosen_while_groups_are_made_stays_chosen(
        self, recording: int, open_page: OpenPage
    ) -> None:
        page = opened(open_page, recording)
        page.keyboard.press("i")
        card = page.get_by_role("region", name="Instants")
        card.get_by_label("Propose cameras afterwards").uncheck()
        with holding(page, f"**/api/v1/recordings/{recording}/groups", answered=True) as made:
            card.get_by_role("button", name="Make 1 group").click()
            made.arrive()
            page.keyboard.press("ArrowDown")
            shows(page, 40)
            page.keyboard.press("i")
            expect(card).to_contain_text("2 frames chosen")
        card.get_by_role("link", name="1 group of this recording").wait_for()
        expect(card).to_contain_text("1 frame chosen")
        expect(card.get_by_role("button", name="Make 1 group")).to_be_enabled()
        jobs_end(page)


@pytest.fixture
def link(recording: int, server: str) -> str:
    """The page of a link of the second shot, a replay, to the first one, without an instant."""
    with httpx.Client(base_url=f"{server}/api/v1/recordings/{recording}") as client:
        shots = client.get("/shots")
        kinds = ("main", "replay", "other")
        items = [
            {"first": one["first"], "last": one["last"], "kind": kind}
            for one, kind in zip(shots.json()["items"], kinds, strict=True)
        ]
        tag = {"If-Match": shots.headers["etag"]}
        assert client.put("/shots", json={"shots": items}, headers=tag).status_code == 200
        both = {
            "live": {"first": 0, "last": LONG - 1},
            "replay": {"recording": recording, "first": LONG, "last": 2 * LONG - 1},
        }
        made = client.post("/links", json=both).json()
    return f"/recordings/{recording}/links/{made['id']}"


def side(page: Page, name: str, frame: int) -> None:
    """Wait until a side shows a frame."""
    page.wait_for_selector(f'.linking__side[aria-label="{name}"][data-frame="{frame}"] img')


def linked(page: Page, link: str) -> list[tuple[int, int]]:
    """The instants as the server has them."""
    found = page.request.get(f"/api/v1{link}").json()["instants"]
    return [(one["live"], one["replay"]) for one in found]


class TestLinking:
    def test_a_replay_leads_to_its_live_shot(
        self, recording: int, link: str, open_page: OpenPage
    ) -> None:
        page = opened(open_page, recording)
        with page.expect_response("**/links/suggestions/**"):
            page.keyboard.press("ArrowDown")
        shows(page, 40)
        card = page.get_by_role("region", name="Links")
        expect(card).to_contain_text("0 instants")
        expect(card).not_to_contain_text("No shot of the main camera")
        card.get_by_role("link", name="frames 0 to 39").click()
        side(page, "Live", 0)
        page.get_by_role("button", name="Remove this link").click()
        page.get_by_role("button", name="Remove the link with its 0 instants").click()
        shows(page, 0)
        page.keyboard.press("ArrowDown")
        shows(page, 40)
        expect(card).to_contain_text("Main camera, 1.6 s long, ends 0.0 s before the replay.")
        card.get_by_role("button", name="Link to cup final").click()
        side(page, "Live", 0)
        side(page, "Replay", 40)

    def test_instants_are_linked_by_keys_and_taken_back(
        self, link: str, open_page: OpenPage
    ) -> None:
        page = open_page(link)
        side(page, "Replay", 40)
        times, instants = (page.get_by_role("region", name=name) for name in ("Times", "Instants"))
        together = page.get_by_role("button", name="Play together")
        expect(times).to_contain_text("Go to the same instant in both")
        expect(together).to_have_attribute("title", "Link two instants first")
        for key in ("ArrowRight", "ArrowRight", "2", "Shift+ArrowRight"):
            page.keyboard.press(key)
        side(page, "Live", 2)
        side(page, "Replay", 65)
        page.keyboard.press("i")
        expect(times).to_contain_text("assumed to run at live speed")
        page.get_by_label("Assume that the replay is").fill("4")
        times.get_by_role("button", name="Assume").click()
        expect(times).to_contain_text("assumed to run 4.0 times slower than live")
        page.keyboard.press("ArrowRight")
        page.keyboard.press("ArrowRight")
        page.keyboard.press("1")
        page.keyboard.press("ArrowRight")
        side(page, "Live", 3)
        side(page, "Replay", 67)
        page.keyboard.press("i")
        expect(times).to_contain_text("are too close together to tell the speed (0.5 ± 0.71)")
        page.keyboard.press("Control+z")
        until(page, lambda: linked(page, link) == [(2, 65)])
        for _ in range(5):
            page.keyboard.press("ArrowRight")
        page.keyboard.press("2")
        for _ in range(10):
            page.keyboard.press("ArrowRight")
        side(page, "Live", 8)
        side(page, "Replay", 77)
        page.keyboard.press("i")
        expect(times).to_contain_text("The replay runs 2.0 times slower than live (speed 0.500 ±")
        until(page, lambda: linked(page, link) == [(2, 65), (8, 77)])
        expect(instants.get_by_role("row")).to_have_count(3)
        page.keyboard.press("ArrowUp")
        side(page, "Live", 2)
        side(page, "Replay", 65)
        instants.get_by_role("button", name="Remove the instant at live frame 8").click()
        until(page, lambda: linked(page, link) == [(2, 65)])
        page.keyboard.press("Control+z")
        until(page, lambda: linked(page, link) == [(2, 65), (8, 77)])

    def test_the_replay_follows_the_live_shot(self, link: str, open_page: OpenPage) -> None:
        page = open_page(link)
        side(page, "Replay", 40)
        tag = {"If-Match": page.request.get(f"/api/v1{link}").headers["etag"]}
        pairs = {"instants": [{"live": 10, "replay": 40}, {"live": 29, "replay": 78}]}
        answer = page.request.put(f"/api/v1{link}/instants", data=pairs, headers=tag)
        assert answer.ok
        page.reload()
        side(page, "Replay", 40)
        page.keyboard.press("p")
        expect(page.get_by_role("button", name="Play together")).to_have_attribute(
            "aria-pressed", "true"
        )
        until(page, lambda: frame_of(page, "Live") > 14)
        page.keyboard.press("k")
        live = page.get_by_role("slider", name="Live frame")
        live.focus()
        live.press("Home")
        side(page, "Live", 0)
        for _ in range(12):
            live.press("ArrowRight")
        side(page, "Live", 12)
        side(page, "Replay", 44)
        page.get_by_role("slider", name="Replay frame").press("ArrowRight")
        side(page, "Replay", 45)
        together = page.get_by_role("button", name="Play together")
        expect(together).to_have_attribute("aria-pressed", "false")
        page.wait_for_url("**live=12&replay=45")
        page.reload()
        side(page, "Live", 12)
        side(page, "Replay", 45)
        page.keyboard.press("ArrowDown")
        side(page, "Live", 29)
        page.keyboard.press("p")
        until(page, lambda: 10 <= frame_of(page, "Live") < 20)

    def test_groups_get_the_views_of_linked_replays(
        self, recording: int, link: str, open_page: OpenPage
    ) -> None:
        page = opened(open_page, recording)
        card = page.get_by_role("region", name="Instants")
        expect(card.get_by_role("button", name="Make groups")).to_have_attribute(
            "title", "Choose an instant first"
        )
        tag = {"If-Match": page.request.get(f"/api/v1{link}").headers["etag"]}
        pairs = {"instants": [{"live": 10, "replay": 40}, {"live": 29, "replay": 78}]}
        assert page.request.put(f"/api/v1{link}/instants", data=pairs, headers=tag).ok
        page.reload()
        shows(page, 0)
        page.keyboard.press("i")
        page.keyboard.press("Shift+ArrowRight")
        shows(page, 25)
        page.keyboard.press("i")
        expect(card.get_by_label("With the views of 1 linked replay")).to_be_checked()
        card.get_by_label("Propose cameras afterwards").uncheck()
        card.get_by_role("button", name="Make 2 groups").click()
        expect(card).to_contain_text(
            "2 groups created. 1 view of linked replays added. 1 view missing, because the replay does not show the instant."
        )
        jobs_end(page)
        rows = page.request.get("/api/v1/groups?dataset=cup").json()["items"]
        group = page.request.get(f"/api/v1/groups/{rows[1]['id']}").json()
        assert [view["key"] for view in group["views"]] == ["25.png", "70.png"]

    def test_what_somebody_else_linked_is_not_overwritten(
        self, link: str, open_page: OpenPage, console: Any
    ) -> None:
        console.expect("412 (Precondition Failed)")
        page = open_page(link)
        side(page, "Replay", 40)
        tag = {"If-Match": page.request.get(f"/api/v1{link}").headers["etag"]}
        theirs = {"instants": [{"live": 10, "replay": 40}]}
        assert page.request.put(f"/api/v1{link}/instants", data=theirs, headers=tag).ok
        page.keyboard.press("i")
        expect(page.get_by_text("This link changed in another window")).to_be_visible()
        expect(page.get_by_role("region", name="Instants")).to_contain_text("1 instant")
        assert linked(page, link) == [(10, 40)]


def frame_of(page: Page, name: str) -> int:
    """Which frame a side shows."""
    shown = page.locator(f'.linking__side[aria-label="{name}"]').get_attribute("data-frame")
    return int(shown or -1)


class TestPages:
    def test_they_are_usable_by_everybody_and_fit(
        self, recording: int, link: str, open_page: OpenPage
    ) -> None:
        page = opened(open_page, recording)
        for path, waited in (
            (f"/recordings/{recording}", ".film__shot img"),
            ("/recordings", ".table tbody tr"),
            (f"/recordings/{recording}?frame={LONG}", "#link-other"),
            (link, ".linking__side img"),
        ):
            page.goto(path)
            page.wait_for_selector(waited)
            found = {"axe": serious_in_both(page)}
            for width, height in SIZES:
                resize(page, width, height)
                found[f"too wide at {width}"] = soon(page, TOO_WIDE)
                found[f"scrolls twice at {width}"] = soon(page, NESTED_SCROLLERS)
                found[f"cut off at {width}"] = soon(page, BEYOND_ITS_FRAME)
            assert {name: what for name, what in found.items() if what} == {}, path

    def test_its_shots_are_fetched_as_a_table(self, recording: int, open_page: OpenPage) -> None:
        page = opened(open_page, recording)
        with page.expect_download() as fetched:
            page.get_by_role("link", name="All shots as CSV").click()
        assert fetched.value.suggested_filename == "touchline-shots.csv"
        rows = fetched.value.path().read_text().splitlines()
        assert (len(rows), rows[1].split(",")[:4]) == (4, ["cup final", "1", "0", "39"])

    def test_their_keys_stand_in_the_help(self, recording: int, open_page: OpenPage) -> None:
        page = opened(open_page, recording)
        page.keyboard.press("?")
        expect(page.get_by_role("dialog")).to_contain_text("Split the shot at this frame")
        expect(page.get_by_role("dialog")).to_contain_text(
            "Play forwards; press again to double the speed"
        )

    def test_a_recording_that_is_gone_says_so(self, open_page: OpenPage, console: Any) -> None:
        console.expect("404 (Not Found)")
        page = open_page("/recordings/999")
        expect(page.get_by_role("alert")).to_contain_text("There is no recording 999")
