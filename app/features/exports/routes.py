"""Exports: written by a job, fetched as a zip."""

from __future__ import annotations

import asyncio
import re
import time
from collections.abc import Iterator
from datetime import datetime
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Path, Query, Request, Response
from pydantic import BaseModel, Field, StrictBool
from starlette.responses import FileResponse, RedirectResponse, StreamingResponse

from app.config import Settings
from app.errors import ConflictError, NotFoundError
from app.features.audit.service import record_audit_event
from app.features.datasets.service import dataset_id
from app.features.exports.jobs import KIND, ExportEntry, request_export
from app.features.exports.service import list_format_availability
from app.features.jobs.queries import DONE, Job
from app.features.jobs.routes import Cursor, DatasetFilter, Limit
from app.features.jobs.schemas import ACCEPTED, JobDocument, make_location_header
from app.features.versions.routes import VersionId
from app.formats.export_formats import list_options_of_format
from app.http.cursor import paged, parse_cursor
from app.http.deps import (
    Actor,
    AppServices,
    AppStore,
    DatasetPath,
    SeesWhole,
    Services,
    is_not_modified,
)
from app.http.documents import (
    Document,
    ListDocument,
    RequestBody,
    make_document_response,
    make_empty_response,
    respond_with,
)
from app.http.headers import make_content_disposition
from app.http.permissions import Action, OwnedKind, RoleScope, may
from app.http.problem import Responses, responses
from app.http.request_limits import TRANSFER, limit
from app.http.route import Route
from app.object_store.path import split_address, split_pinned_address
from app.object_store.store import ChangedObjectError, ObjectStore, StoredObject, open_store
from app.soccer.choices import BoxKind, ExportFormat, JobState, PicturesSent, TrainingViews

SIGNED_SECONDS = 60
"""How long a signed address is good."""
STORE_CHUNK = 4 * 1024**2
"""Bytes that are asked of the store at once."""
_RANGE = re.compile(r"bytes=(\d{0,18})-(\d{0,18})")
router = APIRouter(tags=["exports"], route_class=Route)
PATIENCE = 20.0
"""Seconds that a request for the zip waits for it to be written."""
ExportId = Annotated[str, Path(max_length=64)]
ZIP: Responses = {
    200: {
        "description": "The zip.",
        "content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}},
    }
}


class ExportRequest(RequestBody, examples=[{"dataset": "sample", "format": "soccernet-v3d"}]):
    """Which groups of which dataset, in which format."""

    dataset: Annotated[str, Field(min_length=1, max_length=200)]
    format: ExportFormat
    all: StrictBool = Field(default=False, description="Every group, not the accepted ones alone.")
    version: VersionId | None = Field(
        default=None,
        description="Id, name or hash of a frozen version: its groups as they were, always the "
        "same bytes.",
    )
    boxes: BoxKind = Field(
        default="optimized",
        description="Which ball box is written: coco, parquet, soccernet-v3d and yolo.",
    )
    images: PicturesSent = Field(
        default="none",
        description="Whether frames are copied into the zip; touchline holds none.",
    )
    views: TrainingViews = Field(
        default="valid",
        description="coco and yolo: whether views that annotate a ball and are in no valid pair "
        "take part.",
    )
    to: Annotated[str, Field(max_length=1000, pattern="^s3://")] | None = Field(
        default=None,
        description="Where in an object store the zip goes, `s3://NAME/folder/file.zip`, if the "
        "operator allows it; without it the zip stays on the server.",
    )


class FormatAvailabilityDocument(Document):
    """Whether a dataset can be exported in a format."""

    format: ExportFormat
    possible: bool = Field(description="Whether it holds what the dataset has.")
    reason: str | None = Field(description="Why it cannot; null: it can.")
    hint: str | None = Field(description="What to do instead, where there is anything.")
    options: list[str] = Field(
        description="Which of `boxes`, `images` and `views` it uses; a request with another is refused."
    )


class FormatList(ListDocument[FormatAvailabilityDocument]):
    """Every export format."""


