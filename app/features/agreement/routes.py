"""Agreement: how far people agree, and deciding where they do not."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Response

from app.evaluation.agreement_limits import AgreementLimits
from app.features.agreement import adjudicate
from app.features.agreement import compare as limits
from app.features.agreement.compare import compare_groups
from app.features.agreement.schemas import (
    AgreementDocument,
    CaseDocument,
    Decision,
    GroupComparisonDocument,
    LimitsEdit,
    WaitingList,
)
from app.features.agreement.summary import agreement_csv, agreement_of
from app.features.groups.routes import ETAG, group_answer
from app.features.groups.schemas import GroupDocument
from app.features.groups.state import GroupState
from app.features.independent_annotations.schemas import AnnotationReturn
from app.features.independent_annotations.service import DisclosedAnnotation
from app.finite import MAX_ID
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, Id
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.request_limits import LOOKS, QUESTIONS, limit
from app.http.respond import document, no_content, responds
from app.http.route import Route

router = APIRouter(tags=["agreement"], route_class=Route)
CSV_FILE = "text/csv"
OfBatch = Annotated[
    int | None, Query(ge=0, le=MAX_ID, description="One batch alone; 0: what belongs to none.")
]


@router.get(
    "/groups/{group}/comparison",
    operation_id="compareGroups",
    response_model=GroupComparisonDocument,
    responses=responses(404),
)
@may(Action.READ, group=OwnedKind.GROUP, with_=OwnedKind.GROUP)
@limit(QUESTIONS)
def compare(
    group: Id,
    store: AppStore,
    other: Annotated[
        int, Query(alias="with", ge=1, le=MAX_ID, description="Another group of the same frames.")
    ],
) -> Response:
    """Two annotations of the same frames, and how far they lie apart; saves nothing."""
    return document(
        GroupComparisonDocument.of(compare_groups(store, [group, other], AgreementLimits()))
    )


@router.get("/datasets/{dataset}/agreement", operation_id="getAgreement", responses=responses(404))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
def get_agreement(
    dataset: DatasetPath, store: AppStore, of_batch: OfBatch = None
) -> AgreementDocument:
    """How far the people of a dataset agree: kappa, pixels, metres and JaC, the worst group first."""
    return AgreementDocument.model_validate(agreement_of(store, dataset, of_batch))


@router.get(
    "/datasets/{dataset}/agreement/groups.csv",
    operation_id="getAgreementFile",
    response_class=Response,
    responses={
        **responses(404),
        200: {"content": {CSV_FILE: {}}, "description": "A row for each group."},
    },
)
@may(Action.LEAD, dataset=OwnedKind.DATASET)
def get_agreement_file(dataset: DatasetPath, store: AppStore, of_batch: OfBatch = None) -> Response:
    """The same as CSV, a row for each group."""
    headers = {"Content-Disposition": 'attachment; filename="touchline-agreement.csv"'}
    text = agreement_csv(agreement_of(store, dataset, of_batch))
    return Response(text, headers=headers, media_type=CSV_FILE)


@router.put(
    "/datasets/{dataset}/agreement/limits",
    operation_id="setAgreementLimits",
    response_model=AgreementLimits,
    responses=responses(404, 413, 415),
)
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@responds(document)
def put_limits(
    dataset: DatasetPath, edit: LimitsEdit, store: AppStore, actor: Actor
) -> AgreementLimits:
    """How far annotations may lie apart and still agree; counts for what is submitted from now on."""
    wanted = AgreementLimits(**edit.model_dump())
    return limits.set_limits(store, dataset, wanted, actor=actor)


@router.get(
    "/datasets/{dataset}/adjudications", operation_id="listWaitingGroups", responses=responses(404)
)
@may(Action.REVIEW, dataset=OwnedKind.DATASET, whole=True)
@paged()
def list_waiting(dataset: DatasetPath, store: AppStore) -> WaitingList:
    """Groups whose annotations disagree and wait for a decision, the worst first."""
    return WaitingList.model_validate({"items": adjudicate.list_waiting(store, dataset)})


@router.get(
    "/groups/{group}/adjudication",
    operation_id="getAdjudication",
    response_model=CaseDocument,
    responses=responses(404),
)
@may(Action.REVIEW, group=OwnedKind.GROUP)
@limit(LOOKS)
def get_case(group: Id, store: AppStore, actor: Actor) -> Response:
    """The annotations of a group that disagree, beside each other."""
    return document(CaseDocument.of(adjudicate.get_case(store, group, actor=actor)))


@router.post(
    "/groups/{group}/adjudication",
    operation_id="decideAdjudication",
    response_model=GroupDocument,
    responses={**responses(403, 404, 409, 413, 415), 200: {"headers": ETAG}},
)
@may(Action.REVIEW, group=OwnedKind.GROUP)
@responds(group_answer)
def decide(group: Id, decision: Decision, services: AppServices, actor: Actor) -> GroupState:
    """Take one annotation over into the group, or let a third one begin from it."""
    return adjudicate.decide(
        services.store,
        group,
        decision.annotation,
        as_start=decision.as_start,
        actor=actor,
        paint=services.paint,
    )


@router.post(
    "/groups/{group}/adjudication/return",
    operation_id="returnForCorrection",
    status_code=204,
    responses=responses(403, 404, 409, 413, 415),
)
@may(Action.REVIEW, group=OwnedKind.GROUP)
@responds(no_content)
def return_annotation(
    group: Id, back: AnnotationReturn, store: AppStore, actor: Actor
) -> DisclosedAnnotation:
    """Return one of the annotations to its person; it is compared again when it is submitted."""
    return adjudicate.return_for_correction(store, group, back.annotation, back.reason, actor=actor)
