"""A track in space: the 3D view and the plan play it, and a table says the same."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, Playwright, expect

from tests.e2e.conftest import windows_of
from tests.e2e.screen import until
from tests.e2e.test_access import (
    BEYOND_ITS_FRAME,
    NESTED_SCROLLERS,
    SIZES,
    resize,
    serious_in_both,
    soon,
)
from tests.e2e.test_pages import TOO_WIDE
from tests.e2e.test_scene3d import SOFTWARE_GRAPHICS, colours, label
from tests.e2e.test_tracks import ANOTHER_FRAME, COUNT, flight, shows, track
from tests.e2e.windows import Windows
from tests.flights import FIRST, KICK, places

__all__ = ["flight", "track"]


@pytest.fixture(scope="module")
def windows(playwright: Playwright) -> Iterator[Windows]:
    """Windows of a browser that draws in three dimensions."""
    with windows_of(playwright, SOFTWARE_GRAPHICS) as opened:
        yield opened


@pytest.fixture
def space(track: Page) -> Page:
    """The page of a track with the ball in space, a few frames after the kick."""
    track.goto(f"{track.url.partition('?')[0]}?frame={FIRST + KICK + 10}")
    track.wait_for_selector(".track__band")
    track.keyboard.press("\\")
    track.wait_for_selector('.track__space .scene3d__stage[data-ready="true"]')
    track.wait_for_selector('.track__space [data-thing="ball"]')
    return track


def ball(page: Page) -> list[float]:
    """x, y and height of the ball as the table has them."""
    cells = page.locator('.track__space [data-thing="ball"] td').all_inner_texts()
    return [float(text.replace("−", "-")) for text in cells]


class TestSpace:
    def test_says_in_words_where_the_ball_is_and_who_sees_it(self, space: Page) -> None:
        x, y, z = places(COUNT)[KICK + 10]
        assert ball(space) == pytest.approx([x, y, -z], abs=0.15)
        cameras = space.locator('.track__space [data-thing^="camera"]')
        assert cameras.count() == 4
        sees = cameras.filter(has_text="sees the ball").count()
        assert space.locator('.scene3d__camera[data-sees="true"]').count() == sees >= 2
        until(space, lambda: colours(space) > 30)

    def test_plays_the_ball_while_the_cameras_stand(self, space: Page) -> None:
        expect(space.locator('[data-label="ball"]')).to_be_visible()
        before, camera = label(space, "ball"), label(space, "A")
        path = space.locator(".track-plan__trail").get_attribute("d")
        space.keyboard.press("Space")
        space.wait_for_function(ANOTHER_FRAME, arg=FIRST + KICK + 12)
        space.keyboard.press("Space")
        expect(space.get_by_role("button", name="Play")).to_be_visible()
        until(space, lambda: label(space, "ball") != before)
        assert label(space, "A") == camera
        assert space.locator(".track-plan__trail").get_attribute("d") != path

    def test_arrows_step_until_the_scene_has_the_focus(self, space: Page) -> None:
        at = FIRST + KICK + 10
        space.keyboard.press("ArrowRight")
        shows(space, at + 1)
        before = label(space, "A")
        space.locator(".track__space canvas").focus()
        space.keyboard.press("ArrowRight")
        until(space, lambda: label(space, "A") != before)
        shows(space, at + 1)

    def test_is_accessible_in_every_size(self, space: Page) -> None:
        found: dict[str, list[str]] = {"axe": serious_in_both(space)}
        for width, height in SIZES:
            resize(space, width, height)
            for faults in (TOO_WIDE, BEYOND_ITS_FRAME, NESTED_SCROLLERS):
                found.setdefault(f"{width}", []).extend(soon(space, faults))
        assert not any(found.values()), found

    def test_leads_back_to_the_curves(self, space: Page) -> None:
        space.keyboard.press("Escape")
        expect(space.locator(".track__space")).to_have_count(0)
        expect(space.get_by_role("img", name="height, m of the ball")).to_be_visible()
