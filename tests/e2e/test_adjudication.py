"""Adjudication in the browser: two annotations beside each other, one is taken by keyboard."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from playwright.sync_api import Page, expect

from app.config import Settings
from app.db.store import Store
from app.features.agreement.service import compare_or_adopt_submission
from app.features.independent_annotations.service import begin_annotation, submit_annotation
from tests.e2e.screen import passing, until, withdraw_verdict
from tests.e2e.team import annotate
from tests.e2e.test_access import serious_in_both


def test_one_of_two_is_taken_by_keyboard(
    home: Path, open_page: Callable[..., Page], console: Any
) -> None:
    console.expect("a status of 409")
    page = open_page("/datasets/sample/agreement")
    expect(page.get_by_text("Nothing to decide")).to_be_visible()
    group = passing(page, 1)
    store = Store.open(Settings(home=home))
    try:
        # The second one is taken, so that it shows which one was meant.
        assert annotate(store, group, "bob", 25) is None
        assert annotate(store, group, "ada", 0) == "open"
    finally:
        store.close()
    page.goto(f"/review/{group}")
    expect(
        page.get_by_role("status").filter(has_text="annotations of this group differ")
    ).to_be_visible()
    page.keyboard.press("a")
    expect(page.get_by_role("alert")).to_contain_text("differ, and nobody has decided yet")
    page.get_by_role("link", name="Open the decision").click()
    expect(page.get_by_role("heading", name="Decide", exact=True)).to_be_visible()
    page.goto("/datasets/sample/agreement")
    page.get_by_role("link", name="Decide the worst one").click()
    expect(page.locator(".compare__one")).to_have_count(2)
    expect(page.locator('.compare__panel .image-panel__stage[data-ready="true"]')).to_have_count(2)
    expect(page.locator(".compare__difference").first).to_contain_text("px apart")
    assert serious_in_both(page) == []
    first = page.locator('.compare__views [aria-current="true"]').inner_text()
    page.keyboard.press("ArrowRight")
    expect(page.locator('.compare__views [aria-current="true"]')).not_to_have_text(first)
    page.keyboard.press("n")
    expect(page.locator('.compare__difference[aria-pressed="true"]')).to_have_count(1)
    expect(page.get_by_role("button", name="Decide Enter")).to_be_disabled()
    page.keyboard.press("2")
    expect(page.locator('.compare__one[data-chosen="true"]')).to_contain_text("ada")
    page.keyboard.press("Enter")
    until(page, lambda: page.url.endswith("/datasets/sample/agreement"))
    expect(page.get_by_text("Nothing to decide")).to_be_visible()
    groups = page.get_by_role("region", name="Groups, most disagreement first", exact=True)
    expect(groups).to_contain_text("ada’s annotation, chosen by local")
    withdraw_verdict(page, group)

    agreement = "/api/v1/datasets/sample/agreement"
    before = page.request.get(agreement).json()["limits"]
    page.get_by_label("ball centre, px").fill("4.5")
    page.get_by_role("button", name="Save limits").click()
    expect(page.get_by_text("They apply to annotations submitted from now on")).to_be_visible()
    assert page.request.get(agreement).json()["limits"] == {**before, "ball_px": 4.5}
    assert page.request.put(f"{agreement}/limits", data=before).ok


def test_two_who_agree_without_a_verdict_are_told_alike_by_queue_and_agreement(
    home: Path, open_page: Callable[..., Page]
) -> None:
    page = open_page("/groups")
    group = passing(page, 2)
    store = Store.open(Settings(home=home))
    try:
        for person in ("kim", "lou"):
            take = begin_annotation(store, group, person=person)
            submit_annotation(store, take.id, actor=person)
            came_to = compare_or_adopt_submission(store, take.group)
        assert came_to == "agreed"
    finally:
        store.close()
    page.goto(f"/groups?q=id:{group}")
    row = page.locator(".queue-row:not(.queue-row--head)")
    expect(row.locator(".pill").last).to_contain_text("agreed, no verdict")
    page.goto("/datasets/sample/agreement")
    groups = page.get_by_role("region", name="Groups, most disagreement first", exact=True)
    expect(groups.get_by_role("row").filter(has_text="kim")).to_contain_text("agreed, no verdict")
    takes = page.get_by_role("region", name="Independent annotations").get_by_role("row")
    found = page.request.get(f"/api/v1/groups?dataset=sample&q=id:{group}").json()
    number = found["items"][0]["number"]
    for person in ("kim", "lou"):
        one = takes.filter(has_text=person)
        expect(one).to_contain_text("done")
        expect(one.get_by_role("link")).to_have_text(re.compile(rf"^{number} · "))
    page.get_by_role("link", name="1 without a verdict").click()
    expect(page.locator(".queue-row a").first).to_have_text(str(number))
