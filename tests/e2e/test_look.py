"""How the review screen, the editor and the 3D view use their room: measured in a browser."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.e2e.screen import Screen, rows, until
from tests.e2e.screen import at_rest as box_of

OpenPage = Callable[..., Page]
SIZES = {
    "1440": {"width": 1440, "height": 900},
    "1100": {"width": 1100, "height": 700},
    "1920": {"width": 1920, "height": 1080},
}

PICTURE_SHARE = """() => {
  let [panels, pictures] = [0, 0];
  for (const stage of document.querySelectorAll('.image-panel__stage')) {
    const { width, height } = stage.getBoundingClientRect();
    const [wide, high] = [16, 9].map((side) => side * Math.min(width / 16, height / 9));
    panels += width * height;
    pictures += wide * high;
  }
  return pictures / panels;
}"""

MARKS = """() => [...document.querySelectorAll('.mini-pitch__camera circle')].map((circle) => {
  const { x, y, width, height } = circle.getBoundingClientRect();
  return [x + width / 2, y + height / 2, width];
})"""

COLLISIONS = """() => {
  const texts = [];
  const walker = document.createTreeWalker(document.querySelector('main').parentElement, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode;
    const element = node.parentElement;
    if (!/\\d/.test(node.textContent) || element.closest('.hidden-text, svg, [hidden]')) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    let { left, right, top, bottom } = range.getBoundingClientRect();
    for (let up = element; up && up !== document.body; up = up.parentElement) {
      if (getComputedStyle(up).overflow === 'visible') continue;
      const box = up.getBoundingClientRect();
      [left, right] = [Math.max(left, box.left), Math.min(right, box.right)];
      [top, bottom] = [Math.max(top, box.top), Math.min(bottom, box.bottom)];
    }
    if (right - left < 2 || bottom - top < 2) continue;
    texts.push({ text: node.textContent.trim(), element, left, right, top, bottom });
  }
  const found = [];
  texts.forEach((a, i) => texts.slice(i + 1).forEach((b) => {
    if (a.element === b.element) return;
    const apart = Math.max(a.left - b.right, b.left - a.right, a.top - b.bottom + 3, b.top - a.bottom + 3);
    if (apart < 0) found.push(`${a.text} | ${b.text}`);
  }));
  return found;
}"""

WIDEST = """() => {
  for (const cell of document.querySelectorAll('.rail .numbers:not(.numbers--pairs) td:not(:last-child)')) {
    if (!cell.querySelector('input')) cell.textContent = cell.dataset.number === 'jac' ? '1.00' : '14.3';
  }
  for (const cell of document.querySelectorAll('[data-number="pair-errors"]')) cell.textContent = '1.7k · 14.3';
  for (const value of document.querySelectorAll('.line-row__value')) value.textContent = '23k px';
  for (const value of document.querySelectorAll('.mini-pitch [data-number]')) value.textContent = '−132.14 m';
}"""

LISTED = """async () => {
  const list = document.querySelector('.object-list');
  const covered = [];
  for (let i = 0; i < list.querySelectorAll('button').length - 1; i++) {
    list.querySelectorAll('button')[i].focus();
    await new Promise((seen) => requestAnimationFrame(() => requestAnimationFrame(seen)));
    const { left, right } = list.getBoundingClientRect();
    const [name, point] = [...list.querySelectorAll('[aria-pressed=true] span')].map((span) => span.textContent);
    covered.push({ name, point, left, right });
  }
  return covered;
}"""


def group_of(page: Page, views: int) -> int:
    """A group of the sample with that many views, one that passes first."""
    found = [row for row in rows(page) if row["views"] == views]
    return int(max(found, key=lambda row: bool(row["passes"]))["id"])


def opened(open_page: OpenPage, views: int, size: str = "1440", **more: Any) -> Page:
    """The review screen of such a group."""
    page = open_page(None, size=SIZES[size], **more)
    page.goto(f"/review/{group_of(page, views)}")
    page.wait_for_selector('.image-panel__stage[data-ready="true"] canvas')
    return page


def at_rest(page: Page, measure: str) -> Any:
    """What a script measures once it stays the same for a while."""
    return page.evaluate(
        f"""async () => {{
          const measure = {measure};
          let [before, same] = [null, 0];
          for (let i = 0; i < 100; i++) {{
            const now = JSON.stringify(measure());
            same = now === before ? same + 1 : 0;
            // On a busy machine two moments look alike though more is on its way.
            if (same === 4) return JSON.parse(now);
            before = now;
            await new Promise((resolve) => setTimeout(() => requestAnimationFrame(resolve), 60));
          }}
          return measure();
        }}"""
    )


def stage_pixels(page: Page, letter: str) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """What the panel of a view shows, without what is drawn on it."""
    stage = page.locator(f'.image-panel[data-view="{letter}"] .image-panel__stage')
    return cv2.imdecode(np.frombuffer(stage.screenshot(), np.uint8), cv2.IMREAD_COLOR)


def picture_share(page: Page, letter: str) -> float:
    """Share of a panel that is not as dark as the stage behind the picture."""
    pixels = stage_pixels(page, letter).astype(int)
    return float((pixels.max(axis=2) > 28).mean())


class TestObjectList:
    @pytest.mark.parametrize("size", ["1440", "1100"])
    def test_it_never_lies_over_the_selected_object(self, open_page: OpenPage, size: str) -> None:
        page = opened(open_page, 3, size)
        screen = Screen(page)
        for number, view in enumerate(screen.document()["views"][1:], 2):
            page.keyboard.press(str(number))
            page.keyboard.press("i")
            expect(page.locator(".object-list [aria-pressed=true]")).to_contain_text("Ball")
            seen = page.evaluate(LISTED)
            assert len(seen) > 10
            start, end = (screen.place(view, x, 0)[0] for x in (0, view["width"]))
            for at in seen:
                if at["name"] == "Ball":
                    left, _, width, _ = view["balls"][0]["box"]
                    place = left + width / 2
                else:
                    point = view["lines"][at["name"]][int(at["point"].removeprefix("point ")) - 1]
                    place = point["x"]
                x = start + (end - start) * place / view["width"]
                assert not at["left"] <= x <= at["right"], at
            page.keyboard.press("Escape")
            page.keyboard.press("Escape")


class TestArrangement:
    @pytest.mark.parametrize("size", list(SIZES))
    def test_two_views_fill_their_panels(self, open_page: OpenPage, size: str) -> None:
        page = opened(open_page, 2, size)
        assert at_rest(page, PICTURE_SHARE) > 0.82
        strip = box_of(page.locator(".strip"))
        grid = box_of(page.locator(".image-grid"))
        assert strip["x"] > grid["x"] + grid["width"]

    def test_a_cropped_image_fills_its_panel_and_that_choice_is_kept(
        self, open_page: OpenPage
    ) -> None:
        page = opened(open_page, 4, "1100")
        page.keyboard.press("h")
        at_rest(page, PICTURE_SHARE)
        whole = picture_share(page, "A")
        page.get_by_role("button", name="Fill the panels with the images").first.click()
        expect(page.get_by_role("button", name="Show whole images").first).to_be_visible()
        until(page, lambda: picture_share(page, "A") > whole + 0.04)
        page.reload()
        page.wait_for_selector('.image-panel__stage[data-ready="true"] canvas')
        expect(page.get_by_role("button", name="Show whole images").first).to_be_visible()
        page.keyboard.press("Shift+Z")
        expect(page.get_by_role("button", name="Fill the panels").first).to_be_visible()

    def test_the_wheel_over_a_black_bar_keeps_the_picture(self, open_page: OpenPage) -> None:
        page = opened(open_page, 4, "1100")
        page.keyboard.press("h")
        at_rest(page, PICTURE_SHARE)
        before = picture_share(page, "A")
        stage = box_of(page.locator('.image-panel[data-view="A"] .image-panel__stage'))
        page.mouse.move(stage["x"] + stage["width"] / 2, stage["y"] + stage["height"] - 4)
        for _ in range(6):
            page.mouse.wheel(0, -240)
        page.wait_for_timeout(250)
        until(page, lambda: picture_share(page, "A") >= before)
        # However far it is dragged away, it stays in the middle of the panel at least.
        for _ in range(3):
            page.mouse.down()
            page.mouse.move(stage["x"] + 4, stage["y"] + 40, steps=3)
            page.mouse.up()
            page.mouse.move(stage["x"] + stage["width"] - 4, stage["y"] + stage["height"] - 4)
        page.wait_for_timeout(250)
        until(page, lambda: picture_share(page, "A") > 0.2)

    @pytest.mark.parametrize("views", [2, 4])
    def test_the_ball_card_fills_its_width(self, open_page: OpenPage, views: int) -> None:
        page = opened(open_page, views, "1100")
        widths = at_rest(
            page,
            """() => {
              const box = document.querySelector('.crops').getBoundingClientRect();
              const crops = [...document.querySelectorAll('.crop__canvas')].map((one) => one.getBoundingClientRect());
              return [Math.max(...crops.map((one) => one.right)) - box.left, box.width, crops.length];
            }""",
        )
        assert widths[2] == views
        assert widths[0] > widths[1] - 4


class TestPitch:
    def test_letters_of_six_cameras_do_not_overlap(self, open_page: OpenPage, film: str) -> None:
        page = open_page(None, size=SIZES["1100"])
        first = page.request.get(f"{film}/api/v1/groups?dataset=film&limit=1").json()["items"][0]
        page.goto(f"{film}/review/{first['id']}")
        page.wait_for_selector(".mini-pitch__camera")
        marks = at_rest(page, MARKS)
        until(page, lambda: len(page.evaluate(MARKS)) == 6)
        marks = at_rest(page, MARKS)
        for i, (x, y, width) in enumerate(marks):
            for other_x, other_y, _ in marks[i + 1 :]:
                assert np.hypot(x - other_x, y - other_y) > width

    def test_rays_end_inside_the_drawing(self, open_page: OpenPage) -> None:
        page = opened(open_page, 4)
        at_rest(page, MARKS)
        beyond = page.evaluate(
            """() => {
              const [left, top, width, height] = document.querySelector('.mini-pitch svg')
                .getAttribute('viewBox').split(' ').map(Number);
              return [...document.querySelectorAll('.mini-pitch__ray')].filter((ray) => {
                const box = ray.getBBox();
                return box.x < left || box.y < top || box.x + box.width > left + width || box.y + box.height > top + height;
              }).length;
            }"""
        )
        assert beyond == 0


class TestNumbers:
    @pytest.mark.parametrize("views", [2, 4])
    def test_never_collide_in_a_small_window(self, open_page: OpenPage, views: int) -> None:
        page = opened(open_page, views, "1100")
        at_rest(page, PICTURE_SHARE)
        assert at_rest(page, COLLISIONS) == []
        page.evaluate(WIDEST)
        assert page.evaluate(COLLISIONS) == []


class TestEditor:
    @pytest.mark.parametrize("size", ["1440", "1100"])
    def test_before_and_after_are_seen_at_once(self, open_page: OpenPage, size: str) -> None:
        page = open_page(None, size=SIZES[size])
        page.goto(f"/review/{group_of(page, 2)}/calibration")
        page.wait_for_selector("[data-compared]")
        hidden = at_rest(
            page,
            """() => {
              const scroll = document.querySelector('section[aria-label="Before and after"] .editor__scroll');
              return scroll.scrollHeight - scroll.clientHeight;
            }""",
        )
        assert hidden <= 0
