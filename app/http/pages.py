"""Pages of the browser application, with the modules that they preload."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

from fastapi import APIRouter, FastAPI, Request
from starlette.convertors import StringConvertor, register_url_convertor
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import Receive, Scope, Send

from app.errors import StorageError
from app.http import request_limits
from app.http.permissions import open_to_all
from app.http.request_limits import limit
from app.http.route import Route
from app.http.site import IndexPage, Site

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


class _Elsewhere(StringConvertor):
    """Paths outside the REST interface and the static files that are no page of the application."""

    NAME = "elsewhere"
    regex = r"(?!(?:api|static|assets)(?:/|$)).*"


ELSEWHERE = f"/{{path:{_Elsewhere.NAME}}}"
"""The route of whatever is nowhere else."""
register_url_convertor(_Elsewhere.NAME, _Elsewhere())


def install_pages(
    app: FastAPI,
    site: Site,
    moment: Callable[[], str] | None = None,
    banner: Callable[[], str] = str,
) -> None:
    """Serve the pages and the modules of the browser application.

    ``banner`` is the notice of maintenance as JSON, for pages that are told the moment.
    ``moment`` says how things stand, so that a page hears of all that happens after it was asked
    for; None: the page asks who is there before it reads anything, and is told with the answer.
    """
    router = APIRouter(include_in_schema=False, route_class=Route)

    def found() -> IndexPage:
        index = site.index()
        if index is None:
            raise HTTPException(status_code=404)
        return index

    @open_to_all
    @limit(request_limits.PAGES)
    def page(request: Request) -> Response:
        index = found()
        if moment is not None:
            # A page without it asks once more for what it has read when its stream begins.
            with suppress(StorageError):
                index = index.at(moment(), banner())
        headers = {"ETag": index.etag, "Cache-Control": REVALIDATED}
        if index.etag in request.headers.get("if-none-match", ""):
            return Response(status_code=304, headers=headers)
        return Response(index.html, media_type="text/html", headers=headers)

    @open_to_all
    @limit(None)
    def styles(version: str) -> Response:
        content = found().styles
        headers = {"Cache-Control": FOR_GOOD if version == site.version else REVALIDATED}
        return Response(content, media_type="text/css", headers=headers)

    @open_to_all
    @limit(request_limits.PAGES)
    def elsewhere(request: Request) -> Response:
        """People who mistyped an address are told so by the page, programs by a problem."""
        if "text/html" not in request.headers.get("accept", ""):
            raise HTTPException(status_code=404)
        return Response(found().html, status_code=404, media_type="text/html")

    for path in PAGES:
        router.add_api_route(path, page, methods=["GET", "HEAD"])
    router.add_api_route(ELSEWHERE, elsewhere, methods=["GET", "HEAD"])
    router.add_api_route("/assets/{version}/all.css", styles, methods=["GET", "HEAD"])
    app.include_router(router)
    _install_modules(app, site)


def _install_modules(app: FastAPI, site: Site) -> None:
    kept, fresh = Modules(site.folder, FOR_GOOD), Modules(site.folder, REVALIDATED)

    async def versioned(scope: Scope, receive: Receive, send: Send) -> None:
        """A page of an earlier version goes on, but nobody keeps our files under its address."""
        present = scope["path_params"]["version"] == site.version
        await (kept if present else fresh)(scope, receive, send)

    app.mount("/assets/{version}", versioned, name="assets")
    app.mount("/static", fresh, name="static")
    if index := site.index():
        kept.warm(index.modules)
