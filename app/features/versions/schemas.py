"""Versions: what to freeze, what was frozen, and what changed between two of them."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StrictBool,
    StrictInt,
    model_validator,
)

from app.features.policies.schemas import PolicyDocument
from app.features.versions.diff import BallMove, MembershipChange, Setting
from app.features.versions.freeze import MAX_LICENCE, FreezeRequest
from app.features.versions.queries import Verification
from app.features.versions.verify import VersionDifference
from app.finite import MAX_ID
from app.http.documents import Document, ListDocument
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


class SplitChoice(BaseModel):
    """How a version is split into train and test."""

    model_config = ConfigDict(extra="forbid")

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
    test_cameras: Annotated[list[Camera], Field(min_length=1, max_length=100)] = list(TEST_CAMERAS)

    def value(self) -> Split:
        """The split that this asks for."""
        return Split(self.kind, self.seed, self.test_share, tuple(self.test_cameras))


class VersionRequest(BaseModel):
    """What to freeze, and as what."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [{"name": "v1", "note": "For the benchmark", "split": {"kind": "match"}}]
        },
    )

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
        description="Groups that people accepted, or all groups that pass the policy and are not rejected.",
    )
    dry_run: StrictBool = Field(default=False, description="Count, and freeze nothing.")

    def value(self) -> FreezeRequest:
        """The request as the review floor takes it."""
        return FreezeRequest(self.name, self.note, self.licence, self.split.value(), self.groups)


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
    differences: list[VersionDifference] = Field(description="The first of these values.")

    @model_validator(mode="before")
    @classmethod
    def _with_report(cls, found: Any) -> Any:
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


def _split_values(split: Any) -> Any:
    return split.values() if isinstance(split, Split) else split


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
    split: Annotated[dict[str, Any], BeforeValidator(_split_values)]
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


class VersionName(BaseModel):
    """Which version."""

    id: int
    name: str
    hash: str


class BallMoveDocument(Document, shows=BallMove):
    """A 3D ball that lies elsewhere; pitch frame, metres."""

    before: Point
    after: Point


class ChangeDocument(BaseModel):
    """A group of both versions that is not the same in them."""

    group: str
    what: list[Literal["annotations", "verdict", "split", "ball"]]


class VersionDiffDocument(BaseModel):
    """What changed from one version to another; lists may be cut, counts are whole."""

    older: VersionName
    newer: VersionName
    same: bool = Field(description="Whether both versions have the same hash.")
    counts: dict[str, int]
    lines: list[str] = Field(description="In sentences.")
    added: list[MembershipChange]
    dropped: list[MembershipChange]
    moved: list[BallMoveDocument] = Field(description="The farthest first.")
    changed: list[ChangeDocument]
    settings: list[Setting]