class ExportJobDocument(JobDocument):
    """The job that writes an export; its `id` is that of the export, too."""

    content: str = Field(description="Address of the zip; a request before it is ready waits.")

    @staticmethod
    def of_export(job: JobDocument) -> ExportJobDocument:
        """The document of an export's job."""
        content = f"/api/v1/exports/{job.id}/content"
        return ExportJobDocument(**job.model_dump(), content=content)


class ExportDocument(BaseModel):
    """An export: what was asked for, how far it is, and, once it is ready, what came of it."""

    id: str
    state: Literal[JobState, "gone", "expired"] = Field(
        description=(
            "State of its job; `gone`: a person deleted the file; `expired`: the server deleted "
            "the file after some days."
        )
    )
    status: Literal["waiting", "running", "ready", "failed", "cancelled", "gone", "expired"] = (
        Field(
            description="The same in other words: `ready` is `done`. Read `state`.",
            json_schema_extra={"deprecated": True},
        )
    )
    request: ExportRequest
    created: datetime
    expires: datetime | None = Field(
        description="When the server deletes its file; null: never, or there is none."
    )
    content: str | None = Field(description="Address of the zip, once it is ready.")
    bytes: int | None
    counts: dict[str, int] | None = Field(
        description="What was written, by kind: groups, views, boxes and so on."
    )
    left_out: dict[str, int] | None = Field(
        description="Accepted groups that are not in it, by reason: stale, failing, unsolved."
    )
    missing_images: list[str] | None
    incomplete: str | None = Field(
        description="What the files still lack before they can be used, in words; null: nothing."
    )
    error: str | None = Field(description="Why it failed.")

    @staticmethod
    def of(entry: ExportEntry, days: int) -> ExportDocument:
        """The document of a finished export; files are kept for so many days (0: for good)."""
        return ExportDocument.model_validate(
            {
                **vars(entry),
                "state": "expired" if entry.expired else "done",
                "status": "expired" if entry.expired else "ready",
                "incomplete": entry.incomplete,
                "content": None if entry.expired else f"/api/v1/exports/{entry.id}/content",
                "expires": entry.find_expiry_time(days),
                "error": None,
            }
        )

    @staticmethod
    def of_job(job: Job, entry: ExportEntry | None, days: int) -> ExportDocument:
        """The document of an export by its job; ``entry`` is what it left behind, if anything."""
        if entry is not None:
            return ExportDocument.of(entry, days)
        nothing = dict.fromkeys(
            (
                "expires",
                "content",
                "bytes",
                "counts",
                "left_out",
                "missing_images",
                "incomplete",
            )
        )
        return ExportDocument.model_validate(
            {
                **nothing,
                "id": str(job.id),
                "state": "gone" if job.state == DONE else job.state,
                "status": "gone" if job.state == DONE else job.state,
                "request": job.request,
                "created": job.created,
                "error": job.problem and job.problem["detail"],
            }
        )


class ExportPage(ListDocument[ExportDocument]):
    """Exports, the newest first; ``next`` is the cursor of the next page."""


@router.get("/datasets/{dataset}/export-formats")
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@paged()
def list_export_formats(
    dataset: DatasetPath,
    store: AppStore,
    version: Annotated[
        str | None, Query(max_length=200, description="Of a frozen version: id, name or hash.")
    ] = None,
) -> FormatList:
    """In which formats a dataset, or a version of it, can be exported, and why not in the others."""
    found = dataset_id(store, dataset)
    answers = list_format_availability(store, found, version)
    return FormatList(
        items=[
            FormatAvailabilityDocument(
                **vars(one), possible=one.reason is None, options=list_options_of_format(one.format)
            )
            for one in answers
        ]
    )


def _export_job_response(job: Job) -> Response:
    started = ExportJobDocument.of_export(JobDocument.model_validate(job))
    return make_document_response(started, 202, make_location_header(job))


@router.post(
    "/exports",
    status_code=202,
    response_model=ExportJobDocument,
    responses={**responses(409, 507), **ACCEPTED},
)
@may(Action.EXPORT, body={"dataset": OwnedKind.DATASET}, whole=True)
@respond_with(_export_job_response)
def make_export(request: ExportRequest, services: AppServices, actor: Actor) -> Job:
    """Write accepted groups, or all of them, to a zip; 400 when there is nothing to write."""
    return request_export(
        services.jobs,
        services.store,
        services.exports,
        services.frames,
        request.model_dump(),
        actor=actor,
    )


