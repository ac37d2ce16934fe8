"""What a wheel holds beside the package: the browser application with its libraries, and migrations.

A source distribution brings the same libraries along, so that a wheel is built from it without npm.
Of a library only what a page can ask for is taken, with its licence.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

LIBRARIES = "node_modules"
JOINED = "built"
"""The folder of the application's modules, joined into few files (``npm run build``)."""
TOOLING = frozenset({".npmrc", "build.mjs", "package.json", "tsconfig.json"})
"""Files that only development needs. The libraries' lock file stays: it is a part of what the
server calls the version of the application."""
LICENCE = "[Ll][Ii][Cc][Ee][Nn][CcSs][Ee]*"
_MAP = re.compile(r'<script type="importmap">(.*?)</script>', re.S)
_COMMENT = re.compile(r"/\*.*?\*/", re.S)
_IMPORT = re.compile(
    r"""(?:^|[^\w$./'"`-])(?:import|export)(?:[\w\s{},*$]*?\bfrom)?\s*\(?\s*["']([^"']+)["']"""
)


class TouchlineBuildHook(BuildHookInterface[Any]):
    """Adds those files to whatever is built, except to an editable installation."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Say which files go where; hatchling puts them there."""
        if version == "editable":
            return
        root = Path(self.root)
        taken = [*library_files(root / "static"), *joined_files(root / "static")]
        if self.target_name == "wheel":
            taken += own_files(root / "static")
            taken += sorted(root.glob("migrations/*.*")) + sorted(root.glob("migrations/*/*.py"))
        prefix = "app/" if self.target_name == "wheel" else ""
        for path in taken:
            build_data["force_include"][str(path)] = prefix + path.relative_to(root).as_posix()


def own_files(static: Path) -> list[Path]:
    """The files of the application itself, without the tooling."""
    found = (path for path in sorted(static.rglob("*")) if path.is_file())
    return [
        path
        for path in found
        if path.relative_to(static).parts[0] not in (LIBRARIES, JOINED) and path.name not in TOOLING
    ]


def joined_files(static: Path) -> list[Path]:
    """The modules of the application, joined.

    Raises:
        FileNotFoundError: They have not been.
    """
    found = sorted(path for path in (static / JOINED).rglob("*") if path.is_file())
    if not found:
        raise FileNotFoundError(
            "The browser's modules are not joined: run 'npm run build' in static/ (make setup)."
        )
    return found


def library_files(static: Path) -> Iterator[Path]:
    """The files of libraries that the application imports, directly or not, and their licences.

    Raises:
        FileNotFoundError: A library is not installed, or a file imports what nobody knows.
    """
    if not (static / LIBRARIES).is_dir():
        raise FileNotFoundError(
            "The browser's libraries are not installed: run 'npm ci' in static/ (make setup)."
        )
    imports = json.loads(_found(_MAP, (static / "index.html").read_text("utf-8")))["imports"]
    ours = [path for path in own_files(static) if path.suffix == ".js"]
    seen: set[Path] = set()
    waiting = list(ours)
    while waiting:
        path = waiting.pop()
        if path not in seen:
            seen.add(path)
            waiting += _imported(path, imports, static)
    libraries = {path for path in seen if LIBRARIES in path.relative_to(static).parts}
    yield from sorted(libraries | set(_licences({_package(path) for path in libraries})))


def _imported(path: Path, imports: dict[str, str], static: Path) -> Iterator[Path]:
    code = _COMMENT.sub("", path.read_text("utf-8"))
    for specifier in _IMPORT.findall(code):
        file = (path.parent / specifier).resolve()
        if not specifier.startswith("."):
            file = static / _address(specifier, imports).removeprefix("/static/")
        if file.is_file():
            yield file
        elif LIBRARIES not in path.parts:
            # Libraries also mention in their texts what one might import.
            raise FileNotFoundError(f"{path} imports {specifier}, which is not there.")


def _address(specifier: str, imports: dict[str, str]) -> str:
    """The address of a module that a file names, by the import map."""
    folders = (name for name in imports if name.endswith("/") and specifier.startswith(name))
    under = next((imports[name] + specifier.removeprefix(name) for name in folders), "")
    return imports.get(specifier, under)


def _package(path: Path) -> Path:
    """The folder of the library that a file belongs to."""
    return next(
        folder
        for folder in path.parents
        if folder.parent.name == LIBRARIES
        or (folder.parent.name.startswith("@") and folder.parent.parent.name == LIBRARIES)
    )


def _licences(packages: Iterable[Path]) -> Iterator[Path]:
    for package in packages:
        found = sorted(package.glob(LICENCE))
        if not found:
            raise FileNotFoundError(f"{package} has no licence file.")
        yield from found


def _found(pattern: re.Pattern[str], text: str) -> str:
    match = pattern.search(text)
    if match is None:
        raise FileNotFoundError(f"index.html holds no {pattern.pattern}.")
    return match[1]
