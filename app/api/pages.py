"""Pages: the addresses that the browser application answers to, and what each is given."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from fastapi import APIRouter, FastAPI, Request, Response
from starlette.convertors import StringConvertor, register_url_convertor
from starlette.exceptions import HTTPException
from starlette.types import Receive, Scope, Send

from app.api.modules import FOR_GOOD, REVALIDATED, Modules
from app.api.site import IndexPage, Site
from app.errors import StorageError

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
    "/exports",
    "/findings",
    "/help",
    "/help/{tab}",
    "/import",
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
    router = APIRouter(include_in_schema=False)

    def found() -> IndexPage:
        index = site.index()
        if index is None:
            raise HTTPException(status_code=404)
        return index

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

    def styles(version: str) -> Response:
        content = found().styles
        headers = {"Cache-Control": FOR_GOOD if version == site.version else REVALIDATED}
        return Response(content, media_type="text/css", headers=headers)

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
