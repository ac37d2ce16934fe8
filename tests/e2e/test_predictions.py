"""What a detector said: seen as another kind of mark, accepted by people, compared with another."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.screen import Document, Screen, passing, undo_edit
from tests.e2e.test_access import serious_in_both

OpenPage = Callable[..., Page]

API = "/api/v1"
COUNT_PREDICTED = """(() => {
  const canvas = [...document.querySelectorAll('.image-panel[data-view="A"] canvas')].at(-1);
  const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  let found = 0;
  for (let i = 0; i < data.length; i += 4) {
    if (data[i] === 0xd2 && data[i + 1] === 0xa8 && data[i + 2] === 0xff) found += 1;
  }
  return found;
})()"""
"""How many pixels of the main camera's overlay have the colour of predictions."""


@dataclass
class Predicted:
    """A group with predictions; its first view has no ball.

    ``boxes`` has the best prediction of each view by key.
    """

    page: Page
    group: int
    boxes: dict[str, list[float]]

    def document(self) -> Document:
        """The group as the server has it."""
        found: Document = self.page.request.get(f"{API}/groups/{self.group}").json()
        return found

    def remove_ball(self, place: int) -> None:
        """Nobody annotated a ball in the view of that place."""
        document = self.document()
        answer = self.page.request.patch(
            f"{API}/views/{document['views'][place]['id']}/ball",
            data="null",
            headers={"If-Match": document["etag"], "Content-Type": "application/json"},
        )
        assert answer.ok, answer.text()

    def open(self) -> Screen:
        """The review screen, once the predictions are there."""
        self.page.goto(f"/review/{self.group}")
        screen = Screen(self.page)
        screen.ready()
        expect(self.page.locator(".predictions")).to_be_visible()
        return screen


def upload(page: Page, name: str, document: Document, off: float) -> tuple[int, Document]:
    """A set with two boxes in each view of a group: the ball, moved by pixels, and a worse one."""
    boxes = {
        view["key"]: [view["balls"][0]["box"][0] + off, *view["balls"][0]["box"][1:]]
        for view in document["views"]
        if view["balls"] and view["balls"][0]["box"]
    }
    rows = [
        {
            "image_id": f"{document['match']}/{key}",
            "category_id": 1,
            "score": score,
            "bbox": [box[0] + 0.5, box[1] + 0.5, *box[2:]],
        }
        for key, ball in boxes.items()
        for box, score in ((ball, 0.83), ([40.0, 300.0, 12.0, 12.0], 0.12))
    ]
    sent = page.request.post(
        f"{API}/uploads?name={name}.json",
        data=json.dumps(rows).encode(),
        headers={"Content-Type": "application/octet-stream"},
    )
    body = {"name": name, "format": "coco", "upload": sent.json()["id"]}
    made = page.request.post(f"{API}/datasets/sample/predictions", data=body)
    assert made.ok, made.text()
    return int(made.json()["id"]), boxes


def give_back(page: Page, group: int, before: list[Document]) -> None:
    """Undo until the views are what they were."""
    for _ in range(12):
        now = page.request.get(f"{API}/groups/{group}").json()
        if [view["balls"] for view in now["views"]] == [view["balls"] for view in before]:
            return
        undo_edit(page, group)
    pytest.fail("undo did not lead back")


@pytest.fixture
def predicted(open_page: OpenPage) -> Iterator[Predicted]:
    """A group whose views have predictions three pixels beside their balls."""
    page = open_page(None)
    group = passing(page, 1)
    before = page.request.get(f"{API}/groups/{group}").json()
    made, boxes = upload(page, "detector", before, 3.0)
    found = Predicted(page, group, boxes)
    found.remove_ball(0)
    yield found
    # What is on its way must not come after the undo.
    page.goto("about:blank")
    give_back(page, group, before["views"])
    assert page.request.delete(f"{API}/predictions/{made}").ok


class TestMarks:
    def test_predictions_are_drawn_pointed_at_listed_and_hidden(self, predicted: Predicted) -> None:
        screen = predicted.open()
        page, view = predicted.page, screen.document()["views"][0]
        page.wait_for_function(f"() => {COUNT_PREDICTED} > 20")
        x, y, width, height = predicted.boxes[view["key"]]
        place = screen.place(view, x + width / 2, y + height / 2)
        page.mouse.move(*place)
        stage = page.locator('.image-panel[data-view="A"] .image-panel__stage')
        expect(stage).to_have_attribute("title", re.compile("detector predicts a ball here"))
        page.mouse.click(*place)
        chip = page.locator('.image-panel[data-view="A"] .prediction-chip')
        expect(chip).to_contain_text("detector predicts a ball, score 0.83")
        screen.press("i")
        objects = page.get_by_role("list", name="Objects of view A")
        expect(objects.get_by_role("button", name="Predicted by detector")).to_have_count(2)
        expect(objects.locator("[aria-pressed=true]")).to_contain_text("0.83")
        assert serious_in_both(page) == []
        screen.press("b")
        expect(objects.get_by_role("button", name="Predicted by detector")).to_have_count(0)
        page.wait_for_function(f"() => {COUNT_PREDICTED} === 0")
        screen.press("y")
        expect(page.locator(".bars")).to_contain_text("Predictions are hidden. Press B to see")
        assert screen.document()["views"][0]["balls"] == []

    def test_without_a_prediction_set_nothing_is_shown(self, open_page: OpenPage) -> None:
        page = open_page(None)
        with page.expect_response("**/predictions") as answer:
            page.goto(f"/review/{passing(page, 0)}")
        assert answer.value.json()["sets"] == 0
        page.keyboard.press("y")
        expect(page.locator(".predictions")).to_have_count(0)


