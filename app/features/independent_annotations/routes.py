"""Independent annotations and gold groups, and how they travel."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

from fastapi import APIRouter, BackgroundTasks, Request, Response
from pydantic import ConfigDict, Field

from app.evaluation.annotation_distance import DistanceFromTruth
from app.features.agreement.adjudicate import adopt_into_group
from app.features.agreement.service import compare_or_adopt_submission
from app.features.groups.routes import ETAG
from app.features.groups.schemas import GroupDocument, make_group_response
from app.features.groups.state import GroupState
from app.features.guidelines.service import MAX_LETTERS
from app.features.independent_annotations import gold, service
from app.features.independent_annotations.adopt import MAX_REASON, return_annotation
from app.features.independent_annotations.gold import (
    GoldGroup,
    GoldResult,
    MedianInterval,
    PersonResults,
)
from app.features.independent_annotations.known_truth import (
    MOST,
    GoldChoice,
    GoldChoiceResult,
    mark_groups_with_known_truth,
)
from app.features.independent_annotations.service import DisclosedAnnotation
from app.features.people.roles import role_allows
from app.features.queue.query import MAX_LISTED_LENGTH
from app.http.access import get_current_login
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, Id
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
from app.soccer.choices import GoldStart


class ReturnReason(RequestBody, examples=[{"reason": "The far goal line is missing in view B."}]):
    """Why something that was submitted goes back."""

    reason: Annotated[str, Field(max_length=MAX_REASON)] = Field(
        default="", description="A sentence for the person who gets the group back."
    )


class AnnotationReturn(ReturnReason):
    """Which annotation of a group goes back, and why."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"annotation": 7, "reason": "The ball in B is the spot."}]},
    )

    annotation: Annotated[int, Field(ge=1, le=MAX_ID)]


class IndependentAnnotationList(ListDocument[DisclosedAnnotation]):
    """Own annotations, oldest first: for a lead everybody's, else those of whoever asks."""


class GoldEdit(RequestBody, examples=[{"start": "without_balls"}]):
    """What annotators of a gold group begin with.

    `imported`: as its dataset brought it; `without_balls`: what it holds but for the balls;
    `bare`: its pictures alone.
    """

    start: GoldStart = "imported"


class GoldChoiceDocument(
    RequestBody,
    examples=[{"source": "sample", "start": "bare"}, {"source": "version", "version": "v1"}],
):
    """Groups that become gold by what is known of them.

    `sample`: by the cameras and the ball with which a generated sample was drawn; `version`: by what
    a frozen version holds, upon which people agreed or somebody decided.
    """

    source: Literal["sample", "version"]
    version: Annotated[str, Field(min_length=1, max_length=100)] | None = Field(
        default=None, description="Name or id of the version."
    )
    q: Annotated[str, Field(max_length=MAX_LISTED_LENGTH)] = Field(
        default="", description="Which groups; default: all."
    )
    size: Annotated[int, Field(ge=1, le=MOST)] = Field(
        default=MOST, description="So many of them at most, the first ones."
    )
    start: GoldStart = "imported"


class GoldResultDocument(Document, shows=GoldResult):
    """What one person made of a gold group."""

    submitted: datetime = Field(description="When they submitted it first.")
    true_verdict: str = Field(title="Known Verdict")
    right: bool | None = Field(description="Whether they judged as is true; null: not judged.")
    error: DistanceFromTruth
    submissions: int = Field(
        description="How often they submitted it. The first one is measured; there are more where a "
        "lead returned it."
    )


class PersonResultsDocument(Document, shows=PersonResults):
    """What somebody made of gold groups, oldest first."""

    results: list[GoldResultDocument]
    line_px: MedianInterval
    ball_px: MedianInterval
    ball_m: MedianInterval
    right_low: float | None = Field(description="Wilson's interval of the share, 95 %.")


class GoldReportDocument(Document):
    """The gold groups of a dataset, and how far each person is from what is true of them."""

    groups: list[GoldGroup]
    people: list[PersonResultsDocument]


class GuidelinesEdit(
    RequestBody, examples=[{"text": "## Balls\n\nDraw tight boxes.", "based_on": 0}]
):
    """Another version of the guidelines."""

    text: Annotated[str, Field(max_length=MAX_LETTERS)]
    based_on: Annotated[int, Field(ge=0, le=2**31, description="The version that was changed.")]


class NewGuidelinePicture(RequestBody, examples=[{"upload": "0123456789abcdef0123456789abcdef"}]):
    """A picture that was uploaded."""

    upload: Annotated[str, Field(pattern=r"^[0-9a-f]{32}$")]


class GuidelinePictureDocument(Document):
    """A picture of the guidelines, under the SHA-256 of its bytes."""

    digest: str
    type: str


annotations_router = APIRouter(tags=["independent annotations"], route_class=Route)


@annotations_router.get("/datasets/{dataset}/independent-annotations")
@may(Action.READ, dataset=OwnedKind.DATASET)
@paged()
def list_independent_annotations(
    dataset: DatasetPath, store: AppStore, request: Request, actor: Actor
) -> IndependentAnnotationList:
    """Own annotations of a dataset's groups: for a lead everybody's, else those of whoever asks."""
    login = get_current_login(request.scope)
    found = service.list_annotations(
        store,
        dataset,
        lambda dataset_id: (
            login is None or role_allows(login.roles.find_role_in(dataset_id), Action.LEAD)
        ),
        person=actor,
    )
    return IndependentAnnotationList(items=found)


