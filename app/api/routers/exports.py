"""Exports: made on request, fetched as a zip."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import Annotated

from fastapi import APIRouter, Path, Response
from starlette.responses import FileResponse

from app.api.deps import AppServices, IdempotencyKey
from app.api.problem import Responses, responses
from app.api.schemas.export import ExportDocument, ExportRequest
from app.errors import NotFoundError
from app.review.datasets import get_dataset
from app.review.export import ExportReport, export
from app.store.session import Store

router = APIRouter(prefix="/exports", tags=["exports"])

ExportId = Annotated[str, Path(max_length=64)]
LOCATION = {"Location": {"description": "Of the export.", "schema": {"type": "string"}}}
ZIP: Responses = {
    200: {
        "description": "The zip.",
        "content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}},
    }
}


@router.post(
    "",
    operation_id="makeExport",
    status_code=201,
    responses={
        **responses(404, 413, 415, 429, 507),
        201: {"headers": LOCATION, "description": "The export is ready."},
    },
)
def make_export(
    request: ExportRequest, services: AppServices, key: IdempotencyKey, response: Response
) -> ExportDocument:
    """Write accepted groups, or all of them, to a zip; 400 when there is nothing to write."""
    # By id: a dataset may be asked for by its name, and the file's name is ours.
    found = get_dataset(services.store, request.dataset)
    entry = services.exports.make(
        request.model_dump(),
        key,
        lambda path: _write(services.store, found.name, request, path),
    )
    response.headers["Location"] = f"/api/v1/exports/{entry.id}"
    return ExportDocument.of(entry)


@router.get("/{export}", operation_id="getExport", responses=responses(404))
def get_export(export: ExportId, services: AppServices) -> ExportDocument:
    """What was asked for, and what came of it."""
    return ExportDocument.of(services.exports.get(export))


@router.get(
    "/{export}/content",
    operation_id="getExportContent",
    response_class=FileResponse,
    responses={**responses(404), **ZIP},
)
def get_content(export: ExportId, services: AppServices) -> FileResponse:
    """The zip itself."""
    entry = services.exports.get(export)
    path = services.exports.content(entry.id)
    if not path.is_file():
        raise NotFoundError("the file of this export is gone", hint="Make the export again.")
    return FileResponse(
        path,
        media_type="application/zip",
        filename=f"touchline-{entry.request['format']}-{entry.id[:8]}.zip",
        headers={"Cache-Control": "private, no-cache"},
    )


def _write(store: Store, dataset: str, request: ExportRequest, path: FilePath) -> ExportReport:
    return export(
        store,
        dataset,
        request.format,
        path,
        everything=request.all,
        boxes=request.boxes,
        images=request.images,
    )
