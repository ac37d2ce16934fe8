"""A wheel serves the whole product where there is no checkout."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from playwright.sync_api import sync_playwright

from tests.e2e.install_chromium import ADVICE, find_chromium
from tests.e2e.screen import Screen, rows
from tests.e2e.service import ROOT
from tests.release.sources import unpack

SECONDS = 300
LOAD_ALL = """(modules) => {
  const folder = new URL('..', document.querySelector('script[src$="/built/main.js"]').src);
  return Promise.all(modules.map(async (name) => { await import(new URL(name, folder).href); }));
}"""
ASK = """from app import command_line
print(command_line.__file__)
for words in (["--version"], ["backup", "-h"]):
    command_line.app(words, standalone_mode=False)
"""
WHEEL, SOURCES = "*.whl", "*.tar.gz"


def build(project: Path, out: Path, target: str) -> subprocess.CompletedProcess[str]:
    """Build a distribution of a project folder into ``out``, without a network."""
    command = [sys.executable, "-m", "hatchling", "build", "-t", target, "-d", str(out)]
    return subprocess.run(command, cwd=project, capture_output=True, text=True, timeout=SECONDS)


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the wheel and the source distribution of this checkout."""
    folder = tmp_path_factory.mktemp("dist")
    for target in ("wheel", "sdist"):
        assert (built := build(ROOT, folder, target)).returncode == 0, built.stderr
    return folder


@pytest.fixture(scope="module")
def sources(dist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project as the source distribution has it."""
    return unpack(next(dist.glob(SOURCES)), tmp_path_factory.mktemp("sources"))


@dataclass(frozen=True)
class Installation:
    """An environment in which the wheel is installed, and an empty folder to work in."""

    folder: Path

    def run(self, *arguments: str) -> str:
        """What a command of touchline prints."""
        done = subprocess.run(
            [self.folder / "bin" / "touchline", *arguments],
            cwd=self.work,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=SECONDS,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    @contextmanager
    def serving(self) -> Iterator[str]:
        """Address of a server."""
        server = subprocess.Popen(
            [self.folder / "bin" / "touchline", "serve", "--port", "0"],
            cwd=self.work,
            env=self.environment,
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            assert server.stdout is not None
            line = server.stdout.readline()
            assert line.startswith("Touchline is at http://127.0.0.1:")
            yield line.split()[-1]
        finally:
            server.terminate()
            server.communicate(timeout=60)

    @property
    def work(self) -> Path:
        """A folder that was empty before the first command."""
        return self.folder / "work"

    @property
    def environment(self) -> dict[str, str]:
        """Nothing of the environment that the tests run in but what every process needs."""
        return {"PATH": os.environ["PATH"], "HOME": str(self.work)}


@pytest.fixture(scope="module")
def installed(dist: Path, tmp_path_factory: pytest.TempPathFactory) -> Installation:
    """The wheel in an environment of its own, which borrows the installed libraries."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder)
    python = folder / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "--no-deps"]
    wheel = str(next(dist.glob(WHEEL)))
    subprocess.run([*pip, "--no-index", "--quiet", wheel], check=True, timeout=SECONDS)
    own = Path(sysconfig.get_path("purelib", vars={"base": str(folder)}))
    (own / "borrowed.pth").write_text(sysconfig.get_path("purelib") + "\n")
    borrow_compiled(own)
    (folder / "work").mkdir()
    return Installation(folder)


def borrow_compiled(own: Path) -> None:
    """What numba has compiled for this checkout; it is the same code, and takes half a minute."""
    for compiled in (ROOT / "app").rglob("__pycache__/*.nb[ic]"):
        source = compiled.parents[1] / f"{compiled.name.partition('.')[0]}.py"
        target = own / source.relative_to(ROOT)
        shutil.copystat(source, target)
        shutil.copy2(compiled, target.parent / "__pycache__")


def names(wheel: Path) -> list[str]:
    """Names of the files in a wheel."""
    with zipfile.ZipFile(wheel) as archive:
        return archive.namelist()


