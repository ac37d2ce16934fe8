"""Imports: carried out as jobs, from uploads or from folders that the operator allows."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query

from app.api.deps import Actor, AppServices, DryRun
from app.api.jobs import by_job, job_answer
from app.api.paging import paged
from app.api.problem import responses
from app.api.respond import responds
from app.api.schemas.imports import FolderDocument, ImportBody
from app.review.importing.folders import FolderListing, list_folder
from app.review.jobs.imports import request_import
from app.review.jobs.records import Job

router = APIRouter(prefix="/imports", tags=["imports"])

FolderPath = Annotated[
    str, Query(max_length=4000, description="`path` of an item; empty for the allowed folders.")
]


@router.get(
    "/folders",
    operation_id="listImportFolders",
    response_model=FolderDocument,
    responses=responses(404),
)
@paged()
def get_folders(services: AppServices, path: FolderPath = "") -> FolderListing:
    """What may be imported from: the operator names folders in TOUCHLINE_IMPORT_FOLDERS."""
    return list_folder(services.settings, path)


@router.post(
    "",
    operation_id="startImport",
    **by_job(404, 413, 415, 503),
)
@responds(job_answer)
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
        request.value(dry_run=dry_run),
        actor=actor,
    )
