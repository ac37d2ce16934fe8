"""From a broadcast to a frozen version, in the browser: the tutorial as somebody clicks it (docs/tutorial-recording.md)."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from app.sample.recording import ShotPlan, write_recording
from tests.e2e.screen import Screen, jobs_end
from tests.e2e.service import delete_dataset
from tests.e2e.test_recordings import shots_of, shows

OpenPage = Callable[..., Page]
PARTS = (
    ShotPlan("main", 2.4, "start"), ShotPlan("replay", 3.0, "wipe", 0.5, 1), ShotPlan("main", 1.6, "wipe"),
)  # fmt: skip
LONG_MS = 240_000
"""What decodes or tracks a film, on a machine that does other things."""


@pytest.fixture(scope="module")
def broadcast(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short film of the sample, with its truth beside it."""
    out = tmp_path_factory.mktemp("broadcast") / "derby.mp4"
    write_recording(out, parts=PARTS)
    return out


@pytest.fixture
def dataset(server: str) -> Iterator[str]:
    yield "derby"
    delete_dataset(server, "derby")


class TestBroadcast:
    def test_a_film_becomes_a_frozen_version(
        self, broadcast: Path, dataset: str, open_page: OpenPage
    ) -> None:
        truth = json.loads(broadcast.with_suffix(".json").read_text(encoding="utf-8"))
        known = {row["frame"]: row for row in truth["each"]}
        live, replay = truth["shots"][:2]
        page = open_page("/recordings")
        recording = added(page, broadcast, dataset)
        assert [one["kind"] for one in shots_of(page, recording)] == ["main", "replay", "main"]
        for first, counted in (
            (live["first"], live["last"] + 1),
            (replay["first"], replay["last"] - replay["first"] + 1),
        ):
            tracked(page, first, counted)
        linked(page, *same_instants(truth, known))
        chosen = grouped(page, recording, truth, known)
        for group in chosen:
            balls_clicked(page, group, known)
        accepted(page, dataset)
        frozen(page, dataset, len(chosen))


def added(page: Page, film: Path, dataset: str) -> int:
    """Send the film, and open it; its number."""
    page.get_by_label("Dataset", exact=True).fill(dataset)
    page.set_input_files("#import-file", film)
    uploads = page.get_by_role("list", name="Uploads")
    expect(uploads.locator(".pill").first).to_have_text("uploaded", timeout=LONG_MS)
    page.get_by_role("button", name="Add and find its shots").click()
    page.get_by_role("link", name=f"Open {film.stem}").click(timeout=LONG_MS)
    shows(page, 0)
    return int(page.url.split("?")[0].rpartition("/")[2])


def tracked(page: Page, first: int, count: int) -> None:
    """Track the shot that begins at a frame; every frame has its camera then."""
    to(page, first)
    card = page.get_by_role("region", name="Cameras")
    card.get_by_role("button", name="Track this shot").click()
    expect(card.get_by_role("row", name="tracked")).to_contain_text(str(count), timeout=LONG_MS)


def to(page: Page, frame: int) -> None:
    """Go to the shot that begins at a frame by its key."""
    page.keyboard.press("Home")
    while int(page.locator(".film__stage").get_attribute("data-frame") or 0) < frame:
        shown = page.locator(".film__stage").get_attribute("data-frame")
        page.keyboard.press("ArrowDown")
        page.wait_for_selector(f'.film__stage:not([data-frame="{shown}"]) img')
    shows(page, frame)


def same_instants(truth: dict[str, Any], known: dict[int, Any]) -> list[tuple[int, int]]:
    """Two frames of the live shot and those of the replay that show the same."""
    live, replay = truth["shots"][:2]
    found = []
    for frame in (replay["first"] + 2, replay["last"] - 2):
        at = known[frame]["play_s"]
        frames = range(live["first"], live["last"] + 1)
        found.append((min(frames, key=lambda one: abs(known[one]["play_s"] - at)), frame))
    return found


def linked(page: Page, *instants: tuple[int, int]) -> None:
    """Link the replay on screen to its live shot."""
    page.get_by_role("region", name="Links").get_by_role("button", name="Link to derby").click()
    for live, replay in instants:
        for side, frame in (("Live", live), ("Replay", replay)):
            page.get_by_role("slider", name=f"{side} frame").fill(str(frame))
            page.wait_for_selector(f'.linking__side[aria-label="{side}"][data-frame="{frame}"] img')
        page.keyboard.press("i")
    expect(page.get_by_role("region", name="Times")).to_contain_text("The replay runs 2.")
    page.get_by_role("link", name="derby", exact=True).first.click()


def grouped(page: Page, recording: int, truth: dict[str, Any], known: dict[int, Any]) -> list[int]:
    """Make groups of two instants of the live shot in which both see the ball; their ids."""
    page.goto(f"/recordings/{recording}")
    shows(page, 0)
    link = truth["links"][0]
    start = truth["shots"][1]["first"]
    begins = round((link["offset_s"] + link["speed"] * start / truth["fps"]) * truth["fps"]) + 3
    card = page.get_by_role("region", name="Instants")
    for frame in (begins, begins + 10):
        at = int(page.locator(".film__stage").get_attribute("data-frame") or 0)
        for key, presses in (
            ("Shift+ArrowRight", (frame - at) // 25),
            ("ArrowRight", (frame - at) % 25),
        ):
            for _ in range(presses):
                page.keyboard.press(key)
        shows(page, frame)
        page.keyboard.press("i")
    card.get_by_label("Propose cameras afterwards").uncheck()
    card.get_by_role("button", name="Make 2 groups").click()
    expect(card).to_contain_text(
        "2 groups created. 2 views of linked replays added.", timeout=LONG_MS
    )
    jobs_end(page)
    rows = page.request.get("/api/v1/groups?dataset=derby").json()["items"]
    return [row["id"] for row in rows]


def balls_clicked(page: Page, group: int, known: dict[int, Any]) -> None:
    """Mark the ball in both views where it is seen."""
    page.goto(f"/review/{group}")
    screen = Screen(page)
    for view in screen.document()["views"]:
        screen.ready(view["letter"])
        x, y = known[int(view["key"].removesuffix(".png"))]["pixel"]
        page.mouse.move(*screen.place(view, x, y))
        screen.press("n", "Enter")
        screen.saved()
    assert [len(view["balls"]) for view in screen.document()["views"]] == [1, 1]


def accepted(page: Page, dataset: str) -> None:
    """Accept all groups at once."""
    page.goto(f"/groups?dataset={dataset}")
    page.wait_for_selector(".queue-row a")
    page.keyboard.press("b")
    page.locator("#bulk-note").fill("looked at")
    page.locator("dialog").get_by_role("button", name="Accept").click()
    expect(page.locator(".bar")).to_contain_text("groups accepted")


def frozen(page: Page, dataset: str, groups: int) -> None:
    """Freeze a version, and compute it again."""
    page.goto(f"/datasets/{dataset}/versions")
    page.get_by_role("button", name="Freeze a version").first.click()
    expect(page.locator(".bulk__outcome")).to_contain_text("groups are included")
    page.get_by_role("button", name="Freeze", exact=True).click()
    page.get_by_role("button", name="Done", exact=True).click()
    page.get_by_role("button", name="Verify").click()
    expect(page.locator(".verify")).to_contain_text("came out as they were")
    (version,) = page.request.get(f"/api/v1/datasets/{dataset}/versions").json()["items"]
    counts = version["counts"]
    assert (counts["groups"], counts["views"]) == (groups, 2 * groups)
    assert counts["balls"] >= groups