def _begun_response(annotation: DisclosedAnnotation) -> Response:
    return make_document_response(annotation, 201)


@annotations_router.post(
    "/groups/{group}/independent-annotations",
    response_model=DisclosedAnnotation,
    status_code=201,
    responses=responses(409),
)
@may(Action.ANNOTATE, group=OwnedKind.GROUP)
@respond_with(_begun_response)
def begin_independent_annotation(
    group: Id, store: AppStore, actor: Actor, request: Request
) -> service.DisclosedAnnotation:
    """Begin an own annotation of a group, on a copy that nobody else sees; the one begun, if so."""
    login = get_current_login(request.scope)
    service.require_reach(login is None or not login.roles.limited)
    return service.begin_annotation(store, group, person=actor)


@annotations_router.get(
    "/groups/{group}/independent-annotation", response_model=DisclosedAnnotation
)
@may(Action.READ, group=OwnedKind.GROUP)
def get_independent_annotation(group: Id, store: AppStore) -> service.DisclosedAnnotation:
    """Whose own annotation a group is; 404 for an ordinary group."""
    return service.disclose_annotation(store, service.get_annotation_of_copy(store, group))


@annotations_router.post(
    "/groups/{group}/submission", response_model=DisclosedAnnotation, responses=responses(409)
)
@may(Action.ANNOTATE, group=OwnedKind.GROUP)
@respond_with(make_document_response)
def submit_independent_annotation(
    group: Id, services: AppServices, actor: Actor, background: BackgroundTasks
) -> service.DisclosedAnnotation:
    """Submit an independent annotation; a verdict on it does the same. Only a lead can return it."""
    store = services.store
    annotation = service.get_annotation_of_copy(store, group)
    background.add_task(compare_or_adopt_submission, store, group, services.paint)
    return service.submit_annotation(store, annotation.id, actor=actor)


@annotations_router.post(
    "/groups/{group}/return", response_model=DisclosedAnnotation, responses=responses(409)
)
@may(Action.LEAD, group=OwnedKind.GROUP)
@respond_with(make_document_response)
def return_independent_annotation(
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
    response_model=GroupDocument,
    responses={**responses(409, 412), 200: {"headers": ETAG}},
)
@may(Action.LEAD, group=OwnedKind.GROUP)
@respond_with(make_group_response)
def adopt_independent_annotation(group: Id, services: AppServices, actor: Actor) -> GroupState:
    """Take an annotation and its verdict over into the group that it is of; the answer is that group.

    They are its person's there, as one edit that undo takes back.
    """
    annotation = service.get_annotation_of_copy(services.store, group)
    return adopt_into_group(services.store, annotation, actor=actor, paint=services.paint)


gold_router = APIRouter(tags=["independent annotations"], route_class=Route)


@gold_router.get("/datasets/{dataset}/gold", response_model=GoldReportDocument)
@may(Action.LEAD, dataset=OwnedKind.DATASET)
def get_gold_report(dataset: DatasetPath, store: AppStore) -> gold.GoldReport:
    """The gold groups of a dataset, and what each person made of those that they were given."""
    return gold.read_gold_report(store, dataset)


@gold_router.post(
    "/datasets/{dataset}/gold", response_model=GoldChoiceResult, responses=responses(409)
)
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(make_document_response)
def choose_gold_groups(
    dataset: DatasetPath, choice: GoldChoiceDocument, store: AppStore, actor: Actor
) -> GoldChoiceResult:
    """Make gold groups of those whose truth is known, also while batches are under way."""
    values = choice.model_dump(exclude={"q", "source"})
    wanted = GoldChoice(gold.TruthSource(choice.source), query=choice.q, **values)
    return mark_groups_with_known_truth(store, dataset, wanted, actor=actor)


@gold_router.put("/groups/{group}/gold", response_model=GoldGroup, responses=responses(409))
@may(Action.LEAD, group=OwnedKind.GROUP)
@respond_with(make_document_response)
def mark_gold(group: Id, edit: GoldEdit, store: AppStore, actor: Actor) -> gold.GoldGroup:
    """Say that what a group holds now, with its verdict, is true."""
    return gold.mark_gold_group(store, group, edit.start, actor=actor)


@gold_router.patch("/groups/{group}/gold", response_model=GoldGroup)
@may(Action.LEAD, group=OwnedKind.GROUP)
@respond_with(make_document_response)
def change_gold(group: Id, edit: GoldEdit, store: AppStore, actor: Actor) -> gold.GoldGroup:
    """Let annotators of a gold group begin with something else; what is true of it stays."""
    return gold.set_gold_start(store, group, edit.start, actor=actor)


@gold_router.delete("/groups/{group}/gold", response_model=GoldGroup)
@may(Action.LEAD, group=OwnedKind.GROUP)
@respond_with(make_document_response)
def unmark_gold(group: Id, store: AppStore, actor: Actor) -> gold.GoldGroup:
    """Let a gold group be an ordinary one again; what people made of it is no longer shown."""
    return gold.unmark_gold_group(store, group, actor=actor)
