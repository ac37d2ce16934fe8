"""Windows of a browser, each as new to the page as if nobody had been there.

What a window has loaded from the server stays with the browser from test to test; what the page
kept for itself (storage, databases, cookies) does not.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from urllib.parse import urlsplit

from playwright.sync_api import Browser, BrowserContext, CDPSession, Error, Page

SIZE = {"width": 1440, "height": 900}
SLOW = int(os.environ.get("TOUCHLINE_SLOW_PAGES", "0"))
"""Milliseconds by which pages are late at most, to find tests that do not wait for them."""
TIMEOUT_MS = 30_000 if SLOW else 120_000
"""What a machine that does much else may take for anything a page waits for."""
NOTHING_ON_ITS_WAY = """() => {
  const save = document.querySelector('.save[data-unsaved]');
  return !save || save.dataset.unsaved === '0' || ['away', 'failed'].includes(save.dataset.state);
}"""
LATE = """(most) => {
  const late = (value) => new Promise((go) => setTimeout(go, Math.random() * most, value));
  const { fetch, requestAnimationFrame: frame, createImageBitmap: decode } = window;
  window.fetch = (...asked) => late().then(() => fetch(...asked)).then(late);
  window.createImageBitmap = (...asked) => decode(...asked).then(late);
  // One delay for all that ask for the same frame, which keeps their order.
  let waiting = null;
  window.requestAnimationFrame = (draw) => {
    waiting ??= late().then(() => { waiting = null; });
    const own = {};
    waiting.then(() => { own.number = frame((now) => { if (!own.ended) draw(now); }); });
    drawn.set(++last, own);
    return last;
  };
  const drawn = new Map();
  let last = 0;
  window.cancelAnimationFrame = (number) => { (drawn.get(number) ?? {}).ended = true; };
  const { addEventListener } = EventSource.prototype;
  EventSource.prototype.addEventListener = function (kind, hear, ...more) {
    const heard = (event) => setTimeout(() => {
      if (this.readyState !== EventSource.CLOSED) hear.call(this, event);
    }, most / 2);
    addEventListener.call(this, kind, heard, ...more);
  };
}"""
KEPT_BY_PAGES = "cookies,indexeddb,local_storage,service_workers,cache_storage"


def _let_write(page: Page) -> None:
    """Wait for what the page is about to save: the next test must not meet it on its way."""
    with suppress(Error):
        page.wait_for_function(NOTHING_ON_ITS_WAY, timeout=TIMEOUT_MS)


@dataclass
class _Window:
    """One profile of the browser, and a blank page through which it is cleaned."""

    address: str
    context: BrowserContext
    blank: Page
    cleaner: CDPSession

    @classmethod
    def new(cls, browser: Browser, address: str) -> _Window:
        context = browser.new_context(base_url=address, accept_downloads=True)
        blank = context.new_page()
        return cls(address, context, blank, context.new_cdp_session(blank))

    def clean(self) -> None:
        origins = {self.address}
        self.context.set_offline(False)
        self.context.unroute_all()
        for page in self.context.pages:
            if page is not self.blank:
                _let_write(page)
                origins.add("{0.scheme}://{0.netloc}".format(urlsplit(page.url)))
                page.close()
        for origin in origins:
            self.cleaner.send(
                "Storage.clearDataForOrigin", {"origin": origin, "storageTypes": KEPT_BY_PAGES}
            )


class Windows:
    """Windows of one browser: taken by a test, given back cleaned."""

    def __init__(self, browser: Browser):
        self.browser = browser
        self._free: defaultdict[str, list[_Window]] = defaultdict(list)
        self._taken: list[_Window] = []

    def take(
        self, address: str, scheme: str = "dark", size: Mapping[str, int] | None = None
    ) -> Page:
        """A blank page in a window of its own, whose relative addresses start at ``address``."""
        free = self._free[address]
        window = free.pop() if free else _Window.new(self.browser, address)
        self._taken.append(window)
        page = window.context.new_page()
        if SLOW:
            page.add_init_script(f"({LATE})({SLOW})")
        page.set_viewport_size(size or SIZE)  # type: ignore[arg-type]
        page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
        page.set_default_timeout(TIMEOUT_MS)
        return page

    def give_back(self) -> None:
        """Clean and keep every window that was taken."""
        while self._taken:
            window = self._taken.pop()
            window.clean()
            self._free[window.address].append(window)
