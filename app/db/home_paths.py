"""Paths of files in a home: a home that was moved, or restored into another folder, reads its own files.

Log, tables and frozen versions keep the path that a file had when it came into the home.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Engine

from app.config import Settings

_OF_ONE_FILE = re.compile(r"/((?:uploads/[0-9a-f]{32}|recordings/[0-9a-f]{64})/.+)", re.DOTALL)
"""Id of an upload, SHA-256 of a video: no other file has such a path."""
_OF_SOME_FILE = re.compile(r"/((?:practice|sample)/.+)", re.DOTALL)


def find_path_in_home(path: str, home: Path) -> str:
    """Where a file lies in a home whose files were in another folder before; any other path as it is."""
    if not path.startswith("/") or ".." in path.split("/"):
        return path
    if found := _OF_ONE_FILE.search(path):
        there = f"{home}/{found[1]}"
        return there if path != there and _exists(there) else path
    if found := _OF_SOME_FILE.search(path):
        there = f"{home}/{found[1]}"
        # A folder of somebody else's may be called "sample".
        if path != there and not _exists(path) and _exists(there):
            return there
    return path


def _exists(path: str) -> bool:
    # That of pathlib raises where a folder must not be looked into.
    return os.path.exists(path)  # noqa: PTH110


def set_home_of_engine(engine: Engine, settings: Settings) -> None:
    """Let sessions of an engine read paths as those of a home."""
    dialect: Any = engine.dialect
    dialect.touchline_home = settings.home.absolute()


def find_stored_path(session: Connection, path: str) -> str:
    """Where a file lies whose path is in the database: ``find_path_in_home`` of the home of a session."""
    home: Path | None = getattr(session.dialect, "touchline_home", None)
    return path if home is None else find_path_in_home(path, home)
