"""Work: batches that leads give out, who has which group open, and how it goes on."""

from __future__ import annotations

from datetime import date, datetime
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from app.features.batches.progress import Pace
from app.features.batches.service import (
    MOST_GROUPS,
    MOST_VERDICTS,
    RAREST_GOLD,
    BatchGroup,
    BatchKind,
    Part,
)
from app.features.datasets.service import MAX_TITLE
from app.features.independent_annotations.service import ReturnedGroup
from app.features.queue.query import MAX_LISTED_LENGTH
from app.finite import MAX_ID
from app.http.documents import Document, ListDocument
from app.http.problem import PresenceDocument
from app.soccer.choices import BatchState

Name = Annotated[str, Field(min_length=1, max_length=MAX_TITLE)]
People = Annotated[list[Annotated[str, Field(max_length=60)]], Field(max_length=200)]


class NewBatchDocument(BaseModel):
    """Groups that shall be given out."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
                {"name": "First forty", "q": "status:unreviewed sort:value", "size": 40},
            ]
        },
    )

    name: Name
    q: Annotated[str, Field(max_length=MAX_LISTED_LENGTH)] = Field(
        default="", description="Which groups, and in which order they are given out."
    )
    size: Annotated[int, Field(ge=1, le=MOST_GROUPS)] | None = Field(
        default=None, description=f"The first so many; default: all, up to {MOST_GROUPS}."
    )
    annotators: People = []
    reviewers: People = Field(
        default=[], description="Empty: every reviewer of the dataset may review the batch."
    )
    due: date | None = None
    skip_given: bool = Field(
        default=True, description="Leave out groups that wait in another open batch."
    )
    verdicts: Annotated[int, Field(ge=1, le=MOST_VERDICTS)] = Field(
        default=1, description="How many people judge each group independently."
    )
    blind: bool = Field(
        default=True,
        description="When several people judge, they do not see each other's verdicts.",
    )
    gold_every: Annotated[int, Field(ge=1, le=RAREST_GOLD)] | None = Field(
        default=None, description="One of so many groups is a gold one; null: none is."
    )
    tracks: (
        Annotated[list[Annotated[int, Field(ge=1, le=MAX_ID)]], Field(max_length=MOST_GROUPS)]
        | None
    ) = Field(
        default=None,
        description="Ids of tracks of the ball, which reviewers judge, in place of groups.",
    )


class BatchEdit(BaseModel):
    """What changes of a batch; what is left out stays."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"name": "Second half"}]}
    )

    name: Name | None = None
    due: date | None = Field(default=None, description="null: on no day.")
    annotators: People | None = None
    reviewers: People | None = None
    state: BatchState | None = Field(
        default=None, description="Nothing is given out of a closed one."
    )
    gold_every: Annotated[int, Field(ge=1, le=RAREST_GOLD)] | None = Field(
        default=None,
        description="Counts from the next group that an annotator opens; null: no more gold groups.",
    )


class WorkBatchDocument(Document):
    """A batch, and how far it is."""

    id: int
    dataset: str
    name: str
    kind: BatchKind = Field(description="What is given out; the counts are of these.")
    q: str = Field(validation_alias="query")
    sort: str
    verdicts: int
    blind: bool
    due: date | None
    state: BatchState
    created: datetime
    created_by: str
    annotators: list[str]
    reviewers: list[str]
    groups: int
    waiting: int = Field(description="Groups that are neither submitted nor judged.")
    submitted: int = Field(description="Groups that wait for a verdict.")
    settled: int = Field(description="Groups that are complete.")
    last: datetime | None = Field(description="When a group was last submitted or completed.")


class WorkBatchList(ListDocument[WorkBatchDocument]):
    """Batches; open ones and those that are due first come first."""


class BatchGroupList(ListDocument[BatchGroup]):
    """The groups of a batch in the order in which they are given out."""


class NextGroup(BaseModel):
    """Where somebody comes from who asks for the next group."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{"after": 12}, {}]})

    after: Annotated[int, Field(ge=1, le=MAX_ID)] | None = Field(
        default=None,
        description="The group that they come from; they get one behind it first, and not that "
        "one. Without it they get the one again that they have open.",
    )


class LeaseRequest(BaseModel):
    """How a group is opened."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"take_over": False}]}
    )

    take_over: bool = Field(default=False, description="Also when another person has it open.")


class LeaseDocument(Document):
    """A group that somebody has open."""

    batch: WorkBatchDocument
    group: int | None = Field(description="null: no group waits for them now.")
    part: Part | None = Field(description="What they do with it.")
    until: datetime | None = Field(description="When the lease ends unless it is taken again.")
    here: list[PresenceDocument] = Field(description="People who have the group open.")
    submitted_by: str | None = Field(description="Person who submitted it; null: not submitted.")
    returned: ReturnedGroup | None = Field(
        description="Why its annotator has it back; null: they have not."
    )
    place: int | None = Field(
        default=None,
        description="Of the groups that they annotate on their own: which this is, from 1.",
    )
    of: int | None = Field(
        default=None,
        description="How many these are as the batch stands; null where gold groups are mixed in.",
    )


class MyBatchDocument(Document):
    """A batch of one's own."""

    batch: WorkBatchDocument
    parts: list[Part]
    left: int = Field(description="Groups that one may still get.")
    returned: list[ReturnedGroup] = Field(
        description="Submitted groups that were returned to the person, in the order of the batch."
    )


class MyWork(ListDocument[MyBatchDocument]):
    """Open batches that are one's own, those that are due first, first."""


class PaceDocument(Document, shows=Pace):
    """What somebody has done in a batch."""

    groups: int = Field(description="Handed in or judged, each counted once.")
    minutes: float = Field(
        description="How long they worked: the time between what they did, pauses of more than "
        "ten minutes left out."
    )
    minutes_a_group: float | None
    groups_an_hour: float | None


class TeamBatchDocument(Document):
    """A batch and who has done what of it."""

    batch: WorkBatchDocument
    gold_every: int | None = Field(description="One gold group in N.")
    here: list[PresenceDocument]
    stalled: datetime | None = Field(
        description=(
            "Time of the last activity, if it is longer ago than the operator's setting "
            "`stalled_hours` (default: one day); else null."
        )
    )
    people: list[PaceDocument]


class TeamWork(ListDocument[TeamBatchDocument]):
    """Every batch of a dataset, and who has done what."""
