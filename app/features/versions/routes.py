"""Versions: frozen, listed, compared, verified."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends, Path, Query, Response

from app.features.jobs.queries import Job
from app.features.jobs.schemas import ACCEPTED, JobDocument, by_job, job_answer
from app.features.versions import jobs as version_jobs
from app.features.versions import service as versions
from app.features.versions.diff import diff_versions, version_changelog
from app.features.versions.freeze import FreezePlan, plan_freeze
from app.features.versions.membership import version_manifest
from app.features.versions.schemas import (
    Changelog,
    VersionDiffDocument,
    VersionDocument,
    VersionList,
    VersionManifest,
    VersionRequest,
)
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, DryRun
from app.http.documents import document, responds
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.route import Route

router = APIRouter(tags=["versions"], route_class=Route)


def called(
    store: AppStore,
    version: Annotated[
        str, Path(min_length=1, max_length=100, description="Id, name or hash of the version.")
    ],
    dataset: Annotated[
        str | None,
        Query(
            max_length=200,
            description="Name or id of its dataset, where several have a version of that name.",
        ),
    ] = None,
) -> int:
    """Id of the version that the address names."""
    return versions.find_version_id(store, version, dataset)


VersionId = Annotated[int, Depends(called)]


@router.get("/datasets/{dataset}/versions", operation_id="listVersions", responses=responses(404))
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@paged()
def list_versions(dataset: DatasetPath, store: AppStore) -> VersionList:
    """The frozen versions of a dataset, newest first."""
    found = versions.list_versions(store, dataset)
    return VersionList(items=found)


@router.post(
    "/datasets/{dataset}/versions",
    operation_id="freezeVersion",
    status_code=202,
    response_model=JobDocument,
    responses={
        **responses(404, 409, 413, 415),
        **ACCEPTED,
        200: {"model": FreezePlan, "description": "After a dry run: what would be frozen."},
    },
)
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@responds(job_answer)
def freeze_version(
    dataset: DatasetPath,
    request: VersionRequest,
    services: AppServices,
    actor: Actor,
    dry_run: DryRun = False,
) -> Job | Response:
    """Freeze the dataset as it is into a version that never changes.

    409 when the name is taken or groups that might enter are not solved; 400 when none enters.
    The job's result names the version.
    """
    if dry_run or request.dry_run:
        plan = plan_freeze(services.store, dataset, request.value())
        return document(plan)
    return version_jobs.request_freeze(
        services.jobs, services.store, dataset, request.value(), actor=actor
    )


@router.get(
    "/versions/{version}",
    operation_id="getVersion",
    response_model=VersionDocument,
    responses=responses(404),
)
@may(Action.READ, version=OwnedKind.VERSION, dataset=OwnedKind.DATASET)
def get_version(version: VersionId, store: AppStore) -> versions.Version:
    """One version."""
    return versions.get_version(store, version)


@router.get(
    "/versions/{version}/manifest", operation_id="getVersionManifest", responses=responses(404)
)
@may(Action.READ, version=OwnedKind.VERSION, dataset=OwnedKind.DATASET)
def get_manifest(version: VersionId, store: AppStore) -> VersionManifest:
    """What a version says of itself: counts, settings, licence, overrides, changelog."""
    return VersionManifest.model_validate(version_manifest(store, version))


@router.get("/versions/{version}/changelog", operation_id="getChangelog", responses=responses(404))
@may(Action.READ, version=OwnedKind.VERSION, dataset=OwnedKind.DATASET)
def get_changelog(version: VersionId, store: AppStore) -> Changelog:
    """What changed since the version before, in sentences."""
    found = versions.get_version(store, version)
    return Changelog(id=found.id, version=found.name, lines=version_changelog(store, version))


@router.get("/versions/{version}/diff", operation_id="diffVersions", responses=responses(404))
@may(Action.READ, version=OwnedKind.VERSION, dataset=OwnedKind.DATASET)
def get_diff(
    version: VersionId,
    store: AppStore,
    against: Annotated[
        str,
        Query(min_length=1, max_length=100, description="Id, name or hash of the older version."),
    ],
    limit: Annotated[
        int, Query(ge=0, le=10_000, description="Largest number of items in each list.")
    ] = 500,
) -> VersionDiffDocument:
    """What changed in a version against another: groups added, dropped, moved, and why."""
    older = versions.find_version_id(
        store, against, str(versions.get_version(store, version).dataset_id)
    )
    return VersionDiffDocument.model_validate(diff_versions(store, older, version).values(limit))


@router.post(
    "/versions/{version}/verify",
    operation_id="verifyVersion",
    **by_job(404),
)
@may(Action.LEAD, version=OwnedKind.VERSION, dataset=OwnedKind.DATASET)
@responds(job_answer)
def verify_version(version: VersionId, services: AppServices, actor: Actor) -> Job:
    """Compute a version from scratch and compare it bit for bit; the job's result reports."""
    return version_jobs.request_verify(services.jobs, services.store, version, actor=actor)
