"""The 3D view: it shows what the solution says, lets one look through cameras, and leaves nothing."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

import cv2
import numpy as np
import pytest
from playwright.sync_api import Page, Playwright, expect

from tests.e2e.conftest import windows_of
from tests.e2e.screen import Screen, at_rest, passing, until
from tests.e2e.test_access import serious
from tests.e2e.windows import Windows

OpenPage = Callable[..., Page]
CONTEXTS = 4
"""3D contexts that the browser keeps at a time."""
SOFTWARE_GRAPHICS = [
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    f"--max-active-webgl-contexts={CONTEXTS}",
]
"""Where there is no graphics card the 3D view is drawn by the processor, which costs time."""
MORE_THAN_CHROMIUM_KEEPS = CONTEXTS + 2
"""Times the view is opened: more contexts that nobody gave back make Chromium complain."""

LABELS = """() => [...document.querySelectorAll('.scene3d__camera')].map((label) => {
  const { x, y, width, height } = label.getBoundingClientRect();
  return { x: x + width / 2, y: y + height / 2, hidden: label.hidden };
})"""


@pytest.fixture(scope="module")
def windows(playwright: Playwright) -> Iterator[Windows]:
    """Windows of a browser that draws in three dimensions."""
    with windows_of(playwright, SOFTWARE_GRAPHICS) as opened:
        yield opened


def show(page: Page) -> None:
    """Open the 3D view."""
    page.keyboard.press("\\")
    page.wait_for_selector('.scene3d__stage[data-ready="true"]')


def colours(page: Page) -> int:
    """How many different colours the canvas shows."""
    picture = page.locator(".scene3d__stage").screenshot()
    pixels = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
    return len(np.unique(pixels.reshape(-1, 3), axis=0))


def numbers(page: Page, thing: str) -> list[float]:
    """x, y and height of a row of the table."""
    cells = page.locator(f'.scene3d__table [data-thing="{thing}"] td').all_inner_texts()
    return [float(text.replace("−", "-")) for text in cells]


def label(page: Page, name: str) -> tuple[float, float]:
    """Where a label stands in the panel, CSS pixels."""
    style = page.locator(f'[data-label="{name}"]').get_attribute("style") or ""
    found = re.search(r"translate\(([-\d.]+)px, ([-\d.]+)px\)", style)
    assert found is not None, style
    return float(found[1]), float(found[2])


class TestScene:
    def test_says_in_words_what_the_solution_says(self, review: Callable[..., Screen]) -> None:
        screen = review(0)
        show(screen.page)
        solution: dict[str, Any] = screen.document()["solution"]
        x, y, z = solution["ball"]["point"]
        assert numbers(screen.page, "mean") == pytest.approx([x, y, -z], abs=0.006)
        for view, solved in zip(screen.document()["views"], solution["views"], strict=True):
            x, y, z = solved["calibration"]["camera"]["position_meters"]
            row = numbers(screen.page, f"camera {view['letter']}")
            assert row == pytest.approx([x, y, -z], abs=0.006)
        assert screen.page.locator('[data-thing^="pair"]').count() == len(solution["pairs"])

    def test_draws_the_scene_and_other_sides_of_it(self, review: Callable[..., Screen]) -> None:
        page = review(0).page
        show(page)
        expect(page.locator('[data-label="A"]')).to_be_visible()
        until(page, lambda: colours(page) > 30)
        before = label(page, "ball")
        page.keyboard.press("7")
        expect(page.get_by_role("button", name="Top 7")).to_have_attribute("aria-pressed", "true")
        page.wait_for_function(
            "style => document.querySelector('[data-label=ball]').style.transform !== style",
            arg=f"translate({before[0]:.1f}px, {before[1]:.1f}px)",
        )

    def test_the_ball_is_followed_to_the_next_group_after_the_scene_was_turned(
        self, review: Callable[..., Screen]
    ) -> None:
        page = review(0).page
        show(page)
        expect(page.locator(".header__place")).to_contain_text("of")
        page.keyboard.press("z")
        expect(page.get_by_role("button", name="Ball Z")).to_have_attribute("aria-pressed", "true")
        box = at_rest(page.locator(".scene3d__stage"))

        def is_in_the_middle() -> bool:
            x, y = label(page, "ball")
            away = max(
                abs(x - box["width"] / 2) / box["width"], abs(y - box["height"] / 2) / box["height"]
            )
            return away < 0.25

        until(page, is_in_the_middle)
        page.locator(".scene3d__stage canvas").focus()
        for _ in range(3):
            page.keyboard.press("ArrowLeft")
        address = page.url
        page.keyboard.press("f")
        page.wait_for_url(lambda url: url != address)
        until(page, is_in_the_middle)
        expect(page.get_by_role("button", name="Ball Z")).to_have_attribute("aria-pressed", "true")

    def test_a_camera_shows_the_ball_where_its_image_does(
        self, review: Callable[..., Screen]
    ) -> None:
        screen = review(0)
        page = screen.page
        show(page)
        document = screen.document()
        pairs = zip(document["views"], document["solution"]["views"], strict=True)
        view, solved = next((view, solved) for view, solved in pairs if solved["ball"])
        page.get_by_role("button", name=f"Look through camera {view['letter']}").click()
        expect(page.locator(".scene3d__through")).to_have_text(f"Through camera {view['letter']}")
        box = at_rest(page.locator(".scene3d__stage"))
        scale = min(box["width"] / view["width"], box["height"] / view["height"])
        u, v = solved["ball"]["reprojected"]
        left = (box["width"] - view["width"] * scale) / 2
        top = (box["height"] - view["height"] * scale) / 2
        # The picture is straightened, so the lens may move the ball a little.
        lens = abs(solved["calibration"]["camera"]["radial_distortion"][0])
        allowed = 2 + 0.1 * lens * box["width"]
        page.wait_for_function(
            """([x, y, allowed]) => {
              const found = /translate\\(([-\\d.]+)px, ([-\\d.]+)px\\)/.exec(
                document.querySelector('[data-label="ball"]').style.transform);
              return Math.hypot(Number(found[1]) - x, Number(found[2]) - y) < allowed;
            }""",
            arg=[left + (u + 0.5) * scale, top + (v + 0.5) * scale, allowed],
        )
        page.keyboard.press("Escape")
        expect(page.locator(".scene3d__through")).to_have_text("")
        page.keyboard.press("Escape")
        page.wait_for_selector(".image-panel__stage[data-ready=true]")

    def test_can_be_opened_again_and_again(self, review: Callable[..., Screen]) -> None:
        page = review(0).page
        for _ in range(MORE_THAN_CHROMIUM_KEEPS):
            show(page)
            page.keyboard.press("\\")
            page.wait_for_selector(".image-panel__stage")

    def test_says_so_where_there_is_no_webgl(self, open_page: OpenPage) -> None:
        page = open_page(None)
        page.add_init_script(
            "const get = HTMLCanvasElement.prototype.getContext;"
            "HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {"
            "  return kind === 'webgl2' ? null : get.call(this, kind, ...rest); };"
        )
        page.goto(f"/review/{passing(page, 0)}")
        Screen(page).ready()
        page.keyboard.press("\\")
        expect(page.locator(".scene3d__stage .scene3d__missing")).to_contain_text("no 3D graphics")
        assert len(numbers(page, "mean")) == 3

    @pytest.mark.parametrize("scheme", ["dark", "light"])
    def test_axe_finds_nothing_serious(self, open_page: OpenPage, scheme: str) -> None:
        page = open_page(None, scheme=scheme)
        page.goto(f"/review/{passing(page, 0)}")
        Screen(page).ready()
        show(page)
        assert serious(page) == []


class TestWhole:
    def test_shows_every_camera_with_a_letter_of_its_own(
        self, open_page: OpenPage, film: str
    ) -> None:
        page = open_page(None, size={"width": 1100, "height": 700})
        first = page.request.get(f"{film}/api/v1/groups?dataset=film&limit=1").json()["items"][0]
        page.goto(f"{film}/review/{first['id']}")
        page.wait_for_selector(".mini-pitch__camera")
        page.keyboard.press("\\")
        page.wait_for_selector('.scene3d__stage[data-ready="true"]')
        page.wait_for_function("() => !document.querySelector('.scene3d__camera')?.hidden")
        stage = at_rest(page.locator(".scene3d__stage"))
        at_rest(page.locator(".scene3d__camera").first)
        until(page, lambda: [one["hidden"] for one in page.evaluate(LABELS)] == [False] * 6)
        labels = page.evaluate(LABELS)
        for i, label in enumerate(labels):
            assert stage["x"] < label["x"] < stage["x"] + stage["width"]
            assert stage["y"] < label["y"] < stage["y"] + stage["height"]
            for other in labels[i + 1 :]:
                assert np.hypot(label["x"] - other["x"], label["y"] - other["y"]) > 24
