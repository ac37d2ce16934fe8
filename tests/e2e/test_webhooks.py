"""Webhooks in the browser: made, tried, seen to fail, turned off and deleted."""

from __future__ import annotations

import re
from collections.abc import Callable

from playwright.sync_api import Page, expect

from tests.e2e.conftest import Console
from tests.e2e.service import NOBODY


def test_a_lead_sees_that_nobody_takes_the_messages(
    open_page: Callable[..., Page], console: Console
) -> None:
    console.expect("400")
    page = open_page("/datasets/sample/statistics")
    card = page.locator(".webhooks")
    card.get_by_label("Address").fill("http://127.0.0.1:9/elsewhere")
    card.get_by_label("group.judged").check()
    card.get_by_role("button", name="Add the webhook").click()
    expect(card.get_by_role("alert")).to_contain_text("does not allow webhooks to this address")
    card.get_by_label("Address").fill(NOBODY)
    card.get_by_role("button", name="Add the webhook").click()
    expect(card.get_by_label("Secret")).to_have_value(re.compile("^whsec_"))
    secret = card.get_by_label("Secret").input_value()
    card.get_by_role("button", name="Done").click()
    card.get_by_role("button", name="Send a test").click()
    expect(card.get_by_text("it could not be reached")).to_be_visible()
    expect(card.get_by_text("will be retried")).to_be_visible()
    card.get_by_role("button", name="Turn off").click()
    expect(card.get_by_text("a person turned it off")).to_be_visible()
    page.reload()
    expect(card.get_by_text("a person turned it off")).to_be_visible()
    assert secret not in page.content()
    card.get_by_role("button", name="Delete").click()
    card.get_by_role("button", name="Delete it with its messages?").click()
    expect(card.get_by_role("listitem")).to_have_count(0)
