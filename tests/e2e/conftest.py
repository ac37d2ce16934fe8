"""A real server over a small sample dataset, and a real browser in front of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page, expect, sync_playwright

from tests.e2e.homes import build_film, build_sample, build_season
from tests.e2e.install_chromium import ADVICE, find_chromium
from tests.e2e.screen import Screen, passing
from tests.e2e.service import ROOT, serving
from tests.e2e.windows import TIMEOUT_MS, Windows
from tests.homes import copy_home, once_for_all

CONTEXTS = 4
"""3D contexts that the browser keeps at a time."""
SOFTWARE_GRAPHICS = [
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    f"--max-active-webgl-contexts={CONTEXTS}",
]

FEW_PROCESSES = [
    "--disable-gpu",
    "--in-process-gpu",
    "--disable-site-isolation-trials",
    "--renderer-process-limit=1",
]
"""Every page in one process: starting another for each costs a tenth of what a page costs."""


def _chromium() -> str:
    found = find_chromium()
    if not found or not Path(found).exists():
        pytest.fail(ADVICE, pytrace=False)
    return found


@pytest.fixture(scope="session")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the solved sample dataset, ``home``, and the files it came from, ``tree``."""
    if not (ROOT / "static" / "node_modules" / "preact").is_dir():
        pytest.fail(
            "The browser's libraries are not installed: run 'npm ci' in static/ (make setup).",
            pytrace=False,
        )
    return once_for_all(tmp_path_factory, "sample", build_sample)


@pytest.fixture(scope="session")
def labels_file(sample: Path) -> Path:
    """The labels of the sample's first match, in SoccerNet-v3 layout."""
    return sorted((sample / "tree").rglob("Labels-v3.json"))[0]


@pytest.fixture(scope="session")
def home(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home with the solved sample dataset."""
    return copy_home(sample, tmp_path_factory)


@pytest.fixture(scope="session")
def server(home: Path) -> Iterator[str]:
    """Address of a server over the home."""
    with serving(home) as address:
        yield address


@pytest.fixture(scope="session")
def film(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a server over a home of its own: a short film by six static cameras."""
    built = once_for_all(tmp_path_factory, "film", build_film)
    with serving(copy_home(built, tmp_path_factory)) as address:
        yield address


@pytest.fixture(scope="session")
def season(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a server over a home of its own: two thousand groups."""
    built = once_for_all(tmp_path_factory, "season", build_season)
    with serving(copy_home(built, tmp_path_factory)) as address:
        yield address


@pytest.fixture(scope="module")
def browser(request: pytest.FixtureRequest) -> Iterator[Browser]:
    """Chromium, for one module: while Playwright runs, no other test can run an event loop."""
    # On a busy machine five seconds are little.
    expect.set_options(timeout=TIMEOUT_MS)
    with sync_playwright() as playwright:
        # Where there is no graphics card the 3D view is drawn by the processor, which costs time.
        drawn = request.module.__name__.endswith("scene3d")
        arguments = SOFTWARE_GRAPHICS if drawn else FEW_PROCESSES
        launched = playwright.chromium.launch(executable_path=_chromium(), args=arguments)
        yield launched
        launched.close()


@dataclass
class Console:
    """What the page complained about; a test may say what it expects."""

    messages: list[str] = field(default_factory=list)
    expected: list[str] = field(default_factory=list)

    def expect(self, part: str) -> None:
        """Allow complaints that contain this text."""
        self.expected.append(part)

    @property
    def unexpected(self) -> list[str]:
        """Complaints that nobody allowed."""
        return [
            message
            for message in self.messages
            if not any(part in message for part in self.expected)
        ]

    def hear(self, message: ConsoleMessage) -> None:
        """Keep errors and warnings."""
        if message.type in ("error", "warning"):
            self.messages.append(f"{message.type}: {message.text}")


@pytest.fixture
def console() -> Iterator[Console]:
    """Fails the test when the page complained."""
    heard = Console()
    yield heard
    assert heard.unexpected == []


OpenPage = Callable[..., Page]


@pytest.fixture(scope="module")
def windows(browser: Browser) -> Windows:
    """Windows of the browser, which know nothing of earlier tests."""
    return Windows(browser)


@pytest.fixture
def open_page(windows: Windows, server: str, console: Console) -> Iterator[OpenPage]:
    """A function that opens a fresh window: ``open_page("/groups", scheme=...)``; None: blank."""

    def open_one(
        path: str | None,
        *,
        scheme: str = "dark",
        size: dict[str, int] | None = None,
        address: str = server,
    ) -> Page:
        page = windows.take(address, scheme, size)
        page.on("console", console.hear)
        page.on("pageerror", lambda error: console.messages.append(f"error: {error}"))
        if path is not None:
            page.goto(path)
        return page

    yield open_one
    windows.give_back()


@pytest.fixture
def review(open_page: OpenPage) -> Callable[..., Screen]:
    """A function that opens the review screen of a passing group."""

    def open_group(place: int) -> Screen:
        page = open_page(None)
        page.goto(f"/review/{passing(page, place)}")
        screen = Screen(page)
        screen.ready()
        return screen

    return open_group