@router.get("/exports")
@may(Action.READ, dataset=OwnedKind.DATASET, where=RoleScope.SOMEWHERE, whole=True)
def list_exports(
    services: AppServices,
    visibility: SeesWhole,
    dataset: DatasetFilter = None,
    limit: Limit = 50,
    cursor: Cursor = None,
) -> ExportPage:
    """Exports, the newest first, those under way and those that failed too."""
    found = None if dataset is None else dataset_id(services.store, dataset)
    jobs = services.jobs.find(
        dataset_id=found,
        kinds=[KIND],
        before=parse_cursor(cursor),
        limit=limit + 1,
        visibility=visibility,
    )
    more = str(jobs[limit - 1].id) if len(jobs) > limit else None
    days = services.settings.export_days
    items = [
        ExportDocument.of_job(job, _find_entry_of_job(services, job), days) for job in jobs[:limit]
    ]
    return ExportPage(items=items, next=more)


@router.get("/exports/{export}")
@may(Action.READ, export=OwnedKind.EXPORT)
def get_export(export: ExportId, services: AppServices) -> ExportDocument:
    """An export: its request, progress and result."""
    return _export_document(services, export)


@router.delete(
    "/exports/{export}",
    status_code=204,
    response_class=Response,
    responses={**responses(409), 204: {"description": "It is gone."}},
)
@may(Action.LEAD, export=OwnedKind.EXPORT)
@respond_with(make_empty_response)
def delete_export(export: ExportId, services: AppServices, actor: Actor) -> None:
    """Delete the file of an export, or one that failed altogether; 409 while it is being written."""
    document = _export_document(services, export)
    if document.state in ("waiting", "running"):
        raise _not_ready_error(document)
    if document.state == "gone":
        raise NotFoundError("there is no such export")
    if document.state in ("failed", "cancelled"):
        services.jobs.forget(int(export))
    services.exports.delete_export(document.id)
    record_audit_event(services.store, actor, "export deleted", None, export=export)


async def wait_for_export(export: ExportId, services: AppServices) -> str:
    """The id of an export, once that is no longer under way or patience is at its end."""
    end = time.monotonic() + PATIENCE
    number = int(export) if _may_be_job_id(export) else 0
    while services.jobs.is_open(number, KIND) and time.monotonic() < end:
        await asyncio.sleep(0.05)
    return export


@router.get(
    "/exports/{export}/content", response_class=FileResponse, responses={**responses(409), **ZIP}
)
@may(Action.READ, export=OwnedKind.EXPORT)
@limit(TRANSFER)
def get_export_content(
    export: Annotated[str, Depends(wait_for_export)], services: AppServices, request: Request
) -> Response:
    """The zip itself; waits a while for one that is still being written.

    409 when it is not ready by then, or its writing failed. One that lies in an object store comes
    through this server, or from an address of the store that is good for a minute.
    """
    document = _export_document(services, export)
    entry = services.exports.find_entry(document.id) if document.state == "done" else None
    if entry is not None and entry.stored is not None:
        return redirect_or_stream_stored_file(
            services.settings, entry.stored, _file_name(document), request
        )
    if document.state == "expired":
        days = services.settings.export_days
        raise NotFoundError(
            "the file of this export has expired",
            hint=f"Files of exports are kept for {days} days here. Make the export again."
            if days
            else "Make the export again.",
        )
    path = services.exports.get_zip_path(document.id)
    if document.state == "gone" or (document.state == "done" and not path.is_file()):
        raise NotFoundError(
            "the file of this export is no longer on the server", hint="Make the export again."
        )
    if document.state != "done":
        raise _not_ready_error(document)
    return FileResponse(
        path,
        media_type="application/zip",
        filename=_file_name(document),
        headers={"Cache-Control": "private, no-cache"},
    )


def _file_name(document: ExportDocument) -> str:
    return f"touchline-{document.request.format}-{document.id[:8]}.zip"


