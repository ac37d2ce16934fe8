"""Windows of a browser, each as new to the page as if nobody had been there.

What a window has loaded from the server stays with the browser from test to test; what the page
kept for itself (storage, databases, cookies, its history) does not, nor what a test asked of it.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Callable, Mapping, Set
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit

from playwright.sync_api import Browser, BrowserContext, CDPSession, Error, Page

SIZE = {"width": 1440, "height": 900}
SLOW = int(os.environ.get("TOUCHLINE_SLOW_PAGES", "0"))
"""Milliseconds by which pages are late at most, to find tests that do not wait for them."""
PROCESSOR = int(os.environ.get("TOUCHLINE_SLOW_PROCESSOR", "1"))
"""How many times slower pages reckon, to the same end."""
TIMEOUT_MS = 30_000 * PROCESSOR if SLOW else 120_000
"""What a machine that does much else may take for anything a page waits for."""
NOTHING_ON_ITS_WAY = """() => {
  const save = document.querySelector('.save[data-unsaved]');
  return !save || save.dataset.unsaved === '0' || ['away', 'failed'].includes(save.dataset.state);
}"""
LATE = """(most) => {
  const late = (value) => new Promise((go) => setTimeout(go, Math.random() * most, value));
  const { fetch, requestAnimationFrame: frame, createImageBitmap: decode } = window;
  // A page that goes away would never send what it says last.
  window.fetch = (...asked) => (asked[1]?.keepalive ? fetch(...asked) : late().then(() => fetch(...asked)).then(late));
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
LATE_ANSWERS = {
    "offline": False,
    "latency": SLOW / 5,
    "downloadThroughput": -1,
    "uploadThroughput": -1,
}
"""Of modules, too, which a page fetches when something is first shown."""
KEPT_BY_PAGES = "cookies,indexeddb,local_storage,service_workers,cache_storage"
LASTING = ("add_init_script", "expose_function", "expose_binding")
"""What a tab goes on doing after it was told once."""
HELD = ("Shift", "Control", "Alt", "Meta", "z")
"""Keys that tests hold down."""
EMPTYING_MS = 10_000
"""A tab that cannot be left within that is closed."""
BLANK = "about://"
"""Where a tab is that nobody has used, as an origin."""


def _let_write(page: Page) -> None:
    """Wait for what the page is about to save: the next test must not meet it on its way."""
    with suppress(Error):
        page.wait_for_function(NOTHING_ON_ITS_WAY, timeout=TIMEOUT_MS)


@dataclass
class _Window:
    """One profile of the browser, its tab, and a blank page through which it is cleaned."""

    address: str
    context: BrowserContext
    blank: Page
    cleaner: CDPSession
    tab: Page | None = None
    history: CDPSession | None = None
    heard: list[tuple[str, Callable[..., Any]]] = field(default_factory=list)
    spent: bool = False
    """The tab does at every page what it was once told; nobody can take that back."""

    @classmethod
    def new(cls, browser: Browser, address: str) -> _Window:
        context = browser.new_context(base_url=address, accept_downloads=True)
        context.set_default_timeout(TIMEOUT_MS)
        blank = context.new_page()
        window = cls(address, context, blank, context.new_cdp_session(blank))
        if SLOW:
            cut = context.set_offline

            def set_offline(offline: bool) -> None:
                cut(offline)
                window._answer_late(offline)

            context.set_offline = set_offline  # type: ignore[method-assign]
        return window

    def page(self) -> Page:
        """The tab; a new one where there is none that can be used again.

        One that is used again still has in memory what it loaded: to read two hundred modules
        anew is most of what a page costs.
        """
        if self.tab is None:
            self.tab = self.context.new_page()
            self.history = self.context.new_cdp_session(self.tab)
            self.spent = False
            if SLOW:
                self.tab.add_init_script(f"({LATE})({SLOW})")
            self._watch(self.tab)
        if SLOW:
            assert self.history
            self.history.send("Network.enable")
            self._answer_late()
            self.history.send("Emulation.setCPUThrottlingRate", {"rate": PROCESSOR})
        return self.tab

    def _answer_late(self, offline: bool = False) -> None:
        """Let answers be late, or none: of two sessions that ask for conditions the later one counts,
        and that of Playwright cannot be late."""
        asked = {**LATE_ANSWERS, "offline": offline}
        if self.history is not None and self.tab is not None and not self.tab.is_closed():
            self.history.send("Network.emulateNetworkConditions", asked)

    def _watch(self, tab: Page) -> None:
        """Remember what somebody asks of the tab that would outlive their test."""
        listen = tab.on

        def on(event: str, hear: Callable[..., Any]) -> None:
            self.heard.append((event, hear))
            listen(event, hear)

        def lasting(ask: Callable[..., Any]) -> Callable[..., Any]:
            def asked(*words: Any, **options: Any) -> Any:
                self.spent = True
                return ask(*words, **options)

            return asked

        tab.on = on  # type: ignore[method-assign, assignment]
        for name in LASTING:
            setattr(tab, name, lasting(getattr(tab, name)))

    def clean(self) -> None:
        origins = {self.address}
        self.context.set_offline(False)
        self.context.unroute_all()
        for page in self.context.pages:
            if page is not self.blank:
                _let_write(page)
                origins.add("{0.scheme}://{0.netloc}".format(urlsplit(page.url)))
        for page in self.context.pages:
            if page is not self.blank and not (page is self.tab and self._emptied(page, origins)):
                page.close()
        if self.tab is not None and self.tab.is_closed():
            self.tab, self.heard = None, []
        for origin in origins:
            self.cleaner.send(
                "Storage.clearDataForOrigin", {"origin": origin, "storageTypes": KEPT_BY_PAGES}
            )

    def _emptied(self, tab: Page, origins: Set[str]) -> bool:
        """Bring the tab to where it was when it was new; whether that can be done."""
        if self.spent or not origins <= {self.address, BLANK}:
            return False
        while self.heard:
            # A test may have taken its own away.
            with suppress(KeyError):
                tab.remove_listener(*self.heard.pop())
        with suppress(Error):
            # The page is gone before its requests can reach the server again, and before what a
            # tab keeps for itself is forgotten, which only a page of the same server can do.
            tab.goto("/healthz", timeout=EMPTYING_MS)
            tab.unroute_all()
            tab.evaluate("() => sessionStorage.clear()")
            tab.goto("about:blank", timeout=EMPTYING_MS)
            # What is still held is let go where nothing happens.
            tab.mouse.up()
            tab.mouse.move(0, 0)
            for key in HELD:
                tab.keyboard.up(key)
            assert self.history
            self.history.send("Page.resetNavigationHistory")
            return True
        return False


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
        page = window.page()
        page.set_viewport_size(size or SIZE)  # type: ignore[arg-type]
        page.emulate_media(
            media="null",
            color_scheme=scheme,  # type: ignore[arg-type]
            reduced_motion="null",
            forced_colors="null",
            contrast="null",
        )
        page.set_default_timeout(TIMEOUT_MS)
        return page

    def give_back(self) -> None:
        """Clean and keep every window that was taken."""
        while self._taken:
            window = self._taken.pop()
            window.clean()
            self._free[window.address].append(window)
