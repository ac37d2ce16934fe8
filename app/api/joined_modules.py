"""JoinedModules: the modules of the browser application in a few files (``static/build.mjs``).

A page that asks for two hundred modules takes half as long again as one that asks for these. They
are sent only while they are of the modules that lie beside them; who changes a module and has not
built since, gets the modules themselves. A wheel holds both.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

FOLDER = "built"
APART = ("node_modules", FOLDER, f"{FOLDER}.new")
"""Folders beside the modules that hold none of them."""
LOCK = "package-lock.json"
"""Which libraries are among what was joined."""
_ENTRY = re.compile(rb'(<script type="module"[^>]* src="/static/)((?:ahead|main)\.js")')
_PRELOAD = re.compile(rb'\s*<link rel="modulepreload"[^>]*>')


@dataclass(frozen=True)
class JoinedModules:
    """The joined files of a folder.

    Attributes:
        needed_first: Names of those that the two scripts of the page import before they run.
    """

    needed_first: tuple[str, ...]

    @staticmethod
    def read(folder: Path) -> JoinedModules | None:
        """The joined files of the modules as they are now; None where there are none."""
        with suppress(OSError, ValueError, KeyError, TypeError):
            about = json.loads((folder / FOLDER / "about.json").read_text("utf-8"))
            if about["of"] == digest(folder):
                return JoinedModules(tuple(about["needed_first"]))
        return None

    def put_into(self, html: bytes) -> bytes:
        """The page that asks for the joined files instead of the modules."""
        html = _ENTRY.sub(rb"\g<1>" + f"{FOLDER}/".encode() + rb"\g<2>", _PRELOAD.sub(b"", html))
        links = "".join(
            f'\n\t<link rel="modulepreload" href="/static/{FOLDER}/{name}">'
            for name in self.needed_first
        )
        return html.replace(b"\n</head>", f"{links}\n</head>".encode(), 1)


def digest(folder: Path) -> str:
    """Of the modules' names and contents, as ``static/build.mjs`` reckons it.

    Raises:
        OSError: One of them cannot be read.
    """
    found = hashlib.sha256()
    for name in (*sorted(_modules(folder)), LOCK):
        found.update(f"{name}\n".encode())
        found.update((folder / name).read_bytes())
    return found.hexdigest()


def _modules(folder: Path) -> Iterator[str]:
    for place, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if name not in APART]
        for name in names:
            if name.endswith(".js"):
                yield Path(place, name).relative_to(folder).as_posix()