def own_modules(dist: Path) -> list[str]:
    """The modules of the application in a wheel, as they were written."""
    held = names(next(dist.glob(WHEEL)))
    scripts = [name.removeprefix("app/static/") for name in held if name.endswith(".js")]
    return [name for name in scripts if not name.startswith(("node_modules/", "built/"))]


class TestWheel:
    def test_every_library_in_it_brings_its_licence_and_no_tool_is_in_it(self, dist: Path) -> None:
        held = names(next(dist.glob(WHEEL)))
        libraries = [name for name in held if "/node_modules/" in name]
        assert libraries
        for name in libraries:
            parts = name.split("/")
            depth = 5 if parts[3].startswith("@") else 4
            assert "/".join([*parts[:depth], "LICENSE"]) in held
        tools = ("typescript", "esbuild", "axe-core", "package.json", "tsconfig.json")
        tools += (".npmrc", "build.mjs", "tests/")
        assert [name for name in held if any(tool in name for tool in tools)] == []
        assert any(name.endswith("dist-info/licenses/LICENSE") for name in held)

    def test_the_modules_are_in_it_joined_and_apart(self, dist: Path) -> None:
        with zipfile.ZipFile(next(dist.glob(WHEEL))) as archive:
            about = json.loads(archive.read("app/static/built/about.json"))
            held = archive.namelist()
        joined = [f"built/{name}" for name in ("main.js", "ahead.js", *about["needed_first"])]
        assert {f"app/static/{name}" for name in ("main.js", *joined)} <= {*held}

    def test_without_the_libraries_nothing_is_built(self, sources: Path, tmp_path: Path) -> None:
        bare = tmp_path / "bare"
        shutil.copytree(sources, bare, ignore=shutil.ignore_patterns("node_modules", "tests"))
        built = build(bare, tmp_path / "out", "wheel")
        assert built.returncode != 0
        assert "make setup" in built.stderr


class TestInstallation:
    def test_tells_its_version_and_its_help_and_is_not_this_checkout(
        self, installed: Installation, dist: Path
    ) -> None:
        ask = [installed.folder / "bin" / "python", "-c", ASK]
        told = subprocess.check_output(
            ask, cwd=installed.work, env=installed.environment, text=True, timeout=SECONDS
        )
        where, version, words = told.split("\n", 2)
        assert Path(where).is_relative_to(installed.folder)
        assert version == f"touchline {next(dist.glob(WHEEL)).name.split('-')[1]}"
        assert "--with-frames" in words

    def test_brings_the_library_for_scripts_beside_the_command(
        self, installed: Installation
    ) -> None:
        ask = [
            installed.folder / "bin" / "python",
            "-c",
            "import touchline; print(touchline.__file__)",
        ]
        told = subprocess.check_output(
            ask, cwd=installed.work, env=installed.environment, text=True, timeout=SECONDS
        )
        assert Path(told.strip()).is_relative_to(installed.folder)

    def test_shows_a_group_in_a_browser_which_finds_every_module(
        self, installed: Installation, dist: Path
    ) -> None:
        installed.run(
            "sample", "--groups", "2", "--no-faults", "--dataset", "sample", "--workers", "1"
        )
        assert (installed.work / ".local/share/touchline/touchline.db").is_file()
        chromium = find_chromium()
        assert chromium, ADVICE
        with (
            installed.serving() as address,
            sync_playwright() as playwright,
            playwright.chromium.launch(executable_path=chromium) as browser,
        ):
            page = browser.new_page(base_url=address)
            faults: list[str] = []
            page.on("pageerror", lambda error: faults.append(str(error)))
            page.on("response", lambda answer: answer.ok or faults.append(answer.url))
            page.goto(f"/review/{rows(page)[0]['id']}")
            screen = Screen(page)
            screen.ready()
            assert screen.document()["solution"] is not None
            page.goto("/help/words")
            page.locator(".help-words dt").first.wait_for()
            # Beside the joined ones that the page has; to load the first again would begin again.
            page.evaluate(LOAD_ALL, [name for name in own_modules(dist) if name != "main.js"])
            assert faults == []
