"""So much at once that the dataset is told of instead of its groups: pages read again."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from playwright.sync_api import Page

from tests.e2e.screen import until

OpenPage = Callable[..., Page]

STREAM = """() => {
    window.EventSource = class extends EventTarget {
        constructor() {
            super();
            window.stream = this;
            setTimeout(() => { this.onopen?.(new Event('open')); this.dispatchEvent(new Event('open')); });
        }
        close() {}
    };
}"""
"""A stream that tells what the test says."""
TELL = """() => {
    const data = JSON.stringify({ dataset: 'sample', kind: 'pitch', actor: null });
    window.stream.dispatchEvent(new MessageEvent('dataset', { data }));
}"""


@pytest.mark.parametrize(
    ("path", "ready", "read"),
    [
        ("/groups", ".queue-row a", "/api/v1/groups?"),
        ("/review/1", ".image-panel__stage[data-ready]", "/api/v1/groups/1"),
        ("/datasets/sample/statistics", "#pitches-title", "/pitches"),
    ],
)
def test_the_page_reads_again(open_page: OpenPage, path: str, ready: str, read: str) -> None:
    page = open_page(None)
    page.add_init_script(f"({STREAM})()")
    page.goto(path)
    page.wait_for_selector(ready)
    page.wait_for_function("() => window.stream")
    page.wait_for_timeout(1500)
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))

    def is_read() -> bool:
        # Again: a part of the page that comes late has not begun to listen.
        page.evaluate(TELL)
        return any(read in address for address in asked)

    until(page, is_read)
