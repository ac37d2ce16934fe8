"""Versions: frozen, listed, compared, verified; and how they travel."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, Path, Query, Response
from pydantic import (
    BaseModel,
    BeforeValidator,
    Field,
    StrictBool,
    StrictInt,
    model_validator,
)

from app.features.jobs.queries import Job
from app.features.jobs.schemas import (
    ACCEPTED,
    JobDocument,
    describe_job_response_for_openapi,
    make_job_response,
)
from app.features.policies.schemas import PolicyDocument
from app.features.versions import jobs as version_jobs
from app.features.versions import service as versions
from app.features.versions.diff import (
    BallMove,
    ChangedSetting,
    ChangedTrack,
    MembershipChange,
    diff_versions,
    make_version_changelog,
)
from app.features.versions.freeze import MAX_LICENCE, FreezePlan, FreezeRequest, plan_freeze
from app.features.versions.membership import make_version_manifest
from app.features.versions.queries import Verification
from app.features.versions.verify import VerifyDifference
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, DryRun
from app.http.documents import (
    Document,
    ListDocument,
    RequestBody,
    make_document_response,
    respond_with,
)
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.route import Route
from app.json_text import MAX_ID
from app.soccer.choices import SplitKind, VersionRule
from app.soccer.group import MAX_NOTE
from app.soccer.split import TEST_CAMERAS, Split

Point = Annotated[list[float], Field(min_length=3, max_length=3)]
SHOWN_DIFFERENCES = 40
"""Differences that a version's document names; all are counted."""
VersionId = (
    Annotated[int, Field(strict=True, ge=1, le=MAX_ID)]
    | Annotated[str, Field(min_length=1, max_length=100)]
)
"""A version by its id, its name or its hash."""
Camera = Annotated[str, Field(min_length=1, max_length=200)]


class SplitChoice(RequestBody):
    """How a version is split into train and test."""

    kind: SplitKind = Field(
        default="given", description="As the dataset says; drawn by match; by camera (ISSIA)."
    )
    seed: StrictInt = Field(default=0, ge=0, le=2**53, description="Seed of the draw by match.")
    test_share: Annotated[
        float,
        Field(
            gt=0, lt=1, description="Share of the matches that go to test, in the draw by match."
        ),
    ] = 0.2
    test_cameras: list[Camera] = Field(default=list(TEST_CAMERAS), min_length=1, max_length=100)

    def to_split(self) -> Split:
        """The split that this asks for."""
        return Split(self.kind, self.seed, self.test_share, tuple(self.test_cameras))


class VersionRequest(
    RequestBody, examples=[{"name": "v1", "note": "For the benchmark", "split": {"kind": "match"}}]
):
    """What to freeze, and as what."""

    name: Annotated[str, Field(min_length=1, max_length=100)] | None = Field(
        default=None, description="Unique in its dataset; null: the next free of v1, v2, ..."
    )
    note: Annotated[str, Field(max_length=MAX_NOTE)] = ""
    licence: Annotated[
        str, Field(max_length=MAX_LICENCE, description="Empty: the terms of the sources.")
    ] = ""
    split: SplitChoice = SplitChoice()
    groups: VersionRule = Field(
        default="accepted",
        description="Groups that people accepted, or all groups that pass the policy and are neither "
        "rejected nor deferred, without those whose ball cannot be used unless a person accepted them.",
    )
    dry_run: StrictBool = Field(default=False, description="Count, and freeze nothing.")

    def to_freeze_request(self) -> FreezeRequest:
        """The request as the review floor takes it."""
        return FreezeRequest(self.name, self.note, self.licence, self.split.to_split(), self.groups)


class VerificationDocument(Document):
    """What came of computing a version once more, the last time that somebody asked for it."""

    at: datetime
    actor: str
    solver_version: str = Field(description="Version of the solver that computed it again.")
    ok: bool = Field(description="Whether everything came out as it was frozen.")
    problem: str | None = Field(description="Why the verification failed, where it did.")
    sentence: str
    groups: int | None = Field(description="Groups of the version; null where it failed.")
    equal: int | None = Field(description="Groups that came out as they were frozen.")
    different: int | None = Field(description="Values that came out differently.")
    differences: list[VerifyDifference] = Field(description="The first of these values.")

    @model_validator(mode="before")
    @classmethod
    def _merge_report_fields(cls, found: Any) -> Any:
        if not isinstance(found, Verification):
            return found
        report = found.report or {}
        return {
            **vars(found),
            "ok": bool(report.get("ok")),
            "sentence": report.get(
                "sentence", f"The version could not be verified: {found.problem}."
            ),
            **{name: report.get(name) for name in ("groups", "equal", "different")},
            "differences": report.get("differences", ())[:SHOWN_DIFFERENCES],
        }


def _split_to_dict(split: Any) -> Any:
    return split.to_plain_values() if isinstance(split, Split) else split


