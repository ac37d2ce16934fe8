"""Agreement: how far people agree, and deciding where they do not."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response
from pydantic import Field

from app.evaluation.annotation_distance import (
    Ball3DDistance,
    ViewDistance,
)
from app.evaluation.rater_agreement import (
    AgreementCoefficient,
    AgreementLimits,
    Disagreement,
    MedianAndTail,
)
from app.features.agreement import adjudicate
from app.features.agreement import service as limits
from app.features.agreement.adjudicate import AdjudicationCase, OpenCase
from app.features.agreement.service import AnnotationPair, AnnotationsComparison, compare_groups
from app.features.agreement.summary import (
    GroupAgreement,
    PeopleAgreement,
    agreement_to_csv,
    summarize_agreement,
)
from app.features.groups.routes import ETAG
from app.features.groups.schemas import GroupDocument, make_group_response
from app.features.groups.state import GroupState
from app.features.independent_annotations.routes import AnnotationReturn
from app.features.independent_annotations.service import DisclosedAnnotation
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, Id
from app.http.documents import (
    Document,
    ListDocument,
    RequestBody,
    make_document_response,
    make_empty_response,
    respond_with,
)
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.request_limits import COMPUTE, limit
from app.http.route import Route
from app.json_text import MAX_ID
from app.soccer.choices import VerdictState

router = APIRouter(tags=["agreement"], route_class=Route)
CSV_FILE = "text/csv"
OfBatch = Annotated[
    int | None, Query(ge=0, le=MAX_ID, description="One batch alone; 0: what belongs to none.")
]


class Ball3DDistanceDocument(Document, shows=Ball3DDistance):
    """Both 3D balls."""

    p_value: float | None = Field(
        description="How often chance alone would put them as far apart, were both sigmas true."
    )
    explained: bool | None = Field(
        validation_alias="is_explained",
        description="Whether both uncertainties explain the difference; null: not known.",
    )


class GroupDistanceDocument(Document):
    """How far two annotations lie apart."""

    views: list[ViewDistance]
    ball: Ball3DDistanceDocument


class AnnotationPairDocument(Document, shows=AnnotationPair):
    """Two of the annotations, by their places in `groups`, from 0."""

    distance: GroupDistanceDocument
    disagreements: list[Disagreement] = Field(description="The worst first.")


class GroupComparisonDocument(Document):
    """Annotations of the same frames beside each other."""

    groups: list[GroupDocument]
    pairs: list[AnnotationPairDocument] = Field(description="Those that disagree most first.")
    limits: AgreementLimits
    worst_views: list[str] = Field(description="Keys of the views, the worst first.")

    @staticmethod
    def of(found: AnnotationsComparison) -> GroupComparisonDocument:
        """The document of a comparison."""
        groups = [GroupDocument.of(state) for state in found.states]
        return GroupComparisonDocument.model_validate({**vars(found), "groups": groups})


class LimitsEdit(
    RequestBody,
    examples=[
        {
            "line_px": 5.0,
            "markings": 1,
            "ball_px": 3.0,
            "diameter_px": 5.0,
            "ball_m": 0.5,
            "jac": 0.7,
        }
    ],
):
    """Other limits."""

    line_px: float = Field(gt=0, le=10_000, allow_inf_nan=False)
    markings: int = Field(ge=0, le=100)
    ball_px: float = Field(gt=0, le=10_000, allow_inf_nan=False)
    diameter_px: float = Field(gt=0, le=10_000, allow_inf_nan=False)
    ball_m: float = Field(gt=0, le=1000, allow_inf_nan=False)
    jac: float = Field(ge=0, le=1, allow_inf_nan=False)


class SpreadsDocument(Document):
    """Distances of lines, balls, diameters (px), 3D balls (m), JaC, cameras (m)."""

    line_px: MedianAndTail
    ball_px: MedianAndTail
    diameter_px: MedianAndTail
    ball_m: MedianAndTail
    jac: MedianAndTail
    position_m: MedianAndTail


class PeopleAgreementDocument(Document, shows=PeopleAgreement):
    """How far two people agree, or all of them."""

    kappa: AgreementCoefficient | None = Field(
        description="Cohen's of two; Fleiss' of all, where each group has equally many verdicts."
    )
    spreads: SpreadsDocument


class GroupAgreementDocument(Document, shows=GroupAgreement):
    """What one group came to."""

    state: Literal["agreed", "open", "decided"]
    status: VerdictState = Field(
        description="The verdict on the group itself: annotations that agree without one leave it unreviewed."
    )
    worst: float = Field(description="How many times its limit the worst disagreement was.")
    spreads: SpreadsDocument
    outcome: Literal["take", "start"] | None
    taken: str | None = Field(description="Whose annotation was taken over.")
    decided: datetime | None


class AgreementDocument(Document):
    """How far the people of a dataset agree."""

    agreed: int = Field(
        description="Groups whose annotations agree; the first annotation was adopted."
    )
    open: int = Field(description="Groups that wait for a decision.")
    decided: int
    limits: AgreementLimits
    alpha: AgreementCoefficient
    overall: PeopleAgreementDocument
    pairs: list[PeopleAgreementDocument]
    groups: list[GroupAgreementDocument] = Field(description="The worst first.")


class UndecidedGroupList(ListDocument[OpenCase]):
    """Groups that wait for a decision, those that disagree most first."""


class CaseAnnotation(Document):
    """Somebody's own annotation of a group; its place is that in `comparison.groups`."""

    id: int
    person: str
    verdict: str | None
    submitted: datetime | None


