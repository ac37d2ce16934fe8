"""Why a view is left out, the frames around it, kept verifications and bulk verdicts given again."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.e2e.conftest import OpenPage
from tests.e2e.film import write_film
from tests.e2e.screen import Screen, undo_edit, until, withdraw_verdict
from tests.e2e.service import run_touchline, serving
from tests.homes import copy_home

FRAME = 110


@pytest.fixture(scope="module")
def server(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A server of its own: the sample, and a film whose first camera has frames on disk."""
    home = copy_home(sample, tmp_path_factory)
    film = write_film(tmp_path_factory.mktemp("left-out-film"))
    frames = film / "cam1"
    frames.mkdir()
    for number in (FRAME - 1, FRAME, FRAME + 1):
        picture = np.full((1080, 1920, 3), (number - FRAME + 2) * 60, np.uint8)
        cv2.imwrite(str(frames / f"{number:06d}.jpg"), picture)
    run_touchline(home, f"import issia {film} --dataset film")
    with serving(home) as address:
        yield address


class TestLeftOut:
    def test_the_reason_stands_at_the_view_and_undo_takes_both_back(
        self, review: Callable[..., Screen]
    ) -> None:
        screen = review(0)
        page, panel = screen.page, screen.page.locator('.image-panel[data-view="B"]')
        row = page.locator('.numbers__aside[data-why="not_same_instant"]')
        screen.press("2", "Shift+x", "3")
        expect(panel).to_have_attribute("data-included", "false")
        expect(panel.locator(".caption__state")).to_contain_text("left out: not the same instant")
        expect(row).to_have_text("View B is left out: not the same instant")
        screen.saved()
        document = screen.document()
        assert document["views"][1]["left_out"] == {"reason": "not_same_instant", "note": None}
        assert document["verdict"]["note"] is None
        page.reload()
        expect(row).to_be_visible()
        screen.ready()
        screen.press("Control+z")
        expect(panel).to_have_attribute("data-included", "true")
        expect(row).to_have_count(0)
        expect(page.locator(".verdict-card__verdict")).to_have_count(0)
        screen.press("Control+Shift+z")
        expect(panel.locator(".caption__state")).to_contain_text("left out: not the same instant")
        screen.press("2", "Shift+a")
        expect(panel).to_have_attribute("data-included", "true")
        screen.saved()
        assert screen.document()["views"][1]["left_out"] is None
        screen.press("Shift+x", "7")
        page.get_by_label("Why is this view left out?").fill("from another match")
        screen.press("Enter")
        expect(panel.locator(".caption__state")).to_contain_text("left out: from another match")
        screen.saved()
        screen.press("Control+z")
        expect(panel).to_have_attribute("data-included", "true")
        screen.saved()

    def test_fixed_is_said_of_a_mended_group_until_its_edits_are_undone(
        self, review: Callable[..., Screen]
    ) -> None:
        screen = review(1)
        group, page = screen.group, screen.page
        pill = page.locator(".verdict-card .pill").filter(has_text="fixed")
        screen.press("1", "q")
        screen.saved()
        screen.press("a")
        page.wait_for_url(lambda url: f"/review/{group}" not in url)
        screen.saved()
        page.goto(f"/review/{group}")
        expect(pill).to_be_visible()
        undo_edit(page, group)
        page.reload()
        expect(page.locator('.verdict-card .pill[data-status="accepted"]')).to_be_visible()
        expect(pill).to_have_count(0)
        withdraw_verdict(page, group)


class TestInstants:
    def test_the_frames_around_are_shown_and_nothing_is_drawn_on_them(
        self, open_page: OpenPage
    ) -> None:
        page = open_page(None)
        screen = Screen(page)
        page.goto(f"/review/{group_of(page, FRAME)}")
        screen.ready()
        panel = page.locator('.image-panel[data-view="A"]')
        stage, chip = panel.locator(".image-panel__stage"), panel.locator(".instant-chip")
        expect(panel.get_by_role("button", name="View A one frame after")).to_be_visible()
        screen.press("1", ".")
        expect(chip).to_contain_text("1 frame later: view only")
        expect(stage).to_have_attribute("data-offset", "1")
        until(page, lambda: colours(page) == {180})
        screen.press(".")
        expect(page.locator(".bar")).to_contain_text("No more frames after this one can be shown")
        screen.press(",")
        expect(chip).to_have_count(0)
        until(page, lambda: len(colours(page)) > 1)
        panel.get_by_role("button", name="View A one frame before").click()
        expect(chip).to_contain_text("1 frame before: view only")
        screen.press("Escape")
        expect(chip).to_have_count(0)

    def test_a_dataset_without_neighbouring_frames_says_so(
        self, review: Callable[..., Screen]
    ) -> None:
        screen = review(0)
        screen.press(".")
        expect(screen.page.locator(".bar")).to_contain_text(
            "This dataset has no frames before or after this one."
        )
        expect(screen.page.get_by_role("button", name="one frame after")).to_have_count(0)

    def test_the_help_lists_the_keys(self, review: Callable[..., Screen]) -> None:
        screen = review(0)
        screen.press("?")
        expect(screen.page.get_by_text("The focused view one frame before")).to_be_visible()


