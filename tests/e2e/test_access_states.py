"""Everybody can use what opens on the review screen too."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from playwright.sync_api import Page

from tests.e2e.screen import Screen
from tests.e2e.test_access import serious

OpenPage = Callable[..., Page]
STATES = {
    "chooser": (["n"], ".chooser"),
    "keys": (["?"], "dialog[open]"),
    "note": (["Shift+n"], ".ask"),
    "margins": (["g"], ".gates__margin"),
}


@pytest.mark.parametrize("scheme", ["dark", "light"])
class TestAxe:
    def test_finds_nothing_serious_in_what_opens(self, open_page: OpenPage, scheme: str) -> None:
        page = open_page("/review/1", scheme=scheme)
        screen = Screen(page)
        screen.ready()
        found: dict[str, list[str]] = {}
        for name, (keys, waited) in STATES.items():
            screen.press(*keys)
            page.wait_for_selector(waited)
            found[name] = serious(page)
            screen.press("Escape")
        page.get_by_role("button", name="Brightness and contrast of view A").click()
        found["adjust"] = serious(page)
        assert {name: faults for name, faults in found.items() if faults} == {}
