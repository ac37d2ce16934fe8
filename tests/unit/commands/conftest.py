"""Homes of commands: made once for a module, and each test has a copy."""

from __future__ import annotations

from pathlib import Path
from shutil import copytree

import pytest


@pytest.fixture(scope="module")
def filled() -> Path | None:
    """The home that each test of a module begins with; None: it begins with nothing."""
    return None


@pytest.fixture
def home(filled: Path | None, tmp_path: Path) -> Path:
    """The home of a test, its own to change."""
    home = tmp_path / "home"
    return home if filled is None else Path(copytree(filled, home))
