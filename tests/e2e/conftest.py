"""A real server over a small sample dataset, and a real browser in front of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from playwright.sync_api import (
    Browser,
    ConsoleMessage,
    Error,
    Page,
    Playwright,
    expect,
    sync_playwright,
)

from tests.e2e.crew import CREW, Crew
from tests.e2e.homes import build_film, build_sample, build_season
from tests.e2e.install_chromium import ADVICE, find_chromium
from tests.e2e.lateness import make_late
from tests.e2e.screen import Screen, passing
from tests.e2e.service import ROOT, serving
from tests.e2e.team import join
from tests.e2e.windows import TIMEOUT_MS, Windows
from tests.homes import copy_home, once_for_all
from tests.provider import CLIENT, Provider, providing
from tests.provider import SECRET as CLIENT_SECRET

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


@pytest.fixture(scope="module")
def team_home(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home that one person worked in alone so far."""
    return copy_home(sample, tmp_path_factory)


@pytest.fixture(scope="module")
def provider() -> Iterator[Provider]:
    """By which people of the team may come in."""
    with providing() as found:
        yield found


@pytest.fixture(scope="module")
def team(team_home: Path, provider: Provider) -> Iterator[str]:
    """Address of a team's server over it."""
    said = {"ISSUER": provider.address, "CLIENT_ID": CLIENT, "CLIENT_SECRET": CLIENT_SECRET}
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {**said, "LABEL": "Club"}.items():
            patch.setenv(f"TOUCHLINE_SSO_{name}", value)
        with serving(team_home, "--team") as address:
            yield address


@pytest.fixture(scope="module")
def crew(team: str, team_home: Path) -> Iterator[Crew]:
    """Eight people with roles and passwords, and the server of their team."""
    for name, role in CREW.items():
        join(team_home, name, role)
    with ExitStack() as clients:
        yield Crew(team, clients)


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


@pytest.fixture(scope="package")
def playwright() -> Iterator[Playwright]:
    """What drives browsers, for the tests of this folder: while it runs, no event loop can."""
    # On a busy machine five seconds are little.
    expect.set_options(timeout=TIMEOUT_MS)
    make_late()
    with sync_playwright() as running:
        yield running


def _launched(playwright: Playwright, arguments: list[str]) -> Browser:
    """A Chromium; seldom one crashes before it has opened anything, which says nothing of a page."""
    try:
        return playwright.chromium.launch(executable_path=_chromium(), args=arguments)
    except Error as error:
        if "Segmentation fault" not in error.message:
            raise
    return playwright.chromium.launch(executable_path=_chromium(), args=arguments)


@contextmanager
def windows_of(playwright: Playwright, arguments: list[str]) -> Iterator[Windows]:
    """Windows of a Chromium of their own, which know nothing of earlier tests."""
    browser = _launched(playwright, arguments)
    yield Windows(browser)
    browser.close()


@pytest.fixture(scope="package")
def windows(playwright: Playwright) -> Iterator[Windows]:
    """Windows of one browser, for all modules that need no other."""
    with windows_of(playwright, FEW_PROCESSES) as opened:
        yield opened


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
            place = message.location.get("url", "")
            self.messages.append(f"{message.type}: {message.text} {place}")


@pytest.fixture
def console() -> Iterator[Console]:
    """Fails the test when the page complained."""
    heard = Console()
    yield heard
    assert heard.unexpected == []


OpenPage = Callable[..., Page]


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
