"""Takes: own annotations of groups, begun, handed in and taken over."""

from __future__ import annotations

from fastapi import APIRouter, BackgroundTasks, Request

from app.api.deps import Actor, AppServices, AppStore, DatasetPath, Id
from app.api.paging import paged
from app.api.problem import responses
from app.api.respond import as_document, responds
from app.api.routers.groups import ETAG, group_answer
from app.api.schemas.group import GroupDocument
from app.api.schemas.take import HandBack, TakeDocument, TakeList
from app.api.security.access import login_of
from app.review.agreement.adjudicate import take_over
from app.review.agreement.weigh import after_hand_in
from app.review.editing.state import GroupState
from app.review.people.roles import Action, may
from app.review.takes import take as takes
from app.review.takes.hand_back import hand_back_take

router = APIRouter(tags=["takes"])


@router.get("/datasets/{dataset}/takes", operation_id="listTakes", responses=responses(404))
@paged()
def list_takes(dataset: DatasetPath, store: AppStore, request: Request, actor: Actor) -> TakeList:
    """Own annotations of a dataset's groups: for a lead everybody's, else those of whoever asks."""
    login = login_of(request.scope)
    found = takes.list_takes(
        store,
        dataset,
        lambda dataset_id: login is None or may(login.roles.role_in(dataset_id), Action.LEAD),
        person=actor,
    )
    return TakeList(items=[TakeDocument.model_validate(one) for one in found])


@router.post(
    "/groups/{group}/takes",
    operation_id="beginTake",
    response_model=TakeDocument,
    status_code=201,
    responses=responses(404, 409),
)
@responds(as_document(TakeDocument.model_validate, 201))
def begin(group: Id, store: AppStore, actor: Actor) -> takes.TakeView:
    """Begin an own annotation of a group, on a copy that nobody else sees; the one begun, if so."""
    return takes.begin_take(store, group, person=actor)


@router.get(
    "/groups/{group}/take",
    operation_id="getTake",
    response_model=TakeDocument,
    responses=responses(404),
)
def get_take(group: Id, store: AppStore) -> takes.TakeView:
    """Whose own annotation a group is; 404 for an ordinary group."""
    return takes.shown(store, takes.get_take_of(store, group))


@router.post(
    "/groups/{group}/hand-in",
    operation_id="handInTake",
    response_model=TakeDocument,
    responses=responses(403, 404, 409),
)
@responds(as_document(TakeDocument.model_validate))
def hand_in(
    group: Id, services: AppServices, actor: Actor, background: BackgroundTasks
) -> takes.TakeView:
    """Submit an independent annotation; a verdict on it does the same. Only a lead can return it."""
    store = services.store
    take = takes.get_take_of(store, group)
    background.add_task(after_hand_in, store, group, services.paint)
    return takes.hand_in(store, take.id, actor=actor)


@router.post(
    "/groups/{group}/hand-back",
    operation_id="handBackTake",
    response_model=TakeDocument,
    responses=responses(404, 409, 413, 415),
)
@responds(as_document(TakeDocument.model_validate))
def hand_back(
    group: Id, store: AppStore, actor: Actor, why: HandBack | None = None
) -> takes.TakeView:
    """Let the person of an annotation that was handed in go on with it, and tell them why."""
    take, reason = takes.get_take_of(store, group), "" if why is None else why.reason
    return hand_back_take(store, take.id, reason, actor=actor)


@router.post(
    "/groups/{group}/adoption",
    operation_id="adoptTake",
    response_model=GroupDocument,
    responses={**responses(404, 409, 412), 200: {"headers": ETAG}},
)
@responds(group_answer)
def adopt(group: Id, services: AppServices, actor: Actor) -> GroupState:
    """Take an annotation and its verdict over into the group that it is of; the answer is that group.

    They are its person's there, as one edit that undo takes back.
    """
    take = takes.get_take_of(services.store, group)
    return take_over(services.store, take, actor=actor, paint=services.paint)
