"""Pages and static files of the browser application, with the modules that they preload and joined modules."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path

from fastapi import APIRouter, FastAPI, Request
from starlette.convertors import StringConvertor, register_url_convertor
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import Receive, Scope, Send

from app.config import find_packaged_folder
from app.errors import StorageError
from app.http.headers import make_content_security_policy
from app.http.permissions import open_to_all
from app.http.request_limits import limit
from app.http.route import Route
from app.json_text import digest_content

FOLDER = "built"
APART = ("node_modules", FOLDER, f"{FOLDER}.new")
"""Folders beside the modules that hold none of them."""
LOCK = "package-lock.json"
"""Which libraries are among what was joined."""
_ENTRY = re.compile(rb'(<script type="module"[^>]* src="/static/)((?:ahead|main)\.js")')
_PRELOAD = re.compile(rb'\s*<link rel="modulepreload"[^>]*>')


STATIC = find_packaged_folder("static")
_INLINE_SCRIPT = re.compile(rb"<script\b(?P<attributes>[^>]*)>(?P<text>.*?)</script>", re.S | re.I)
_SHEET = re.compile(rb'\s*<link rel="stylesheet" href="/static/(?P<path>css/[^"]+)">')
_ALL_SHEETS = b'\n\t<link rel="stylesheet" href="/static/all.css">'
_MODULE = re.compile(rb'(?:href|src)="/static/([^"]+\.m?js)"')
MEDIA_TYPES = {
    ".css": "text/css; charset=utf-8",
    ".ico": "image/x-icon",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".map": "application/json",
    ".mjs": "text/javascript; charset=utf-8",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".wasm": "application/wasm",
    ".webp": "image/webp",
    ".woff2": "font/woff2",
}
"""What is served, and as what; the machine's own table of types has no say."""
LIBRARY_TYPES = frozenset({".css", ".js", ".json", ".map", ".mjs", ".wasm", ".woff2"})
"""Libraries bring pages and pictures of their own, which are not ours to serve."""
TOOLS = frozenset({".json", ".mjs"})
"""At the top of the folder these are of the tools that check and join the modules: no page asks for them."""
FOR_GOOD = "public, max-age=31536000, immutable"
REVALIDATED = "no-cache"
PAGES = (
    "/",
    "/groups",
    "/review",
    "/review/{group}",
    "/review/{group}/calibration",
    "/compare/{group}/{other}",
    "/adjudicate/{group}",
    "/review/{group}/history",
    "/datasets",
    "/datasets/{dataset}",
    "/datasets/{dataset}/yield",
    "/datasets/{dataset}/policy",
    "/datasets/{dataset}/statistics",
    "/datasets/{dataset}/versions",
    "/datasets/{dataset}/agreement",
    "/datasets/{dataset}/evaluation",
    "/datasets/{dataset}/tracks",
    "/tracks/{track}",
    "/exports",
    "/findings",
    "/help",
    "/help/{tab}",
    "/import",
    "/recordings",
    "/recordings/{recording}",
    "/recordings/{recording}/links/{link}",
    "/jobs",
    "/work",
    "/account",
    "/people",
    "/audit",
    "/join",
    "/login",
)
"""Addresses that the browser's own router understands."""


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
            if about["of"] == digest_modules(folder):
                return JoinedModules(tuple(about["needed_first"]))
        return None

    def insert_into_page(self, html: bytes) -> bytes:
        """The page that asks for the joined files instead of the modules."""
        html = _ENTRY.sub(rb"\g<1>" + f"{FOLDER}/".encode() + rb"\g<2>", _PRELOAD.sub(b"", html))
        links = "".join(
            f'\n\t<link rel="modulepreload" href="/static/{FOLDER}/{name}">'
            for name in self.needed_first
        )
        return html.replace(b"\n</head>", f"{links}\n</head>".encode(), 1)


def digest_modules(folder: Path) -> str:
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


