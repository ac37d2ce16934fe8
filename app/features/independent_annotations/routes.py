"""Independent annotations and gold groups."""

from __future__ import annotations

from fastapi import APIRouter, BackgroundTasks, Request, Response

from app.features.agreement.adjudicate import adopt_into_group
from app.features.agreement.service import after_submission
from app.features.groups.routes import ETAG, group_answer
from app.features.groups.schemas import GroupDocument
from app.features.groups.state import GroupState
from app.features.independent_annotations import gold, service
from app.features.independent_annotations.adopt import return_annotation
from app.features.independent_annotations.gold import GoldGroup
from app.features.independent_annotations.known_truth import (
    GoldChoice,
    GoldChoiceResult,
    mark_known,
)
from app.features.independent_annotations.schemas import (
    GoldChoiceDocument,
    GoldEdit,
    GoldReportDocument,
    IndependentAnnotationList,
    ReturnReason,
)
from app.features.independent_annotations.service import DisclosedAnnotation
from app.features.people.roles import role_allows
from app.http.access import current_login
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, Id
from app.http.documents import document, responds
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.route import Route

annotations_router = APIRouter(tags=["independent annotations"], route_class=Route)


@annotations_router.get(
    "/datasets/{dataset}/independent-annotations",
    operation_id="listIndependentAnnotations",
    responses=responses(404),
)
@may(Action.READ, dataset=OwnedKind.DATASET)
@paged()
def list_independent_annotations(
    dataset: DatasetPath, store: AppStore, request: Request, actor: Actor
) -> IndependentAnnotationList:
    """Own annotations of a dataset's groups: for a lead everybody's, else those of whoever asks."""
    login = current_login(request.scope)
    found = service.list_annotations(
        store,
        dataset,
        lambda dataset_id: (
            login is None or role_allows(login.roles.role_in(dataset_id), Action.LEAD)
        ),
        person=actor,
    )
    return IndependentAnnotationList(items=found)


def _begun_response(annotation: DisclosedAnnotation) -> Response:
    return document(annotation, 201)


@annotations_router.post(
    "/groups/{group}/independent-annotations",
    operation_id="beginIndependentAnnotation",
    response_model=DisclosedAnnotation,
    status_code=201,
    responses=responses(404, 409),
)
@may(Action.ANNOTATE, group=OwnedKind.GROUP)
@responds(_begun_response)
def begin(group: Id, store: AppStore, actor: Actor) -> service.DisclosedAnnotation:
    """Begin an own annotation of a group, on a copy that nobody else sees; the one begun, if so."""
    return service.begin_annotation(store, group, person=actor)


@annotations_router.get(
    "/groups/{group}/independent-annotation",
    operation_id="getIndependentAnnotation",
    response_model=DisclosedAnnotation,
    responses=responses(404),
)
@may(Action.READ, group=OwnedKind.GROUP)
def get_independent_annotation(group: Id, store: AppStore) -> service.DisclosedAnnotation:
    """Whose own annotation a group is; 404 for an ordinary group."""
    return service.disclose_annotation(store, service.get_annotation_of_copy(store, group))


@annotations_router.post(
    "/groups/{group}/submission",
    operation_id="submitIndependentAnnotation",
    response_model=DisclosedAnnotation,
    responses=responses(403, 404, 409),
)
@may(Action.ANNOTATE, group=OwnedKind.GROUP)
@responds(document)
def hand_in(
    group: Id, services: AppServices, actor: Actor, background: BackgroundTasks
) -> service.DisclosedAnnotation:
    """Submit an independent annotation; a verdict on it does the same. Only a lead can return it."""
    store = services.store
    annotation = service.get_annotation_of_copy(store, group)
    background.add_task(after_submission, store, group, services.paint)
    return service.submit_annotation(store, annotation.id, actor=actor)


