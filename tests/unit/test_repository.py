"""What the repository holds: text, and pictures that are small."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.unit.conftest import WHEN_ALL

ROOT = Path(__file__).parents[2]
MOST_BYTES = 300_000
"""Of a file that is no text."""


def test_no_file_that_is_no_text_is_large():
    if not (ROOT / ".git").exists() or shutil.which("git") is None:
        pytest.skip("only a checkout says what is in it")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True)
    names = [name for name in listed.stdout.decode().split("\0") if name]
    files = [ROOT / name for name in names if (ROOT / name).is_file()]
    assert len(files) > 1000
    binary = [path for path in files if b"\0" in path.read_bytes()]
    assert any(path.suffix == ".jpg" for path in binary)
    assert [path.name for path in binary if path.stat().st_size > MOST_BYTES] == []


def test_every_file_whose_tests_run_on_both_databases_is_there():
    folder = Path(__file__).parent
    assert [name for name in sorted(WHEN_ALL) if not (folder / name).is_file()] == []
