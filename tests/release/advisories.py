"""Advisories: whether anybody has published a weakness of a pinned library."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.release.libraries import LOCK, ROOT

SECONDS = 300
UNANSWERED = "its service did not answer: nothing is known"


@dataclass(frozen=True)
class Answer:
    """What one service says.

    Attributes:
        sentence: For a person.
        weak: It knows of a weakness.
    """

    sentence: str
    weak: bool = False


def ask_python(tools: Path) -> Answer:
    """Ask about requirements.lock, with ``pip-audit`` of the folder ``tools``."""
    choice = ["--require-hashes", "--disable-pip", "-f", "json", "--progress-spinner", "off"]
    return read_python(_told([tools / "pip-audit", "-r", LOCK, *choice]))


def ask_browser() -> Answer:
    """Ask about the browser's libraries, with ``npm audit``."""
    npm = Path(sys.executable).with_name("npm")
    return read_browser(_told([npm, "--prefix", ROOT / "static", "audit", "--json"]))


def read_python(told: Any) -> Answer:
    """Understand what ``pip-audit`` printed; None: nothing."""
    items = (told or {}).get("dependencies", [])
    asked = [item for item in items if "skip_reason" not in item]
    if not asked:
        return Answer(f"pip-audit: {UNANSWERED}")
    found = [
        f"{item['name']} {item['version']}: {weak['id']}, mended in {_versions(weak)}"
        for item in asked
        for weak in item["vulns"]
    ]
    unknown = len(items) - len(asked)
    told_of = f"{len(asked)} Python libraries" + (f", {unknown} unknown" if unknown else "")
    return Answer("\n".join([f"pip-audit: {told_of}, {len(found)} weak", *found]), bool(found))


def _versions(weak: dict[str, Any]) -> str:
    return ", ".join(weak.get("fix_versions") or ()) or "no version"


def read_browser(told: Any) -> Answer:
    """Understand what ``npm audit`` printed; None: nothing."""
    if "vulnerabilities" not in (told or {}):
        return Answer(f"npm audit: {UNANSWERED}")
    found = [f"{name}: {item['severity']}" for name, item in told["vulnerabilities"].items()]
    return Answer("\n".join([f"npm audit: {len(found)} weak", *found]), bool(found))


def _told(command: Sequence[str | Path]) -> Any:
    """The JSON that a program prints; None where it prints none or cannot be run."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)
        return json.loads(done.stdout)
    except (OSError, ValueError, subprocess.TimeoutExpired):
        return None
