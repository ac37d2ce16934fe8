"""Advisories: whether anybody has published a weakness of a pinned library."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

from tests.release.libraries import LOCK, ROOT

SECONDS = 120
UNANSWERED = "its service did not answer: nothing is known"


@dataclass(frozen=True)
class Accepted:
    """A weakness that is known, and with which a tree is right all the same.

    Attributes:
        until: The last day on which it is; then somebody looks again.
        why: What keeps it from doing harm here, or who waits for what.
    """

    until: date
    why: str


ACCEPTED: Mapping[str, Accepted] = {}
"""By the id of the advisory, as the services print it."""


@dataclass(frozen=True)
class Answer:
    """What one service says.

    Attributes:
        sentence: For a person.
        weak: It knows of a weakness that nobody has accepted.
    """

    sentence: str
    weak: bool = False


@dataclass(frozen=True)
class Weakness:
    """A published weakness of a library."""

    id: str
    sentence: str


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
        Weakness(weak["id"], f"{item['name']} {item['version']}: mended in {_versions(weak)}")
        for item in asked
        for weak in item["vulns"]
    ]
    unknown = len(items) - len(asked)
    told_of = f"{len(asked)} Python libraries" + (f", {unknown} unknown" if unknown else "")
    return _answer(f"pip-audit: {told_of}", found)


def _versions(weak: dict[str, Any]) -> str:
    return ", ".join(weak.get("fix_versions") or ()) or "no version"


def read_browser(told: Any) -> Answer:
    """Understand what ``npm audit`` printed; None: nothing."""
    if "vulnerabilities" not in (told or {}):
        return Answer(f"npm audit: {UNANSWERED}")
    # Who depends on a weak library is listed too, with its name instead of an advisory.
    advisories = {
        via["url"].rpartition("/")[2]: f"{name}: {via['severity']}, {via['title']}"
        for name, item in told["vulnerabilities"].items()
        for via in item["via"]
        if isinstance(via, dict)
    }
    return _answer("npm audit", [Weakness(*item) for item in advisories.items()])


def _answer(told: str, found: Sequence[Weakness]) -> Answer:
    lines = [f"{told}, {len(found)} weak"]
    weak = False
    for item in found:
        known = ACCEPTED.get(item.id)
        accepted = known is not None and date.today() <= known.until
        weak |= not accepted
        note = f" (accepted until {known.until}: {known.why})" if known and accepted else ""
        lines.append(f"{item.id}: {item.sentence}{note}")
    return Answer("\n".join(lines), weak)


def _told(command: Sequence[str | Path]) -> Any:
    """The JSON that a program prints; None where it prints none or cannot be run."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)
        return json.loads(done.stdout)
    except (OSError, ValueError, subprocess.TimeoutExpired):
        return None
