"""The life of a dataset, page by page: from its import to its end."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from zipfile import ZipFile

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.service import delete_dataset
from tests.e2e.test_pages import usable

OpenPage = Callable[..., Page]


@pytest.fixture
def labels(labels_file: Path, tmp_path: Path, server: str) -> Iterator[Path]:
    """A zip with the labels of one match of the sample, without frames."""
    target = tmp_path / "match.zip"
    with ZipFile(target, "w") as archive:
        archive.write(labels_file, "/".join(labels_file.parts[-4:]))
    yield target
    delete_dataset(server, "passing through")


@pytest.fixture
def predictions(labels_file: Path, tmp_path: Path) -> Path:
    """COCO results: every ball of that match, a little too large."""
    labels = json.loads(labels_file.read_text())
    rows = list(_boxes(labels, "/".join(labels_file.parts[-4:-1])))
    target = tmp_path / "detector.json"
    target.write_text(json.dumps(rows))
    return target


def _boxes(labels: dict[str, dict[str, dict[str, object]]], match: str) -> Iterator[object]:
    for part in ("actions", "replays"):
        for name, frame in labels[part].items():
            for item in frame["bboxes"]:  # type: ignore[attr-defined]
                if item["class"] == "Ball":
                    x1, y1, x2, y2 = (item["points"][key] for key in ("x1", "y1", "x2", "y2"))
                    box = [x1, y1, x2 - x1 + 1, y2 - y1 + 1]
                    yield {"image_id": f"{match}/{name}", "category_id": 1, "bbox": box, "score": 1}


class TestLifeOfADataset:
    def test_imported_judged_frozen_verified_evaluated_and_deleted(
        self, open_page: OpenPage, labels: Path, predictions: Path
    ) -> None:
        page = open_page("/import")
        bring_in(page, labels)
        accept_all(page)
        freeze_and_verify(page)
        evaluate(page, predictions)
        page.goto("/datasets")
        card = page.get_by_role("region", name="passing through")
        card.get_by_role("button", name="Delete").click()
        delete = page.get_by_role("button", name="Delete for good")
        expect(delete).to_have_attribute("aria-disabled", "true")
        # What goes with it is read first: asked later, there is nothing any more to read of.
        expect(page.locator("dialog[open] .number-list")).to_contain_text("groups")
        page.get_by_label("Type passing through to confirm").fill("passing through")
        delete.click()
        expect(card).to_have_count(0)


def bring_in(page: Page, labels: Path) -> None:
    """A dry run, then the import, then the groups with their numbers."""
    page.get_by_label("Dataset", exact=True).fill("passing through")
    page.set_input_files("#import-file", labels)
    expect(page.get_by_text("is uploaded")).to_be_visible()
    page.get_by_role("button", name="Dry run").click()
    expect(page.get_by_role("region", name="What would happen")).to_be_visible()
    usable(page)
    page.get_by_role("button", name="Import", exact=True).click()
    expect(page.get_by_role("region", name="What happened")).to_be_visible()
    page.goto("/jobs")
    expect(page.locator(".page__main")).to_contain_text("Import match.zip")
    # Solving follows the import by itself.
    expect(page.locator(".meter")).to_have_count(0)
    page.goto("/datasets")
    card = page.get_by_role("region", name="passing through")
    expect(card).to_be_visible()
    expect(card).not_to_contain_text("not solved")


def accept_all(page: Page) -> None:
    """Accept what passes, in one go; a note says why, for the labels came without pictures."""
    page.goto("/groups?dataset=passing through")
    page.wait_for_selector(".queue-row a")
    page.keyboard.press("b")
    page.locator("#bulk-note").fill("seen in the video")
    page.locator("dialog").get_by_role("button", name="Accept").click()
    expect(page.locator(".bar")).to_contain_text("groups accepted")


def freeze_and_verify(page: Page) -> None:
    """A version that comes out the same when it is computed again."""
    page.goto("/datasets/passing through/versions")
    page.get_by_role("button", name="Freeze a version").first.click()
    # The shares are those of the groups, which a split by match only comes near to.
    included = re.compile(r"groups are included: (\w+ \d+ \(\S+ %\)(, )?)+\.")
    expect(page.locator(".bulk__outcome")).to_contain_text(included)
    usable(page)
    page.get_by_role("button", name="Freeze", exact=True).click()
    page.get_by_role("button", name="Done", exact=True).click()
    page.get_by_role("button", name="Verify").click()
    expect(page.locator(".verify")).to_contain_text("came out as they were")
    usable(page)
    page.get_by_role("button", name="Export…").click()
    dialog = page.get_by_role("dialog", name="Export passing through, version v1")
    with page.expect_request(lambda sent: sent.method == "POST" and "exports" in sent.url) as sent:
        dialog.get_by_role("button", name="Export", exact=True).click()
    asked = sent.value.post_data_json
    # By its name, as exports are listed; there is no picture to be copied.
    assert (asked["version"], asked["images"], asked["views"]) == ("v1", "none", "valid")
    expect(dialog.locator(".export__result")).to_contain_text("Ready")
    page.keyboard.press("Escape")


def evaluate(page: Page, predictions: Path) -> None:
    """A run with its tables, its figures and the frames behind a row."""
    page.goto("/datasets/passing through/evaluation")
    page.get_by_role("button", name="Upload predictions").click()
    page.set_input_files("#prediction-boxes", predictions)
    expect(page.get_by_text("is uploaded")).to_be_visible()
    usable(page)
    page.get_by_role("button", name="Add predictions").click()
    expect(page.locator(".prediction-set")).to_contain_text("detector")
    page.get_by_role("button", name="Evaluate", exact=True).click()
    expect(page.locator("#run-title")).to_have_text("detector")
    expect(page.locator(".figure canvas").first).to_be_visible()
    page.get_by_role("button", name="Frames", exact=True).click()
    expect(page.locator("#frames-title")).to_contain_text("Frames")
    expect(page.locator(".table a[href^='/review/']").first).to_be_visible()
    usable(page)
