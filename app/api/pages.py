"""The browser application: one index.html for every page, and the modules below /static."""

from __future__ import annotations

import base64
import hashlib
import os
import re
from dataclasses import dataclass
from pathlib import Path

from fastapi import APIRouter, FastAPI, Request, Response
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
_INLINE_SCRIPT = re.compile(rb"<script\b(?P<attributes>[^>]*)>(?P<text>.*?)</script>", re.S | re.I)


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

    @staticmethod
    def make(html: bytes, version: str) -> IndexPage:
        """The page of those bytes, with the policy that admits its import map.

        Its modules are asked for below an address that names their version, so that browsers
        keep them for good and a start costs no question per module.
        """
        html = html.replace(b'"/static/', f'"/assets/{version}/'.encode())
        etag = f'"{hashlib.sha256(html).hexdigest()[:32]}"'
        return IndexPage(html, etag, content_security_policy(script_hashes(html)))


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
                html = (self.folder / "index.html").read_bytes()
                self._page = IndexPage.make(html, version)
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
    are kept for good. A first visit asks for all of them at once, so those that were asked for are
    answered from memory as long as the file is the same.
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
        response.headers["Cache-Control"] = self._caching
        if isinstance(response, FileResponse):
            response.headers["Content-Type"] = MEDIA_TYPES[Path(path).suffix.lower()]
            if plain:
                return self._remember(path, response)
        return response

    def _known(self, path: str) -> Response | None:
        """The answer given before, if its file has not changed."""
        file, changed, response = self._read.get(path, ("", 0, None))
        try:
            return response if response and Path(file).stat().st_mtime_ns == changed else None
        except OSError:
            return None

    def _remember(self, path: str, response: FileResponse) -> Response:
        """The same answer with the file's bytes in memory."""
        file = str(response.path)
        changed = Path(file).stat().st_mtime_ns
        kept = Response(Path(file).read_bytes(), headers=dict(response.headers))
        self._read[path] = (file, changed, kept)
        return kept


def install_pages(app: FastAPI, site: Site) -> None:
    """Serve the pages and the modules of the browser application."""
    router = APIRouter(include_in_schema=False)

    def page(request: Request) -> Response:
        index = site.index()
        if index is None:
            raise HTTPException(status_code=404)
        headers = {"ETag": index.etag, "Cache-Control": "no-cache"}
        if index.etag in request.headers.get("if-none-match", ""):
            return Response(status_code=304, headers=headers)
        return Response(index.html, media_type="text/html", headers=headers)

    for path in PAGES:
        router.add_api_route(path, page, methods=["GET", "HEAD"])
    app.include_router(router)
    app.mount("/static", Modules(site.folder, "no-cache"), name="static")
    kept = Modules(site.folder, "public, max-age=31536000, immutable")
    app.mount("/assets/{version}", kept, name="assets")
