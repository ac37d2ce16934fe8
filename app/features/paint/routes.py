"""Paint of a dataset and of a view, and proposals."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, Literal

from anyio import to_thread
from fastapi import APIRouter, Request, Response
from pydantic import Field, StrictBool

from app.features.groups.edit_schemas import LineEdits, points_by_marking
from app.features.groups.schemas import LineDocuments, lines_to_document
from app.features.groups.view_paint import (
    ViewPaintRequest,
    make_paint_request,
    make_proposal_request,
)
from app.features.groups.view_routes import CLIENT_GONE, add_view_to_errors
from app.features.jobs.queries import Job
from app.features.jobs.schemas import (
    ACCEPTED,
    JobDocument,
    describe_job_response_for_openapi,
    make_job_response,
)
from app.features.match_estimates.routes import MatchSelection
from app.features.paint.jobs import PAINT, PROPOSALS, cancel_and_forget_proposals
from app.features.paint.proposal_queries import MatchProposalCounts, Proposal
from app.features.paint.proposals import get_group_proposals, get_proposal_counts
from app.features.paint.service import MatchPaintSummary, summarize_paint_readings
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, DryRun, Id
from app.http.documents import (
    Document,
    ListDocument,
    RequestBody,
    make_document_response,
    respond_with,
)
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.request_limits import TRANSFER, limit
from app.http.route import Route
from app.paint.view_paint import ViewPaint
from app.paint.view_proposal import ViewProposal
from app.soccer.choices import ProposalOutcome
from app.worker_pool import PoolTask

Spot = Annotated[list[float], Field(min_length=2, max_length=2)]
"""x and y."""
Place = Annotated[list[float], Field(min_length=3, max_length=3)]
"""x, y and the standard deviation across the marking."""
DIGITS = 3
"""Of a pixel: what lies below is far less than any sigma."""
paint_router = APIRouter(prefix="/datasets/{dataset}/paint", tags=["datasets"], route_class=Route)
view_paint_router = APIRouter(prefix="/views", tags=["views"], route_class=Route)
proposals_router = APIRouter(tags=["datasets"], route_class=Route)


class DatasetPaintDocument(ListDocument[MatchPaintSummary]):
    """What was read of the paint in a dataset's pictures, by name of the match."""

    used: bool = Field(description="Whether the policy uses it: `calibration.source`.")


class UnsavedLinesRequest(
    RequestBody,
    examples=[{}, {"lines": {"Middle line": [{"x": 640.5, "y": 120.0}, {"x": 655.0, "y": 700.0}]}}],
):
    """Lines that are not saved yet; without any those count that are."""

    lines: LineEdits = Field(default_factory=dict)


class PaintDocument(Document):
    """What the frame of a view shows of the painted lines, pixels of the annotated size."""

    outcome: Literal["snapped", "kept", "nothing"] = Field(
        description="`snapped`: the paint places the camera; `kept`: it does not, `reason` says "
        "why; `nothing`: nothing could be read."
    )
    reason: Literal["no_paint", "paint_disagrees"] | None
    sentence: str = Field(description="The reason for people; empty where it is snapped.")
    points: dict[str, list[Place]] = Field(
        description="By marking, in their order along it: x, y and the standard deviation across."
    )
    line_like: list[Spot] = Field(
        description="Places of everything in the frame that looks like painted lines."
    )
    supported: float | None = Field(description="Share of the visible markings that has paint.")
    explained: float | None = Field(description="Share of line-like paint that has a marking.")
    error_px: float | None = Field(description="Median distance of the paint to its marking.")
    moved_px: float | None = Field(
        description="How far the markings moved onto the paint, or would have, in the median."
    )

    @classmethod
    def of(cls, found: ViewPaint) -> PaintDocument:
        """The document of what was read."""
        points = {
            name: [[round(value, DIGITS) for value in place] for place in places]
            for name, places in found.evidence.points.items()
        }
        line_like = [[round(x, 1), round(y, 1)] for x, y in found.line_like]
        own = {**vars(found), "points": points, "line_like": line_like}
        del own["evidence"]
        return cls.model_validate(own)