def hash_import_maps(html: bytes) -> tuple[str, ...]:
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

    def with_moment_and_banner(self, moment: str, banner: str = "") -> IndexPage:
        """The page that says how things stood when it was asked for, and which notice is shown."""
        attributes = f'data-moment="{moment}" ' + (
            f'data-banner="{escape(banner)}" ' if banner else ""
        )
        html = self.html.replace(b"<html ", f"<html {attributes}".encode(), 1)
        version = f"{moment}-{digest_content(banner.encode())[:8]}" if banner else moment
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
            html = joined.insert_into_page(html)
        modules = tuple(found.decode() for found in _MODULE.findall(html))
        html = html.replace(b'"/static/', f'"/assets/{version}/'.encode())
        if team:
            html = html.replace(b"<html ", b"<html data-team ", 1)
        etag = f'"{digest_content(html)}"'
        return IndexPage(
            html, etag, make_content_security_policy(hash_import_maps(html)), styles, modules
        )


class BrowserSite:
    """The folder of the browser application; index.html is read again when it has changed."""

    def __init__(self, folder: Path = STATIC, *, team: bool = False):
        self.folder, self.team = folder, team
        self._version: str | None = None
        self._page: IndexPage | None = None
        self.get_index_page()

    def get_index_page(self) -> IndexPage | None:
        """The page as it is on disk now; None where the application is not installed."""
        try:
            version = self._digest_folder()
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

    def _digest_folder(self) -> str:
        """Digest of the times and sizes of our own files and of the libraries' lock file."""
        digest = hashlib.sha256()
        for folder, folders, names in os.walk(self.folder):
            folders[:] = sorted(name for name in folders if name != "node_modules")
            for name in sorted(names):
                status = Path(folder, name).stat()
                digest.update(f"{folder}/{name} {status.st_mtime_ns} {status.st_size}\n".encode())
        return digest.hexdigest()[:16]

    def get_security_policy(self) -> str:
        """The Content-Security-Policy of every response."""
        return self._page.policy if self._page else make_content_security_policy()


class ModuleFiles(StaticFiles):
    """Files of the application: by known types alone, nothing hidden.

    Below /static they are always revalidated; below an address that names their version they
    are kept for good. A first visit asks for all of them at once, so what was read once is answered
    from memory as long as the file is the same.
    """

    def __init__(self, folder: Path, caching: str):
        super().__init__(directory=folder, check_dir=False)
        self._caching = caching
        self._read: dict[str, tuple[str, int, Response]] = {}

    async def check_config(self) -> None:
        """A folder that is missing has no files; that is no reason to fail."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        if scope["method"] not in ("GET", "HEAD"):
            raise HTTPException(status_code=405, headers={"Allow": "GET, HEAD"})
        parts = Path(path).parts
        allowed = LIBRARY_TYPES if "node_modules" in parts else frozenset(MEDIA_TYPES)
        if len(parts) == 1:
            allowed -= TOOLS
        hidden = any(part.startswith(".") for part in parts)
        if hidden or "\\" in path or Path(path).suffix.lower() not in allowed:
            raise HTTPException(status_code=404)
        names = {name for name, _ in scope["headers"]}
        plain = not names & {b"range", b"if-none-match", b"if-modified-since"}
        if plain and (known := self._cached_response(path)) is not None:
            return known
        response = await super().get_response(path, scope)
        return self._cache_response(path, response) if plain else response

    def file_response(
        self,
        full_path: str | os.PathLike[str],
        stat_result: os.stat_result,
        scope: Scope,
        status_code: int = 200,
    ) -> Response:
        """The answer that has that file, as the type that its name says."""
        response = super().file_response(full_path, stat_result, scope, status_code)
        response.headers["Cache-Control"] = self._caching
        if isinstance(response, FileResponse):
            response.headers["Content-Type"] = MEDIA_TYPES[Path(full_path).suffix.lower()]
        return response

    def warm(self, paths: Iterable[str]) -> None:
        """Read files before anybody asks, so that a first visitor does not wait for the disk."""
        for path in paths:
            file, status = self.lookup_path(path)
            if status is not None:
                self._cache_response(path, self.file_response(file, status, {"headers": []}))

    def _cached_response(self, path: str) -> Response | None:
        """The answer given before, if its file has not changed."""
        file, changed, response = self._read.get(path, ("", 0, None))
        try:
            return response if response and Path(file).stat().st_mtime_ns == changed else None
        except OSError:
            return None

    def _cache_response(self, path: str, response: Response) -> Response:
        """The same answer with the file's bytes in memory."""
        if not isinstance(response, FileResponse):
            return response
        file = str(response.path)
        changed = Path(file).stat().st_mtime_ns
        kept = Response(Path(file).read_bytes(), headers=dict(response.headers))
        self._read[path] = (file, changed, kept)
        return kept