@annotations_router.post(
    "/groups/{group}/return",
    operation_id="returnIndependentAnnotation",
    response_model=DisclosedAnnotation,
    responses=responses(404, 409, 413, 415),
)
@may(Action.LEAD, group=OwnedKind.GROUP)
@responds(document)
def hand_back(
    group: Id, store: AppStore, actor: Actor, why: ReturnReason | None = None
) -> service.DisclosedAnnotation:
    """Let the person of an annotation that was submitted go on with it, and tell them why."""
    annotation, reason = (
        service.get_annotation_of_copy(store, group),
        "" if why is None else why.reason,
    )
    return return_annotation(store, annotation.id, reason, actor=actor)


@annotations_router.post(
    "/groups/{group}/adoption",
    operation_id="adoptIndependentAnnotation",
    response_model=GroupDocument,
    responses={**responses(404, 409, 412), 200: {"headers": ETAG}},
)
@may(Action.LEAD, group=OwnedKind.GROUP)
@responds(group_answer)
def adopt(group: Id, services: AppServices, actor: Actor) -> GroupState:
    """Take an annotation and its verdict over into the group that it is of; the answer is that group.

    They are its person's there, as one edit that undo takes back.
    """
    annotation = service.get_annotation_of_copy(services.store, group)
    return adopt_into_group(services.store, annotation, actor=actor, paint=services.paint)


gold_router = APIRouter(tags=["independent annotations"], route_class=Route)


@gold_router.get(
    "/datasets/{dataset}/gold",
    operation_id="getGoldReport",
    response_model=GoldReportDocument,
    responses=responses(404),
)
@may(Action.LEAD, dataset=OwnedKind.DATASET)
def get_report(dataset: DatasetPath, store: AppStore) -> gold.GoldReport:
    """The gold groups of a dataset, and what each person made of those that they were given."""
    return gold.read_report(store, dataset)


@gold_router.post(
    "/datasets/{dataset}/gold",
    operation_id="chooseGoldGroups",
    response_model=GoldChoiceResult,
    responses=responses(404, 409, 413, 415),
)
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@responds(document)
def choose(
    dataset: DatasetPath, choice: GoldChoiceDocument, store: AppStore, actor: Actor
) -> GoldChoiceResult:
    """Make gold groups of those whose truth is known, also while batches are under way."""
    values = choice.model_dump(exclude={"q", "source"})
    wanted = GoldChoice(gold.TruthSource(choice.source), query=choice.q, **values)
    return mark_known(store, dataset, wanted, actor=actor)


@gold_router.put(
    "/groups/{group}/gold",
    operation_id="markGold",
    response_model=GoldGroup,
    responses=responses(404, 409, 413, 415),
)
@may(Action.LEAD, group=OwnedKind.GROUP)
@responds(document)
def mark(group: Id, edit: GoldEdit, store: AppStore, actor: Actor) -> gold.GoldGroup:
    """Say that what a group holds now, with its verdict, is true."""
    return gold.mark_group(store, group, edit.start, actor=actor)


@gold_router.patch(
    "/groups/{group}/gold",
    operation_id="changeGold",
    response_model=GoldGroup,
    responses=responses(404, 413, 415),
)
@may(Action.LEAD, group=OwnedKind.GROUP)
@responds(document)
def change(group: Id, edit: GoldEdit, store: AppStore, actor: Actor) -> gold.GoldGroup:
    """Let annotators of a gold group begin with something else; what is true of it stays."""
    return gold.start_with(store, group, edit.start, actor=actor)


@gold_router.delete(
    "/groups/{group}/gold",
    operation_id="unmarkGold",
    response_model=GoldGroup,
    responses=responses(404),
)
@may(Action.LEAD, group=OwnedKind.GROUP)
@responds(document)
def unmark(group: Id, store: AppStore, actor: Actor) -> gold.GoldGroup:
    """Let a gold group be an ordinary one again; what people made of it is no longer shown."""
    return gold.unmark_group(store, group, actor=actor)