def _export_document(services: Services, export: str) -> ExportDocument:
    """The document of an export that is ready or under way.

    Raises:
        NotFoundError: There is none of that id.
    """
    days = services.settings.export_days
    if _may_be_job_id(export):
        job = services.jobs.get(int(export))
        if job.kind == KIND:
            return ExportDocument.of_job(job, _find_entry_of_job(services, job), days)
        raise NotFoundError("there is no such export")
    return ExportDocument.of(services.exports.get_entry(export), days)


def _find_entry_of_job(services: Services, job: Job) -> ExportEntry | None:
    """What a job left behind; None of another with its id, as there was before a restore."""
    if job.kind != KIND or job.state != DONE or job.result.get("export") != str(job.id):
        return None
    entry = services.exports.find_entry(str(job.id))
    same = entry is not None and entry.request["dataset"] == job.request["dataset"]
    return entry if same else None


def _may_be_job_id(export: str) -> bool:
    """Whether it may be the id of a job; those of exports that were made before there were jobs are none."""
    return export.isascii() and export.isdigit() and len(export) < 19


def _not_ready_error(document: ExportDocument) -> ConflictError:
    if document.state in ("waiting", "running"):
        return ConflictError(
            "the export is still being written",
            hint=f"GET /api/v1/jobs/{document.id} shows its progress.",
        )
    reason = f": {document.error}" if document.error else ""
    return ConflictError(f"the export was not written{reason}", hint="Make the export again.")


def redirect_or_stream_stored_file(
    settings: Settings, sealed: str, name: str, request: Request
) -> Response:
    """The answer to a request for a file that lies in a store.

    Args:
        settings: Which stores there are.
        sealed: Its address and what its content is called.
        name: What browsers shall call it.
        request: Its headers say which part is wanted.

    Raises:
        NotFoundError: It is gone, or another one now.
        StorageError: The store cannot be asked.
    """
    address, _, etag = split_pinned_address(sealed)
    store_name, key = split_address(address)
    store = open_store(settings, store_name)
    stored = store.head(key)
    if stored.etag.strip('"') != etag:
        raise ChangedObjectError(f"{address} has changed since the export was written there")
    if store.settings.delivery == "signed":
        found = store.make_signed_url(key, SIGNED_SECONDS)
        return RedirectResponse(found, 307, headers={"Cache-Control": "no-store"})
    headers = {
        "ETag": stored.etag,
        "Accept-Ranges": "bytes",
        "Cache-Control": "private, no-cache",
        "Content-Disposition": make_content_disposition(name),
    }
    if is_not_modified(request, stored.etag):
        return Response(status_code=304, headers=headers)
    return _partial_response(store, stored, headers, request)


def _partial_response(
    store: ObjectStore, stored: StoredObject, headers: dict[str, str], request: Request
) -> Response:
    range_header = request.headers.get("range", "")
    # A range of another content than the one that is there would be a part of nothing.
    if request.headers.get("if-range", stored.etag) != stored.etag:
        range_header = ""
    span = _parse_range(range_header, stored.size)
    if span is None:
        return Response(
            status_code=416, headers={**headers, "Content-Range": f"bytes */{stored.size}"}
        )
    start, end = span
    whole = (start, end) == (0, stored.size)
    headers["Content-Length"] = str(end - start)
    if not whole:
        headers["Content-Range"] = f"bytes {start}-{end - 1}/{stored.size}"
    return StreamingResponse(
        _read_chunks(store, stored, start, end),
        status_code=200 if whole else 206,
        media_type="application/zip",
        headers=headers,
    )


def _parse_range(range_header: str, size: int) -> tuple[int, int] | None:
    """First byte and the one after the last, of one range; None where it begins after the end."""
    found = _RANGE.fullmatch(range_header.strip())
    if found is None or found[1] == found[2] == "":
        return 0, size
    if not found[1]:
        return (max(size - int(found[2]), 0), size) if int(found[2]) else None
    start, end = int(found[1]), min(int(found[2] or size) + 1, size)
    return (start, end) if start < end else None


def _read_chunks(store: ObjectStore, stored: StoredObject, start: int, end: int) -> Iterator[bytes]:
    """The bytes, as fast as the client takes them; a thread waits for the store, not the loop."""
    for at in range(start, end, STORE_CHUNK):
        yield store.read(stored.key, at, min(at + STORE_CHUNK, end), stored.etag)