class _UnknownPagePathConvertor(StringConvertor):
    """Paths outside the REST interface and the static files that are no page of the application."""

    NAME = "elsewhere"
    regex = r"(?!(?:api|static|assets)(?:/|$)).*"


ELSEWHERE = f"/{{path:{_UnknownPagePathConvertor.NAME}}}"
"""The route of whatever is nowhere else."""
register_url_convertor(_UnknownPagePathConvertor.NAME, _UnknownPagePathConvertor())


def install_pages(
    app: FastAPI,
    site: BrowserSite,
    moment: Callable[[], str] | None = None,
    banner: Callable[[], str] = str,
) -> None:
    """Serve the pages and the modules of the browser application.

    ``banner`` is the notice of maintenance as JSON, for pages that are told the moment.
    ``moment`` says how things stand, so that a page hears of all that happens after it was asked
    for; None: the page asks who is there before it reads anything, and is told with the answer.
    """
    router = APIRouter(include_in_schema=False, route_class=Route)

    def require_index_page() -> IndexPage:
        index = site.get_index_page()
        if index is None:
            raise HTTPException(status_code=404)
        return index

    @open_to_all
    def serve_page(request: Request) -> Response:
        index = require_index_page()
        if moment is not None:
            # A page without it asks once more for what it has read when its stream begins.
            with suppress(StorageError):
                index = index.with_moment_and_banner(moment(), banner())
        headers = {"ETag": index.etag, "Cache-Control": REVALIDATED}
        if index.etag in request.headers.get("if-none-match", ""):
            return Response(status_code=304, headers=headers)
        return Response(index.html, media_type="text/html", headers=headers)

    @open_to_all
    @limit(None)
    def serve_styles(version: str) -> Response:
        content = require_index_page().styles
        headers = {"Cache-Control": FOR_GOOD if version == site.version else REVALIDATED}
        return Response(content, media_type="text/css", headers=headers)

    @open_to_all
    def serve_unknown_page(request: Request) -> Response:
        """People who mistyped an address are told so by the page, programs by a problem."""
        if "text/html" not in request.headers.get("accept", ""):
            raise HTTPException(status_code=404)
        return Response(require_index_page().html, status_code=404, media_type="text/html")

    for path in PAGES:
        router.add_api_route(path, serve_page, methods=["GET", "HEAD"])
    router.add_api_route(ELSEWHERE, serve_unknown_page, methods=["GET", "HEAD"])
    router.add_api_route("/assets/{version}/all.css", serve_styles, methods=["GET", "HEAD"])
    app.include_router(router)
    _install_modules(app, site)


def _install_modules(app: FastAPI, site: BrowserSite) -> None:
    kept, fresh = ModuleFiles(site.folder, FOR_GOOD), ModuleFiles(site.folder, REVALIDATED)

    async def serve_versioned_module(scope: Scope, receive: Receive, send: Send) -> None:
        """A page of an earlier version goes on, but nobody keeps our files under its address."""
        present = scope["path_params"]["version"] == site.version
        await (kept if present else fresh)(scope, receive, send)

    app.mount("/assets/{version}", serve_versioned_module, name="assets")
    app.mount("/static", fresh, name="static")
    if index := site.get_index_page():
        kept.warm(index.modules)
