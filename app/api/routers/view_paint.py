"""Paint of views: what a frame shows of the painted lines, and lines proposed from it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from anyio import to_thread
from fastapi import APIRouter, Request, Response

from app.api.deps import AppServices, Id
from app.api.problem import responses
from app.api.routers.views import CLIENT_GONE, told_with_view
from app.api.schemas.annotation import points_of
from app.api.schemas.view_paint import PaintDocument, PaintRequest, ProposalDocument
from app.review.editing.view_paint import PaintQuestion, paint_question, proposal_question
from app.worker_pool import PoolTask

router = APIRouter(prefix="/views", tags=["views"])

REFUSALS = (404, 409, 413, 415, 503)


@router.post(
    "/{view}/paint",
    operation_id="readPaint",
    response_model=PaintDocument,
    responses=responses(*REFUSALS),
)
async def read_paint(
    view: Id, wanted: PaintRequest, services: AppServices, request: Request
) -> PaintDocument | Response:
    """What the frame shows of the markings near a view's camera; saves nothing."""
    question = await to_thread.run_sync(
        paint_question, services.store, view, points_of(wanted.lines)
    )
    found = await _answer(request, question, partial(question.ask_paint, services.frames))
    return Response(status_code=CLIENT_GONE) if found is None else PaintDocument.of(found)


@router.post(
    "/{view}/propose",
    operation_id="proposeLines",
    response_model=ProposalDocument,
    responses=responses(404, 413, 415, 503),
)
async def propose_lines(
    view: Id, services: AppServices, request: Request, wanted: PaintRequest | None = None
) -> ProposalDocument | Response:
    """Lines for a view without a camera, from its frame alone; saves nothing.

    Where the view has lines, those that nobody drew are proposed beside them.
    """
    lines = {} if wanted is None else points_of(wanted.lines)
    question = await to_thread.run_sync(proposal_question, services.store, view, lines)
    found = await _answer(request, question, partial(question.ask_proposal, services.frames))
    return Response(status_code=CLIENT_GONE) if found is None else ProposalDocument.of(found)


async def _answer(request: Request, question: PaintQuestion, ask: Callable[[], PoolTask]) -> Any:
    """What was found, or None where nobody waits for it any more."""
    with told_with_view(question.view.key):
        return await ask().result_unless(request.is_disconnected)