class VersionDocument(Document):
    """A frozen version."""

    id: int
    dataset: str
    name: str
    hash: str = Field(
        description="SHA-256 over annotations, verdicts, split, policy and solver version: the "
        "same on every machine."
    )
    created: datetime
    actor: str
    note: str
    licence: str
    groups: VersionRule
    counts: dict[str, Any] = Field(
        description="Groups, views, balls, overrides; by split; why groups are not in it."
    )
    split: Annotated[dict[str, Any], BeforeValidator(_split_to_dict)]
    policy: PolicyDocument
    solver_version: str
    software_version: str
    previous: int | None = Field(description="Id of the version frozen before.")
    verified: VerificationDocument | None = Field(
        description="Result of the last verification; null: never verified."
    )


class VersionList(ListDocument[VersionDocument]):
    """The versions of a dataset, newest first."""


class VersionManifest(BaseModel):
    """What a version says of itself in every export."""

    dataset: str
    version: str
    date: datetime
    counts: dict[str, Any]
    settings: dict[str, Any] = Field(description="Policy, solver, groups, split.")
    licence: str
    verdicts: dict[str, int]
    overrides: list[dict[str, Any]] = Field(description="Groups that are in it against a gate.")
    frozen: dict[str, Any] = Field(description="Hash, note, changelog, rejected groups.")


class Changelog(BaseModel):
    """What changed since the version before."""

    id: int
    version: str = Field(description="Its name.")
    lines: list[str]


class VersionReference(BaseModel):
    """Which version."""

    id: int
    name: str
    hash: str


class BallMoveDocument(Document, shows=BallMove):
    """A 3D ball that lies elsewhere; pitch frame, metres."""

    before: Point
    after: Point


class ChangedGroupDocument(BaseModel):
    """A group of both versions that is not the same in them."""

    group: str
    what: list[Literal["annotations", "verdict", "split", "ball"]]


class VersionDiffDocument(BaseModel):
    """What changed from one version to another; lists may be cut, counts are whole."""

    older: VersionReference
    newer: VersionReference
    same: bool = Field(description="Whether both versions have the same hash.")
    counts: dict[str, int]
    lines: list[str] = Field(description="In sentences.")
    added: list[MembershipChange]
    dropped: list[MembershipChange]
    moved: list[BallMoveDocument] = Field(description="The farthest first.")
    changed: list[ChangedGroupDocument]
    settings: list[ChangedSetting]
    tracks: list[ChangedTrack] = Field(description="Tracks of the ball, by stretch.")


router = APIRouter(tags=["versions"], route_class=Route)


def find_version_id_of_path(
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


VersionPath = Annotated[int, Depends(find_version_id_of_path)]


@router.get("/datasets/{dataset}/versions")
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@paged()
def list_versions(dataset: DatasetPath, store: AppStore) -> VersionList:
    """The frozen versions of a dataset, newest first."""
    found = versions.list_versions(store, dataset)
    return VersionList(items=found)


@router.post(
    "/datasets/{dataset}/versions",
    status_code=202,
    response_model=JobDocument,
    responses={
        **responses(409),
        **ACCEPTED,
        200: {"model": FreezePlan, "description": "After a dry run: what would be frozen."},
    },
)
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(make_job_response)
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
        plan = plan_freeze(services.store, dataset, request.to_freeze_request())
        return make_document_response(plan)
    return version_jobs.request_freeze(
        services.jobs, services.store, dataset, request.to_freeze_request(), actor=actor
    )


@router.get("/versions/{version}", response_model=VersionDocument)
@may(Action.READ, version=OwnedKind.VERSION, dataset=OwnedKind.DATASET)
def get_version(version: VersionPath, store: AppStore) -> versions.Version:
    """One version."""
    return versions.get_version(store, version)


@router.get("/versions/{version}/manifest")
@may(Action.READ, version=OwnedKind.VERSION, dataset=OwnedKind.DATASET)
def get_version_manifest(version: VersionPath, store: AppStore) -> VersionManifest:
    """What a version says of itself: counts, settings, licence, overrides, changelog."""
    return VersionManifest.model_validate(make_version_manifest(store, version))


@router.get("/versions/{version}/changelog")
@may(Action.READ, version=OwnedKind.VERSION, dataset=OwnedKind.DATASET)
def get_changelog(version: VersionPath, store: AppStore) -> Changelog:
    """What changed since the version before, in sentences."""
    found = versions.get_version(store, version)
    return Changelog(id=found.id, version=found.name, lines=make_version_changelog(store, version))


@router.get("/versions/{version}/diff", operation_id="diffVersions")
@may(Action.READ, version=OwnedKind.VERSION, dataset=OwnedKind.DATASET)
def get_diff(
    version: VersionPath,
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
    return VersionDiffDocument.model_validate(diff_versions(store, older, version).to_values(limit))


@router.post("/versions/{version}/verify", **describe_job_response_for_openapi())
@may(Action.LEAD, version=OwnedKind.VERSION, dataset=OwnedKind.DATASET)
@respond_with(make_job_response)
def verify_version(version: VersionPath, services: AppServices, actor: Actor) -> Job:
    """Compute a version from scratch and compare it bit for bit; the job's result reports."""
    return version_jobs.request_verify(services.jobs, services.store, version, actor=actor)
