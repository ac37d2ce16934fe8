"""The review screen as tests see it: its places, numbers, keys, and what the server has."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from re import Pattern
from time import monotonic
from typing import Any

from playwright.sync_api import APIResponse, Error, Locator, Page, Request, Route, expect

from tests.e2e.windows import NOTHING_ON_ITS_WAY, TIMEOUT_MS

Document = dict[str, Any]
Box = Mapping[str, float]
TWO_FRAMES = "() => new Promise((seen) => requestAnimationFrame(() => requestAnimationFrame(seen)))"
SAME = 2
"""Times a box must be the same, two frames apart, until it counts as at rest."""
CHANGED_MEANWHILE = 412
JOB_IS_OVER = {"done", "failed", "cancelled"}
LIES_READY = """async (ids) => {
  const { known } = await import(
    document.querySelector('script[src$="main.js"]').src.replace('main.js', 'state/documents.js'));
  return ids.every((id) => known(id));
}"""
CONNECTED = """async () => (await import(
  document.querySelector('script[src$="main.js"]').src.replace('main.js', 'api/events.js')
)).connected.value"""


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
        box = at_rest(stage)
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


class Held:
    """Requests, or the answers to them, that wait until a test lets them go."""

    def __init__(self, page: Page, *, answered: bool = False):
        self.page, self.answered = page, answered
        self.routes: list[tuple[Route, APIResponse | None]] = []
        self._goes_on = False

    def hear(self, route: Route) -> None:
        """Keep a request, answered or not; those that come after the release pass."""
        if self._goes_on:
            route.fallback()
        else:
            self.routes.append((route, route.fetch() if self.answered else None))

    def arrive(self) -> None:
        """Wait until there is one."""
        until(self.page, lambda: self.routes)

    def release(self) -> None:
        """Let all of them go on."""
        self._goes_on = True
        while self.routes:
            route, answer = self.routes.pop(0)
            # Its page may have gone to another address meanwhile.
            with suppress(Error):
                if answer is None:
                    route.fallback()
                else:
                    route.fulfill(response=answer)


@contextmanager
def holding(page: Page, url: str | Pattern[str], *, answered: bool = False) -> Iterator[Held]:
    """Hold what a page asks for at an address; what is held goes on at the end at the latest.

    Args:
        page: The page.
        url: The address.
        answered: The server is asked at once, and its answers are held.
    """
    held = Held(page, answered=answered)
    page.route(url, held.hear)
    try:
        yield held
    finally:
        # The route stays, and lets pass: a request that is on its way, of whatever address, when
        # the last route is taken away may never arrive.
        held.release()


@contextmanager
def refusing(page: Page, *urls: str) -> Iterator[None]:
    """Let what a page asks for at some addresses fail; afterwards it passes, as with ``holding``."""
    refuses = True

    def hear(route: Route) -> None:
        if refuses:
            route.abort()
        else:
            route.fallback()

    for url in urls:
        page.route(url, hear)
    try:
        yield
    finally:
        refuses = False


def at_rest(element: Locator) -> Box:
    """The box of an element in the window once it has stopped moving."""
    boxes: list[Box] = []

    def rests() -> bool:
        box = element.bounding_box()
        if box is None:
            boxes.clear()
            return False
        boxes.append(box)
        element.page.evaluate(TWO_FRAMES)
        return len(boxes) > SAME and all(one == box for one in boxes[-SAME - 1 :])

    until(element.page, rests)
    return boxes[-1]


def hears(page: Page) -> None:
    """Wait until a page is told what others do; what they did before it may never hear of."""
    until(page, lambda: page.evaluate(CONNECTED))


def lie_ready(page: Page, groups: list[int]) -> None:
    """Wait until the page knows groups, so that a key can speak about them at once."""
    until(page, lambda: page.evaluate(LIES_READY, groups))


def settled(page: Page) -> None:
    """Wait until nothing that was said is on its way, at two looks in a row."""
    looks: list[bool] = []

    def nothing() -> bool:
        # Without a frame of the page's: a test may have held those back.
        looks.append(page.evaluate(NOTHING_ON_ITS_WAY))
        return looks[-2:] == [True, True]

    until(page, nothing)


def jobs_end(page: Page, address: str = "") -> None:
    """Wait until the server has done what it was asked for: numbers change until then."""

    def are_over() -> bool:
        items = page.request.get(f"{address}/api/v1/jobs?limit=100").json()["items"]
        return all(job["state"] in JOB_IS_OVER for job in items)

    until(page, are_over)


def on_present(page: Page, group: int, send: Callable[[dict[str, str]], APIResponse]) -> None:
    """Change a group from elsewhere, in its present state: a page may still be writing to it."""
    refused: list[str] = []

    def is_done() -> bool:
        present = page.request.get(f"/api/v1/groups/{group}")
        answer = send({"If-Match": present.headers["etag"]})
        if answer.status == CHANGED_MEANWHILE:
            return False
        if not answer.ok:
            refused.append(answer.text())
        return True

    until(page, is_done)
    assert refused == []


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
    judge(page, group, "unreviewed")


def judge(page: Page, group: int, state: str, reason: str | None = None) -> None:
    """A verdict from elsewhere."""
    on_present(
        page,
        group,
        lambda headers: page.request.put(
            f"/api/v1/groups/{group}/verdict",
            data={"state": state, **({"reason": reason} if reason else {})},
            headers=headers,
        ),
    )


def undo_edit(page: Page, group: int) -> None:
    """Take the last edit of a group back from elsewhere."""
    on_present(
        page,
        group,
        lambda headers: page.request.post(f"/api/v1/groups/{group}/undo", headers=headers),
    )
