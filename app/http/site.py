"""Static files of the browser application, joined modules first."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path

from app.canonical import digest_of
from app.config import own_folder
from app.http.headers import content_security_policy

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
    for name in (*sorted(_module_paths(folder)), LOCK):
        found.update(f"{name}\n".encode())
        found.update((folder / name).read_bytes())
    return found.hexdigest()


def _module_paths(folder: Path) -> Iterator[str]:
    for place, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if name not in APART]
        for name in names:
            if name.endswith(".js"):
                yield Path(place, name).relative_to(folder).as_posix()


STATIC = own_folder("static")
_INLINE_SCRIPT = re.compile(rb"<script\b(?P<attributes>[^>]*)>(?P<text>.*?)</script>", re.S | re.I)
_SHEET = re.compile(rb'\s*<link rel="stylesheet" href="/static/(?P<path>css/[^"]+)">')
_ALL_SHEETS = b'\n\t<link rel="stylesheet" href="/static/all.css">'
_MODULE = re.compile(rb'(?:href|src)="/static/([^"]+\.m?js)"')


def script_hashes(html: bytes) -> tuple[str, ...]:
    """CSP sources of the import maps in a page; no other inline script is admitted."""
    return tuple(
        "sha256-" + base64.b64encode(hashlib.sha256(found["text"]).digest()).decode()
        for found in _INLINE_SCRIPT.finditer(html)
        if b"importmap" in found["attributes"] and b"src=" not in found["attributes"]
    )


@dataclass(frozen=True)
class IndexPage:
    """One reading of index.html."""

    html: bytes
    etag: str
    policy: str
    styles: bytes
    """All style sheets of the page, in its order."""
    modules: tuple[str, ...]
    """What the page asks for beside them: paths below the folder of the application."""

    def at(self, moment: str, banner: str = "") -> IndexPage:
        """The page that says how things stood when it was asked for, and which notice is shown."""
        attributes = f'data-moment="{moment}" ' + (
            f'data-banner="{escape(banner)}" ' if banner else ""
        )
        html = self.html.replace(b"<html ", f"<html {attributes}".encode(), 1)
        version = f"{moment}-{digest_of(banner.encode())[:8]}" if banner else moment
        return replace(self, html=html, etag=f'{self.etag[:-1]}-{version}"')

    @staticmethod
    def make(folder: Path, version: str, *, team: bool = False) -> IndexPage:
        """The page of a folder, with the policy that admits its import map.

        Its modules, joined where they were, are asked for below an address that names their
        version, so that browsers keep them for good and a start costs no question per module. Its
        style sheets come as one, in the place of the last. On the server of a ``team`` it says so,
        and then asks who is there before it shows anything.

        Raises:
            OSError: The page or one of its sheets cannot be read.
        """
        html = (folder / "index.html").read_bytes()
        sheets = list(_SHEET.finditer(html))
        styles = b"".join((folder / sheet["path"].decode()).read_bytes() for sheet in sheets)
        if sheets:
            last = sheets[-1].end()
            html = _SHEET.sub(b"", html[:last]) + _ALL_SHEETS + html[last:]
        if (joined := JoinedModules.read(folder)) is not None:
            html = joined.put_into(html)
        modules = tuple(found.decode() for found in _MODULE.findall(html))
        html = html.replace(b'"/static/', f'"/assets/{version}/'.encode())
        if team:
            html = html.replace(b"<html ", b"<html data-team ", 1)
        etag = f'"{digest_of(html)}"'
        return IndexPage(html, etag, content_security_policy(script_hashes(html)), styles, modules)


class Site:
    """The folder of the browser application; index.html is read again when it has changed."""

    def __init__(self, folder: Path = STATIC, *, team: bool = False):
        self.folder, self.team = folder, team
        self._version: str | None = None
        self._page: IndexPage | None = None
        self.index()

    def index(self) -> IndexPage | None:
        """The page as it is on disk now; None where the application is not installed."""
        try:
            version = self._folder_version()
            if version != self._version:
                self._page = IndexPage.make(self.folder, version, team=self.team)
                self._version = version
        except OSError:
            self._version = self._page = None
        return self._page

    @property
    def version(self) -> str | None:
        """The version of the page that was asked for last."""
        return self._version

    def _folder_version(self) -> str:
        """Digest of the times and sizes of our own files and of the libraries' lock file."""
        digest = hashlib.sha256()
        for folder, folders, names in os.walk(self.folder):
            folders[:] = sorted(name for name in folders if name != "node_modules")
            for name in sorted(names):
                status = Path(folder, name).stat()
                digest.update(f"{folder}/{name} {status.st_mtime_ns} {status.st_size}\n".encode())
        return digest.hexdigest()[:16]

    def policy(self) -> str:
        """The Content-Security-Policy of every response."""
        return self._page.policy if self._page else content_security_policy()
