"""What an import brought is seen: nothing, a part, or groups that nobody can look at."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import parse_qs, urlparse
from zipfile import ZipFile

import pytest
from PIL import Image
from playwright.sync_api import Page, expect

from tests.e2e.screen import until
from tests.e2e.service import delete_dataset
from tests.e2e.test_access import serious_in_both

OpenPage = Callable[..., Page]


def colour(page: Page, selector: str, token: str) -> bool:
    """Whether the text of an element has the colour of a token."""
    same: bool = page.locator(selector).first.evaluate(
        """(element, token) => {
            const probe = document.createElement('span');
            probe.style.color = `var(${token})`;
            element.append(probe);
            const same = getComputedStyle(element).color === getComputedStyle(probe).color;
            probe.remove();
            return same;
        }""",
        token,
    )
    return same


def bring_in(page: Page, file: Path, dataset: str) -> None:
    page.get_by_label("Dataset", exact=True).fill(dataset)
    page.set_input_files("#import-file", file)
    expect(page.get_by_text("is uploaded")).to_be_visible()
    page.get_by_role("button", name="Import", exact=True).click()
    expect(page.get_by_role("region", name="What happened")).to_be_visible()


@pytest.fixture
def blind(labels_file: Path, tmp_path: Path, server: str) -> Iterator[Path]:
    """A zip with the labels of one match, without frames, and one file that cannot be read.

    Ask for it before the page: what was imported goes after the page has closed.
    """
    target = tmp_path / "blind.zip"
    with ZipFile(target, "w") as archive:
        archive.write(labels_file, "/".join(labels_file.parts[-4:]))
        archive.writestr("broken/Labels-v3.json", "{")
    yield target
    delete_dataset(server, "blind")


DROP = """files => {
    const held = new DataTransfer();
    for (const [name, bytes] of files) held.items.add(new File([Uint8Array.from(bytes)], name));
    const told = { dataTransfer: held, bubbles: true, cancelable: true };
    document.body.dispatchEvent(new DragEvent('dragover', told));
    return !document.body.dispatchEvent(new DragEvent('drop', told));
}"""


def drop(page: Page, *files: Path) -> None:
    """Drop files on the page, beside every field."""
    assert page.evaluate(DROP, [[path.name, list(path.read_bytes())] for path in files])


@pytest.fixture
def stills(tmp_path: Path, server: str) -> Iterator[Path]:
    """A folder of two pictures; ask for it before the page."""
    root = tmp_path / "stills"
    (root / "second half").mkdir(parents=True)
    Image.new("RGB", (320, 180), (40, 120, 40)).save(root / "1.png")
    Image.new("RGB", (640, 360), (40, 120, 40)).save(root / "second half" / "2.jpg")
    yield root
    delete_dataset(server, "stills")


class TestPictures:
    def test_that_are_dropped_become_groups_and_cameras_are_sought(
        self, stills: Path, open_page: OpenPage
    ) -> None:
        page = open_page("/import")
        page.get_by_label("Dataset", exact=True).fill("stills")
        # Also while a folder of the server is chosen: what is dropped is never opened instead.
        page.get_by_role("radio", name="A folder on the server").check()
        drop(page, stills / "1.png", stills / "second half" / "2.jpg")
        expect(page.get_by_text("2 files, ")).to_contain_text("are uploaded")
        expect(page.get_by_role("radio", name="Pictures without")).to_be_checked()
        page.get_by_role("button", name="Import", exact=True).click()
        report = page.get_by_role("region", name="What happened")
        expect(report).to_contain_text("No record was left out")
        expect(report.get_by_role("link", name="cameras are proposed")).to_be_visible()
        assert serious_in_both(page) == []
        groups = page.request.get("/api/v1/groups?dataset=stills").json()["items"]
        assert [(group["key"], group["views"]) for group in groups] == [("1.png", 1), ("2.jpg", 1)]
        page.goto("/jobs")
        expect(page.locator("main")).to_contain_text("Propose cameras for views of stills")

    def test_of_a_folder_that_is_chosen_keep_its_folders(
        self, stills: Path, open_page: OpenPage
    ) -> None:
        page = open_page("/import")
        page.get_by_label("Dataset", exact=True).fill("stills")
        page.set_input_files("#import-folder", stills)
        expect(page.get_by_text("2 files, ")).to_contain_text("are uploaded")
        page.get_by_role("button", name="Import", exact=True).click()
        expect(page.get_by_role("region", name="What happened")).to_be_visible()
        groups = page.request.get("/api/v1/groups?dataset=stills").json()["items"]
        assert [group["key"] for group in groups] == [
            "stills/1.png",
            "stills/second half/2.jpg",
        ]

    def test_the_only_file_of_a_folder_keeps_the_folder_inside_it(
        self, stills: Path, open_page: OpenPage
    ) -> None:
        (stills / "1.png").unlink()
        page = open_page("/import")
        page.get_by_label("Dataset", exact=True).fill("stills")
        page.set_input_files("#import-folder", stills)
        expect(page.get_by_text("stills.zip, ")).to_contain_text("is uploaded")
        page.get_by_role("button", name="Import", exact=True).click()
        expect(page.get_by_role("region", name="What happened")).to_be_visible()
        (group,) = page.request.get("/api/v1/groups?dataset=stills").json()["items"]
        assert group["key"] == "stills/second half/2.jpg"

    def test_that_are_dropped_become_one_group_and_the_room_of_uploads_is_said(
        self, stills: Path, open_page: OpenPage
    ) -> None:
        page = open_page("/import")
        page.get_by_label("Dataset", exact=True).fill("stills")
        drop(page, stills / "1.png", stills / "second half" / "2.jpg")
        expect(page.get_by_text("2 files, ")).to_contain_text("are uploaded")
        expect(page.get_by_text("Your uploads take ")).to_be_visible()
        page.get_by_label("Which pictures form one group").select_option("by their names")
        page.get_by_label("Pattern of the names").fill("{instant}-{camera}")
        page.get_by_role("button", name="Dry run").click()
        report = page.get_by_role("region", name="What would happen")
        expect(report).to_contain_text("2 pictures do not fit {instant}-{camera}")
        page.get_by_label("Which pictures form one group").select_option("folder")
        page.get_by_role("button", name="Dry run").click()
        expect(report).to_contain_text("Grouped by folder: 2 pictures in 1 group")
        # One count has one meaning: groups here and in the sentence of the job.
        expect(page.get_by_text("1 group read")).to_be_visible()
        expect(report.locator("dl > div").first).to_have_text("groups1")
        expect(report).to_contain_text("2 records in the files")
        assert serious_in_both(page) == []
        page.get_by_role("button", name="Import", exact=True).click()
        expect(page.get_by_role("region", name="What happened")).to_be_visible()
        groups = page.request.get("/api/v1/groups?dataset=stills").json()["items"]
        assert [(group["key"], group["views"]) for group in groups] == [("pictures", 2)]

    def test_of_a_video_lead_to_recordings(self, open_page: OpenPage, tmp_path: Path) -> None:
        (video := tmp_path / "match.mp4").write_bytes(b"any bytes")
        page = open_page("/import")
        page.get_by_label("Dataset", exact=True).fill("film")
        drop(page, video)
        told = page.get_by_role("alert")
        expect(told).to_contain_text("match.mp4 is a video. Add it on the page Recordings")
        expect(page.get_by_role("button", name="Import", exact=True)).to_have_attribute(
            "title", "Choose a file or folder first"
        )
        assert serious_in_both(page) == []
        # The same of one inside a zip, which the server alone sees.
        with ZipFile(tmp_path / "film.zip", "w") as archive:
            archive.write(video, "match.mp4")
        bring_in(page, tmp_path / "film.zip", "film")
        card = page.get_by_role("region", name="Progress")
        expect(card).to_contain_text("Nothing could be imported: film.zip holds a video")
        expect(card).to_contain_text("touchline import video FILE")
        expect(card).not_to_contain_text("Labels-v3.json")
        expect(card).not_to_contain_text("docs/")


class TestImportOfNothing:
    def test_fails_in_red_and_offers_no_queue(self, open_page: OpenPage, tmp_path: Path) -> None:
        empty = tmp_path / "empty.zip"
        with ZipFile(empty, "w") as archive:
            archive.writestr("readme.txt", "nothing")
        page = open_page("/import")
        bring_in(page, empty, "nothing")
        expect(page.locator(".pill").first).to_have_text("failed")
        assert colour(page, '.pill[data-state="failed"]', "--bad")
        card = page.get_by_role("region", name="Progress")
        expect(card).to_contain_text("Nothing could be imported from empty.zip")
        expect(card).to_contain_text("Nothing was imported")
        expect(page.get_by_role("link", name="Open the queue")).to_have_count(0)
        assert serious_in_both(page) == []

    def test_a_queue_of_no_dataset_says_so_and_leads_on(self, open_page: OpenPage) -> None:
        page = open_page("/groups?dataset=nothing")
        expect(page.locator(".empty h2")).to_have_text("There is no dataset “nothing”")
        expect(page.locator(".save")).to_contain_text("No such dataset")
        expect(page.locator("body")).not_to_contain_text("Loading")
        expect(page.get_by_role("main").get_by_role("link", name="Import")).to_have_attribute(
            "href", "/import?dataset=nothing"
        )
        page.get_by_role("link", name="All datasets").click()
        expect(page.get_by_role("region", name="sample")).to_be_visible()


@pytest.fixture
def things(tmp_path: Path, server: str) -> Iterator[Path]:
    """A zip of COCO in which the ball is called "thing", with one annotation of no image."""
    box = {"category_id": 7, "bbox": [600, 300, 12, 12]}
    value = {
        "images": [{"id": 1, "file_name": "a.jpg", "width": 1280, "height": 720}],
        "annotations": [{"id": 1, "image_id": 1.0, **box}, {"id": 2, "image_id": 99, **box}],
        "categories": [{"id": 7, "name": "thing"}],
    }
    target = tmp_path / "things.zip"
    with ZipFile(target, "w") as archive:
        archive.writestr("annotations\\instances_default.json", json.dumps(value))
    yield target
    delete_dataset(server, "things")


class TestImportOfForeignCoco:
    def test_says_that_no_category_is_the_ball_and_takes_the_one_that_is_named(
        self, things: Path, open_page: OpenPage
    ) -> None:
        page = open_page("/import")
        bring_in(page, things, "things")
        report = page.get_by_role("region", name="What happened")
        expect(report).to_contain_text('none of its categories ("thing") is recognised as the ball')
        expect(report).to_contain_text("is 99, which no image of the file has")
        page.get_by_label("Category of the ball").fill("Thing")
        page.get_by_role("button", name="Import", exact=True).click()
        expect(report).to_contain_text('category "thing" is the ball (1 annotation)')
        expect(report).to_contain_text("1 record is left out")
        assert serious_in_both(page) == []


class TestGroupsWithoutAPicture:
    def test_are_counted_after_the_import_and_accepted_only_with_a_note(
        self, blind: Path, open_page: OpenPage
    ) -> None:
        page = open_page("/import")
        page.get_by_label("Policy").select_option("touchline")
        bring_in(page, blind, "blind")
        policy = page.request.get("/api/v1/datasets/blind/policy").json()
        assert policy["name"] == "touchline"
        # Another import would not change it.
        expect(page.get_by_label("Policy")).to_be_disabled()
        # Done in part, in orange, with counts.
        expect(page.locator(".pill").first).to_have_text("partly done")
        assert colour(page, '.pill[data-state="partial"]', "--warn")
        report = page.get_by_role("region", name="What happened")
        expect(report).to_contain_text("1 record is left out")
        assert serious_in_both(page) == []
        page.goto("/jobs")
        expect(page.locator('[data-grade="warn"]').first).to_contain_text("without any picture")
        expect(page.locator(".meter")).to_have_count(0)
        # The queue marks them, and finds them.
        page.goto("/groups?dataset=blind&q=pictures:none+passes:yes")
        mark = page.locator('.queue-row .pill[data-status="no-picture"]').first
        expect(mark).to_have_text("no picture")
        assert colour(page, '.queue-row .pill[data-status="no-picture"]', "--warn")
        assert serious_in_both(page) == []
        page.locator(".queue-row a").first.click()
        # A asks for a reason instead of accepting.
        page.wait_for_url("**/review/**")
        expect(page.locator('.header .pill[data-status="no-picture"]')).to_be_visible()
        expect(page.locator(".verdict-card")).to_contain_text("has a picture to look at")
        address = page.url
        page.keyboard.press("a")
        field = page.locator("#verdict-note")
        expect(field).to_be_focused()
        expect(page.locator(".ask")).to_contain_text("no view has a picture to look at")
        expect(page).to_have_url(address)
        assert serious_in_both(page) == []
        group = int(address.split("/review/")[1].split("?")[0])
        assert (
            page.request.get(f"/api/v1/groups/{group}").json()["verdict"]["state"] == "unreviewed"
        )
        field.fill("seen in the video")
        page.keyboard.press("Enter")
        page.wait_for_function("address => location.href !== address", arg=address)

        def verdict() -> tuple[str, str]:
            said = page.request.get(f"/api/v1/groups/{group}").json()["verdict"]
            return said["state"], said["note"]

        until(page, lambda: verdict() == ("accepted", "seen in the video"))


class TestFolders:
    def test_a_double_click_enters_a_folder_once(self, open_page: OpenPage) -> None:
        page = open_page("/import")
        page.route(
            "**/api/v1/imports/folders*",
            lambda route: route.fulfill(
                json={
                    "path": parse_qs(urlparse(route.request.url).query).get("path", [""])[0],
                    "items": [{"name": "matches", "path": "matches", "folder": True}],
                    "format": None,
                    "more": False,
                }
            ),
        )
        page.get_by_label("A folder on the server").check()
        folders = page.get_by_role("list", name="Folders")
        folders.get_by_role("button", name="matches/").dblclick()
        folders.get_by_role("button", name="↑ back").click()
        expect(folders.get_by_role("button", name="↑ back")).to_have_count(0)


class TestGivenCameras:
    def test_lines_of_another_day_can_be_left_aside_where_they_are_files_of_their_own(
        self, open_page: OpenPage
    ) -> None:
        page = open_page("/import")
        choice = page.get_by_label("If a view has both a camera and lines")
        page.locator("label", has_text="SoccerNet-v3D").click()
        assert choice.locator("option").all_inner_texts() == ["the given camera", "the lines"]
        page.locator("label", has_text="XGTF").click()
        assert choice.locator("option").all_inner_texts() == [
            "the given camera; lines check it",
            "the given camera; lines are ignored",
            "the lines",
        ]
