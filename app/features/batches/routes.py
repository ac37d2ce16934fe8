"""Work that is given out: batches, the next group of one, and who has which group open."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from fastapi import APIRouter, BackgroundTasks, Depends, Request, Response

from app.db.store import Store
from app.features.agreement.service import after_submission
from app.features.batches import own_annotations, progress
from app.features.batches import service as batches
from app.features.batches.leases import BatchMember, Lease, Leases
from app.features.batches.schemas import (
    BatchEdit,
    BatchGroupList,
    LeaseDocument,
    LeaseRequest,
    MyWork,
    NewBatchDocument,
    NextGroup,
    TeamWork,
    WorkBatchDocument,
    WorkBatchList,
)
from app.features.batches.service import Batch, NewBatch
from app.features.independent_annotations.schemas import ReturnReason
from app.features.people.logins import Login
from app.features.people.roles import role_allows
from app.http.access import current_login
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, Id, Sees, Services
from app.http.documents import as_document, document, no_content, responds
from app.http.permissions import Action, OwnedKind, Where, may
from app.http.problem import responses
from app.http.route import Route
from app.soccer.actors import LOCAL_USER

router = APIRouter(tags=["work"], route_class=Route)


@dataclass(frozen=True)
class BatchMembers:
    """Who asks, and what they may in a dataset; on a server without accounts there is no ``login``."""

    login: Login | None

    def here(self, dataset_id: int) -> BatchMember:
        """Them, in a dataset."""
        if self.login is None:
            return BatchMember(LOCAL_USER, alone=True)
        role = self.login.roles.role_in(dataset_id)
        annotates, reviews = (role_allows(role, one) for one in (Action.ANNOTATE, Action.REVIEW))
        return BatchMember(self.login.name, annotates, reviews)

    def of_batch(self, store: Store, batch: int) -> BatchMember:
        """Them, in the dataset of a batch."""
        return self.here(batches.dataset_of_batch(store, batch))


async def _batch_workers(request: Request) -> BatchMembers:
    return BatchMembers(current_login(request.scope))


Members = Annotated[BatchMembers, Depends(_batch_workers)]


def _announce_lease(services: Services, lease: Lease) -> Lease:
    """A lease of which everybody has been told who looks."""
    services.events.publish_lease(lease)
    return lease


@router.get("/work", operation_id="getMyWork", responses=responses())
@may(Action.READ, where=Where.SOMEWHERE)
@paged()
def my_work(store: AppStore, visibility: Sees, members: Members) -> MyWork:
    """Open batches of whoever asks; on a server without accounts all of them."""
    return MyWork.model_validate({"items": progress.my_work(store, members.here, visibility)})


@router.get("/datasets/{dataset}/batches", operation_id="listBatches", responses=responses(404))
@may(Action.READ, dataset=OwnedKind.DATASET)
@paged()
def list_batches(dataset: DatasetPath, store: AppStore) -> WorkBatchList:
    """The batches of a dataset."""
    return WorkBatchList.model_validate({"items": own_annotations.seen_batches(store, dataset)})


def _created_response(batch: Batch) -> Response:
    headers = {"Location": f"/api/v1/batches/{batch.id}"}
    return document(WorkBatchDocument.model_validate(batch), 201, headers)


@router.post(
    "/datasets/{dataset}/batches",
    operation_id="makeBatch",
    response_model=WorkBatchDocument,
    status_code=201,
    responses={
        **responses(404, 409, 413, 415),
        201: {
            "headers": {"Location": {"description": "Its address.", "schema": {"type": "string"}}},
            "description": "The batch.",
        },
    },
)
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@responds(_created_response)
def make_batch(dataset: DatasetPath, new: NewBatchDocument, store: AppStore, actor: Actor) -> Batch:
    """Give out the groups that a query finds now, in its order."""
    wanted = NewBatch(query=new.q, **new.model_dump(exclude={"q"}))
    return batches.make_batch(store, dataset, wanted, actor=actor)


@router.get("/datasets/{dataset}/team-work", operation_id="getTeamWork", responses=responses(404))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@paged()
def team_work(dataset: DatasetPath, store: AppStore) -> TeamWork:
    """Every batch of a dataset: who has done what, how fast, and which batch has stalled."""
    items = [
        {**vars(one), "here": one.batch.here, "gold_every": one.batch.gold_every}
        for one in progress.team_work(store, dataset)
    ]
    return TeamWork.model_validate({"items": items})


@router.get(
    "/batches/{batch}",
    operation_id="getBatch",
    response_model=WorkBatchDocument,
    responses=responses(404),
)
@may(Action.READ, batch=OwnedKind.WORK)
def get_batch(batch: Id, store: AppStore) -> Batch:
    """One batch."""
    return own_annotations.seen_batch(store, batch)


@router.patch(
    "/batches/{batch}",
    operation_id="changeBatch",
    response_model=WorkBatchDocument,
    responses=responses(404, 409, 413, 415),
)
@may(Action.LEAD, batch=OwnedKind.WORK)
@responds(as_document(WorkBatchDocument.model_validate))
def change_batch(batch: Id, change: BatchEdit, store: AppStore, actor: Actor) -> Batch:
    """Give a batch on to others, close it, or name it otherwise."""
    values = change.model_dump(exclude_unset=True)
    never, none = ({name: None}.items() <= values.items() for name in ("due", "gold_every"))
    return batches.change_batch(store, batch, actor=actor, never_due=never, no_gold=none, **values)


@router.delete(
    "/batches/{batch}", operation_id="deleteBatch", status_code=204, responses=responses(404)
)
@may(Action.LEAD, batch=OwnedKind.WORK)
@responds(no_content)
def delete_batch(batch: Id, store: AppStore, actor: Actor) -> Batch:
    """Delete a batch; what was said of its groups stays."""
    return batches.remove_batch(store, batch, actor=actor)


@router.get("/batches/{batch}/groups", operation_id="listBatchGroups", responses=responses(404))
@may(Action.READ, batch=OwnedKind.WORK, whole=True)
@paged()
def list_batch_groups(batch: Id, store: AppStore) -> BatchGroupList:
    """The groups of a batch in order, with who has them open."""
    return BatchGroupList.model_validate({"items": batches.list_batch_groups(store, batch)})


@router.post(
    "/batches/{batch}/next",
    operation_id="openNextGroup",
    response_model=LeaseDocument,
    responses=responses(404, 409, 413, 415),
)
@may(Action.ANNOTATE, batch=OwnedKind.WORK)
def open_next_group(batch: Id, origin: NextGroup, services: AppServices, members: Members) -> Lease:
    """Take the next group that waits for whoever asks, and that nobody else has open.

    The lease lasts three minutes, and three more each time that it is taken again.
    """
    worker = members.of_batch(services.store, batch)
    return _announce_lease(services, Leases(services.store).next(batch, worker, after=origin.after))


@router.put(
    "/batches/{batch}/groups/{group}/lease",
    operation_id="openGroup",
    response_model=LeaseDocument,
    responses=responses(404, 409, 413, 415),
)
@may(Action.ANNOTATE, batch=OwnedKind.WORK)
def open_group(
    batch: Id, group: Id, how: LeaseRequest, services: AppServices, members: Members
) -> Lease:
    """Take a group, or keep it for another three minutes; 409 where somebody has it open."""
    worker = members.of_batch(services.store, batch)
    taken = Leases(services.store).take(batch, group, worker, take_over=how.take_over)
    return _announce_lease(services, taken)


@router.delete(
    "/batches/{batch}/groups/{group}/lease",
    operation_id="releaseGroup",
    status_code=204,
    responses=responses(404),
)
@may(Action.ANNOTATE, batch=OwnedKind.WORK)
def give_back(batch: Id, group: Id, services: AppServices, members: Members) -> None:
    """Leave a group to others."""
    worker = members.of_batch(services.store, batch)
    _announce_lease(services, Leases(services.store).give_back(batch, group, worker))


@router.put(
    "/batches/{batch}/groups/{group}/submission",
    operation_id="submitGroup",
    response_model=LeaseDocument,
    responses=responses(404, 409, 413, 415),
)
@may(Action.ANNOTATE, batch=OwnedKind.WORK)
@responds(as_document(LeaseDocument.model_validate))
def submit_group(
    batch: Id,
    group: Id,
    services: AppServices,
    actor: Actor,
    members: Members,
    background: BackgroundTasks,
) -> Lease:
    """Say that a group is annotated, so that a reviewer gets it."""
    worker = members.of_batch(services.store, batch)
    background.add_task(after_submission, services.store, group, services.paint)
    return _announce_lease(
        services, Leases(services.store).submit(batch, group, worker, actor=actor)
    )


@router.delete(
    "/batches/{batch}/groups/{group}/submission",
    operation_id="withdrawSubmission",
    response_model=LeaseDocument,
    responses=responses(404, 409),
)
@may(Action.ANNOTATE, batch=OwnedKind.WORK)
@responds(as_document(LeaseDocument.model_validate))
def withdraw_submission(
    batch: Id, group: Id, services: AppServices, actor: Actor, members: Members
) -> Lease:
    """Say that a group is not annotated yet, after all; 409 for one's own copy that is submitted."""
    worker = members.of_batch(services.store, batch)
    lease = Leases(services.store).submit(batch, group, worker, actor=actor, done=False)
    return _announce_lease(services, lease)


@router.post(
    "/batches/{batch}/groups/{group}/return",
    operation_id="returnGroup",
    response_model=LeaseDocument,
    responses=responses(404, 409, 413, 415),
)
@may(Action.REVIEW, batch=OwnedKind.WORK)
@responds(as_document(LeaseDocument.model_validate))
def return_group(
    batch: Id, group: Id, why: ReturnReason, services: AppServices, actor: Actor, members: Members
) -> Lease:
    """Give a group back to the annotator who submitted it, and tell them why."""
    worker = members.of_batch(services.store, batch)
    lease = Leases(services.store).return_group(batch, group, worker, why.reason, actor=actor)
    return _announce_lease(services, lease)