class ProposalDocument(Document):
    """Lines for a view without a camera, as its frame shows them; a prediction until saved."""

    outcome: ProposalOutcome
    sentence: str = Field(
        description="Why no lines are proposed, or which drawn lines contradict the proposal; else empty."
    )
    lines: LineDocuments = Field(
        description="Points on the paint, pixels of the annotated size; none unless proposed, and "
        "none of markings that are drawn."
    )
    supported: float | None = Field(description="Share of the visible markings that has paint.")
    explained: float | None = Field(description="Share of line-like paint that has a marking.")
    runner_up: float | None = Field(
        description="How much less the next best camera agrees; null where there is no other."
    )
    error_px: float | None = Field(description="Median distance of the paint to its marking.")
    points: int = Field(description="How many places of paint the best camera lies on.")

    @classmethod
    def of(cls, found: ViewProposal) -> ProposalDocument:
        """The document of a proposal."""
        return cls.model_validate({**vars(found), "lines": lines_to_document(found.lines)})


class DatasetProposalCountsDocument(ListDocument[MatchProposalCounts]):
    """What was proposed for the views of a dataset, by name of the match."""


class DatasetProposalsRequest(MatchSelection):
    """Look for cameras to propose."""

    dry_run: StrictBool = Field(default=False, description="Count, and look at nothing.")


class ProposalPlanDocument(Document):
    """What a search would do."""

    views: int = Field(description="Views whose pictures would be compared or looked at.")
    looked: int = Field(
        description="How many were looked at before: most of them are only compared."
    )


class ForgottenProposalsDocument(Document):
    """What was taken back."""

    forgotten: int = Field(description="How many proposals there were; accepted lines stay.")


class GroupViewProposal(ProposalDocument):
    """What was proposed for one view: a prediction until its lines are saved."""

    view: int
    key: str
    open: bool = Field(
        description="Whether the view still has no given camera, and no lines or those beside "
        "which this was proposed because they determined no camera."
    )
    frame: str = Field(description="Digest of the picture's bytes; empty where there were none.")
    version: str = Field(description="Of what read the picture.")

    @classmethod
    def of_view(cls, key: str, is_open: bool, found: Proposal) -> GroupViewProposal:
        """The document of what was proposed for a view."""
        shown = cls.model_fields.keys() - {"view", "key", "open"}
        values: dict[str, Any] = {name: getattr(found, name) for name in shown}
        values |= {"view": found.view_id, "key": key, "open": is_open}
        return cls.model_construct(**{**values, "lines": lines_to_document(found.lines)})


class GroupProposals(ListDocument[GroupViewProposal]):
    """What was proposed for the views of a group, in their order."""


@paint_router.get("")
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@paged()
def list_dataset_paint(dataset: DatasetPath, store: AppStore) -> DatasetPaintDocument:
    """How many pictures of each match were read for their paint, and what came of it."""
    return DatasetPaintDocument.model_validate(summarize_paint_readings(store, dataset))


