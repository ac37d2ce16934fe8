"""Windows that tests use one after the other: what one leaves, the next does not meet."""

from __future__ import annotations

from playwright.sync_api import Page

from tests.e2e.windows import Windows

LEFT = """async () => {
  localStorage.setItem('left', '1');
  sessionStorage.setItem('left', '1');
  document.cookie = 'left=1';
  window.left = 1;
  addEventListener('pagehide', () => sessionStorage.setItem('later', '1'));
  await new Promise((done) => { indexedDB.open('left').onsuccess = done; });
}"""
FOUND = """async () => ({
  kept: { ...localStorage, ...sessionStorage },
  cookie: document.cookie,
  left: [window.left, window.told, window.asked].filter((value) => value !== undefined),
  databases: (await indexedDB.databases()).map(({ name }) => name),
  history: history.length,
  still: matchMedia('(prefers-reduced-motion: reduce)').matches,
  size: [innerWidth, innerHeight],
  focus: document.hasFocus(),
})"""
HELD = """() => {
  // A set: browsers may tell of one move twice, and before all else, where a page has just been drawn under the mouse.
  window.held = new Set();
  addEventListener('keydown', (event) => window.held.add(`shift ${event.shiftKey}`));
  addEventListener('mousemove', (event) => window.held.add(`buttons ${event.buttons}`));
}"""


def met(page: Page) -> tuple[object, set[str]]:
    """What a page meets in a tab that says it is new."""
    assert page.url == "about:blank"
    page.goto("/readyz")
    found = page.evaluate(FOUND)
    page.evaluate(HELD)
    page.keyboard.press("a")
    page.mouse.move(30, 30)
    return found, set(page.evaluate("() => [...window.held]"))


class TestWindows:
    def test_a_tab_is_used_again_and_is_as_new(self, windows: Windows, server: str) -> None:
        first = windows.take(server, size={"width": 700, "height": 600})
        heard: list[str] = []
        first.on("request", lambda request: heard.append(request.url))
        first.route("**/readyz", lambda route: route.abort())
        first.goto("/healthz")
        first.goto("/help")
        first.evaluate(LEFT)
        first.emulate_media(reduced_motion="reduce")
        first.mouse.move(30, 30)
        first.mouse.down()
        first.keyboard.down("Shift")
        windows.give_back()
        told = len(heard)
        assert told > 1

        second = windows.take(server)
        assert second is first
        new = Windows(windows.browser).take(server)
        assert met(second) == met(new)
        assert len(heard) == told
        windows.give_back()
        new.context.close()

    def test_a_tab_that_was_told_something_for_good_is_closed(
        self, windows: Windows, server: str
    ) -> None:
        first = windows.take(server)
        first.add_init_script("window.told = 1")
        first.goto("/healthz")
        windows.give_back()
        second = windows.take(server)
        second.expose_function("asked", lambda: 1)
        second.goto("/healthz")
        assert second.evaluate(FOUND)["left"] == [None]
        windows.give_back()
        third = windows.take(server)
        third.goto("/healthz")
        assert third.evaluate(FOUND)["left"] == []
        assert first.is_closed() and second.is_closed()
        windows.give_back()
