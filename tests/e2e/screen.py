"""The review screen as tests see it: its places, numbers, keys, and what the server has."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import Any

from playwright.sync_api import Page, Request, expect

from tests.e2e.windows import TIMEOUT_MS

Document = dict[str, Any]
TWO_FRAMES = "() => new Promise((seen) => requestAnimationFrame(() => requestAnimationFrame(seen)))"


class Screen:
    """The review screen of one group, with the places of things on it."""

    def __init__(self, page: Page):
        self.page = page

    @property
    def group(self) -> int:
        """Number in the address."""
        return int(self.page.url.split("/review/")[1].split("?")[0])

    def document(self) -> Document:
        """The group as the server has it."""
        answer = self.page.request.get(f"/api/v1/groups/{self.group}")
        assert answer.ok
        document: Document = answer.json()
        return document

    def ready(self, letter: str = "A") -> None:
        """Wait until a view shows its frame."""
        stage = f'.image-panel[data-view="{letter}"] .image-panel__stage[data-ready="true"]'
        self.page.wait_for_selector(stage)

    def place(self, view: Document, x: float, y: float) -> tuple[float, float]:
        """Where an image point stands in the window, while the image is shown whole."""
        stage = self.page.locator(f'.image-panel[data-view="{view["letter"]}"] .image-panel__stage')
        box = stage.bounding_box()
        assert box is not None
        scale = min(box["width"] / view["width"], box["height"] / view["height"])
        left = box["x"] + (box["width"] - view["width"] * scale) / 2
        top = box["y"] + (box["height"] - view["height"] * scale) / 2
        return left + (x + 0.5) * scale, top + (y + 0.5) * scale

    def drag(self, start: tuple[float, float], dx: float, dy: float, *, drop: bool = True) -> None:
        """Move the pointer with the button held, in window pixels."""
        mouse = self.page.mouse
        mouse.move(*start)
        mouse.down()
        mouse.move(start[0] + dx, start[1] + dy, steps=5)
        if drop:
            mouse.up()

    def number(self, letter: str, name: str) -> str:
        """A number of the view table."""
        return self.page.locator(f'[data-row="{letter}"] [data-number="{name}"]').inner_text()

    def pitch(self, name: str) -> str:
        """A number below the pitch."""
        return self.page.locator(f'.mini-pitch [data-number="{name}"]').inner_text()

    def press(self, *keys: str) -> None:
        """Press keys one after the other."""
        for key in keys:
            self.page.keyboard.press(key)

    def drawn(self) -> None:
        """Wait until what a key has done is drawn; until then the page says what was."""
        self.page.evaluate(TWO_FRAMES)

    def saved(self) -> None:
        """Wait until the last write was answered."""
        self.drawn()
        # The first edit of a server may have to wait for its compiled solver.
        patient = expect(self.page.locator('.save[data-unsaved="0"]'))
        patient.to_contain_text("Saved")


def until(page: Page, happens: Callable[[], Any]) -> None:
    """Wait for what a page or its server says when asked; the browser takes a promise for a yes."""
    end = monotonic() + TIMEOUT_MS / 1000
    while not happens():
        assert monotonic() < end, "it did not happen in time"
        page.wait_for_timeout(50)


def go_offline(page: Page) -> None:
    """Cut the page off, and wait until its own requests feel it: the browser only promises."""
    page.context.set_offline(True)
    reached = "() => fetch('/healthz', { cache: 'no-store' }).then(() => true, () => false)"
    until(page, lambda: not page.evaluate(reached))


def rows(page: Page) -> list[Document]:
    """All groups of the sample dataset."""
    answer = page.request.get("/api/v1/groups?dataset=sample&limit=100")
    items: list[Document] = answer.json()["items"]
    return items


def passing(page: Page, place: int) -> int:
    """A group that passes every gate and has three views or more, or the next best."""
    good = [row for row in rows(page) if row["passes"] and not row["findings"]]
    good.sort(key=lambda row: -row["views"])
    return int(good[place]["id"])


def interior_point(view: Document) -> tuple[str, int, Document]:
    """An annotated point that can be dragged: well inside, away from every other and the ball."""
    points = [
        (marking, index, point)
        for marking, line in view["lines"].items()
        for index, point in enumerate(line)
    ]
    ball = view["balls"][0]["box"]
    others = [point for _, _, point in points]
    others.append({"x": ball[0] + ball[2] / 2, "y": ball[1] + ball[3] / 2})

    def room(candidate: tuple[str, int, Document]) -> float:
        own = candidate[2]
        x, y = own["x"], own["y"]
        edge = min(x, y - 60, view["width"] - 60 - x, view["height"] - y)
        gaps = [
            ((other["x"] - x) ** 2 + (other["y"] - y) ** 2) ** 0.5
            for other in others
            if other is not own
        ]
        return min(edge, *gaps)

    return max(points, key=room)


def submitted(page: Page) -> list[str]:
    """Methods and paths of the writes that the page sends from now on."""
    seen: list[str] = []

    def hear(request: Request) -> None:
        if request.method in ("PATCH", "PUT"):
            seen.append(f"{request.method} {request.url}")

    page.on("request", hear)
    return seen


def withdraw_verdict(page: Page, group: int) -> None:
    """Leave a group as the next test expects it."""
    present = page.request.get(f"/api/v1/groups/{group}")
    answer = page.request.put(
        f"/api/v1/groups/{group}/verdict",
        data={"state": "unreviewed"},
        headers={"If-Match": present.headers["etag"]},
    )
    assert answer.ok