class TestVersions:
    def test_the_result_of_verifying_survives_a_reload(self, open_page: OpenPage) -> None:
        page = open_page("/datasets/sample/versions")
        page.get_by_role("button", name="Freeze a version").first.click()
        page.get_by_label("Passing").check()
        page.get_by_role("button", name="Freeze", exact=True).click()
        page.get_by_role("button", name="Done", exact=True).click()
        report = page.locator(".verify")
        expect(report).to_contain_text("This version is not verified yet")
        page.get_by_role("button", name="Verify").click()
        expect(report).to_contain_text("came out as they were frozen")
        page.reload()
        expect(report).to_contain_text("came out as they were frozen")
        expect(report).to_contain_text("with solver")
        page.goto("/datasets/sample/yield")
        expect(page.locator(".version-line")).to_contain_text("✓ verified")


class TestManyAtOnce:
    def test_ctrl_shift_z_gives_a_bulk_verdict_again(self, open_page: OpenPage) -> None:
        page = open_page("/groups?dataset=sample&q=number%3C%3D3")
        page.wait_for_selector(".queue-row a")
        deferred = page.locator(".pill[data-status=deferred]")
        page.keyboard.press("b")
        page.get_by_label("Defer").check()
        page.get_by_role("button", name="Defer 3 groups").click()
        # The rows may say it before the page has its answer, until which the dialog has the keys.
        expect(page.locator(".bar")).to_contain_text("3 groups deferred")
        expect(page.locator("dialog[open]")).to_have_count(0)
        expect(deferred).to_have_count(3)
        page.keyboard.press("Control+z")
        expect(page.locator(".bar")).to_contain_text("3 verdicts are undone")
        expect(deferred).to_have_count(0)
        redo = page.locator(".queue-tools").get_by_role("button", name="Redo", exact=True)
        expect(redo).to_have_attribute("title", "Redo: 3 groups deferred (Ctrl Shift Z)")
        page.keyboard.press("Control+Shift+z")
        expect(page.locator(".bar")).to_contain_text("3 groups deferred again")
        expect(deferred).to_have_count(3)
        page.keyboard.press("Control+z")
        expect(page.locator(".bar")).to_contain_text("3 verdicts are undone")
        expect(deferred).to_have_count(0)
        page.get_by_role("button", name="Reviewers").click()
        entry = page.locator(".batches li").first
        entry.get_by_role("button", name="Redo").click()
        expect(entry.get_by_role("button", name="Undo")).to_be_visible()
        entry.get_by_role("button", name="Undo").click()
        expect(deferred).to_have_count(0)


def group_of(page: Page, frame: int) -> int:
    """The film's group of a frame."""
    answer = page.request.get(f"/api/v1/groups?dataset=film&limit=100&q=number:{frame - 99}")
    (row,) = answer.json()["items"]
    assert row["key"] == str(frame)
    return int(row["id"])


def colours(page: Page) -> set[int]:
    """Red values in the middle of what view A shows, drawn things included."""
    values: list[int] = page.evaluate(
        """() => {
            const found = [];
            for (const canvas of document.querySelectorAll('[data-view="A"] canvas')) {
                const { width, height } = canvas;
                const context = canvas.getContext('2d');
                const x = Math.round(width * 0.3), y = Math.round(height * 0.3);
                const { data } = context.getImageData(x, y, Math.round(width * 0.4), Math.round(height * 0.4));
                for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 0) found.push(data[i]);
            }
            return [...new Set(found)];
        }"""
    )
    return set(values)
