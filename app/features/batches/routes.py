"""Work that is given out: batches, the next group of one, and who has which group open."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, datetime
from typing import Annotated

from fastapi import APIRouter, BackgroundTasks, Depends, Request, Response
from pydantic import Field

from app.db.store import Store
from app.features.agreement.service import compare_or_adopt_submission
from app.features.batches import own_annotations, progress
from app.features.batches import service as batches
from app.features.batches.leases import BatchMember, Lease, LeaseService
from app.features.batches.progress import WorkPace
from app.features.batches.service import (
    MOST_GROUPS,
    MOST_VERDICTS,
    RAREST_GOLD,
    Batch,
    BatchGroup,
    BatchKind,
    BatchRole,
    NewBatch,
)
from app.features.datasets.service import MAX_TITLE
from app.features.independent_annotations.routes import ReturnReason
from app.features.independent_annotations.service import ReturnedGroup
from app.features.people.logins import Login
from app.features.people.roles import role_allows
from app.features.queue.query import MAX_LISTED_LENGTH
from app.http.access import get_current_login
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, Id, Sees, Services
from app.http.documents import (
    Document,
    ListDocument,
    RequestBody,
    make_document_responder,
    make_document_response,
    make_empty_response,
    respond_with,
)
from app.http.permissions import Action, OwnedKind, RoleScope, may
from app.http.problem import GroupViewerDocument, responses
from app.http.route import Route
from app.json_text import MAX_ID
from app.soccer.actors import LOCAL_USER
from app.soccer.choices import BatchState

Name = Annotated[str, Field(min_length=1, max_length=MAX_TITLE)]
People = Annotated[list[Annotated[str, Field(max_length=60)]], Field(max_length=200)]


class NewBatchDocument(
    RequestBody, examples=[{"name": "First forty", "q": "status:unreviewed sort:value", "size": 40}]
):
    """Groups that shall be given out."""

    name: Name
    q: Annotated[str, Field(max_length=MAX_LISTED_LENGTH)] = Field(
        default="", description="Which groups, and in which order they are given out."
    )
    size: Annotated[int, Field(ge=1, le=MOST_GROUPS)] | None = Field(
        default=None, description=f"The first so many; default: all, up to {MOST_GROUPS}."
    )
    annotators: People = Field(default=[])
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


class BatchEdit(RequestBody, examples=[{"name": "Second half"}]):
    """What changes of a batch; what is left out stays."""

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


class NextGroupRequest(RequestBody, examples=[{"after": 12}, {}]):
    """Where somebody comes from who asks for the next group."""

    after: Annotated[int, Field(ge=1, le=MAX_ID)] | None = Field(
        default=None,
        description="The group that they come from; they get one behind it first, and not that "
        "one. Without it they get the one again that they have open.",
    )


class LeaseRequest(RequestBody, examples=[{"take_over": False}]):
    """How a group is opened."""

    take_over: bool = Field(default=False, description="Also when another person has it open.")


class LeaseDocument(Document):
    """A group that somebody has open."""

    batch: WorkBatchDocument
    group: int | None = Field(description="null: no group waits for them now.")
    part: BatchRole | None = Field(description="What they do with it.")
    until: datetime | None = Field(description="When the lease ends unless it is taken again.")
    here: list[GroupViewerDocument] = Field(description="People who have the group open.")
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
    parts: list[BatchRole]
    left: int = Field(description="Groups that one may still get.")
    returned: list[ReturnedGroup] = Field(
        description="Submitted groups that were returned to the person, in the order of the batch."
    )
    hides_groups: bool = Field(
        description="The person annotates copies of its groups, and the groups are hidden from them."
    )


class MyWork(ListDocument[MyBatchDocument]):
    """Open batches that are one's own, those that are due first, first."""


class PaceDocument(Document, shows=WorkPace):
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
    here: list[GroupViewerDocument]
    stalled: datetime | None = Field(
        description=(
            "Time of the last activity, if it is longer ago than the operator's setting "
            "`stalled_hours` (default: one day); else null."
        )
    )
    people: list[PaceDocument]


class TeamWork(ListDocument[TeamBatchDocument]):
    """Every batch of a dataset, and who has done what."""


router = APIRouter(tags=["work"], route_class=Route)


