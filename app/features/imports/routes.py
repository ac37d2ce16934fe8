"""Imports, their folders, and uploads."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from contextlib import suppress
from functools import partial
from typing import Annotated, Any, TypeVar

from anyio import CancelScope, CapacityLimiter, to_thread
from anyio.lowlevel import RunVar
from fastapi import APIRouter, Path, Query, Request, Response
from starlette.requests import ClientDisconnect

from app.errors import InputError, OverloadedError, ReviewError
from app.features.imports.jobs import request_import
from app.features.imports.schemas import FolderDocument, ImportBody, UploadDocument, UploadList
from app.features.imports.upload_queries import Upload, UploadWriter
from app.features.imports.upload_quota import count_used_bytes, find_person_quota
from app.features.imports.uploads import (
    FolderListing,
    PartWriter,
    begin_part,
    begin_upload,
    begin_upload_in_parts,
    delete_own_upload,
    find_upload,
    finish_upload,
    list_folder,
    list_own_uploads,
)
from app.features.jobs.queries import Job
from app.features.jobs.schemas import describe_job_response_for_openapi, make_job_response
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, DryRun, Sees, Services
from app.http.documents import make_empty_response, respond_with
from app.http.permissions import Action, OwnedKind, RoleScope, may
from app.http.problem import responses
from app.http.request_limits import TRANSFER, limit
from app.http.requests import BodyError
from app.http.route import Route
from app.json_text import MAX_ID

imports_router = APIRouter(prefix="/imports", tags=["imports"], route_class=Route)

FolderPath = Annotated[
    str, Query(max_length=4000, description="`path` of an item; empty for the allowed folders.")
]


@imports_router.get("/folders", response_model=FolderDocument, responses=responses(404))
@may(Action.LEAD, where=RoleScope.EVERYWHERE)
@paged()
def list_import_folders(services: AppServices, path: FolderPath = "") -> FolderListing:
    """What may be imported from: the operator names folders in TOUCHLINE_IMPORT_FOLDERS."""
    return list_folder(services.settings, path)


@imports_router.post("", **describe_job_response_for_openapi())
@may(
    Action.LEAD,
    body={
        "dataset": OwnedKind.NEW_DATASET,
        "source/upload": OwnedKind.UPLOAD,
        "options/lines/upload": OwnedKind.UPLOAD,
        "options/frames/upload": OwnedKind.UPLOAD,
        "source/folder": OwnedKind.FOLDER,
        "options/lines/folder": OwnedKind.FOLDER,
        "options/frames/folder": OwnedKind.FOLDER,
        # Wherever a list of frames itself is, it names files of the operator's stores.
        "options/frames": OwnedKind.FOLDER,
    },
)
@respond_with(make_job_response)
def start_import(
    request: ImportBody, services: AppServices, actor: Actor, dry_run: DryRun = False
) -> Job:
    """Read files into a dataset, which is made when there is none of that name.

    The job's result is the report: read, imported, new, changed, unchanged, findings, and what
    was skipped with file, record and reason. A dry run reports the same and keeps nothing.
    """
    return request_import(
        services.jobs,
        services.store,
        services.settings,
        request.to_import_request(dry_run=dry_run),
        actor=actor,
    )


uploads_router = APIRouter(prefix="/uploads", tags=["imports"], route_class=Route)
T = TypeVar("T")
Writer = TypeVar("Writer", UploadWriter, PartWriter)

CHUNK = 1024 * 1024
"""Bytes that are gathered before they are written."""
PART_CHUNK = 4 * CHUNK
"""The same of a part, of which each writing is put on the disk: so much is sent again after a stop."""
DISK_THREADS = 1
"""For the files of all uploads: each takes turns with the event loop at each call of the disk. Beside a
flood of uploads an editor's slowest answers took 3.0 to 3.8 times as long as alone with two, and take
2.4 to 2.8 times as long with one."""
_THREADS: RunVar[CapacityLimiter] = RunVar("threads of uploads")
DISCARD_SECONDS = 5.0
"""So long the rest of a refused file is read before the answer."""
LOOK_SECONDS = 0.25
"""Between two looks whether the server stops."""
UploadId = Annotated[str, Path(max_length=64)]
FileName = Annotated[
    str, Query(min_length=1, max_length=255, description="Name of the file; its ending matters.")
]
Size = Annotated[
    int | None,
    Query(
        ge=1,
        le=MAX_ID,
        description="Bytes of a file that is sent in parts, by PATCH; the body is then empty.",
    ),
]
Mark = Annotated[
    str,
    Query(
        max_length=200,
        description="Tells a file that is sent in parts from others of its name and size: when it was "
        "changed, or its digest.",
    ),
]
PartOffset = Annotated[
    int, Query(ge=0, le=MAX_ID, description="Place in the file of the first byte of the body.")
]
BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "description": "The file.",
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}


@uploads_router.post(
    "",
    status_code=201,
    openapi_extra=BODY,
    responses={
        **responses(507),
        201: {
            "description": "The file is on disk.",
            "headers": {"Location": {"description": "Of it.", "schema": {"type": "string"}}},
        },
    },
)
@may(Action.LEAD, where=RoleScope.SOMEWHERE)
@limit(TRANSFER)
async def upload_file(
    request: Request,
    services: AppServices,
    actor: Actor,
    name: FileName,
    response: Response,
    size: Size = None,
    mark: Mark = "",
) -> UploadDocument:
    """Take a file, to import it or its predictions; the same file again is the same upload.

    With `size` and `mark` it comes in parts, and the answer's `bytes` says how many are here already.
    """
    settings = services.settings
    if size is None:
        begin = partial(begin_upload, settings, name, _content_length(request), actor)
        upload = await _receive_upload(request, services, begin, finish_upload)
    else:
        if not mark:
            raise InputError(
                f"{name} is uploaded in parts and needs `mark`, a value that changes when the file"
                " changes",
                hint="Send the modification time or digest of the file as mark.",
                pointer="/mark",
            )
        upload = await _run_in_disk_thread(
            partial(begin_upload_in_parts, settings, name, size, mark, by=actor)
        )
    response.headers["Location"] = f"/api/v1/uploads/{upload.id}"
    return UploadDocument.model_validate(upload)


@uploads_router.patch("/{upload}", openapi_extra=BODY, responses=responses(409, 507))
@may(Action.LEAD, upload=OwnedKind.UPLOAD)
@limit(TRANSFER)
async def send_part(
    upload: UploadId, request: Request, services: AppServices, offset: PartOffset = 0
) -> UploadDocument:
    """Add bytes to a file that is sent in parts; `bytes` of the answer are on the disk.

    What is here already may be sent again. A part that was cut off stays as far as it came: ask how far
    that is. When `bytes` is `size`, the file is whole.
    """
    begin = partial(begin_part, services.settings, upload, offset, _content_length(request))
    found = await _receive_upload(request, services, begin, PartWriter.finish, PART_CHUNK)
    return UploadDocument.model_validate(found)


async def _receive_upload(
    request: Request,
    services: Services,
    begin: Callable[[], Writer],
    finish: Callable[[Writer], Upload],
    at_once: int = CHUNK,
) -> Upload:
    """Write what comes, off the event loop; of what does not come whole, what its writer leaves there."""
    try:
        return await _write_upload(request, services, begin, finish, at_once)
    except ReviewError:
        if not services.stopping.is_set():
            await _discard_rest(request)
        raise


async def _discard_rest(request: Request) -> None:
    """Read what a client still sends: one that sends reads no answer, and finds the connection reset."""
    # RuntimeError: there is no rest.
    with suppress(TimeoutError, ClientDisconnect, BodyError, RuntimeError):
        async with asyncio.timeout(DISCARD_SECONDS):
            async for _ in request.stream():
                pass


async def _write_upload(
    request: Request,
    services: Services,
    begin: Callable[[], Writer],
    finish: Callable[[Writer], Upload],
    at_once: int,
) -> Upload:
    writer = await _run_in_disk_thread(begin)
    writing = asyncio.ensure_future(_write_body(request, writer, at_once))
    try:
        while not writing.done():
            await asyncio.wait({writing}, timeout=LOOK_SECONDS)
            if services.stopping.is_set():
                raise OverloadedError(
                    "the server is shutting down", hint="Send the file again in a moment."
                )
        writing.result()
        return await _run_in_disk_thread(finish, writer)
    except BaseException as error:
        with CancelScope(shield=True):
            writing.cancel()
            await asyncio.wait({writing})
            await _run_in_disk_thread(writer.abort)
        if isinstance(error, ClientDisconnect):
            raise InputError("the upload was cut off") from None
        raise


def _content_length(request: Request) -> int:
    """How many bytes a request says that it has; 0: it says nothing that can be read."""
    declared = request.headers.get("content-length", "")
    known = declared.isascii() and declared.isdigit() and len(declared) < 19
    return int(declared) if known else 0


async def _write_body(request: Request, writer: UploadWriter | PartWriter, at_once: int) -> None:
    waiting = bytearray()

    async def flush_part() -> None:
        if waiting:
            part = bytes(waiting)
            # Before the wait: what a thread writes is not sent a second time when the request ends.
            waiting.clear()
            await _finish_despite_cancel(_run_in_disk_thread(writer.write, part))

    try:
        async for chunk in request.stream():
            waiting += chunk
            if len(waiting) >= at_once:
                await flush_part()
    except (ClientDisconnect, asyncio.CancelledError):
        # Of a part that is cut off, what has come is kept.
        await flush_part()
        raise
    await flush_part()


async def _finish_despite_cancel(work: Coroutine[Any, Any, T]) -> T:
    """What some work comes to; cancelled, it is waited for all the same, since its thread goes on."""
    task = asyncio.ensure_future(work)
    try:
        return await asyncio.shield(task)
    except asyncio.CancelledError:
        await asyncio.wait({task})
        raise


async def _run_in_disk_thread(work: Callable[..., T], *arguments: Any) -> T:
    """Work on files, in one of ``DISK_THREADS``."""
    try:
        threads = _THREADS.get()
    except LookupError:
        threads = CapacityLimiter(DISK_THREADS)
        _THREADS.set(threads)
    return await to_thread.run_sync(work, *arguments, limiter=threads)


@uploads_router.get("")
@may(Action.LEAD, where=RoleScope.SOMEWHERE)
@paged()
def list_uploads(services: AppServices, visibility: Sees, actor: Actor) -> UploadList:
    """Every file of one's own that is still here; an admin is shown everybody's.

    `used_bytes` and `quota_bytes` are of whoever asks.
    """
    settings = services.settings
    return UploadList(
        items=list_own_uploads(settings, visibility),
        max_bytes=settings.max_upload_bytes,
        days=settings.upload_days,
        used_bytes=count_used_bytes(settings, actor),
        quota_bytes=find_person_quota(settings),
    )


@uploads_router.get("/{upload}")
@may(Action.LEAD, upload=OwnedKind.UPLOAD)
def get_upload(upload: UploadId, services: AppServices) -> UploadDocument:
    """One uploaded file, without its content."""
    return UploadDocument.model_validate(find_upload(services.settings, upload))


@uploads_router.delete(
    "/{upload}",
    status_code=204,
    response_class=Response,
    responses={204: {"description": "It is gone."}},
)
@may(Action.LEAD, upload=OwnedKind.UPLOAD)
@respond_with(make_empty_response)
def delete_upload(upload: UploadId, services: AppServices, visibility: Sees) -> None:
    """Delete a file; 400 while a dataset reads its frames from it.

    Where others have sent the same file, it stays with them; an admin deletes it for all.
    """
    delete_own_upload(services.store, upload, partial(visibility.sees, None))
