"""Modules: the files of the browser application, below /static and below /assets/{version}."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

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