@dataclass(frozen=True)
class BatchMemberResolver:
    """The person of the request and their permissions in a dataset; ``login`` is None on a server without accounts."""

    login: Login | None

    def member_in_dataset(self, dataset_id: int) -> BatchMember:
        """Them, in a dataset."""
        if self.login is None:
            return BatchMember(LOCAL_USER, alone=True)
        role = self.login.roles.find_role_in(dataset_id)
        annotates, reviews, leads = (
            role_allows(role, one) for one in (Action.ANNOTATE, Action.REVIEW, Action.LEAD)
        )
        return BatchMember(
            self.login.name,
            annotates,
            reviews,
            leads=leads,
            reaches_copies=not self.login.roles.limited,
        )

    def member_of_batch(self, store: Store, batch: int) -> BatchMember:
        """Them, in the dataset of a batch."""
        return self.member_in_dataset(batches.find_dataset_of_batch(store, batch))


async def _get_batch_member_resolver(request: Request) -> BatchMemberResolver:
    return BatchMemberResolver(get_current_login(request.scope))


Members = Annotated[BatchMemberResolver, Depends(_get_batch_member_resolver)]


def _announce_lease(services: Services, lease: Lease) -> Lease:
    """A lease of which everybody has been told who looks."""
    services.events.publish_lease(lease)
    return lease


@router.get("/work")
@may(Action.READ, where=RoleScope.SOMEWHERE)
@paged()
def get_my_work(store: AppStore, visibility: Sees, members: Members) -> MyWork:
    """Open batches of whoever asks; on a server without accounts all of them."""
    return MyWork.model_validate(
        {"items": progress.list_own_batches(store, members.member_in_dataset, visibility)}
    )


@router.get("/datasets/{dataset}/batches")
@may(Action.READ, dataset=OwnedKind.DATASET)
@paged()
def list_batches(dataset: DatasetPath, store: AppStore) -> WorkBatchList:
    """The batches of a dataset."""
    return WorkBatchList.model_validate(
        {"items": own_annotations.list_visible_batches(store, dataset)}
    )


def _created_response(batch: Batch) -> Response:
    headers = {"Location": f"/api/v1/batches/{batch.id}"}
    return make_document_response(WorkBatchDocument.model_validate(batch), 201, headers)


@router.post(
    "/datasets/{dataset}/batches",
    response_model=WorkBatchDocument,
    status_code=201,
    responses={
        **responses(409),
        201: {
            "headers": {"Location": {"description": "Its address.", "schema": {"type": "string"}}},
            "description": "The batch.",
        },
    },
)
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(_created_response)
def make_batch(dataset: DatasetPath, new: NewBatchDocument, store: AppStore, actor: Actor) -> Batch:
    """Give out the groups that a query finds now, in its order."""
    wanted = NewBatch(query=new.q, **new.model_dump(exclude={"q"}))
    return batches.make_batch(store, dataset, wanted, actor=actor)


@router.get("/datasets/{dataset}/team-work")
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@paged()
def get_team_work(dataset: DatasetPath, store: AppStore) -> TeamWork:
    """Every batch of a dataset: who has done what, how fast, and which batch has stalled."""
    items = [
        {**vars(one), "here": one.batch.here, "gold_every": one.batch.gold_every}
        for one in progress.list_team_batches(store, dataset)
    ]
    return TeamWork.model_validate({"items": items})


@router.get("/batches/{batch}", response_model=WorkBatchDocument)
@may(Action.READ, batch=OwnedKind.WORK)
def get_batch(batch: Id, store: AppStore) -> Batch:
    """One batch."""
    return own_annotations.get_visible_batch(store, batch)


@router.patch("/batches/{batch}", response_model=WorkBatchDocument, responses=responses(409))
@may(Action.LEAD, batch=OwnedKind.WORK)
@respond_with(make_document_responder(WorkBatchDocument.model_validate))
def change_batch(batch: Id, change: BatchEdit, store: AppStore, actor: Actor) -> Batch:
    """Give a batch on to others, close it, or name it otherwise."""
    values = change.model_dump(exclude_unset=True)
    never, none = ({name: None}.items() <= values.items() for name in ("due", "gold_every"))
    return batches.change_batch(store, batch, actor=actor, never_due=never, no_gold=none, **values)


