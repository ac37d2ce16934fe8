"""Case: files of one kind, as a reader is given them; kept as data, so that a test can replay it."""

from __future__ import annotations

import base64
import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

Files = dict[str, bytes]
"""Contents by relative name."""


@dataclass(frozen=True)
class Case:
    """Files that somebody might bring.

    Attributes:
        kind: What reads them, one of ``readers.KINDS``.
        files: Relative names and contents.
        given: The file that is named to the reader; empty: the folder that holds them all.
        found: What went wrong when it was found, for people.
    """

    kind: str
    files: Files
    given: str = ""
    found: str = ""

    @property
    def name(self) -> str:
        """A name that says kind and content."""
        digest = hashlib.sha256(self.text().encode()).hexdigest()[:10]
        return f"{self.kind}-{digest}.json"

    def text(self) -> str:
        """The case as JSON; files that are text stay readable."""
        files = {name: _shown(content) for name, content in self.files.items()}
        value = {"kind": self.kind, "found": self.found, "given": self.given, "files": files}
        return json.dumps(value, indent=1, ensure_ascii=True) + "\n"

    @staticmethod
    def of(text: str) -> Case:
        """Back from ``text``."""
        value = json.loads(text)
        files = {name: _content(shown) for name, shown in value["files"].items()}
        return Case(value["kind"], files, value["given"], value["found"])

    def write(self, folder: Path) -> Path:
        """Put the files into a folder; returns what is named to the reader."""
        for name, content in self.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        return folder / self.given if self.given else folder


def _shown(content: bytes) -> dict[str, str]:
    try:
        text = content.decode("ascii")
    except UnicodeDecodeError:
        return {"base64": base64.b64encode(content).decode()}
    return {"text": text}


def _content(shown: dict[str, str]) -> bytes:
    return shown["text"].encode() if "text" in shown else base64.b64decode(shown["base64"])
