"""A real server over a small sample dataset, and a real browser in front of it."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from playwright.sync_api import (
    Browser,
    BrowserContext,
    ConsoleMessage,
    Page,
    expect,
    sync_playwright,
)

from tests.e2e.film import write_film
from tests.e2e.install_chromium import ADVICE, find_chromium
from tests.e2e.screen import Screen, passing
from tests.e2e.season import fill_season

ROOT = Path(__file__).resolve().parents[2]
GROUPS = 14
SIZE = {"width": 1440, "height": 900}
START_SECONDS = 60.0
SOFTWARE_GRAPHICS = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


def _chromium() -> str:
    found = find_chromium()
    if not found or not Path(found).exists():
        pytest.fail(ADVICE, pytrace=False)
    return found


def _touchline(*arguments: str, home: Path) -> None:
    command = [sys.executable, "-c", "from app.cli import main; main()", *arguments]
    done = subprocess.run(
        command, cwd=ROOT, env=_environment(home), capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, f"touchline {' '.join(arguments)}: {done.stderr}"


def _environment(home: Path, port: int = 0) -> dict[str, str]:
    return {**os.environ, "TOUCHLINE_HOME": str(home), "TOUCHLINE_PORT": str(port)}


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture(scope="session")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home with the solved sample dataset."""
    if not (ROOT / "static" / "node_modules" / "preact").is_dir():
        pytest.fail(
            "The browser's libraries are not installed: run 'npm ci' in static/ (make setup).",
            pytrace=False,
        )
    folder = tmp_path_factory.mktemp("home")
    sample = tmp_path_factory.mktemp("sample")
    _touchline("migrate", home=folder)
    _touchline("sample", "--groups", str(GROUPS), str(sample / "tree"), home=folder)
    _touchline("import", "soccernet-v3", str(sample / "tree"), "--dataset", "sample", home=folder)
    _touchline("solve", "--dataset", "sample", "--workers", "1", home=folder)
    return folder


@pytest.fixture(scope="session")
def server(home: Path) -> Iterator[str]:
    """Address of a server over the home."""
    with _serving(home) as address:
        yield address


@pytest.fixture(scope="session")
def film(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a server over a home of its own: a short film by six static cameras."""
    home = tmp_path_factory.mktemp("film-home")
    folder = write_film(tmp_path_factory.mktemp("film"))
    _touchline("migrate", home=home)
    _touchline("import", "issia", str(folder), "--dataset", "film", home=home)
    _touchline("solve", "--dataset", "film", "--workers", "1", home=home)
    with _serving(home) as address:
        yield address


@pytest.fixture(scope="session")
def season(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a server over a home of its own: two thousand groups."""
    home = tmp_path_factory.mktemp("season-home")
    fill_season(home)
    with _serving(home) as address:
        yield address


@contextmanager
def _serving(home: Path) -> Iterator[str]:
    port = _free_port()
    address = f"http://127.0.0.1:{port}"
    with (home / "server.log").open("wb") as log:
        process = subprocess.Popen(
            [sys.executable, "-c", "from app.cli import main; main()", "serve"],
            cwd=ROOT,
            env=_environment(home, port),
            stdout=log,
            stderr=log,
        )
        try:
            _wait_for(address, process, home / "server.log")
            yield address
        finally:
            process.terminate()
            process.wait(timeout=20)


def _wait_for(address: str, process: subprocess.Popen[bytes], log: Path) -> None:
    deadline = time.monotonic() + START_SECONDS
    while time.monotonic() < deadline:
        assert process.poll() is None, log.read_text()
        try:
            with urllib.request.urlopen(f"{address}/healthz", timeout=2):
                return
        except OSError:
            time.sleep(0.1)
    pytest.fail(f"the server did not start: {log.read_text()}")


@pytest.fixture(scope="module")
def browser(request: pytest.FixtureRequest) -> Iterator[Browser]:
    """Chromium, for one module: while Playwright runs, no other test can run an event loop."""
    # On a busy machine five seconds are little.
    expect.set_options(timeout=20_000)
    with sync_playwright() as playwright:
        # Where there is no graphics card the 3D view is drawn by the processor, which costs time.
        drawn = request.module.__name__.endswith("scene3d")
        arguments = SOFTWARE_GRAPHICS if drawn else []
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


@pytest.fixture
def open_page(browser: Browser, server: str, console: Console) -> Iterator[OpenPage]:
    """A function that opens a fresh window: ``open_page("/groups", scheme=...)``; None: blank."""
    contexts: list[BrowserContext] = []

    def open_one(
        path: str | None, *, scheme: str = "dark", size: dict[str, int] | None = None
    ) -> Page:
        context = browser.new_context(
            base_url=server,
            viewport=size or SIZE,  # type: ignore[arg-type]
            color_scheme=scheme,  # type: ignore[arg-type]
            accept_downloads=True,
        )
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(20_000)
        page.on("console", console.hear)
        page.on("pageerror", lambda error: console.messages.append(f"error: {error}"))
        if path is not None:
            page.goto(path)
        return page

    yield open_one
    for context in contexts:
        context.close()


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
