"""The libraries of the product: which are pinned, and which a user of it installs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib.metadata import requires
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
LOCK = ROOT / "requirements.lock"
EXTRAS = ("export", "library", "charts", "detect", "postgres", "s3", "cluster")
"""What a user may add; ``dev`` is for who works on the product."""


@dataclass(frozen=True)
class Pin:
    """An entry of a lock file; one library may have several, for other versions of Python.

    Attributes:
        name: Of the library, in its canonical form.
        here: This machine installs it.
        text: The entry with its hashes.
    """

    name: str
    here: bool
    text: str


def pins(lock: Path = LOCK) -> list[Pin]:
    """The entries of a lock file."""
    entries = re.split(r"\n(?=\S)", re.sub(r"^ *#.*\n", "", lock.read_text("utf-8"), flags=re.M))
    found = []
    for entry in filter(str.strip, entries):
        requirement = Requirement(entry.partition("--hash")[0].replace("\\", "").strip())
        here = requirement.marker is None or requirement.marker.evaluate()
        found.append(Pin(canonicalize_name(requirement.name), here, entry.strip()))
    return found


def pinned() -> set[str]:
    """Names of the libraries that the lock file puts onto this machine."""
    return {pin.name for pin in pins() if pin.here}


def closure(extras: Iterable[str] = (), project: str = "touchline") -> set[str]:
    """Names of all libraries that an installation with these extras brings, by what is installed
    here."""
    found: set[str] = set()
    waiting = [(project, frozenset(extras))]
    while waiting:
        name, wanted = waiting.pop()
        for requirement in _needed(name, wanted):
            key = canonicalize_name(requirement.name)
            if key not in found or requirement.extras:
                found.add(key)
                waiting.append((key, frozenset(requirement.extras)))
    return found


def _needed(name: str, extras: frozenset[str]) -> Iterator[Requirement]:
    for line in requires(name) or ():
        requirement = Requirement(line)
        marker = requirement.marker
        if marker is None or any(marker.evaluate({"extra": extra}) for extra in ("", *extras)):
            yield requirement