class CaseDocument(Document):
    """A group that waits for a decision, and what it is to be decided between."""

    group: GroupDocument
    batch: int | None
    annotations: list[CaseAnnotation]
    comparison: GroupComparisonDocument
    refused: str | None = Field(
        description="Why the logged-in person may not decide; null: they may."
    )
    own: bool = Field(
        description="They annotated the group themselves, and no other reviewer exists."
    )

    @staticmethod
    def of(case: AdjudicationCase) -> CaseDocument:
        """The document of a case."""
        return CaseDocument.model_validate(
            {
                **vars(case),
                "group": GroupDocument.of(case.original),
                "comparison": GroupComparisonDocument.of(case.comparison),
            }
        )


class Decision(RequestBody, examples=[{"annotation": 7}, {"annotation": 7, "as_start": True}]):
    """Which annotation is taken over."""

    annotation: int = Field(ge=1, le=MAX_ID)
    as_start: bool = Field(
        default=False,
        description="It is where a third one begins: it is edited and judged in the group itself.",
    )


@router.get(
    "/groups/{group}/comparison",
    operation_id="compareGroups",
    response_model=GroupComparisonDocument,
)
@may(Action.READ, group=OwnedKind.GROUP, with_=OwnedKind.GROUP)
@limit(COMPUTE)
def compare(
    group: Id,
    store: AppStore,
    other: Annotated[
        int, Query(alias="with", ge=1, le=MAX_ID, description="Another group of the same frames.")
    ],
) -> Response:
    """Two annotations of the same frames, and how far they lie apart; saves nothing."""
    return make_document_response(
        GroupComparisonDocument.of(compare_groups(store, [group, other], AgreementLimits()))
    )


@router.get("/datasets/{dataset}/agreement")
@may(Action.LEAD, dataset=OwnedKind.DATASET)
def get_agreement(
    dataset: DatasetPath, store: AppStore, of_batch: OfBatch = None
) -> AgreementDocument:
    """How far the people of a dataset agree: kappa, pixels, metres and JaC, the worst group first."""
    return AgreementDocument.model_validate(summarize_agreement(store, dataset, of_batch))


@router.get(
    "/datasets/{dataset}/agreement/groups.csv",
    response_class=Response,
    responses={
        200: {"content": {CSV_FILE: {}}, "description": "A row for each group."},
    },
)
@may(Action.LEAD, dataset=OwnedKind.DATASET)
def get_agreement_file(dataset: DatasetPath, store: AppStore, of_batch: OfBatch = None) -> Response:
    """The same as CSV, a row for each group."""
    headers = {"Content-Disposition": 'attachment; filename="touchline-agreement.csv"'}
    text = agreement_to_csv(summarize_agreement(store, dataset, of_batch))
    return Response(text, headers=headers, media_type=CSV_FILE)


@router.put("/datasets/{dataset}/agreement/limits", response_model=AgreementLimits)
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(make_document_response)
def set_agreement_limits(
    dataset: DatasetPath, edit: LimitsEdit, store: AppStore, actor: Actor
) -> AgreementLimits:
    """How far annotations may lie apart and still agree; counts for what is submitted from now on."""
    wanted = AgreementLimits(**edit.model_dump())
    return limits.set_limits(store, dataset, wanted, actor=actor)


@router.get("/datasets/{dataset}/adjudications")
@may(Action.REVIEW, dataset=OwnedKind.DATASET, whole=True)
@paged()
def list_waiting_groups(dataset: DatasetPath, store: AppStore) -> UndecidedGroupList:
    """Groups whose annotations disagree and wait for a decision, the worst first."""
    return UndecidedGroupList.model_validate({"items": adjudicate.list_open_cases(store, dataset)})


@router.get("/groups/{group}/adjudication", response_model=CaseDocument)
@may(Action.REVIEW, group=OwnedKind.GROUP)
def get_adjudication(group: Id, store: AppStore, actor: Actor) -> Response:
    """The annotations of a group that disagree, beside each other."""
    return make_document_response(CaseDocument.of(adjudicate.read_case(store, group, actor=actor)))


@router.post(
    "/groups/{group}/adjudication",
    response_model=GroupDocument,
    responses={**responses(409), 200: {"headers": ETAG}},
)
@may(Action.REVIEW, group=OwnedKind.GROUP)
@respond_with(make_group_response)
def decide_adjudication(
    group: Id, decision: Decision, services: AppServices, actor: Actor
) -> GroupState:
    """Take one annotation over into the group, or let a third one begin from it."""
    return adjudicate.adjudicate_case(
        services.store,
        group,
        decision.annotation,
        as_start=decision.as_start,
        actor=actor,
        paint=services.paint,
    )


@router.post("/groups/{group}/adjudication/return", status_code=204, responses=responses(409))
@may(Action.REVIEW, group=OwnedKind.GROUP)
@respond_with(make_empty_response)
def return_for_correction(
    group: Id, back: AnnotationReturn, store: AppStore, actor: Actor
) -> DisclosedAnnotation:
    """Return one of the annotations to its person; it is compared again when it is submitted."""
    return adjudicate.return_for_correction(store, group, back.annotation, back.reason, actor=actor)
