"""What a person does on a page, what leaves for the server, and what the server has."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from playwright.sync_api import Page, Request, expect

from tests.e2e.screen import settled, until

Json = Any
Step = Callable[[Page], Any]
Ids = Mapping[str, int | str]
API = "/api/v1"
DIALOG = "dialog[open]"


def fill(label: str, text: str, where: str = "body") -> Step:
    return lambda page: page.locator(where).get_by_label(label, exact=True).fill(text)


def choose(label: str, option: str, where: str = "body") -> Step:
    def step(page: Page) -> None:
        page.locator(where).get_by_label(label, exact=True).select_option(option)

    return step


def tick(label: str, where: str = "body", *, on: bool = True) -> Step:
    return lambda page: page.locator(where).get_by_label(label, exact=True).set_checked(on)


def press(name: str, where: str = "body") -> Step:
    return lambda page: (
        page.locator(where).get_by_role("button", name=name, exact=True).first.click()
    )


@dataclass(frozen=True)
class Row:
    """What a person does, and what leaves: "METHOD /path" below the API's root, and its body.

    Attributes:
        sends: In braces stand names of ids that the server has given.
        shows: What the page then says, by selector.
        hides: What is no longer there.
        tagged: The address whose ETag is sent along.
    """

    does: str
    steps: Sequence[Step]
    sends: Mapping[str, Json]
    shows: Mapping[str, str] | None = None
    hides: str | None = None
    tagged: str | None = None


@contextmanager
def listening(page: Page) -> Iterator[list[Request]]:
    """What the page asks of the API meanwhile."""
    heard: list[Request] = []

    def hear(request: Request) -> None:
        if urlsplit(request.url).path.startswith(API):
            heard.append(request)

    page.on("request", hear)
    try:
        yield heard
    finally:
        page.remove_listener("request", hear)


def line_of(request: Request) -> str:
    """Method, path and query of a request."""
    url = urlsplit(request.url)
    query = f"?{url.query}" if url.query else ""
    return f"{request.method} {url.path.removeprefix(API)}{query}"


def carry_out(page: Page, row: Row, ids: Ids) -> None:
    """Do what a row says; what the page sends must be what it expects, and the server must take it."""
    wanted = {line.format(**ids): body for line, body in row.sends.items()}
    etag = page.request.get(API + row.tagged.format(**ids)).headers["etag"] if row.tagged else None

    def told() -> list[Request]:
        """What changes something; what is read, where it is expected: pages read anew on their own."""
        return [one for one in heard if one.method != "GET" or line_of(one) in wanted]

    with listening(page) as heard:
        for step in row.steps:
            step(page)
        until(page, lambda: len(told()) >= len(wanted))
        for place, text in (row.shows or {}).items():
            expect(page.locator(place).first, row.does).to_contain_text(text.format(**ids))
        if row.hides:
            expect(page.locator(row.hides.format(**ids)), row.does).to_have_count(0)
        # What leaves once too often may leave later.
        settled(page)
    sent = told()
    assert [(line_of(one), one.post_data_json) for one in sent] == list(wanted.items()), row.does
    for one in sent:
        answer = one.response()
        assert answer is not None, row.does
        assert answer.ok, f"{row.does}: {answer.text()}"
        if etag is not None:
            assert one.headers["if-match"] == etag, row.does


def read(page: Page, path: str) -> Json:
    answer = page.request.get(API + path)
    assert answer.ok, answer.text()
    return answer.json()


def fixed(value: float | None, digits: int, unit: str = "") -> str:
    """A number as people read it."""
    if value is None:
        return "–"
    text = f"{abs(value):.{digits}f}"
    return f"{'−' if value < 0 and float(text) else ''}{text}{unit}"


def says(page: Page, numbers: Mapping[str, str]) -> None:
    """What stands at some places of the page, all of it at once."""
    for place, text in numbers.items():
        expect(page.locator(place).first, place).to_have_text(text)
