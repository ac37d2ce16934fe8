"""Uploads: sent as plain bytes, listed, deleted."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, TypeVar

from anyio import CancelScope, CapacityLimiter, to_thread
from anyio.lowlevel import RunVar
from fastapi import APIRouter, Path, Query, Request, Response
from starlette.requests import ClientDisconnect

from app.api.deps import Actor, AppServices, Sees
from app.api.paging import paged
from app.api.problem import responses
from app.api.respond import no_content, responds
from app.api.schemas.upload import UploadDocument, UploadList
from app.api.services import Services
from app.errors import InputError, OverloadedError
from app.review.importing.receiving import (
    Upload,
    UploadWriter,
    begin_upload,
    delete_sent,
    find_upload,
    finish_upload,
    own_uploads,
    quota_of,
    used_bytes,
)

router = APIRouter(prefix="/uploads", tags=["imports"])
T = TypeVar("T")

CHUNK = 1024 * 1024
"""Bytes that are gathered before they are written."""
DISK_THREADS = 1
"""For the files of all uploads: each takes turns with the event loop at each call of the disk. Beside a
flood of uploads an editor's slowest answers took 3.0 to 3.8 times as long as alone with two, and take
2.4 to 2.8 times as long with one."""
_THREADS: RunVar[CapacityLimiter] = RunVar("threads of uploads")
LOOK_SECONDS = 0.25
"""Between two looks whether the server stops."""
UploadId = Annotated[str, Path(max_length=64)]
FileName = Annotated[
    str, Query(min_length=1, max_length=255, description="Name of the file; its ending matters.")
]
BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "description": "The file.",
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}


@router.post(
    "",
    operation_id="uploadFile",
    status_code=201,
    openapi_extra=BODY,
    responses={
        **responses(413, 415, 507),
        201: {
            "description": "The file is on disk.",
            "headers": {"Location": {"description": "Of it.", "schema": {"type": "string"}}},
        },
    },
)
async def upload_file(
    request: Request, services: AppServices, actor: Actor, name: FileName, response: Response
) -> UploadDocument:
    """Take a file, to import it or its predictions; the same file again is the same upload."""
    upload = await _receive(request, services, name, actor)
    response.headers["Location"] = f"/api/v1/uploads/{upload.id}"
    return UploadDocument.model_validate(upload)


async def _receive(request: Request, services: Services, name: str, actor: str) -> Upload:
    """Write what comes, off the event loop; nothing stays of what does not come whole."""
    writer = await _on_disk(begin_upload, services.settings, name, _declared(request), actor)
    writing = asyncio.ensure_future(_write(request, writer))
    try:
        while not writing.done():
            await asyncio.wait({writing}, timeout=LOOK_SECONDS)
            if services.stopping.is_set():
                raise OverloadedError(
                    "the server is shutting down", hint="Send the file again in a moment."
                )
        writing.result()
        return await _on_disk(finish_upload, writer)
    except BaseException as error:
        with CancelScope(shield=True):
            writing.cancel()
            await asyncio.wait({writing})
            await _on_disk(writer.abort)
        if isinstance(error, ClientDisconnect):
            raise InputError("the upload was cut off") from None
        raise


def _declared(request: Request) -> int:
    """How many bytes a request says that it has; 0: it says nothing that can be read."""
    declared = request.headers.get("content-length", "")
    known = declared.isascii() and declared.isdigit() and len(declared) < 19
    return int(declared) if known else 0


async def _write(request: Request, writer: UploadWriter) -> None:
    waiting = bytearray()
    async for chunk in request.stream():
        waiting += chunk
        if len(waiting) >= CHUNK:
            await _on_disk(writer.write, bytes(waiting))
            waiting.clear()
    await _on_disk(writer.write, bytes(waiting))


async def _on_disk(work: Callable[..., T], *arguments: Any) -> T:
    """Work on files, in one of ``DISK_THREADS``."""
    try:
        threads = _THREADS.get()
    except LookupError:
        threads = CapacityLimiter(DISK_THREADS)
        _THREADS.set(threads)
    return await to_thread.run_sync(work, *arguments, limiter=threads)


@router.get("", operation_id="listUploads", responses=responses())
@paged()
def get_uploads(services: AppServices, sight: Sees, actor: Actor) -> UploadList:
    """Every file of one's own that is still here; an admin is shown everybody's.

    `used_bytes` and `quota_bytes` are of whoever asks.
    """
    settings = services.settings
    return UploadList(
        items=own_uploads(settings, sight),
        max_bytes=settings.max_upload_bytes,
        days=settings.upload_days,
        used_bytes=used_bytes(settings, actor),
        quota_bytes=quota_of(settings),
    )


@router.get("/{upload}", operation_id="getUpload", responses=responses(404))
def get_one(upload: UploadId, services: AppServices) -> UploadDocument:
    """One uploaded file, without its content."""
    return UploadDocument.model_validate(find_upload(services.settings, upload))


@router.delete(
    "/{upload}",
    operation_id="deleteUpload",
    status_code=204,
    response_class=Response,
    responses={**responses(404), 204: {"description": "It is gone."}},
)
@responds(no_content)
def delete_one(upload: UploadId, services: AppServices, sight: Sees) -> None:
    """Delete a file; 400 while a dataset reads its frames from it.

    Where others have sent the same file, it stays with them; an admin deletes it for all.
    """
    delete_sent(services.store, upload, partial(sight.sees, None))
