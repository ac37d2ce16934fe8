"""What the repository holds: text, and pictures that are small."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.conftest import broad_lines
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


def test_what_is_left_to_all_tests_names_tests_that_are_there():
    """`tests/broad.txt` leaves nothing out by a name that nobody has any more."""
    lines = [line for line in broad_lines() if not line.startswith("[")]
    assert len(lines) > 100
    lost = []
    for line in lines:
        file, *inner = line.split(" * ")[0].split("::")
        files = [ROOT / file] if file.endswith(".py") else list(ROOT.glob(f"{file}*.py"))
        text = "".join(path.read_text() for path in files if path.is_file())
        words = ["def" if name.startswith("test_") else "class" for name in inner]
        names = [f"{word} {name.split('[')[0]}" for word, name in zip(words, inner, strict=True)]
        if not text or not all(name in text for name in names):
            lost.append(line)
    assert lost == []
