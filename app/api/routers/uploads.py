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

from app.api.deps import Actor, AppServices, Sees, Services
from app.api.problem import responses
from app.api.schemas.upload import UploadDocument, UploadList
from app.datasets.guess_format import guess_format
from app.errors import InputError, OverloadedError
from app.store.uploads import (
    Upload,
    UploadWriter,
    delete_upload,
    get_upload,
    list_uploads,
    require_size,
)

router = APIRouter(prefix="/uploads", tags=["imports"])
T = TypeVar("T")

CHUNK = 1024 * 1024
"""Bytes that are gathered before they are written."""
DISK_THREADS = 2
"""For the files of all uploads: with eight, which take turns with the event loop at each call of the
disk, readers beside a flood of uploads waited half as long again."""
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
    declared = request.headers.get("content-length", "")
    if declared.isascii() and declared.isdigit() and len(declared) < 19:
        require_size(services.settings, int(declared))
    upload = await _receive(request, services, name, actor)
    response.headers["Location"] = f"/api/v1/uploads/{upload.id}"
    return UploadDocument.model_validate(upload)


async def _receive(request: Request, services: Services, name: str, actor: str) -> Upload:
    """Write what comes, off the event loop; nothing stays of what does not come whole."""
    writer = await _on_disk(UploadWriter, services.settings, name)
    writing = asyncio.ensure_future(_write(request, writer))
    try:
        while not writing.done():
            await asyncio.wait({writing}, timeout=LOOK_SECONDS)
            if services.stopping.is_set():
                raise OverloadedError("the server stops", hint="Send the file again in a while.")
        writing.result()
        return await _on_disk(partial(writer.finish, guess_format, by=actor))
    except BaseException as error:
        with CancelScope(shield=True):
            writing.cancel()
            await asyncio.wait({writing})
            await _on_disk(writer.abort)
        if isinstance(error, ClientDisconnect):
            raise InputError("the upload was cut off") from None
        raise


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


@router.get("", operation_id="listUploads")
def get_uploads(services: AppServices, sight: Sees) -> UploadList:
    """Every file of one's own that is still here; an admin is shown everybody's."""
    settings = services.settings
    mine = [
        item
        for item in list_uploads(settings)
        if sight.sees(None) or any(sight.sees(None, name) for name in item.by)
    ]
    return UploadList(
        items=mine,
        max_bytes=settings.max_upload_bytes,
        days=settings.upload_days,
    )


@router.get("/{upload}", operation_id="getUpload", responses=responses(404))
def get_one(upload: UploadId, services: AppServices) -> UploadDocument:
    """One uploaded file, without its content."""
    return UploadDocument.model_validate(get_upload(services.settings, upload))


@router.delete("/{upload}", operation_id="deleteUpload", status_code=204, responses=responses(404))
def delete_one(upload: UploadId, services: AppServices, sight: Sees) -> None:
    """Delete a file; 400 while a dataset reads its frames from it.

    Where others have sent the same file, it stays with them; an admin deletes it for all.
    """
    delete_upload(services.settings, upload, partial(sight.sees, None))
