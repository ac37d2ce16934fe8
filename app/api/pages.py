"""The browser application: one index.html for every page, and the modules below /static."""

from __future__ import annotations

import base64
import hashlib
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from fastapi import APIRouter, FastAPI, Request, Response
from starlette.convertors import StringConvertor, register_url_convertor
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from app.api.security.headers import content_security_policy

STATIC = Path(__file__).resolve().parents[2] / "static"
PAGES = (
    "/",
    "/groups",
    "/review",
    "/review/{group}",
    "/review/{group}/calibration",
    "/datasets",
    "/datasets/{dataset}",
    "/datasets/{dataset}/yield",
    "/datasets/{dataset}/policy",
    "/datasets/{dataset}/statistics",
    "/datasets/{dataset}/versions",
    "/datasets/{dataset}/evaluation",
    "/exports",
    "/findings",
    "/help",
    "/help/{tab}",
    "/import",
    "/jobs",
)
"""Addresses that the browser's own router understands."""
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
FOR_GOOD = "public, max-age=31536000, immutable"
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

    @staticmethod
    def make(folder: Path, version: str) -> IndexPage:
        """The page of a folder, with the policy that admits its import map.

        Its modules are asked for below an address that names their version, so that browsers
        keep them for good and a start costs no question per module. Its style sheets come as
        one, in the place of the last.

        Raises:
            OSError: The page or one of its sheets cannot be read.
        """
        html = (folder / "index.html").read_bytes()
        sheets = list(_SHEET.finditer(html))
        styles = b"".join((folder / sheet["path"].decode()).read_bytes() for sheet in sheets)
        if sheets:
            last = sheets[-1].end()
            html = _SHEET.sub(b"", html[:last]) + _ALL_SHEETS + html[last:]
        modules = tuple(found.decode() for found in _MODULE.findall(html))
        html = html.replace(b'"/static/', f'"/assets/{version}/'.encode())
        etag = f'"{hashlib.sha256(html).hexdigest()[:32]}"'
        return IndexPage(html, etag, content_security_policy(script_hashes(html)), styles, modules)


class Site:
    """The folder of the browser application; index.html is read again when it has changed."""

    def __init__(self, folder: Path = STATIC):
        self.folder = folder
        self._version: str | None = None
        self._page: IndexPage | None = None
        self.index()

    def index(self) -> IndexPage | None:
        """The page as it is on disk now; None where the application is not installed."""
        try:
            version = self._folder_version()
            if version != self._version:
                self._page = IndexPage.make(self.folder, version)
                self._version = version
        except OSError:
            self._version = self._page = None
        return self._page

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


class Modules(StaticFiles):
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
        allowed = LIBRARY_TYPES if "node_modules" in parts else MEDIA_TYPES.keys()
        hidden = any(part.startswith(".") for part in parts)
        if hidden or "\\" in path or Path(path).suffix.lower() not in allowed:
            raise HTTPException(status_code=404)
        names = {name for name, _ in scope["headers"]}
        plain = not names & {b"range", b"if-none-match", b"if-modified-since"}
        if plain and (known := self._known(path)) is not None:
            return known
        response = await super().get_response(path, scope)
        return self._remember(path, response) if plain else response

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
                self._remember(path, self.file_response(file, status, {"headers": []}))

    def _known(self, path: str) -> Response | None:
        """The answer given before, if its file has not changed."""
        file, changed, response = self._read.get(path, ("", 0, None))
        try:
            return response if response and Path(file).stat().st_mtime_ns == changed else None
        except OSError:
            return None

    def _remember(self, path: str, response: Response) -> Response:
        """The same answer with the file's bytes in memory."""
        if not isinstance(response, FileResponse):
            return response
        file = str(response.path)
        changed = Path(file).stat().st_mtime_ns
        kept = Response(Path(file).read_bytes(), headers=dict(response.headers))
        self._read[path] = (file, changed, kept)
        return kept


class _Elsewhere(StringConvertor):
    """Paths below none of the folders that programs ask; those that are no page of ours."""

    NAME = "elsewhere"
    regex = r"(?!(?:api|static|assets)(?:/|$)).*"


register_url_convertor(_Elsewhere.NAME, _Elsewhere())


def install_pages(app: FastAPI, site: Site) -> None:
    """Serve the pages and the modules of the browser application."""
    router = APIRouter(include_in_schema=False)

    def found() -> IndexPage:
        index = site.index()
        if index is None:
            raise HTTPException(status_code=404)
        return index

    def page(request: Request) -> Response:
        index = found()
        headers = {"ETag": index.etag, "Cache-Control": "no-cache"}
        if index.etag in request.headers.get("if-none-match", ""):
            return Response(status_code=304, headers=headers)
        return Response(index.html, media_type="text/html", headers=headers)

    def styles() -> Response:
        return Response(found().styles, media_type="text/css", headers={"Cache-Control": FOR_GOOD})

    def elsewhere(request: Request) -> Response:
        """People who mistyped an address are told so by the page, programs by a problem."""
        if "text/html" not in request.headers.get("accept", ""):
            raise HTTPException(status_code=404)
        return Response(found().html, status_code=404, media_type="text/html")

    for path in PAGES:
        router.add_api_route(path, page, methods=["GET", "HEAD"])
    router.add_api_route(f"/{{path:{_Elsewhere.NAME}}}", elsewhere, methods=["GET", "HEAD"])
    router.add_api_route("/assets/{version}/all.css", styles, methods=["GET", "HEAD"])
    app.include_router(router)
    _install_modules(app, site)


def _install_modules(app: FastAPI, site: Site) -> None:
    kept = Modules(site.folder, FOR_GOOD)
    app.mount("/assets/{version}", kept, name="assets")
    app.mount("/static", Modules(site.folder, "no-cache"), name="static")
    if index := site.index():
        kept.warm(index.modules)
