"""Homes and folders that are built once, whichever of the test processes needs them first."""

from __future__ import annotations

import os
from collections.abc import Callable
from fcntl import LOCK_EX, flock
from pathlib import Path
from shutil import copytree

import pytest


def once_for_all(factory: pytest.TempPathFactory, name: str, build: Callable[[Path], None]) -> Path:
    """A folder of this session that one process builds while the others wait; nobody changes it."""
    base = factory.getbasetemp()
    # One process of several has a folder of its own below that of the session.
    session = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    folder, built = session / name, session / f"{name}.built"
    with (session / f"{name}.lock").open("w") as lock:
        flock(lock, LOCK_EX)
        if not built.exists():
            folder.mkdir()
            build(folder)
            built.touch()
    return folder


def copy_home(built: Path, factory: pytest.TempPathFactory) -> Path:
    """A copy of the home in such a folder, to be served and changed."""
    return Path(copytree(built / "home", factory.mktemp(built.name) / "home"))