@paint_router.post("", **describe_job_response_for_openapi(409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(make_job_response)
def read_dataset_paint(
    dataset: DatasetPath, request: MatchSelection, services: AppServices, actor: Actor
) -> Job:
    """Read the paint of pictures and give it to their groups, which are solved again.

    Pictures that were read for the lines that their view has now are left alone. An edit never
    reads any; this does. 409 while the policy does not use paint.
    """
    return PAINT.request(services.jobs, services.store, dataset, request.match, actor=actor)


@paint_router.delete("", **describe_job_response_for_openapi(409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(make_job_response)
def revert_dataset_paint(dataset: DatasetPath, services: AppServices, actor: Actor) -> Job:
    """Give all groups what they had before paint was read last; the job solves them.

    Once more takes back the reading before that one; 409 when there is none any more. A reading
    that waits or runs is cancelled, and is the one that is taken back, as far as it came.
    """
    return PAINT.undo_last_job(services.jobs, services.store, dataset, actor=actor)


@view_paint_router.post("/{view}/paint", response_model=PaintDocument, responses=responses(409))
@may(Action.ANNOTATE, view=OwnedKind.VIEW)
@limit(TRANSFER)
async def read_paint(
    view: Id, wanted: UnsavedLinesRequest, services: AppServices, request: Request
) -> PaintDocument | Response:
    """What the frame shows of the markings near a view's camera; saves nothing."""
    question = await to_thread.run_sync(
        make_paint_request, services.store, view, points_by_marking(wanted.lines)
    )
    found = await _wait_for_result(
        request, question, partial(question.request_paint, services.frames)
    )
    return Response(status_code=CLIENT_GONE) if found is None else PaintDocument.of(found)


@view_paint_router.post("/{view}/propose", response_model=ProposalDocument)
@may(Action.ANNOTATE, view=OwnedKind.VIEW)
@limit(TRANSFER)
async def propose_lines(
    view: Id, services: AppServices, request: Request, wanted: UnsavedLinesRequest | None = None
) -> ProposalDocument | Response:
    """Lines for a view without a camera, from its frame alone; saves nothing.

    Where the view has lines, those that nobody drew are proposed beside them.
    """
    lines = {} if wanted is None else points_by_marking(wanted.lines)
    question = await to_thread.run_sync(make_proposal_request, services.store, view, lines)
    found = await _wait_for_result(
        request, question, partial(question.request_proposal, services.frames)
    )
    return Response(status_code=CLIENT_GONE) if found is None else ProposalDocument.of(found)


async def _wait_for_result(
    request: Request, question: ViewPaintRequest, ask: Callable[[], PoolTask]
) -> Any:
    """What was found, or None where nobody waits for it any more."""
    with add_view_to_errors(question.view.key):
        return await ask().result_unless_client_gone(request.is_disconnected)


@proposals_router.get("/datasets/{dataset}/proposals")
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@paged()
def list_dataset_proposals(dataset: DatasetPath, store: AppStore) -> DatasetProposalCountsDocument:
    """For how many views of each match something is proposed; nothing of it counts."""
    return DatasetProposalCountsDocument.model_validate(get_proposal_counts(store, dataset))


@proposals_router.post(
    "/datasets/{dataset}/proposals",
    status_code=202,
    response_model=JobDocument,
    responses={
        **ACCEPTED,
        200: {
            "model": ProposalPlanDocument,
            "description": "After a dry run: how many views would be looked at.",
        },
    },
)
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(make_job_response)
def propose_dataset_lines(
    dataset: DatasetPath,
    request: DatasetProposalsRequest,
    services: AppServices,
    actor: Actor,
    dry_run: DryRun = False,
) -> Job | Response:
    """Look at the pictures of views without a camera, neither given nor from their lines.

    What is found is kept as predictions: nothing counts before a person saves the lines of one.
    Views that were looked at are left alone, unless their picture is another, or more is known of
    their match and nothing was proposed. The job's result counts the outcomes.
    """
    if dry_run or request.dry_run:
        matches = None if request.match is None else [request.match]
        found = get_proposal_counts(services.store, dataset, matches)
        counts = {name: found.sum_counts(name) for name in ("views", "looked")}
        return make_document_response(ProposalPlanDocument(**counts))
    return PROPOSALS.request(services.jobs, services.store, dataset, request.match, actor=actor)


def _make_forgotten_response(gone: int) -> Response:
    return make_document_response(ForgottenProposalsDocument(forgotten=gone))


@proposals_router.delete("/datasets/{dataset}/proposals", response_model=ForgottenProposalsDocument)
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(_make_forgotten_response)
def forget_dataset_proposals(dataset: DatasetPath, services: AppServices) -> int:
    """Forget everything that was proposed for a dataset; lines that were accepted stay.

    A search that waits or runs is cancelled, and nothing that it finds is kept afterwards.
    """
    return cancel_and_forget_proposals(services.jobs, services.store, dataset)


@proposals_router.get(
    "/groups/{group}/proposals", operation_id="getGroupProposals", tags=["groups"]
)
@may(Action.READ, group=OwnedKind.GROUP)
@paged()
def group_proposals(group: Id, store: AppStore) -> GroupProposals:
    """The proposed cameras of the views of a group, with lines and scores."""
    found = get_group_proposals(store, group)
    return GroupProposals(items=[GroupViewProposal.of_view(*item) for item in found])