class TestAccept:
    def test_a_prediction_is_accepted_by_key_and_taken_back_after_a_reload(
        self, predicted: Predicted
    ) -> None:
        screen = predicted.open()
        page = predicted.page
        screen.press("y")
        screen.saved()
        ball = screen.document()["views"][0]["balls"][0]
        assert (ball["source"], ball["predicted_by"]) == ("prediction", "detector")
        assert ball["box"] == predicted.boxes[screen.document()["views"][0]["key"]]
        expect(page.locator("[aria-live]").last).to_contain_text("accepted from detector, saved")
        row = page.locator('[data-prediction="A"]')
        expect(row).to_have_text("Apredicted by detector, score 0.83, accepted by local")
        page.reload()
        expect(row).to_contain_text("accepted by local")
        screen.press("Control+z")
        expect(row).to_contain_text("Accept")
        assert screen.document()["views"][0]["balls"] == []

    def test_a_ball_stays_until_it_is_to_be_replaced(self, predicted: Predicted) -> None:
        screen = predicted.open()
        page = predicted.page
        before = screen.document()["views"][1]["balls"]
        screen.press("2", "y")
        expect(page.locator(".bars")).to_contain_text("View B has a ball already")
        assert screen.document()["views"][1]["balls"] == before
        page.get_by_role("button", name="Replace it").click()
        screen.saved()
        assert screen.document()["views"][1]["balls"][0]["predicted_by"] == "detector"
        screen.press("Control+z")
        expect(page.locator('[data-prediction="B"]')).to_contain_text("3.0 px off")

    def test_in_all_views_without_a_ball_at_once(self, predicted: Predicted) -> None:
        predicted.remove_ball(1)
        screen = predicted.open()
        page = predicted.page
        page.get_by_role("button", name="Accept in 2 views without a ball").click()
        expect(page.locator(".predictions")).to_contain_text("Nothing more to accept")
        screen.saved()
        balls = [view["balls"][0] for view in screen.document()["views"]]
        assert [ball["source"] for ball in balls[:2]] == ["prediction"] * 2
        assert all(ball["source"] != "prediction" for ball in balls[2:])


class TestEvaluationPage:
    def test_a_query_is_tried_out_then_accepted(self, predicted: Predicted) -> None:
        page, number = predicted.page, predicted.document()["number"]
        page.goto("/datasets/sample/evaluation")
        page.get_by_role("button", name="Accept… detector").click()
        dialog = page.get_by_role("dialog")
        expect(dialog).to_contain_text("1 view of 1 group gets a ball.")
        expect(dialog).to_contain_text("the view has a ball already")
        page.get_by_label("Groups (a query as in the queue)").fill(f"number:{number}")
        page.locator("#accept-score").fill("0.9")
        expect(dialog).to_contain_text("the best prediction is below the score")
        page.locator("#accept-score").fill("0.8")
        page.keyboard.press("Tab")
        page.get_by_role("button", name="Accept 1", exact=True).click()
        expect(page.locator(".notice, .bars")).to_contain_text("1 view has a ball from detector")
        assert predicted.document()["views"][0]["balls"][0]["predicted_by"] == "detector"

    def test_two_runs_are_compared_down_to_their_frames(self, predicted: Predicted) -> None:
        page = predicted.page
        document = predicted.document()
        other, _ = upload(page, "worse", document, 9.0)
        runs = [run(page, name) for name in ("detector", "worse")]
        page.goto(f"/datasets/sample/evaluation?run={runs[1]}")
        page.get_by_label("Compare with another run").select_option(label="detector")
        table = page.get_by_role("region", name="Numbers of both runs")
        expect(table.get_by_role("row", name="All frames: AP@0.5 ").first).to_contain_text("worse")
        page.get_by_label("Frame by frame").select_option("iou")
        compared = page.get_by_role("region", name="Compared with detector")
        expect(compared).to_contain_text("0 better")
        compared.get_by_role("link").first.click()
        page.wait_for_url(f"**/review/{predicted.group}*")
        for found in runs:
            assert page.request.delete(f"{API}/evaluations/{found}").ok
        assert page.request.delete(f"{API}/predictions/{other}").ok


def run(page: Page, name: str) -> int:
    """Evaluate a set against every group, by the form."""
    page.goto("/datasets/sample/evaluation")
    page.locator("#run-predictions").select_option(label=name)
    page.locator("#run-against").select_option("all")
    page.get_by_role("button", name="Evaluate", exact=True).click()
    page.wait_for_url("**/evaluation?run=*")
    expect(page.locator("#run-title")).to_have_text(name)
    return int(page.url.rsplit("=", 1)[1])