@router.delete("/batches/{batch}", status_code=204)
@may(Action.LEAD, batch=OwnedKind.WORK)
@respond_with(make_empty_response)
def delete_batch(batch: Id, store: AppStore, actor: Actor) -> Batch:
    """Delete a batch; what was said of its groups stays."""
    return batches.remove_batch(store, batch, actor=actor)


@router.get("/batches/{batch}/groups")
@may(Action.READ, batch=OwnedKind.WORK, whole=True)
@paged()
def list_batch_groups(batch: Id, store: AppStore) -> BatchGroupList:
    """The groups of a batch in order, with who has them open."""
    return BatchGroupList.model_validate({"items": batches.list_batch_groups(store, batch)})


@router.post("/batches/{batch}/next", response_model=LeaseDocument, responses=responses(409))
@may(Action.ANNOTATE, batch=OwnedKind.WORK)
def open_next_group(
    batch: Id, origin: NextGroupRequest, services: AppServices, members: Members
) -> Lease:
    """Take the next group that waits for whoever asks, and that nobody else has open.

    The lease lasts three minutes, and three more each time that it is taken again.
    """
    worker = members.member_of_batch(services.store, batch)
    return _announce_lease(
        services, LeaseService(services.store).lease_next_group(batch, worker, after=origin.after)
    )


@router.put(
    "/batches/{batch}/groups/{group}/lease", response_model=LeaseDocument, responses=responses(409)
)
@may(Action.ANNOTATE, batch=OwnedKind.WORK)
def open_group(
    batch: Id, group: Id, body: LeaseRequest, services: AppServices, members: Members
) -> Lease:
    """Take a group, or keep it for another three minutes; 409 where somebody has it open."""
    worker = members.member_of_batch(services.store, batch)
    lease = LeaseService(services.store).lease_group(batch, group, worker, take_over=body.take_over)
    return _announce_lease(services, lease)


@router.delete("/batches/{batch}/groups/{group}/lease", status_code=204)
@may(Action.ANNOTATE, batch=OwnedKind.WORK)
def release_group(batch: Id, group: Id, services: AppServices, members: Members) -> None:
    """Leave a group to others."""
    worker = members.member_of_batch(services.store, batch)
    _announce_lease(services, LeaseService(services.store).release_group(batch, group, worker))


@router.put(
    "/batches/{batch}/groups/{group}/submission",
    response_model=LeaseDocument,
    responses=responses(409, 413, 415),
)
@may(Action.ANNOTATE, batch=OwnedKind.WORK)
@respond_with(make_document_responder(LeaseDocument.model_validate))
def submit_group(
    batch: Id,
    group: Id,
    services: AppServices,
    actor: Actor,
    members: Members,
    background: BackgroundTasks,
) -> Lease:
    """Say that a group is annotated, so that a reviewer gets it."""
    worker = members.member_of_batch(services.store, batch)
    background.add_task(compare_or_adopt_submission, services.store, group, services.paint)
    return _announce_lease(
        services, LeaseService(services.store).submit_group(batch, group, worker, actor=actor)
    )


@router.delete(
    "/batches/{batch}/groups/{group}/submission",
    response_model=LeaseDocument,
    responses=responses(409),
)
@may(Action.ANNOTATE, batch=OwnedKind.WORK)
@respond_with(make_document_responder(LeaseDocument.model_validate))
def withdraw_submission(
    batch: Id, group: Id, services: AppServices, actor: Actor, members: Members
) -> Lease:
    """Say that a group is not annotated yet, after all; 409 for one's own copy that is submitted."""
    worker = members.member_of_batch(services.store, batch)
    lease = LeaseService(services.store).submit_group(batch, group, worker, actor=actor, done=False)
    return _announce_lease(services, lease)


@router.post(
    "/batches/{batch}/groups/{group}/return", response_model=LeaseDocument, responses=responses(409)
)
@may(Action.REVIEW, batch=OwnedKind.WORK)
@respond_with(make_document_responder(LeaseDocument.model_validate))
def return_group(
    batch: Id, group: Id, why: ReturnReason, services: AppServices, actor: Actor, members: Members
) -> Lease:
    """Give a group back to the annotator who submitted it, and tell them why."""
    worker = members.member_of_batch(services.store, batch)
    lease = LeaseService(services.store).return_group(batch, group, worker, why.reason, actor=actor)
    return _announce_lease(services, lease)
