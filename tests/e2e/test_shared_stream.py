"""All windows of a browser share one stream of events."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest
from playwright.sync_api import BrowserContext, Page

from tests.e2e.windows import Windows

WINDOWS = 8
READ = """async () => {
  const { readStream } = await import('/static/api/shared_stream.js');
  window.heard = [];
  window.openings = 0;
  readStream(['group'], {
    opened: () => { window.openings += 1; },
    lost: () => {},
    told: (kind, data) => {
      const told = JSON.parse(data);
      if (told.group === 1) window.heard.push(told.kind);
    },
  });
}"""


@pytest.fixture
def streams() -> list[str]:
    """Addresses of the streams that were opened."""
    return []


@pytest.fixture
def context(windows: Windows, streams: list[str]) -> Iterator[BrowserContext]:
    context = windows.browser.new_context()
    context.on(
        "request", lambda request: streams.append(request.url) if "/events" in request.url else None
    )
    yield context
    context.close()


def window(context: BrowserContext, server: str) -> Page:
    """A window that reads the stream and shows nothing."""
    page = context.new_page()
    page.goto(f"{server}/healthz")
    page.evaluate(READ)
    page.wait_for_function("() => window.openings > 0")
    return page


def judge(server: str, state: str) -> None:
    """A verdict of somebody else."""
    group = f"{server}/api/v1/groups/1"
    etag = httpx.get(group).json()["etag"]
    answer = httpx.put(f"{group}/verdict", json={"state": state}, headers={"If-Match": etag})
    assert answer.status_code == 200, answer.text


def test_many_windows_are_told_by_one_stream_and_by_the_next_one_when_its_window_closes(
    context: BrowserContext, server: str, streams: list[str]
) -> None:
    pages = [window(context, server) for _ in range(WINDOWS)]
    assert len(streams) == 1
    judge(server, "deferred")
    for page in pages:
        page.wait_for_function("() => window.heard.length === 1")
    before = pages[1].evaluate("window.openings")
    # The first one reads for all.
    pages[0].close()
    pages[1].wait_for_function("(before) => window.openings > before", arg=before)
    judge(server, "unreviewed")
    for page in pages[1:]:
        page.wait_for_function("() => window.heard.length === 2")
        assert page.evaluate("window.heard") == ["verdict", "verdict"]
    assert len(streams) == 2
