"""Packages with which users read what leaves: apart from the product's, each in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
READERS = ROOT / ".readers"
HEAD = """
import json, sys
from pathlib import Path
from zipfile import ZipFile
root, found = Path(sys.argv[1]), {}
"""


def read_by(program: str, export: Path, folder: Path) -> dict[str, Any]:
    """What a program finds that reads an export with a package of its users.

    Args:
        program: Python; it reads what is at ``root`` and fills ``found``.
        export: Folder or file, ``root``.
        folder: Where the program works.
    """
    if not (READERS / "ready").is_file():
        pytest.fail(
            "The packages that read exports are missing: run 'make readers'.", pytrace=False
        )
    done = subprocess.run(
        [sys.executable, "-c", f"{HEAD}{program}\nprint(json.dumps(found))", export],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": f"{READERS}{os.pathsep}{ROOT}", "HF_HUB_OFFLINE": "1"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found
